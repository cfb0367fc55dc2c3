"""Limits of gimbals and least thrusts move hover, refusals and verdicts by the right amount."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import lsq_linear

import snakegen
from snakegen.analysis import hover
from snakegen.analysis.allocation import allocation
from snakegen.analysis.hover_result import Hover
from snakegen.base.geometry import skew
from snakegen.control.controller import flight_controller
from snakegen.control.switch import check_mode
from snakegen.description.mjcf.decorate import decorate
from snakegen.errors import MissionError, SpecError
from snakegen.kernels.control.types import VIRTUAL
from snakegen.robot.posture import hover_gimbals
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.run import prepare, run
from snakegen.spec.loading import load_spec
from snakegen.wrench_margins.vectored import set_margins, vectored_margins

BEND = {"joint1_pitch": 0.8, "joint1_yaw": 1.0, "joint2_yaw": 1.0, "joint3_yaw": 1.0}
ARC = {"joint1_yaw": 1.0, "joint2_yaw": 1.0, "joint3_yaw": 1.0}


def limited(limit: float = 3.14159265, least: float = 0.0, *more: str) -> Robot:
    """Returns dragon4 with gimbals of ±limit [rad] and a least thrust [N] of each rotor."""
    section = "vectoring_apparatus"
    given = {"roll_limit": limit, "pitch_limit": limit, "thrust_min": least}
    overrides = [*(f"{section}.{k}={v}" for k, v in given.items()), *more]
    return snakegen.load(load_spec("dragon4", overrides=overrides))


def hovering(robot: Robot, posture: dict[str, float]) -> Hover:
    return hover.analyze(robot, hover_gimbals(robot, robot.configuration(posture)))


def test_hover_names_the_gimbals_that_leave_their_limits() -> None:
    """One gimbal is left just below the limit at which hover passes: it asks for that angle."""
    free = limited()
    q = hover_gimbals(free, free.configuration(BEND))
    a = hover.analyze(free, q)
    assert a.virtual_feasible and a.beyond == () and a.short.max() < 1e-9
    narrow = hovering(limited(0.05), BEND)
    assert not narrow.virtual_feasible
    angles = dict(narrow.beyond)
    assert set(angles) == {f"gimbal{j}_{k}" for j in (2, 3, 4) for k in ("roll", "pitch")}
    assert narrow.to_json()["virtual_single_rotor"]["gimbals_beyond_limits_rad"] == angles
    assert narrow.possible is False, "the force sets prove that nothing hovers"
    assert hovering(limited(0.7), BEND).possible is True
    heavy = snakegen.load(load_spec("dragon4", overrides=["chain.mass=5"]))
    assert hovering(heavy, ARC).possible is False and hovering(heavy, {}).possible is False
    low, high = 0.05, 1.5
    while high - low > 2e-2:
        middle = 0.5 * (low + high)
        if hovering(limited(middle), BEND).virtual_feasible:
            high = middle
        else:
            low = middle
    left = hovering(limited(low), BEND)
    ((name, angle),) = left.beyond
    assert low < abs(angle) < high + 1e-2 and name.startswith("gimbal")
    assert 0 < left.short.max() <= abs(angle) - low + 1e-9


def test_least_thrust_counts_in_virtual_hover() -> None:
    """A least thrust just below what hover asks of the idlest apparatus passes; above, not."""
    asked = hovering(limited(), ARC).virtual_thrust.min() / 2
    below, above = (hovering(limited(least=asked + d), ARC) for d in (-0.01, 0.01))
    assert below.virtual_feasible and not above.virtual_feasible
    assert np.allclose(above.apparatus_min, 2 * (asked + 0.01))
    assert any("least thrust" in text for _, text in above.rows())


@pytest.mark.parametrize(
    "limit, least, remedy",
    [(0.05, 0.0, "gimbals that reach gimbal2_roll -0.7"), (3.1, 9.9, "less")],
)
def test_a_start_out_of_limits_is_refused_with_its_remedy(
    limit: float, least: float, remedy: str
) -> None:
    """Missions refuse what neither limits of gimbals nor least thrusts let hover."""
    robot = limited(limit, least)
    posture = BEND if least == 0.0 else ARC
    with pytest.raises(MissionError, match=remedy):
        prepare(robot, "hover", options={"posture": posture})
    prepare(limited(1.0, 9.0), "hover", options={"posture": posture})


def test_margins_of_logs_count_gimbal_limits_and_least_thrusts() -> None:
    """A log's bounds hold the margins of the force sets at its postures, far below those of balls.

    Two products of convex pieces an instant keep within 2 % where gimbals are narrow; a cut-out
    core takes more of them (one posture: 0.3 %).
    """
    cases = (
        (limited(0.05), -1, 0.2, 0.98),
        (limited(0.2), -1, 0.6, 0.98),
        (limited(least=8.5), 0, 0.9, 0.0),
    )
    for robot, row, most, close in cases:
        recording = run(robot, "hover", options={"duration": 0.5, "trim": 0.0, "posture": ARC})
        time = recording.times("force_margin")[row]
        at = np.searchsorted(recording.times("q"), time - 1e-9)
        a = allocation(robot, recording.channel("q").values[at])
        sets = robot.force_sets(recording.channel("q").values[at])
        scale = {"force_scale": robot.force_scale, "torque_scale": robot.torque_scale}
        m = set_margins(sets, a.hover_wrench, tolerance=1e-2, **scale)
        stack = replace(sets, points=sets.points[None], frames=sets.frames[None])
        batch = set_margins(stack, a.hover_wrench, tolerance=1e-2, **scale)
        for name in ("force", "torque"):
            low = recording.channel(f"{name}_margin").values[row, 0]
            high = recording.channel(f"{name}_margin_upper").values[row, 0]
            inner, outer = getattr(m, f"{name}_bounds")
            assert outer - inner <= 3e-3 * outer
            assert [low, high] == pytest.approx(getattr(batch, f"{name}_bounds")[0], rel=1e-3)
            assert max(0.0, close * inner) < low <= outer and inner <= high <= 1.03 * outer
        balls = vectored_margins(a.thrust_points, robot.gimbals.limit, a.hover_wrench, **scale)
        assert 0.0 < recording.channel("force_margin").values[row, 0] < most * balls.force


@pytest.mark.parametrize(
    "limit, least, posture, allowed",
    [
        (0.05, 0.0, BEND, False),
        (1.0, 0.0, BEND, True),
        (3.1, 9.9, ARC, False),
        (3.1, 9.0, ARC, True),
    ],
)
def test_mode_switches_count_limits(
    limit: float, least: float, posture: dict[str, float], allowed: bool
) -> None:
    """Virtual-single-rotor mode is allowed where its hover is within all limits."""
    robot = limited(limit, least)
    controller = flight_controller(robot)
    q = robot.configuration(posture)
    check = check_mode(controller, VIRTUAL, robot.angles(q), robot.base_pose(q)[0])
    assert check.allowed == allowed and check.saturated != allowed


def test_the_verdict_names_gimbals_at_their_limits() -> None:
    """A body hovers on gimbals of ±0.05 rad; at ±0.01 the verdict fails and names a gimbal.

    Of equal rotors: unequal ones are refused before take-off.
    """
    shares = {}
    for limit in (3.14159265, 0.05, 0.01):
        equal = ["plant.thrust_mismatch=0"] if limit < 0.05 else []
        robot = limited(limit, 0.0, *equal)
        recording = run(robot, "hover", options={"duration": 2.0, "posture": ARC})
        checks = {c.metric: c for c in recording.verdict.checks}
        shares[limit] = checks.get("gimbal_angle_limit_share")
        command = recording.channel("gimbal_command").values
        assert np.abs(command).max() <= limit + 1e-9
    assert shares[3.14159265] is None and shares[0.05].passed
    assert not shares[0.01].passed and shares[0.01].value > 0.5
    assert "gimbal" in shares[0.01].worst.part


def test_keyframes_hover_within_least_thrusts() -> None:
    """Keyframe thrusts carry the weight; above a least thrust they miss it least."""

    def thrusts(least: float) -> tuple[np.ndarray, Robot]:
        robot = snakegen.load(
            load_spec("dragon3", overrides=[f"vectoring_apparatus.thrust_min={least}"])
        )
        model = decorate(robot.urdf, robot.modules, {}, visuals=False).compile()
        return model.key("home").ctrl[: len(robot.rotors.body)], robot

    free, robot = thrusts(0.0)
    assert free.sum() == pytest.approx(robot.force_scale, rel=1e-6)
    least = 0.5 * (free.min() + robot.force_scale / free.size)
    narrowed, _ = thrusts(float(least))
    assert free.min() < least - 0.1 and narrowed.min() >= least - 1e-6
    a = allocation(robot, robot.configuration({}))
    wrench = np.linalg.lstsq(a.dual, a.hover_wrench, rcond=1e-9)[0]
    assert np.allclose(a.dual @ free, a.dual @ wrench, atol=1e-6)
    about_root = np.eye(6)
    about_root[3:, :3] = skew(a.cog)  # the keyframe's wrench is that of the free joint
    q, wanted = about_root @ a.dual, about_root @ a.hover_wrench
    box = lsq_linear(q, wanted, (least, robot.rotors.thrust_max))
    missed = np.linalg.norm(q @ narrowed - wanted)
    assert missed == pytest.approx(np.sqrt(2 * box.cost), rel=1e-4)


def test_reversible_rotors_build_and_push_both_ways(tmp_path: Path) -> None:
    """A negative least thrust passes spec, URDF, MJCF and equivalence check; sets reach below 0."""
    spec = load_spec("dragon4", links=2, overrides=["vectoring_apparatus.thrust_min=-4"])
    made = snakegen.build(spec, tmp_path / "r", picture=False)
    assert made.equivalence.passed
    robot = snakegen.load(made.urdf)
    assert np.allclose(robot.rotors.thrust_min, -4.0) and np.allclose(robot.force_shapes.low, -8.0)
    with pytest.raises(SpecError, match="thrust_min"):
        load_spec("dragon4", overrides=["vectoring_apparatus.thrust_min=20"])
