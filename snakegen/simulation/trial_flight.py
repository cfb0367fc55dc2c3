"""A planned motion that also flies: certified, then flown once with the usual noise.

The certificate is of hover: along the path the body can hold margins and clearance. It says nothing
of the loops that hold it there. Where a long body passes nearly straight, the reaction of its own
gimbals outweighs the torque that their thrusts have about its line, and the attitude swings up. So
a motion is flown before it is offered, and one that fails is planned again with a larger torque
margin, which keeps the body bent.
"""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from snakegen.errors import PlanError
from snakegen.planning.motion import Motion
from snakegen.planning.motion_search import search
from snakegen.robot.robot import Robot
from snakegen.scene.schema import Scene
from snakegen.simulation.flight.run import prepare

RETRIES = 2  # plans after the first
STIFFER = 1.5  # times the torque margin proved of a motion that failed


@dataclass(frozen=True)
class Trial:
    """One flight of a planned motion.

    Attributes:
        seed: of noise and mismatch.
        failed: checks of the verdict that it failed.
        stopped: why it ended early, or "".
    """

    seed: int
    failed: tuple[str, ...]
    stopped: str

    @property
    def passed(self) -> bool:
        """Whether every check of the verdict passed."""
        return not self.failed

    def to_json(self) -> dict[str, Any]:
        """Returns plain data."""
        return {
            "seed": self.seed,
            "passed": self.passed,
            "failed": list(self.failed),
            "stopped": self.stopped,
        }


def fly_once(robot: Robot, motion: Motion, scene: Scene, seed: int) -> Trial:
    """Returns the flight of a motion through its scene, as `analyze flight` flies its file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{scene.name}.yaml"
        motion.file(scene).write(path)
        ready = prepare(robot, str(path))
    noise = np.random.default_rng(seed)
    recording = ready.flown(ready.world(), ready.imperfections, noise, seed, margins=False)
    checks = recording.verdict.checks if recording.verdict is not None else ()
    failed = tuple(dict.fromkeys(c.metric for c in checks if not c.passed))
    return Trial(seed, failed, str(recording.meta["stopped"]))


def search_and_fly(
    robot: Robot,
    scene: Scene,
    *,
    seed: int = 0,
    progress: Callable[[str], object] | None = None,
    find: Callable[..., Motion] = search,
    fly: Callable[[Robot, Motion, Scene, int], Trial] = fly_once,
    **options: Any,
) -> tuple[Motion, Trial | None]:
    """Returns a certified motion and its flight; the first of those that failed where none passes.

    Args:
        robot, scene: as `search` takes them.
        seed: of the flight.
        progress: called with what is going on.
        find, fly: what plans and what flies.
        options: of `find`.

    Raises:
        PlanError: as `search`, of the first plan.
    """
    say = progress or (lambda _: None)
    motion = find(robot, scene, seed=seed, progress=progress, **options)
    if motion.unmet(scene.demands):
        return motion, None
    first = motion, fly(robot, motion, scene, seed)
    trial = first[1]
    for _ in range(RETRIES):
        if trial.passed:
            return motion, trial
        proved = float(motion.certificate.bounds()["torque_margin"].lower)
        demands = replace(scene.demands, torque_margin=STIFFER * proved)
        say(
            f"certified, but its trial flight fails ({', '.join(trial.failed[:3])}): planned again "
            f"with a torque margin of {demands.torque_margin:.2f} N·m"
        )
        again = replace(scene, demands=demands)
        try:
            motion = find(robot, again, seed=seed, progress=progress, **options)
        except PlanError:
            return first
        if motion.unmet(demands):
            return first
        trial = fly(robot, motion, again, seed)
    return (motion, trial) if trial.passed else first
