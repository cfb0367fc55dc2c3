"""Allocation laws against plain NumPy, finite differences and independent solvers."""

import numpy as np
import pytest
from flat_robots import FlatRobot, X, Y, Z, random_rotation, snake

from snakegen.base.geometry import rotation_about
from snakegen.control import fully_actuated, switch, underactuated
from snakegen.control.controller import Controller, ControlRefused, LawOptions, check_mounts, law_of
from snakegen.control.frame import cog_frame
from snakegen.control.gains import Gains
from snakegen.kernels.allocation import fully_actuated as kernel
from snakegen.kernels.allocation import gimbals as vectoring
from snakegen.kernels.allocation import wrench_map
from snakegen.kernels.control.types import DUAL, VIRTUAL
from snakegen.kernels.kinematics import chain

LENGTH, G = 0.42, 9.81


def controller_of(robot, gains=None, mode=VIRTUAL, **options):
    tree, rotors, gimbals = robot[:3]
    return Controller(
        tree,
        rotors,
        gimbals,
        law_of(gains or Gains(), gimbals, LawOptions(length=LENGTH, **options)),
        mode,
    )


def bent(robot, rng, most=1.5):
    """Joint angles at random, gimbals at 0."""
    angles = np.zeros(len(robot[0].parent) - 1)
    angles[robot[3]] = rng.uniform(-most, most, robot[3].shape)
    return angles


def with_gimbals(robot, angles, gimbals):
    out = angles.copy()
    out[robot[4]] = gimbals
    return out


def true_wrench(robot, frame, angles, gimbals, thrust):
    """The wrench by the allocation kernels of the analysis, the CoG held at the frame's."""
    tree, rotors, _ = robot[:3]
    poses = chain.forward(tree, np.eye(3), np.zeros(3), with_gimbals(robot, angles, gimbals))
    points, directions = wrench_map.rotor_frames(rotors, *poses, frame.cog, frame.axes)
    return wrench_map.dual_map(rotors, points, directions) @ thrust


def random_wrench(rng, frame, robot):
    weight = frame.mass * G
    extra = np.r_[rng.normal(size=3) * 0.1 * weight, rng.normal(size=3) * 0.03 * weight * LENGTH]
    return frame.hover_wrench + extra


def test_aiming_is_the_papers_inverse():
    """φ = atan2(-f_y, f_z), θ = atan2(f_x, -f_y sinφ + f_z cosφ): eqs 38-39."""
    rng = np.random.default_rng(0)
    robot = snake(2, offset=0.037)
    frame = cog_frame(controller_of(robot), np.zeros(len(robot[0].parent) - 1))
    low, high, out = np.full(2, -np.pi), np.full(2, np.pi), np.empty(2)
    for _ in range(50):
        f = rng.normal(size=3)
        f /= np.linalg.norm(f)
        roll = np.arctan2(-f[1], f[2])
        expected = roll, np.arctan2(f[0], -f[1] * np.sin(roll) + f[2] * np.cos(roll))
        near = np.array(expected) + rng.uniform(-0.1, 0.1, 2)
        vectoring.point_thrust(frame.mounts, 1, f, near, low, high, out)
        np.testing.assert_allclose(out, expected, atol=1e-9)


