"""Derivatives of margins against central differences of exact margins; kinks; the compiled twin."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import snakegen
from snakegen.errors import SnakegenError
from snakegen.kernels.margins import saddle_point as kernel
from snakegen.robot.robot import Robot
from snakegen.sensitivity.margin_gradient import margin_gradients
from snakegen.wrench_margins.saddle_point import saddle_point

STEP = 1e-5
VIRTUAL, DUAL = "virtual_single_rotor", "dual_rotor"
CASES = [
    ("dragon4", VIRTUAL, "force"),
    ("dragon4", VIRTUAL, "torque"),
    ("dragon4", VIRTUAL, "wrench"),
    ("dragon4", DUAL, "force"),
    ("dragon4", DUAL, "torque"),
    ("dragon4", DUAL, "wrench"),
    ("dragon3", DUAL, "attitude_altitude"),
]


@pytest.fixture(scope="module")
def robots() -> dict[str, Robot]:
    return {name: snakegen.load(name) for name in ("dragon3", "dragon4")}


def posture(robot: Robot, seed: int, hover: bool, tilt: float = 0.2) -> np.ndarray:
    rng = np.random.default_rng(seed)
    low, high, _ = robot.limits(robot.joint_names)
    angles = dict(zip(robot.joint_names, rng.uniform(0.8 * low, 0.8 * high), strict=True))
    more = {"gimbals": "hover"} if hover else {}
    if hover:
        angles = {k: v for k, v in angles.items() if k not in robot.gimbal_names}
    q = robot.configuration(angles, base_rpy=rng.uniform(-0.3, 0.3, 3), **more)
    q = np.array(q)
    if hover:  # parallel thrusts leave the dual-rotor set flat: turn them apart
        names = [n for n in robot.joint_names if n in robot.gimbal_names]
        at = [7 + robot.joint_names.index(n) for n in names]
        q[at] += rng.uniform(-tilt, tilt, len(at))
    return q


def central(value, size: int) -> np.ndarray:
    out = np.empty(size)
    for i in range(size):
        step = STEP * np.eye(size)[i]
        out[i] = (value(step) - value(-step)) / (2.0 * STEP)
    return out


def close(by: np.ndarray, differences: np.ndarray) -> None:
    assert np.abs(by).max() > 1e-4  # a zero test sees nothing
    assert np.abs(by - differences).max() <= 1e-6 * np.abs(by).max()


@pytest.mark.parametrize(("name", "mode", "kind"), CASES)
def test_joints_and_attitude_against_central_differences(robots, name, mode, kind):
    robot = robots[name]
    q = posture(robot, 0, mode == DUAL, 0.0 if kind == "attitude_altitude" else 0.2)
    found = margin_gradients(robot, q, kind, mode)
    assert not found.kink

    def at_joints(step):
        moved = q.copy()
        moved[7:] += step
        return margin_gradients(robot, moved, kind, mode, ties=False).value

    def at_attitude(step):
        moved = q.copy()
        moved[3:7] = (Rotation.from_quat(q[3:7]) * Rotation.from_rotvec(step)).as_quat()
        return margin_gradients(robot, moved, kind, mode, ties=False).value

    close(found.by("joints"), central(at_joints, len(q) - 7))
    close(found.by("attitude"), central(at_attitude, 3))
    again = snakegen.margin_gradient(robot, q, kind, mode, "attitude")  # by then compiled
    np.testing.assert_allclose(again, found.by("attitude"), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    ("mode", "kind"), [(VIRTUAL, "torque"), (VIRTUAL, "wrench"), (DUAL, "wrench"), (DUAL, "force")]
)
def test_masses_limits_and_drag_against_central_differences(robots, mode, kind):
    robot = robots["dragon4"]
    q = posture(robot, 0, mode == DUAL)
    found = margin_gradients(robot, q, kind, mode)

    def changed(**parts) -> Robot:
        other = replace(robot)
        for name, value in parts.items():
            other.__dict__[name] = value
        return other

    def value(other: Robot) -> float:
        return margin_gradients(other, q, kind, mode, ties=False).value

    tree, rotors, n = robot.tree, robot.rotors, robot.tree.mass.size

    def of_mass(step):
        return value(changed(tree=tree._replace(mass=tree.mass + step)))

    def of_com(step):
        return value(changed(tree=tree._replace(com=tree.com + step.reshape(n, 3))))

    close(found.by("masses"), central(of_mass, n))
    close(found.by("centres_of_mass").ravel(), central(of_com, 3 * n))

    def of_limit(step):  # of an apparatus both rotors' limits rise alike
        if mode == VIRTUAL:
            step = np.repeat(0.5 * step, 2)
        return value(changed(rotors=rotors._replace(thrust_max=rotors.thrust_max + step)))

    close(found.by("thrust_limits"), central(of_limit, len(found.bodies[0])))
    if mode == DUAL:

        def of_drag(step):
            return value(changed(rotors=rotors._replace(torque_ratio=rotors.torque_ratio + step)))

        close(found.by("drag"), central(of_drag, len(found.bodies[0])))


def test_apparatus_on_the_twist_axis_is_smooth_with_its_balancing_force(robots):
    """THEORY A9: there L y/‖y‖ is any direction, the balancing force is not of length L."""
    robot, inside = robots["dragon4"], 0
    for seed in range(12):
        q = posture(robot, seed, False)
        found = margin_gradients(robot, q, "torque")
        o = found.pieces[0]
        if np.linalg.norm(o.forces, axis=1).min() < 0.999 * 32.0:
            inside += 1
            by = found.by("joints")

            def value(step, q=q):
                moved = q.copy()
                moved[7] += step[0]
                return margin_gradients(robot, moved, "torque", ties=False).value

            assert abs(central(value, 1)[0] - by[0]) <= 1e-6 * np.abs(by).max()
    assert inside >= 3


def test_kink_between_two_worst_directions_has_both_pieces(robots):
    """One-sided slopes along random directions are the least of the pieces' (a minimum's kink)."""
    robot = robots["dragon4"]
    q, way = posture(robot, 0, False), np.random.default_rng(1).standard_normal(21)
    way[:7] = 0.0

    def twist(t):
        return margin_gradients(robot, q + t * way, "torque", ties=False).pieces[0].twist[3:]

    low, high = 0.0, 0.0  # the worst direction jumps between them
    before = twist(0.0)
    while before @ twist(high) > 0.9:
        low, before, high = high, twist(high), high + 0.02
    first = twist(low)
    for _ in range(45):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if first @ twist(middle) > 0.9 else (low, middle)
    q += low * way
    found = margin_gradients(robot, q, "torque")
    assert len(found.pieces) == 2 and "2 directions tie" in found.kink
    slopes = np.array([found.by("joints", k) for k in range(2)])
    assert np.ptp(slopes, axis=0).max() > 1e-2
    rng, h = np.random.default_rng(2), 1e-6
    for _ in range(6):
        way[7:] = rng.standard_normal(14)
        moved = margin_gradients(robot, q + h * way, "torque", ties=False).value
        assert (moved - found.value) / h == pytest.approx((slopes @ way[7:]).min(), rel=1e-3)


def test_straight_body_has_zero_as_a_subgradient(robots):
    robot = robots["dragon4"]
    q = robot.configuration({}, gimbals="hover")
    found = margin_gradients(robot, q, "torque")
    assert found.value == 0.0 and "lost" in found.kink
    assert not found.by("joints").any() and found.by("joints").shape == (14,)


def test_compiled_twin_agrees(robots):
    robot = robots["dragon4"]
    rows = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])
    points, hovers, twists, values = [], [], [], []
    for seed in range(6):
        q = posture(robot, seed, False)
        o = margin_gradients(robot, q, "torque", ties=False).pieces[0]
        p = np.column_stack([o.points, o.drag]) * o.scale[0] / o.scale[3]
        points.append(p), hovers.append(o.hover_wrench / o.scale)
        twists.append(o.twist * o.scale / o.scale[3] + 1e-3), values.append(o.value / o.scale[3])
    limit = np.full(4, 32.0) / robot.force_scale
    m = len(points)
    bounds = np.column_stack([np.array(values) * 0.999, np.array(values) * 1.001])
    out, forces, solved = np.empty(m), np.empty((m, 4, 3)), np.empty(m, np.int64)
    stack = np.array(points), limit, np.array(hovers), rows, bounds
    kernel.batch(*stack, np.array(twists), out, forces, solved)
    assert solved.all()
    np.testing.assert_allclose(out, values, rtol=1e-11)
    plain = [
        saddle_point(p, np.broadcast_to(np.eye(3), (4, 3, 3)), 0 * limit, limit, w, rows, d)
        for p, w, d in zip(points, hovers, twists, strict=True)
    ]
    np.testing.assert_allclose(out, [s.value for s in plain], rtol=1e-11)
    np.testing.assert_allclose(forces[0], plain[0].forces, atol=1e-8)


def test_typed_result_has_its_gradient(robots):
    robot = robots["dragon4"]
    q = robot.configuration({"joint1_yaw": 0.9, "joint2_pitch": 0.4, "joint3_yaw": -0.7})
    by = snakegen.margins(q).gradient("torque")
    np.testing.assert_array_equal(by, snakegen.margin_gradient(robot, q, "torque"))
    assert by.shape == (len(robot.joint_names),)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("torqe",), "torque"),
        (("torque", "dual_rotr"), "dual_rotor"),
        (("torque", VIRTUAL, "joint"), "joints"),
        (("attitude_altitude", VIRTUAL), "wrench, force and torque"),
    ],
)
def test_unknown_names_are_refused(robots, arguments, words):
    robot = robots["dragon4"]
    with pytest.raises(SnakegenError, match=words):
        snakegen.margin_gradient(robot, robot.configuration({}), *arguments)


def test_robot_that_cannot_hover_is_refused():
    robot = snakegen.load("arm6")
    with pytest.raises(SnakegenError, match="cannot hover"):
        snakegen.margin_gradient(robot, robot.configuration({}), "force")
