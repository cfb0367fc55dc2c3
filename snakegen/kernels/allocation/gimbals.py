"""Gimbals seen from the CoG frame: where a thrust points, and which angles point it somewhere.

Serves any two gimbal axes in any order (ZN23's roll and pitch, eqs 38-39, are the case w1 = x,
w2 = y, u = z), one axis, or none. The geometry of an apparatus is ten rows of three numbers, made
anew each tick (one array, because passing tuples of arrays costs more than the arithmetic):
rows 0-2 the frame A, then o, w1, w2, t, f, u, and [drag ratio, joint 1 is the pitch joint, 0].
Joint 1 is the one nearer to the link. Thrust direction and point are
``A exp(w1 x1) exp(w2 x2) u`` and ``o + A exp(w1 x1) (t + exp(w2 x2) f)``; absent axes are zero.
"""

from math import atan2, pi, sqrt

import numpy as np

from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.mat3 import (
    cross_into,
    dot,
    matmul_into,
    rotation_into,
    turn_back_into,
    turn_into,
)
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.stack_arrays import scratch
from snakegen.kernels.core.types import Floats, Gimbals, Rotors, Tree

ORIGIN, FIRST, SECOND, LEVER, POINT, AXIS, EXTRA = 3, 4, 5, 6, 7, 8, 9


@jit
def mounts(
    tree: Tree,
    rotors: Rotors,
    gimbals: Gimbals,
    rotation: Floats,
    position: Floats,
    cog: Floats,
    axes: Floats,
) -> tuple[Floats, Floats]:
    """Returns the gimbals' geometry in the CoG frame, free of the gimbal angles.

    Args:
        tree, rotors, gimbals: the robot.
        rotation: (n, 3, 3) world attitudes of the bodies.
        position: (n, 3) m, world origins of the bodies.
        cog: (3,) m, world; held fixed while the gimbals turn.
        axes: (3, 3) attitude of the CoG frame in the world.

    Returns:
        mounts (Ñ, 10, 3), and per rotor (n_rotors, 3, 3): its point, its axis (both like f, u),
        and [torque ratio, apparatus, 0].
    """
    m, rows = np.empty((gimbals.limit.shape[0], 10, 3)), np.empty((rotors.body.shape[0], 3, 3))
    mounts_into(tree, rotors, gimbals, rotation, position, cog, axes, m, rows)
    return m, rows


@bare
def mounts_into(
    tree: Tree,
    rotors: Rotors,
    gimbals: Gimbals,
    rotation: Floats,
    position: Floats,
    cog: Floats,
    axes: Floats,
    m: Floats,
    rows: Floats,
) -> None:
    """Writes the geometry (Ñ, 10, 3) and the rotors' rows (n_rotors, 3, 3): `mounts`."""
    n = gimbals.link_body.shape[0]
    turn, world, arm = scratch((n, 3, 3)), scratch((3, 3)), scratch(3)
    for j in range(n):
        for k in range(10):
            for i in range(3):
                m[j, k, i] = 0.0
        roll, pitch = gimbals.roll_body[j], gimbals.pitch_body[j]
        near, far = min(roll, pitch), max(roll, pitch)
        m[j, EXTRA, 1] = 1.0 if pitch < roll else 0.0
        body = near
        if near >= 0:
            matmul_into(rotation[tree.parent[near]], tree.rotation[near], world)
            for k in range(3):
                m[j, FIRST, k] = tree.axis[near, k]
        else:
            body = tree.parent[far] if far >= 0 else gimbals.thrust_body[j]
            for k in range(3):
                for i in range(3):
                    world[k, i] = rotation[body, k, i]
        for k in range(3):
            arm[k] = position[body, k] - cog[k]
            for i in range(3):
                turn[j, k, i] = tree.rotation[far, k, i] if far >= 0 else (1.0 if k == i else 0.0)
        turn_back_into(axes, arm, m[j, ORIGIN])
        for k in range(3):
            for i in range(3):
                for a in range(3):
                    m[j, k, i] += axes[a, k] * world[a, i]
        if far >= 0:
            for k in range(3):
                m[j, LEVER, k] = tree.translation[far, k]
            turn_into(turn[j], tree.axis[far], m[j, SECOND])
        turn_into(turn[j], gimbals.thrust_point[j], m[j, POINT])
        turn_into(turn[j], gimbals.thrust_axis[j], m[j, AXIS])
    rotor_rows(rotors, turn, m, rows)


@bare
def rotor_rows(rotors: Rotors, turn: Floats, m: Floats, rows: Floats) -> None:
    """Writes the rotors' rows of `mounts`, and their mean torque ratio into `m`."""
    count = rotors.body.shape[0]
    share = scratch(m.shape[0])
    for j in range(m.shape[0]):
        share[j] = 0.0
    for r in range(count):
        share[rotors.apparatus[r]] += 1.0
    for r in range(count):
        j = rotors.apparatus[r]
        turn_into(turn[j], rotors.position[r], rows[r, 0])
        turn_into(turn[j], rotors.axis[r], rows[r, 1])
        rows[r, 2, 0], rows[r, 2, 1], rows[r, 2, 2] = rotors.torque_ratio[r], j, 0.0
        m[j, EXTRA, 0] += rotors.torque_ratio[r] / share[j]