def test_aiming_unwraps_keeps_phi_at_the_pole_and_respects_limits():
    robot = snake(2)
    m = cog_frame(controller_of(robot), np.zeros(len(robot[0].parent) - 1)).mounts
    free, out = np.full(2, 10.0), np.empty(2)
    for roll in np.linspace(0.0, 9.0, 60):  # through ±180° and on
        f = np.array([0.0, -np.sin(roll), np.cos(roll)])
        last = out.copy() if roll > 0 else np.zeros(2)
        vectoring.point_thrust(m, 0, f, last, -free, free, out)
        np.testing.assert_allclose(out, [roll, 0.0], atol=1e-9)
    vectoring.point_thrust(m, 0, X, np.array([0.7, 1.5]), -free, free, out)
    np.testing.assert_allclose(out, [0.7, np.pi / 2], atol=1e-9)
    limit = np.array([0.3, 0.4])
    vectoring.point_thrust(m, 0, np.array([0.6, 0.0, 0.8]), np.zeros(2), -limit, limit, out)
    np.testing.assert_allclose(out, [0.0, 0.4], atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_kernel_jacobian_equals_the_analysis_and_the_wrench_equals_the_rotors(seed):
    rng = np.random.default_rng(seed)
    robot = snake(3, offset=0.05)
    tree, rotors, gimbals = robot[:3]
    angles = bent(robot, rng)
    c = controller_of(robot, axes_body=1, axes_rotation=random_rotation(rng))
    turns, thrust = rng.uniform(-2, 2, (3, 2)), rng.uniform(5, 30, 3)
    poses = chain.forward(tree, np.eye(3), np.zeros(3), with_gimbals(robot, angles, turns))
    frame = cog_frame(c, with_gimbals(robot, angles, turns))
    expected = wrench_map.wrench_maps(tree, rotors, gimbals, *poses, frame.axes, thrust)
    jacobian = kernel.wrench_jacobian(frame.mounts, thrust, turns)
    np.testing.assert_allclose(jacobian, expected[5], atol=1e-11)
    np.testing.assert_allclose(
        kernel.wrench_of(frame.mounts, thrust, turns), expected[3] @ thrust, atol=1e-11
    )


@pytest.mark.parametrize("links, share", [(4, 0.99), (5, 0.99), (6, 0.99)])
def test_newton_meets_the_wrench_in_three_steps_from_a_cold_start(links, share):
    """Residual 1e-6 in at most 3 iterations for 99 % of bent postures (largest yaw ≥ 0.3)."""
    rng = np.random.default_rng(links)
    robot = snake(links, offset=0.037)
    c = controller_of(robot)
    steps, cases = [], 400
    while len(steps) < cases:
        angles = bent(robot, rng)
        if np.abs(angles[robot[3][:, 1]]).max() < 0.3:
            continue
        frame = cog_frame(c, angles)
        wrench = random_wrench(rng, frame, robot)
        a = fully_actuated.allocate(c, frame, wrench, force=True)
        met = np.linalg.norm(a.given - wrench) <= 1e-6
        steps.append(a.iterations if met else 99)
        if len(steps) % 40 == 0:
            shared = np.repeat(a.thrust / 2, 2)
            given = true_wrench(robot, frame, angles, a.gimbals, shared)
            np.testing.assert_allclose(given, wrench, atol=1e-5)
    assert np.mean(np.array(steps) <= 3) >= share


def test_warm_start_takes_at_most_two_steps():
    """A bent body under a wrench that changes as it does from tick to tick."""
    rng = np.random.default_rng(3)
    robot = snake(4, offset=0.037)
    c, angles = controller_of(robot), np.zeros(len(robot[0].parent) - 1)
    angles[robot[3][:, 1]], angles[robot[3][:, 0]] = 0.8, [0.4, -0.4, 0.4]
    frame = cog_frame(c, angles)
    last = fully_actuated.allocate(c, frame, frame.hover_wrench).gimbals
    for k in range(60):
        swing = np.array([5.0, -4.0, 3.0, 0.6, 0.5, -0.7]) * np.sin(0.1 * k)
        noise = rng.normal(size=6) * [0.5, 0.5, 0.5, 0.05, 0.05, 0.05]
        a = fully_actuated.allocate(c, frame, frame.hover_wrench + swing + noise, last)
        assert a.iterations <= 2 and a.residual <= 1e-6
        assert np.abs(a.gimbals - last).max() < 0.3, "the gimbals do not jump"
        last = a.gimbals


def test_a_straight_body_is_refused_with_the_number():
    robot = snake(4, offset=0.037)
    c = controller_of(robot)
    frame = cog_frame(c, np.zeros(len(robot[0].parent) - 1))
    with pytest.raises(ControlRefused, match="σ_min"):
        fully_actuated.allocate(c, frame, frame.hover_wrench)
    assert switch.check_mode(c, DUAL, np.zeros(len(robot[0].parent) - 1)).allowed
    assert not switch.check_mode(c, VIRTUAL, np.zeros(len(robot[0].parent) - 1)).allowed


@pytest.mark.parametrize("options", [{"drag": 0.0}, {"same_spin": True}])
def test_dual_rotor_mode_is_refused_without_yaw(options):
    robot = snake(4, **options)
    c = controller_of(robot)
    with pytest.raises(ControlRefused, match="dual-rotor"):
        switch.require_mode(c, DUAL, np.zeros(len(robot[0].parent) - 1))


@pytest.mark.parametrize("seed", range(3))
def test_dual_rotor_thrusts_are_the_weighted_pseudo_inverse(seed):
    rng = np.random.default_rng(seed)
    robot = snake(4, offset=0.037)
    rotors = robot[1]
    c, angles = controller_of(robot), bent(robot, rng, 1.0)
    frame = cog_frame(c, angles)
    force = np.array([4.0, -3.0, frame.mass * G])
    turns = underactuated.gimbals_for(c, frame, force, np.eye(3))
    wrench = random_wrench(rng, frame, robot)
    a = underactuated.allocate(c, frame, wrench, turns)
    q = np.stack([true_wrench(robot, frame, angles, turns, e) for e in np.eye(8)], 1)[2:]
    d = np.diag(rotors.thrust_max)
    np.testing.assert_allclose(a.thrust, d @ np.linalg.pinv(q @ d) @ wrench[2:], atol=1e-9)


def test_horizontal_law_follows_the_mended_equations():
    rng = np.random.default_rng(5)
    robot = snake(2, offset=0.05)
    gains = Gains(attitude_roll=0.8, attitude_pitch=0.3, vectoring_roll=[1, 0.5],
                  vectoring_pitch=[0.4, 0.7], tilt_limit=1.0)  # fmt: skip
    c, angles, yaw = controller_of(robot, gains), bent(robot, rng, 0.8), 2.1
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    frame = cog_frame(c, angles, turn)
    weight = frame.mass * G
    fx, fy = 5.0, -7.0
    roll = 0.8 * (fx * np.sin(yaw) - fy * np.cos(yaw)) / weight
    pitch = 0.3 * (fx * np.cos(yaw) + fy * np.sin(yaw)) / weight
    expected = turn @ rotation_about(Y, pitch) @ rotation_about(X, roll)
    wanted = underactuated.attitude_for(c, frame, [fx, fy, weight], turn)
    np.testing.assert_allclose(wanted, expected, atol=1e-12)

    turns = underactuated.gimbals_for(c, frame, [fx, fy, weight], turn)
    level = turn.T @ [fx, fy, 0.0]
    full = with_gimbals(robot, angles, turns)
    rotation, _ = chain.forward(robot[0], turn, np.zeros(3), full)
    for j, (k_roll, k_pitch) in enumerate(((1, 0.4), (0.5, 0.7))):
        n = np.array([k_pitch * level[0], k_roll * level[1], weight])
        u = turn.T @ rotation[robot[2].thrust_body[j]] @ Z
        np.testing.assert_allclose(u, n / np.linalg.norm(n), atol=1e-9)


def test_gimbals_that_cannot_be_turned_are_refused():
    tree, rotors, gimbals = snake(2)[:3]
    tilted = rotors._replace(axis=np.where(rotors.apparatus[:, None] == 1, Y, rotors.axis))
    with pytest.raises(ControlRefused, match="parallel"):
        check_mounts(tree, tilted, gimbals)
    with pytest.raises(ControlRefused, match="between its gimbal joints"):
        check_mounts(tree, rotors, gimbals._replace(roll_body=gimbals.roll_body[::-1]))


def foreign_robot():
    """Six apparatuses of a foreign make: pitch before roll, skewed axes, some with one gimbal."""
    rng, length = np.random.default_rng(4), 0.42
    robot = FlatRobot(2.0, (length / 2, 0, 0), 2.0 * np.diag([0.001, 0.0165, 0.0165]))
    body, joints, gimbals = 0, [], []
    for j in range(6):
        if j > 0:
            pitch = robot.add(body, (length, 0, 0), Y)
            body = robot.add(pitch, np.zeros(3), Z, 2.0, (length / 2, 0, 0), 0.03 * np.eye(3))
            joints.append((pitch - 1, body - 1))
        turn = rotation_about(Z, 0.2 * j)
        first = robot.add(body, (length / 2, 0, 0), Y, rotation=turn)
        roll, last, axis = -1, first, Z
        if j < 4:
            skewed = np.array([1.0, 0.0, 0.15]) / np.hypot(1.0, 0.15)
            roll = last = robot.add(first, (0.01, 0, 0.04), skewed, rotation=rotation_about(X, 0.3))
            axis = rotation_about(X, -0.3) @ Z
        point = rng.normal(size=3) * 0.02
        robot.rotors.append((last, point, axis, 0.01 * (-1.0) ** j, 0.0, 40.0, j))
        robot.gimbals.append((body, np.eye(3), roll, first, last, point, axis, 40.0))
        gimbals.append((roll - 1, first - 1))
    return *robot.freeze(), np.array(joints), np.array(gimbals)


@pytest.mark.parametrize("seed", range(3))
def test_foreign_gimbals_are_served(seed):
    """Single rotors drag, gimbals stand in another order, two apparatuses have one gimbal."""
    robot = foreign_robot()
    check_mounts(*robot[:3])
    rng = np.random.default_rng(seed)
    c = controller_of(robot, sweeps=8, newton=20)
    angles = bent(robot, rng, 0.8)
    frame = cog_frame(c, angles)
    wrench = random_wrench(rng, frame, robot)
    a = fully_actuated.allocate(c, frame, wrench)
    assert a.residual <= 1e-6 and np.all(a.gimbals[4:, 0] == 0.0)
    full = angles.copy()
    for j, (roll, pitch) in enumerate(robot[4]):
        full[pitch] = a.gimbals[j, 1]
        if roll >= 0:
            full[roll] = a.gimbals[j, 0]
    poses = chain.forward(robot[0], np.eye(3), np.zeros(3), full)
    points, directions = wrench_map.rotor_frames(robot[1], *poses, frame.cog, frame.axes)
    given = wrench_map.dual_map(robot[1], points, directions) @ a.thrust
    np.testing.assert_allclose(given, wrench, atol=1e-5)
