"""Derivatives of joint-limited margins, against central differences of margins found anew."""

import numpy as np
import pytest

import snakegen
from snakegen.errors import SnakegenError
from snakegen.robot.posture import hover_gimbals
from snakegen.robot.robot import Robot
from snakegen.sensitivity.joint_limited import joint_limited_gradient
from snakegen.sensitivity.margin_gradient import margin_gradients
from snakegen.spec.loading import load_spec

STEP = 1e-5
VIRTUAL, DUAL = "virtual_single_rotor", "dual_rotor"


@pytest.fixture(scope="module")
def robot() -> Robot:
    return snakegen.load("dragon4")


def posture(robot: Robot, mode: str) -> np.ndarray:
    rng = np.random.default_rng(0)
    if mode == VIRTUAL:
        low, high, _ = robot.limits(robot.chain_joints)
        angles = dict(zip(robot.chain_joints, 0.6 * rng.uniform(low, high), strict=True))
        return np.array(hover_gimbals(robot, robot.configuration(angles)))
    low, high, _ = robot.limits(robot.joint_names)
    drawn = dict(zip(robot.joint_names, rng.uniform(0.8 * low, 0.8 * high), strict=True))
    angles = {name: drawn[name] for name in robot.chain_joints}
    rpy = rng.uniform(-0.3, 0.3, 3)
    q = np.array(hover_gimbals(robot, robot.configuration(angles, base_rpy=rpy)))
    names = [n for n in robot.joint_names if n in robot.gimbal_names]
    at = [7 + robot.joint_names.index(n) for n in names]
    q[at] += rng.uniform(-0.2, 0.2, len(at))  # parallel thrusts leave the set flat
    return q


@pytest.mark.parametrize(
    ("mode", "kind", "link"),
    [(VIRTUAL, "force", None), (VIRTUAL, "torque", "link3"), (DUAL, "force", None)],
)
def test_joints_against_central_differences(robot: Robot, mode, kind, link) -> None:
    q = posture(robot, mode)
    found = joint_limited_gradient(robot, q, kind, mode, link)
    low, high = found.bounds
    assert low * (1 - 1e-9) <= found.value <= high * (1 + 1e-9) and high - low < 2e-3 * high
    size = np.abs(found.by_joints).max()
    assert size > 0.05
    for name in ("joint1_yaw", "joint2_pitch", "gimbal3_roll"):
        at = robot.joint_names.index(name)
        step = STEP * np.eye(len(q))[7 + at]
        up, down = (
            joint_limited_gradient(robot, q + s, kind, mode, link).value for s in (step, -step)
        )
        assert (up - down) / (2 * STEP) == pytest.approx(found.by_joints[at], abs=1e-6 * size)


def test_strong_joints_leave_the_margin_of_the_thrusts() -> None:
    """No joint at its limit: value and derivative are those of the free margin."""
    strong = snakegen.load(load_spec("dragon4", overrides=["joint.effort=500"]))
    q = posture(strong, VIRTUAL)
    found, free = joint_limited_gradient(strong, q, "torque"), margin_gradients(strong, q, "torque")
    assert found.joints == () and found.value == pytest.approx(free.value, rel=1e-9)
    np.testing.assert_allclose(found.by_joints, free.by("joints"), atol=1e-7)


def test_joints_at_their_limit_are_named_and_lower_the_margin(robot: Robot) -> None:
    q = posture(robot, VIRTUAL)
    found = joint_limited_gradient(robot, q, "force")
    assert found.joints and found.value < margin_gradients(robot, q, "force").value


def test_what_has_no_derivative_is_refused(robot: Robot) -> None:
    q = posture(robot, VIRTUAL)
    narrow = [f"vectoring_apparatus.{k}_limit=0.5" for k in ("roll", "pitch")]
    for given, words in (
        ((robot, q, "wrench"), "force and torque"),
        ((snakegen.load(load_spec("dragon4", overrides=narrow)), q, "force"), "convex"),
        ((snakegen.load("arm6"), q, "force"), "cannot hover"),
        ((robot, robot.configuration(), "torque"), "no derivative here"),
    ):
        with pytest.raises(SnakegenError, match=words):
            joint_limited_gradient(*given)