@bare
def turned_into(
    m: Floats, j: int, x1: float, x2: float, once: Floats, twice: Floats, elbow: Floats
) -> None:
    """Writes, in CoG axes, ``A exp(w1 x1)``, ``A exp(w1 x1) exp(w2 x2)``, and joint 2's origin."""
    step = scratch((3, 3))
    rotation_into(m[j, FIRST], x1, step)
    matmul_into(m[j], step, once)
    rotation_into(m[j, SECOND], x2, step)
    matmul_into(once, step, twice)
    turn_into(once, m[j, LEVER], elbow)
    for k in range(3):
        elbow[k] += m[j, ORIGIN, k]


@bare
def thrust_line(m: Floats, j: int, x: Floats, u: Floats, p: Floats) -> None:
    """Writes the thrust direction u (3,) and point p (3,) [m] of apparatus j at angles x (2,)."""
    once, twice, elbow = scratch((3, 3)), scratch((3, 3)), scratch(3)
    turned_into(m, j, x[0], x[1], once, twice, elbow)
    turn_into(twice, m[j, AXIS], u)
    turn_into(twice, m[j, POINT], p)
    for k in range(3):
        p[k] += elbow[k]


@bare
def swing_into(
    m: Floats,
    j: int,
    kind: int,
    turned: tuple[Floats, Floats],
    u: Floats,
    p: Floats,
    axis: Floats,
    arm: Floats,
    du: Floats,
    dp: Floats,
) -> None:
    """Writes what a turn of joint `kind` (0, 1) of apparatus j does: ``∂u/∂x`` and ``∂p/∂x``.

    Args:
        turned: once (3, 3) and elbow (3,) of `turned_into`.
        u, p: (3,) thrust direction and a point [m], CoG axes.
        axis, arm: (3,) the joint's axis, and the point [m] from its origin.
        du, dp: (3,) per rad, ``axis × u`` and ``axis × arm``.
    """
    once, elbow = turned
    turn_into(once, m[j, FIRST + kind], axis)
    for k in range(3):
        arm[k] = p[k] - (m[j, ORIGIN, k] if kind == 0 else elbow[k])
    cross_into(axis, u, du)
    cross_into(axis, arm, dp)


@bare
def angle_about(w: Floats, a: Floats, b: Floats) -> float:
    """Returns the angle [rad] about unit w that turns a's part across w onto b's."""
    swept = scratch(3)
    cross_into(a, b, swept)
    return atan2(dot(w, swept), dot(a, b) - dot(w, a) * dot(w, b))


@bare
def nearest_turn(x: float, last: float, lower: float, upper: float) -> float:
    """Returns the angle equal to x modulo 2π nearest to `last` within limits, else the nearest."""
    x += 2.0 * pi * round((last - x) / (2.0 * pi))
    if x > upper and x - 2.0 * pi >= lower:
        return x - 2.0 * pi
    if x < lower and x + 2.0 * pi <= upper:
        return x + 2.0 * pi
    return min(max(x, lower), upper)


@bare
def point_thrust(
    m: Floats, j: int, direction: Floats, last: Floats, lower: Floats, upper: Floats, out: Floats
) -> None:
    """Writes the angles (x1, x2) that turn apparatus j's thrust along `direction`.

    Of the two solutions and their whole turns, the one within limits nearest to `last`. Where
    joint 1 has no effect (thrust along its own axis: ZN23's θ = ±90°) it keeps its last angle.
    An axis that is absent, or a limit, leaves the nearest direction that the rest can reach.

    Args:
        m: (Ñ, 10, 3) from `mounts`.
        j: the apparatus.
        direction: (3,) unit, CoG axes.
        last: (2,) rad, angles of joints 1 and 2 to stay near.
        lower, upper: (2,) rad, limits of joints 1 and 2.
        out: (2,) rad.
    """
    q, middle, twist, reached = scratch(3), scratch(3), scratch(3), scratch(3)
    once, twice, elbow = scratch((3, 3)), scratch((3, 3)), scratch(3)
    turn_back_into(m[j], direction, q)
    w1, w2, p = m[j, FIRST], m[j, SECOND], m[j, AXIS]
    out[0], out[1] = last[0], last[1]
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
        distance = (x1 - last[0]) ** 2 + (x2 - last[1]) ** 2
        inside = lower[0] < x1 < upper[0] and lower[1] < x2 < upper[1]
        if rest < 0.0 or lost or not inside:  # else the direction is met
            turned_into(m, j, x1, x2, once, twice, elbow)
            turn_into(twice, p, reached)
            distance += 1e4 * (1.0 - dot(reached, direction))
        if distance < best:
            best = distance
            out[0], out[1] = x1, x2


@bare
def joint_order_into(m: Floats, angles: Floats, out: Floats) -> None:
    """Writes (Ñ, 2) angles reordered between [roll, pitch] and [joint 1, joint 2]."""
    for j in range(angles.shape[0]):
        first = 1 if m[j, EXTRA, 1] > 0.5 else 0
        out[j, 0], out[j, 1] = angles[j, first], angles[j, 1 - first]


@jit
def joint_order(m: Floats, angles: Floats) -> Floats:
    """Returns (Ñ, 2) angles reordered between [roll, pitch] and [joint 1, joint 2]."""
    out = np.empty(angles.shape)
    joint_order_into(m, angles, out)
    return out
