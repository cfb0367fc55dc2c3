"""Vectored allocation within thrust and gimbal limits: balls, cut by the faces of the gimbals.

A gimbal at a limit confines its apparatus' force: to the plane that the other joint sweeps, or to
a line when both are at limits. Rounds of bounded allocation and aiming repeat until the angles
rest; each round also moves the thrust points (THEORY A4, A7).
"""

from math import sqrt

import numpy as np

from snakegen.kernels.balls import ball_allocation, near_allocation
from snakegen.kernels.fully_actuated import (
    across_into,
    aim_forces,
    along_into,
    confinement,
    point_map,
)
from snakegen.kernels.jit import jit
from snakegen.kernels.joint_loads import JointLoads
from snakegen.kernels.linear import cross_into, dot, turn_into
from snakegen.kernels.tree import Floats
from snakegen.kernels.vectoring import AXIS, FIRST, SECOND, thrust_line, turned_into

LEAST, NEAR, CALMLY = 0, 1, 2  # which of all the answers


@jit
def confine_at_limits(
    m: Floats, angles: Floats, lower: Floats, upper: Floats, missed: Floats, allowed: Floats
) -> None:
    """Narrows `allowed` (Ñ, 3, 3) for apparatuses that `missed` their direction by a limit."""
    u, axis, swept, elbow = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    once, twice = np.empty((3, 3)), np.empty((3, 3))
    for j in range(angles.shape[0]):
        if missed[j] < 1e-9:
            continue
        one = angles[j, 0] <= lower[j, 0] or angles[j, 0] >= upper[j, 0]
        two = angles[j, 1] <= lower[j, 1] or angles[j, 1] >= upper[j, 1]
        turned_into(m, j, angles[j, 0], angles[j, 1], once, twice, elbow)
        turn_into(twice, m[j, AXIS], u)
        if one and two:
            along_into(u, allowed[j])
        elif one:
            turn_into(once, m[j, SECOND], axis)
            across_into(axis, allowed[j])
        elif two:
            turn_into(once, m[j, FIRST], axis)
            cross_into(axis, u, swept)
            cross_into(u, swept, axis)
            size = sqrt(dot(axis, axis))
            if size > 1e-6:
                for k in range(3):
                    axis[k] /= size
                across_into(axis, allowed[j])


@jit
def confined_loads(loads: JointLoads, allowed: Floats) -> JointLoads:
    """Returns the joints' bounds on forces that `allowed` (Ñ, 3, 3) projects."""
    out = np.zeros_like(loads.rows)
    for i in range(out.shape[0]):
        for j in range(allowed.shape[0]):
            for c in range(3):
                for k in range(3):
                    out[i, 3 * j + c] += loads.rows[i, 3 * j + k] * allowed[j, k, c]
    return JointLoads(out, loads.bias, loads.limit)


@jit
def confined_forces(forces: Floats, allowed: Floats) -> Floats:
    """Returns forces (3Ñ,) projected by `allowed` (Ñ, 3, 3)."""
    out = np.zeros_like(forces)
    for j in range(allowed.shape[0]):
        for c in range(3):
            for k in range(3):
                out[3 * j + c] += allowed[j, c, k] * forces[3 * j + k]
    return out


@jit
def bounded_forces(
    m: Floats,
    wrench: Floats,
    rows: Floats,
    limit: Floats,
    lower: Floats,
    upper: Floats,
    last: Floats,
    rounds: int,
    loads: JointLoads,
    internal: Floats,
    near: int,
) -> tuple[Floats, Floats]:
    """Returns thrust (Ñ,) in [0, limit] and angles (Ñ, 2) within limits, nearest to `wrench`.

    Args:
        m: (Ñ, 10, 3) from `vectoring.mounts`.
        wrench: (6,) wanted, CoG axes.
        rows: (6,) scale of the wrench's rows; it decides what is given up when out of reach.
        limit: (Ñ,) N.
        lower, upper: (Ñ, 2) rad, joint order.
        last: (Ñ, 2) rad, joint order.
        rounds: most rounds.
        loads: bounds of the joints on forces in CoG axes.
        internal: (3Ñ,) N, CoG axes, forces against one another to keep, unless `near` is LEAST.
        near: LEAST for the least forces within the joints' bounds; NEAR, or CALMLY, for
            `near_allocation`, which knows no joints.
    """
    n = limit.shape[0]
    angles, thrust, missed = last.copy(), np.zeros(n), np.zeros(n)
    u, p = np.empty(3), np.empty(3)
    allowed = confinement(m, angles)
    for _ in range(rounds):
        q = point_map(m, angles, allowed)
        if near != LEAST:
            kept = confined_forces(internal, allowed)
            forces = near_allocation(q, wrench, rows, limit, kept, int(near == CALMLY))
        else:
            forces = ball_allocation(q, wrench, rows, limit, confined_loads(loads, allowed))
        before, moved = angles.copy(), 0.0
        aim_forces(m, forces, lower, upper, thrust, angles)
        for j in range(n):
            thrust_line(m, j, angles[j], u, p)
            along = dot(u, forces[3 * j : 3 * j + 3])
            missed[j] = 1.0 - along / thrust[j] if thrust[j] > 1e-9 else 0.0
            thrust[j] = max(along, 0.0)
            moved = max(moved, abs(angles[j, 0] - before[j, 0]), abs(angles[j, 1] - before[j, 1]))
            moved = max(moved, missed[j])
        confine_at_limits(m, angles, lower, upper, missed, allowed)
        if moved < 1e-9:
            break
    return thrust, angles
