"""Derivatives of margins of limited gimbals and least thrusts, against central differences."""

from dataclasses import replace

import numpy as np
import pytest

import snakegen
from snakegen.errors import SnakegenError
from snakegen.robot.posture import hover_gimbals
from snakegen.robot.robot import Robot
from snakegen.sensitivity.margin_gradient import MarginGradient, margin_gradients
from snakegen.spec.loading import load_spec
from snakegen.wrench_margins import set_optima

STEP = 1e-5
BENT = {"joint1_yaw": 0.9, "joint2_yaw": 0.7, "joint3_yaw": -0.4, "joint2_pitch": 0.3}


def limited(*fields: str) -> tuple[Robot, np.ndarray]:
    """Returns dragon4 with changed apparatuses, hovering in a bent posture."""
    spec = load_spec("dragon4", overrides=[f"vectoring_apparatus.{f}" for f in fields])
    robot = snakegen.load(spec)
    return robot, np.array(hover_gimbals(robot, robot.configuration(BENT)))


def slope(robot: Robot, q: np.ndarray, kind: str, index: int) -> float:
    """Returns the central difference by one joint, each margin found anew."""
    values = []
    for side in (STEP, -STEP):
        at = q.copy()
        at[7 + index] += side
        values.append(margin_gradients(robot, at, kind).value)
    return (values[0] - values[1]) / (2.0 * STEP)


def test_wrench_of_limited_gimbals_against_central_differences():
    robot, q = limited("roll_limit=0.5", "pitch_limit=1.2")
    found = margin_gradients(robot, q, "wrench")
    assert found.value > 0.1 and not found.kink
    by, at = found.by("joints"), robot.joint_names.index("joint1_yaw")
    assert slope(robot, q, "wrench", at) == pytest.approx(by[at], abs=1e-6 * np.abs(by).max())
    assert abs(by[at]) > 0.01


@pytest.mark.parametrize("kind", ["force", "torque"])
@pytest.mark.parametrize(
    "fields", [("roll_limit=0.8", "pitch_limit=0.8"), ("roll_limit=0.5", "pitch_limit=1.2")]
)
def test_joints_and_limits_against_central_differences(fields, kind):
    robot, q = limited(*fields)
    found = margin_gradients(robot, q, kind)
    assert not found.kink and found.apart < 3e-3
    assert any(robot.force_sets(q).phi[:, 1] < 1.0)
    by = found.by("joints")
    for name in ("joint1_yaw", "joint2_pitch", "gimbal2_roll"):
        at = robot.joint_names.index(name)
        assert slope(robot, q, kind, at) == pytest.approx(by[at], abs=1e-6 * np.abs(by).max())

    def with_thrust(step: float) -> float:
        other, rotors = replace(robot), robot.rotors
        more = np.where(rotors.apparatus == 1, 0.5 * step, 0.0)
        other.__dict__["rotors"] = rotors._replace(thrust_max=rotors.thrust_max + more)
        return margin_gradients(other, q, kind).value

    by_limit = found.by("thrust_limits")
    difference = (with_thrust(STEP) - with_thrust(-STEP)) / (2.0 * STEP)
    assert difference == pytest.approx(by_limit[1], abs=1e-6 * np.abs(by_limit).max())
    assert np.abs(by_limit).max() > 1e-3


def test_the_optimum_lies_between_the_bounds_and_its_forces_in_the_sets():
    robot, q = limited("roll_limit=1.0", "pitch_limit=1.0", "thrust_min=1")
    found = snakegen.margins(robot.validate_configuration(q))
    for kind, (low, high) in (("force", found.force_bounds_N), ("torque", found.torque_bounds_Nm)):
        o = margin_gradients(robot, q, kind).pieces[0]
        assert low * (1 - 1e-6) <= o.value <= high * (1 + 1e-6)
        sets = robot.force_sets(q)
        x = set_optima.angles_of(sets, o.forces)
        np.testing.assert_allclose(
            set_optima.force_derivatives(sets.frames, x)[0], o.forces, atol=1e-7
        )
        torque = np.cross(o.points, o.forces) + o.drag[:, None] * o.forces
        wrench = np.r_[o.forces.sum(axis=0), torque.sum(axis=0)] - o.hover_wrench
        part = slice(0, 3) if kind == "force" else slice(3, 6)
        assert np.linalg.norm(wrench[part]) == pytest.approx(o.value, rel=1e-8)
        assert np.linalg.norm(np.delete(wrench, part)) < 1e-7 * robot.force_scale


def test_the_typed_result_of_limited_gimbals_has_its_gradient():
    robot, q = limited("roll_limit=0.8", "pitch_limit=0.8")
    by = snakegen.margins(robot.validate_configuration(q)).gradient("force")
    found = margin_gradients(robot, q, "force")
    assert isinstance(found, MarginGradient)
    np.testing.assert_allclose(by, found.by("joints"), rtol=1e-8, atol=1e-8)


def test_limited_gimbals_out_of_reach_of_hover_are_refused():
    robot, _ = limited("roll_limit=0.05", "pitch_limit=0.05")
    q = robot.configuration({"base_rpy": (0.4, 0.0, 0.0), **BENT})
    for kind in ("force", "wrench"):
        with pytest.raises(SnakegenError, match="out of reach"):
            margin_gradients(robot, q, kind)
