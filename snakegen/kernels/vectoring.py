"""Gimbals seen from the CoG frame: where a thrust points, and which angles point it somewhere.

Serves any two gimbal axes in any order (ZN23's roll and pitch, eqs 38-39, are the case w1 = x,
w2 = y, u = z), one axis, or none.
"""

from math import atan2, pi, sqrt

import numpy as np

from snakegen.kernels.control_types import Mounts
from snakegen.kernels.jit import jit
from snakegen.kernels.linear import (
    cross_into,
    dot,
    matmul_into,
    rotation_into,
    turn_back_into,
    turn_into,
)
from snakegen.kernels.tree import Floats, Gimbals, Rotors, Tree
from snakegen.kernels.wrench_map import mean_drag


@jit
def mounts(
    tree: Tree,
    rotors: Rotors,
    gimbals: Gimbals,
    rotation: Floats,
    position: Floats,
    cog: Floats,
    axes: Floats,
) -> Mounts:
    """Returns the gimbals' geometry in the CoG frame, free of the gimbal angles.

    Args:
        tree, rotors, gimbals: the robot.
        rotation: (n, 3, 3) world attitudes of the bodies.
        position: (n, 3) m, world origins of the bodies.
        cog: (3,) m, world; held fixed while the gimbals turn.
        axes: (3, 3) attitude of the CoG frame in the world.
    """
    n, count = gimbals.link_body.shape[0], rotors.body.shape[0]
    frame, turn = np.empty((n, 3, 3)), np.zeros((n, 3, 3))
    origin, first, second = np.empty((n, 3)), np.zeros((n, 3)), np.zeros((n, 3))
    lever, point, axis = np.zeros((n, 3)), np.empty((n, 3)), np.empty((n, 3))
    swapped = np.zeros(n, np.int64)
    world, arm = np.empty((3, 3)), np.empty(3)
    for j in range(n):
        roll, pitch = gimbals.roll_body[j], gimbals.pitch_body[j]
        near, far = min(roll, pitch), max(roll, pitch)
        swapped[j] = int(pitch < roll)
        if near >= 0:
            matmul_into(rotation[tree.parent[near]], tree.rotation[near], world)
            arm[:] = position[near] - cog
            first[j] = tree.axis[near]
        else:
            carrier = tree.parent[far] if far >= 0 else gimbals.thrust_body[j]
            world[:] = rotation[carrier]
            arm[:] = position[carrier] - cog
        matmul_into(axes.T, world, frame[j])
        turn_back_into(axes, arm, origin[j])
        if far >= 0:
            turn[j] = tree.rotation[far]
            lever[j] = tree.translation[far]
            turn_into(turn[j], tree.axis[far], second[j])
        else:
            turn[j] = np.eye(3)
        turn_into(turn[j], gimbals.thrust_point[j], point[j])
        turn_into(turn[j], gimbals.thrust_axis[j], axis[j])
    rotor_point, rotor_axis = np.empty((count, 3)), np.empty((count, 3))
    for r in range(count):
        j = rotors.apparatus[r]
        turn_into(turn[j], rotors.position[r], rotor_point[r])
        turn_into(turn[j], rotors.axis[r], rotor_axis[r])
    drag = mean_drag(rotors, n)
    return Mounts(
        frame, origin, first, second, lever, point, axis, rotor_point, rotor_axis, swapped, drag
    )


@jit
def turned(m: Mounts, j: int, x1: float, x2: float) -> tuple[Floats, Floats, Floats]:
    """Returns, in CoG axes, ``A exp(w1 x1)``, ``A exp(w1 x1) exp(w2 x2)`` and joint 2's origin."""
    step, once, twice = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    elbow = np.empty(3)
    rotation_into(m.first[j], x1, step)
    matmul_into(m.frame[j], step, once)
    rotation_into(m.second[j], x2, step)
    matmul_into(once, step, twice)
    turn_into(once, m.lever[j], elbow)
    for k in range(3):
        elbow[k] += m.origin[j, k]
    return once, twice, elbow


