"""A certified motion is flown before it is offered, and planned again where it does not fly."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import pytest

from snakegen.errors import PlanError
from snakegen.scene.schema import Demands, Scene
from snakegen.simulation.trial_flight import RETRIES, STIFFER, Trial, search_and_fly

SCENE = Scene("gate", (), demands=Demands(torque_margin=1.0))


@dataclass
class Planner:
    """Proves twice the torque margin that is demanded, up to `most`; keeps what was asked."""

    most: float = 100.0
    demanded: list[float] = field(default_factory=list)

    def __call__(self, robot: Any, scene: Scene, **_: Any) -> Any:
        asked = scene.demands.torque_margin
        self.demanded.append(asked)
        if asked > self.most:
            raise PlanError("no way")
        bound = SimpleNamespace(lower=2.0 * asked)
        certificate = SimpleNamespace(bounds=lambda: {"torque_margin": bound})
        return SimpleNamespace(
            unmet=lambda demands: [], certificate=certificate, proved=2.0 * asked
        )


def flight(least: float) -> Any:
    """Returns flights that pass where the motion keeps a torque margin."""

    def fly(robot: Any, motion: Any, scene: Scene, seed: int) -> Trial:
        return Trial(seed, () if motion.proved >= least else ("completed",), "")

    return fly


@pytest.mark.parametrize(("least", "plans"), [(1.5, 1), (5.0, 2), (17.0, 3)])
def test_a_motion_that_falls_is_planned_again_with_more_margin(least: float, plans: int) -> None:
    find, said = Planner(), list[str]()
    motion, trial = search_and_fly(
        None, SCENE, seed=4, progress=said.append, find=find, fly=flight(least)
    )
    assert trial == Trial(4, (), "") and motion.proved >= least
    steps = [1.0, 2.0 * STIFFER, 4.0 * STIFFER**2]
    assert find.demanded == pytest.approx(steps[:plans]) and len(said) == plans - 1


@pytest.mark.parametrize("most", [100.0, 2.0])
def test_where_none_flies_the_first_is_returned_with_its_failure(most: float) -> None:
    find = Planner(most)
    motion, trial = search_and_fly(None, SCENE, find=find, fly=flight(1e9))
    assert motion.proved == 2.0 and trial is not None and trial.failed == ("completed",)
    assert len(find.demanded) == (1 + RETRIES if most > 50.0 else 2)


def test_what_is_not_certified_is_not_flown() -> None:
    unmet = SimpleNamespace(unmet=lambda demands: ["clearance"])
    motion, trial = search_and_fly(None, SCENE, find=lambda *_, **__: unmet, fly=None)
    assert motion is unmet and trial is None
