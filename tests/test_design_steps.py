"""Sensitivities of margins against the margins of changed specs."""

import numpy as np
import pytest
from click.testing import CliRunner

import snakegen
from snakegen.cli import cli
from snakegen.errors import SnakegenError
from snakegen.sensitivity.design_steps import design_steps
from snakegen.sensitivity.margin_gradient import margin_gradients
from snakegen.spec.loading import load_spec
from snakegen.wrench_margins.force_sets import ForceSets
from snakegen.wrench_margins.gradients import vectored_optima
from snakegen.wrench_margins.vectored import set_margins

POSTURE = {"joint1_yaw": 0.8, "joint2_yaw": 0.7, "joint3_pitch": 0.5, "joint3_yaw": -0.4}
STEP = 1e-4  # of the change that is told


def spec_of(change: str, share: float) -> list[str]:
    """Returns the overrides that make `share` of a change of dragon4."""
    h = 0.01 * share
    if "apparatus 2 towards" in change:
        return [f"vectoring_apparatus.at=1,2@{0.5 + h / 0.42},3,4"]
    if "longer link2" in change:  # what it carries stays where it is
        long = 0.42 + h
        return [
            f"chain.length=[0.42, {long}, 0.42, 0.42]",
            f"vectoring_apparatus.at=1,2@{0.21 / long},3,4",
            f"chain.com=[0.5, {0.21 / long}, 0.5, 0.5]",
        ]
    if "rotor of apparatus 3" in change:
        return [f"vectoring_apparatus.thrust_max=[16, 16, {16 + share}, 16]"]
    mass = 0.91025 + 0.01 * share  # of a link, whose centre of mass is its middle
    return [f"chain.mass=[0.91025, 0.91025, {mass}, 0.91025]"]


@pytest.mark.parametrize(
    "change",
    [
        "1 cm of apparatus 2 towards the tip",
        "1 cm longer link2",
        "10 g more at the middle of link3",
        "1 N more from each rotor of apparatus 3",
    ],
)
def test_effects_are_those_of_changed_specs(change):
    robot = snakegen.load("dragon4")
    q = np.array(robot.configuration(POSTURE, gimbals="hover"))
    steps = design_steps(robot, q)
    effect = next(s.effect for s in steps.steps if s.change == change)
    for kind in ("force", "torque", "wrench"):
        ends = [
            margin_gradients(
                snakegen.load(load_spec("dragon4", overrides=spec_of(change, s))), q, kind
            ).value
            for s in (STEP, -STEP)
        ]
        difference = (ends[0] - ends[1]) / (2.0 * STEP)
        assert effect[kind] == pytest.approx(difference, rel=1e-5, abs=1e-9)
    assert max(abs(v) for v in effect.values()) > 1e-3


def test_best_turns_a_harmful_change_round():
    robot = snakegen.load("dragon4")
    steps = design_steps(robot, robot.configuration(POSTURE, gimbals="hover"))
    for kind in ("force", "torque"):
        text, gain = steps.best(kind) or ("", 0.0)
        rows = [s for s in steps.steps if not s.thrust]
        assert gain == max(abs(s.effect[kind]) if s.about_zero else s.effect[kind] for s in rows)
        if "root" in text or "shorter" in text or "less" in text:
            assert min(s.effect[kind] for s in rows) == -gain
        else:
            assert max(s.effect[kind] for s in rows) == gain


def tilting_arms(along: float = 0.0) -> ForceSets:
    """Four arms of one tilt axis each, alike but that the first may be moved outward."""
    turn = [np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1))]  # fmt: skip
    points = [0.25 * r[:, 0] for r in turn]
    points[0] = points[0] + [along, 0.0, 0.0]
    whole, still = np.array([-np.pi, np.pi]), np.zeros(2)
    return ForceSets.checked(points, turn, 0.0, 10.0, whole, still)


@pytest.mark.parametrize("kind", ["force", "torque"])
def test_symmetric_discs_have_all_their_ties(kind):
    """A body of four equal arms is as weak in four directions; one-sided slopes are the least."""

    def margin(along):
        return set_margins(
            tilting_arms(along), [0.0, 0.0, 18.6, 0.0, 0.0, 0.0], force_scale=18.6,
            torque_scale=5.0, wrench_starts=0,
        )  # fmt: skip

    pieces = vectored_optima(margin(0.0), kind)
    assert len(pieces) == 4
    slopes = [float(p.by_points[0, 0]) for p in pieces]
    h = 1e-6
    value = vectored_optima(margin(0.0), kind)[0].value
    up = (vectored_optima(margin(h), kind)[0].value - value) / h
    down = (vectored_optima(margin(-h), kind)[0].value - value) / h
    assert up == pytest.approx(min(slopes), abs=1e-3)
    assert down == pytest.approx(min(-s for s in slopes), abs=1e-3)
    assert kind == "force" or max(slopes) - min(slopes) > 1.0


def test_straight_dual_rotor_body_has_attitude_altitude_alone():
    robot = snakegen.load("dragon3")
    steps = design_steps(robot, robot.configuration({}, gimbals="hover"), "dual_rotor")
    assert "attitude_altitude" in steps.margins and "wrench" not in steps.margins


def test_command_prints_the_best_and_draws(tmp_path):
    picture = tmp_path / "s.png"
    words = ["analyze", "margin", "dragon4", "--joint", "joint1_yaw=0.8", "--sensitivity"]
    made = CliRunner().invoke(cli, [*words, "--picture", str(picture)], catch_exceptions=False)
    assert "best for torque" in made.stdout and "apparatus 2 towards the" in made.stdout
    assert picture.stat().st_size > 10_000
    with pytest.raises(SnakegenError, match="ask for sensitivity"):
        CliRunner().invoke(cli, [*words[:-1], "--picture", "a.png"], catch_exceptions=False)
