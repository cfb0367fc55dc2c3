"""Allocation kernels against plain NumPy, finite differences, and THEORY A3's table of ranks."""

import numpy as np
import pytest
from flat_robots import FlatRobot, random_inertia, random_rotation, snake

from snakegen.kernels.allocation import wrench_map
from snakegen.kernels.kinematics import chain

LENGTH, MASS, LIMIT, G = 0.42, 2.0, 32.0, 9.81


def gripped_robot(rng):
    """Gimbals with odd axes, single and double rotors, and one apparatus without a roll joint."""
    robot = FlatRobot(1.3, rng.normal(size=3) * 0.1, random_inertia(rng))
    link = robot.add(0, (0.4, 0, 0.1), (0, 0, 1.0), 0.9, (0.2, 0, 0), random_inertia(rng))
    unit = lambda v: v / np.linalg.norm(v)  # noqa: E731
    for j, body in enumerate((0, link, link)):
        turn = random_rotation(rng)
        carrier, roll = body, -1
        if j != 1:
            carrier = roll = robot.add(
                body, rng.normal(size=3) * 0.2, unit(rng.normal(size=3)), rotation=turn
            )
        pitch = robot.add(carrier, rng.normal(size=3) * 0.2, unit(rng.normal(size=3)), 0.3)
        points = rng.normal(size=(2 if j < 2 else 1, 3)) * 0.1
        axis = unit(rng.normal(size=3))
        for k, point in enumerate(points):
            robot.rotors.append((pitch, point, axis, 0.02 * (-1) ** k, 0.0, 20.0, j))
        robot.gimbals.append(
            (body, turn, roll, pitch, pitch, points.mean(0), axis, 20.0 * len(points))
        )
    return robot.freeze()


def random_posture(rng, tree):
    angles = rng.uniform(-1.5, 1.5, len(tree.parent) - 1)
    return random_rotation(rng), rng.normal(size=3), angles


def maps(robot, posture, thrust, axes_body=0):
    tree, rotors, gimbals = robot[:3]
    rotation, position = chain.forward(tree, *posture)
    return wrench_map.wrench_maps(
        tree, rotors, gimbals, rotation, position, rotation[axes_body].copy(), thrust
    )


def wrench_about(robot, posture, thrusts, cog, axes):
    """Plain sum of rotor forces and drags about a given CoG, in given axes."""
    tree, rotors, _ = robot[:3]
    rotation, position = chain.forward(tree, *posture)
    total = np.zeros(6)
    for r, body in enumerate(rotors.body):
        u = rotation[body] @ rotors.axis[r]
        p = position[body] + rotation[body] @ rotors.position[r] - cog
        total[:3] += axes.T @ u * thrusts[r]
        total[3:] += axes.T @ (np.cross(p, u) + rotors.torque_ratio[r] * u) * thrusts[r]
    return total


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("axes_body", [0, 1])
def test_every_map_gives_the_sum_of_the_rotors(seed, axes_body):
    rng = np.random.default_rng(seed)
    robot = gripped_robot(rng)
    tree, rotors, gimbals = robot
    posture = random_posture(rng, tree)
    rotation, position = chain.forward(tree, *posture)
    _, cog, _ = chain.mass_properties(tree, rotation, position)
    axes = rotation[axes_body]
    lam = rng.uniform(3, 9, 3)
    points, directions, dual, virtual, force, _ = maps(robot, posture, lam, axes_body)

    thrusts = rng.uniform(1, 9, len(rotors.body))
    np.testing.assert_allclose(
        dual @ thrusts, wrench_about(robot, posture, thrusts, cog, axes), atol=1e-11
    )
    counts = np.bincount(rotors.apparatus)
    shared = (lam / counts)[rotors.apparatus]
    expected = wrench_about(robot, posture, shared, cog, axes)
    np.testing.assert_allclose(virtual @ lam, expected, atol=1e-11)
    pushes = [
        (rotation[g] @ gimbals.link_rotation[j]).T
        @ rotation[gimbals.thrust_body[j]]
        @ gimbals.thrust_axis[j]
        * lam[j]
        for j, g in enumerate(gimbals.link_body)
    ]
    np.testing.assert_allclose(force @ np.concatenate(pushes), expected, atol=1e-11)
    for r, body in enumerate(rotors.body):
        world = position[body] + rotation[body] @ rotors.position[r]
        np.testing.assert_allclose(points[r], axes.T @ (world - cog), atol=1e-12)
        np.testing.assert_allclose(
            directions[r], axes.T @ rotation[body] @ rotors.axis[r], atol=1e-12
        )


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("axes_body", [0, 1])
def test_jacobian_is_the_derivative_with_the_cog_held(seed, axes_body):
    rng = np.random.default_rng(50 + seed)
    robot = gripped_robot(rng)
    tree, rotors, gimbals = robot
    base_r, base_p, angles = random_posture(rng, tree)
    rotation, position = chain.forward(tree, base_r, base_p, angles)
    _, cog, _ = chain.mass_properties(tree, rotation, position)
    lam, counts = rng.uniform(3, 9, 3), np.bincount(rotors.apparatus)
    jacobian = maps(robot, (base_r, base_p, angles), lam, axes_body)[5]

    def wrench(x):
        moved = angles.copy()
        for j in range(3):
            for body, value in (
                (gimbals.roll_body[j], x[3 + j]),
                (gimbals.pitch_body[j], x[6 + j]),
            ):
                if body > 0:
                    moved[body - 1] += value
        shared = ((lam + x[:3]) / counts)[rotors.apparatus]
        posture = (base_r, base_p, moved)
        return wrench_about(robot, posture, shared, cog, rotation[axes_body])

    h = 1e-5
    numeric = [(wrench(h * e) - wrench(-h * e)) / (2 * h) for e in np.eye(9)]
    np.testing.assert_allclose(jacobian, np.array(numeric).T, atol=1e-8)
    assert np.all(jacobian[:, 4] == 0), "an absent roll joint has no column"