@jit
def thrust_point(m: Mounts, j: int, x1: float, x2: float, out: Floats) -> None:
    """Writes the point (3,) [m] where apparatus j pushes, from the CoG."""
    _, twice, elbow = turned(m, j, x1, x2)
    turn_into(twice, m.point[j], out)
    for k in range(3):
        out[k] += elbow[k]


@jit
def angle_about(w: Floats, a: Floats, b: Floats) -> float:
    """Returns the angle [rad] about unit w that turns a's part across w onto b's."""
    swept = np.empty(3)
    cross_into(a, b, swept)
    return atan2(dot(w, swept), dot(a, b) - dot(w, a) * dot(w, b))


@jit
def nearest_turn(x: float, last: float, lower: float, upper: float) -> float:
    """Returns the angle equal to x modulo 2π nearest to `last` within limits, else the nearest."""
    x += 2.0 * pi * round((last - x) / (2.0 * pi))
    if x > upper and x - 2.0 * pi >= lower:
        return x - 2.0 * pi
    if x < lower and x + 2.0 * pi <= upper:
        return x + 2.0 * pi
    return min(max(x, lower), upper)


@jit
def point_thrust(
    m: Mounts, j: int, direction: Floats, last: Floats, lower: Floats, upper: Floats, out: Floats
) -> None:
    """Writes the angles (x1, x2) that turn apparatus j's thrust along `direction`.

    Of the two solutions and their whole turns, the one within limits nearest to `last`. Where
    joint 1 has no effect (thrust along its own axis: ZN23's θ = ±90°) it keeps its last angle.
    An axis that is absent, or a limit, leaves the nearest direction that the rest can reach.

    Args:
        m: the mounts.
        j: the apparatus.
        direction: (3,) unit, CoG axes.
        last: (2,) rad, angles of joints 1 and 2 to stay near.
        lower, upper: (2,) rad, limits of joints 1 and 2.
        out: (2,) rad.
    """
    q, middle, twist = np.empty(3), np.empty(3), np.empty(3)
    turn_back_into(m.frame[j], direction, q)
    w1, w2, p = m.first[j], m.second[j], m.axis[j]
    out[:] = last
    if dot(w2, w2) < 0.5 and dot(w1, w1) < 0.5:
        return
    if dot(w1, w1) < 0.5:
        out[1] = nearest_turn(angle_about(w2, p, q), last[1], lower[1], upper[1])
        return
    if dot(w2, w2) < 0.5:
        out[0] = nearest_turn(angle_about(w1, p, q), last[0], lower[0], upper[0])
        return
    skewed, along1, along2 = dot(w1, w2), dot(w1, q), dot(w2, p)
    cross_into(w1, w2, twist)
    bulk = dot(twist, twist)
    a = (along1 - skewed * along2) / bulk
    b = (along2 - skewed * along1) / bulk
    rest = 1.0 - a * a - b * b - 2.0 * a * b * skewed
    height = sqrt(max(rest, 0.0) / bulk)
    lost = 1.0 - along1 * along1 < 1e-12
    best = np.inf
    for sign in (1.0, -1.0):
        for k in range(3):
            middle[k] = a * w1[k] + b * w2[k] + sign * height * twist[k]
        x1 = last[0]
        if not lost:
            x1 = nearest_turn(angle_about(w1, middle, q), last[0], lower[0], upper[0])
        x2 = nearest_turn(angle_about(w2, p, middle), last[1], lower[1], upper[1])
        _, twice, _ = turned(m, j, x1, x2)
        turn_into(twice, p, q)
        missed = 1.0 - dot(q, direction)
        turn_back_into(m.frame[j], direction, q)
        distance = (x1 - last[0]) ** 2 + (x2 - last[1]) ** 2 + 1e4 * missed
        if distance < best:
            best = distance
            out[0], out[1] = x1, x2


@jit
def joint_order(m: Mounts, angles: Floats) -> Floats:
    """Returns (Ñ, 2) angles reordered between [roll, pitch] and [joint 1, joint 2]."""
    out = angles.copy()
    for j in range(angles.shape[0]):
        if m.swapped[j]:
            out[j, 0], out[j, 1] = angles[j, 1], angles[j, 0]
    return out
