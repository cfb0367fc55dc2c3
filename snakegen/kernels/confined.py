"""Vectored allocation within thrust and gimbal limits: balls, cut by the faces of the gimbals.

A gimbal at a limit confines its apparatus' force: to the plane that the other joint sweeps, or to
a line when both are at limits. Rounds of bounded allocation and aiming repeat until the angles
rest; each round also moves the thrust points (THEORY A4, A7).
"""

import numpy as np

from snakegen.kernels.bounded import ball_allocation
from snakegen.kernels.control_types import Mounts
from snakegen.kernels.fully_actuated import aim_forces, confinement, point_map, thrust_points
from snakegen.kernels.jit import jit
from snakegen.kernels.linear import cross_into, dot, turn_into
from snakegen.kernels.tree import Floats
from snakegen.kernels.vectoring import turned


@jit
def across(normal: Floats) -> Floats:
    """Returns the projector (3, 3) onto the plane across `normal`."""
    return np.eye(3) - np.outer(normal, normal) / dot(normal, normal)


@jit
def confine_at_limits(
    m: Mounts, angles: Floats, lower: Floats, upper: Floats, missed: Floats, allowed: Floats
) -> None:
    """Narrows `allowed` (Ñ, 3, 3) for apparatuses that `missed` their direction by a limit."""
    u, axis, swept = np.empty(3), np.empty(3), np.empty(3)
    for j in range(angles.shape[0]):
        if missed[j] < 1e-9:
            continue
        one = angles[j, 0] <= lower[j, 0] or angles[j, 0] >= upper[j, 0]
        two = angles[j, 1] <= lower[j, 1] or angles[j, 1] >= upper[j, 1]
        once, twice, _ = turned(m, j, angles[j, 0], angles[j, 1])
        turn_into(twice, m.axis[j], u)
        if one and two:
            allowed[j] = np.outer(u, u)
        elif one:
            turn_into(once, m.second[j], axis)
            allowed[j] = across(axis)
        elif two:
            turn_into(once, m.first[j], axis)
            cross_into(axis, u, swept)
            cross_into(u, swept, axis)
            if dot(axis, axis) > 1e-12:
                allowed[j] = across(axis)


@jit
def bounded_forces(
    m: Mounts,
    wrench: Floats,
    rows: Floats,
    limit: Floats,
    lower: Floats,
    upper: Floats,
    last: Floats,
    rounds: int,
) -> tuple[Floats, Floats]:
    """Returns thrust (Ñ,) in [0, limit] and angles (Ñ, 2) within limits, nearest to `wrench`.

    Args:
        m: the mounts.
        wrench: (6,) wanted, CoG axes.
        rows: (6,) scale of the wrench's rows; it decides what is given up when out of reach.
        limit: (Ñ,) N.
        lower, upper: (Ñ, 2) rad, joint order.
        last: (Ñ, 2) rad, joint order.
        rounds: most rounds.
    """
    n = limit.shape[0]
    angles, thrust, missed, u = last.copy(), np.zeros(n), np.zeros(n), np.empty(3)
    allowed = confinement(m, angles)
    for _ in range(rounds):
        q = point_map(thrust_points(m, angles), m.drag, allowed)
        forces = ball_allocation(q, wrench, rows, limit)
        before = angles.copy()
        aim_forces(m, forces, lower, upper, thrust, angles)
        for j in range(n):
            _, twice, _ = turned(m, j, angles[j, 0], angles[j, 1])
            turn_into(twice, m.axis[j], u)
            along = dot(u, forces[3 * j : 3 * j + 3])
            missed[j] = 1.0 - along / thrust[j] if thrust[j] > 1e-9 else 0.0
            thrust[j] = max(along, 0.0)
        confine_at_limits(m, angles, lower, upper, missed, allowed)
        if np.max(np.abs(angles - before)) < 1e-9 and np.max(missed) < 1e-9:
            break
    return thrust, angles