def table_posture(links, shape):
    """Joint angles of THEORY A3: straight, planar (yaw 60°) or spatial."""
    bends = np.zeros((links - 1, 2))
    if shape == "planar":
        bends[:, 1] = np.pi / 3
    elif shape == "spatial":
        bends[:, 0] = 0.6 * (-1.0) ** np.arange(links - 1)
        bends[:, 1] = 0.8
    return bends


def upright(robot, bends):
    """Full angles with every apparatus' thrust vertical, root level."""
    tree, _, gimbals, joints, turns = robot
    angles = np.zeros(len(tree.parent) - 1)
    if len(joints):
        angles[joints[:, 0]], angles[joints[:, 1]] = bends.T
    rotation, _ = chain.forward(tree, np.eye(3), np.zeros(3), angles)
    for j, link in enumerate(gimbals.link_body):
        x, y, z = rotation[link].T @ [0, 0, 1]
        roll = np.arctan2(-y, z)
        angles[turns[j]] = roll, np.arctan2(x, -y * np.sin(roll) + z * np.cos(roll))
    return angles


def rank(matrix, column_scale, mass):
    weight = mass * G
    rows = np.r_[np.full(3, 1 / weight), np.full(3, 1 / (weight * LENGTH))]
    s = np.linalg.svd(rows[:, None] * matrix * column_scale, compute_uv=False)
    return int(np.sum(s > 1e-6 * s[0]))


# apparatuses, posture: Q_dual (alternating, same spin, no drag), Q_force, J_w (o = 0, 37 mm)
TABLE = [
    (1, "straight", (2, 2, 2), 3, (3, 3)),
    (2, "straight", (4, 3, 3), 5, (5, 5)),
    (2, "planar", (4, 3, 3), 5, (5, 6)),
    (2, "spatial", (4, 4, 3), 5, (5, 6)),
    (3, "straight", (4, 3, 3), 5, (5, 5)),
    (3, "planar", (4, 4, 3), 6, (6, 6)),
    (3, "spatial", (4, 4, 3), 6, (6, 6)),
    (4, "straight", (4, 3, 3), 5, (5, 5)),
    (4, "planar", (4, 4, 3), 6, (6, 6)),
    (4, "spatial", (4, 4, 3), 6, (6, 6)),
    (5, "straight", (4, 3, 3), 5, (5, 5)),
    (5, "planar", (4, 4, 3), 6, (6, 6)),
    (5, "spatial", (4, 4, 3), 6, (6, 6)),
]


@pytest.mark.parametrize("links, shape, dual, force, jacobian", TABLE)
def test_table_of_ranks(links, shape, dual, force, jacobian):
    bends, mass = table_posture(links, shape), links * MASS
    thrust = np.full(links, mass * G / links)
    full_scale = np.r_[np.full(links, 2 * LIMIT), np.ones(2 * links)]

    def built(**options):
        robot = snake(links, **options)
        posture = (np.eye(3), np.zeros(3), upright(robot, bends))
        return maps(robot, posture, thrust)

    for expected, options in zip(dual, ({}, {"same_spin": True}, {"drag": 0.0}), strict=True):
        assert rank(built(**options)[2], LIMIT, mass) == expected, options
    for expected, offset in zip(jacobian, (0.0, 0.037), strict=True):
        result = built(offset=offset)
        assert rank(result[4], 2 * LIMIT, mass) == force
        assert rank(result[5], full_scale, mass) == expected, offset


def test_vertical_straight_robot_loses_three_motions():
    """All gimbal pitches at -90°: equal rolls give rank 3, 4 with an offset (THEORY A3)."""
    down = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    for offset, expected in ((0.0, 3), (0.037, 4)):
        robot = snake(4, offset=offset)
        angles = np.zeros(len(robot[0].parent) - 1)
        angles[robot[4][:, 1]] = -np.pi / 2
        thrust = np.full(4, 8 * G / 4)
        jacobian = maps(robot, (down, np.zeros(3), angles), thrust)[5]
        assert rank(jacobian, np.r_[np.full(4, 64.0), np.ones(8)], 8.0) == expected


@pytest.mark.parametrize("links, expected", [(2, 3), (3, 4), (4, 5)])
def test_vertical_straight_robot_with_alternating_rolls(links, expected):
    robot = snake(links)
    angles = np.zeros(len(robot[0].parent) - 1)
    angles[robot[4][:, 1]] = -np.pi / 2
    angles[robot[4][:, 0]] = np.pi / 2 * (np.arange(links) % 2)
    down = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    jacobian = maps(robot, (down, np.zeros(3), angles), np.full(links, 2 * G))[5]
    scale = np.r_[np.full(links, 64.0), np.ones(2 * links)]
    assert rank(jacobian, scale, 2.0 * links) == expected
