"""Vectored allocation within thrust and gimbal limits: balls, cut by the faces of the gimbals.

A gimbal at a limit confines its apparatus' force: to the plane that the other joint sweeps, or to
a line when both are at limits. Rounds of bounded allocation and aiming repeat until the angles
rest; each round also moves the thrust points (THEORY A4, A7).
"""

from math import nan, sqrt

from snakegen.kernels.allocation.ball_allocation import ball_forces_into, near_forces_into
from snakegen.kernels.allocation.confinement import across_into, along_into, confinement_into
from snakegen.kernels.allocation.fully_actuated import aim_forces, forces_into, point_map_into
from snakegen.kernels.allocation.gimbals import (
    AXIS,
    FIRST,
    POINT,
    SECOND,
    swing_into,
    thrust_line,
    turned_into,
)
from snakegen.kernels.allocation.types import Limits, Previous, Task
from snakegen.kernels.core.mat3 import cross_into, dot, turn_into
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.stack_arrays import scratch
from snakegen.kernels.core.types import Floats
from snakegen.kernels.dynamics.joint_loads import JointLoads

LEAST, NEAR, CALMLY = 0, 1, 2  # which of all the answers
ROUNDS = 20  # of bounded allocation and aiming
AT_REST = 1e-4  # rad, of the last round: what it leaves of the wrench is of second order, 1e-8
LEAST_TURNED = 0.5  # N; what turns a lesser force moves its point for next to nothing
LEAST_SWEPT = 0.05  # of ‖∂u/∂x‖²; less is too near θ = ±90° for a derivative to show it


@bare
def confine_at_limits(
    m: Floats, angles: Floats, lower: Floats, upper: Floats, missed: Floats, allowed: Floats
) -> None:
    """Narrows `allowed` (Ñ, 3, 3) for apparatuses that `missed` their direction by a limit."""
    u, axis, swept, elbow = scratch(3), scratch(3), scratch(3), scratch(3)
    once, twice = scratch((3, 3)), scratch((3, 3))
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


@bare
def confined_loads_into(loads: JointLoads, allowed: Floats, out: Floats) -> None:
    """Writes the rows (k, 3Ñ) of the joints' bounds on forces that `allowed` (Ñ, 3, 3) projects."""
    for i in range(out.shape[0]):
        for j in range(allowed.shape[0]):
            for c in range(3):
                out[i, 3 * j + c] = 0.0
                for k in range(3):
                    out[i, 3 * j + c] += loads.rows[i, 3 * j + k] * allowed[j, k, c]


@bare
def confined_forces_into(forces: Floats, allowed: Floats, out: Floats) -> None:
    """Writes forces (3Ñ,) projected by `allowed` (Ñ, 3, 3)."""
    for j in range(allowed.shape[0]):
        for c in range(3):
            out[3 * j + c] = 0.0
            for k in range(3):
                out[3 * j + c] += allowed[j, c, k] * forces[3 * j + k]


@bare
def turning_map_into(m: Floats, angles: Floats, forces: Floats, allowed: Floats, q: Floats) -> None:
    """Writes the derivative (6, 3Ñ) of the wrench by forces whose gimbals follow them.

    ``dw = [df; p × df + c df + dp × f]`` with ``dp = Σ_k (∂p/∂x_k) dx_k`` and
    ``dx_k = (∂u/∂x_k · df) / (‖f‖ ‖∂u/∂x_k‖²)``: thrust points move as their gimbals turn (THEORY
    A7). Along f itself nothing turns, so the map times `forces` is their wrench.

    Args:
        m: (Ñ, 10, 3) from `vectoring.mounts`.
        angles: (Ñ, 2) rad, joint order, at which the gimbals aim.
        forces: (3Ñ,) N, CoG axes, along which they aim there; 0 where that is not known.
        allowed: (Ñ, 3, 3) projectors, see `confinement`.
        q: (6, 3Ñ)
    """
    u, p, axis, arm = scratch(3), scratch(3), scratch(3), scratch(3)
    du, dp, moment = scratch(3), scratch(3), scratch(3)
    once, twice, elbow = scratch((3, 3)), scratch((3, 3)), scratch(3)
    point_map_into(m, angles, allowed, q)
    for j in range(angles.shape[0]):
        force = forces[3 * j : 3 * j + 3]
        size = sqrt(dot(force, force))
        if size < LEAST_TURNED:
            continue
        turned_into(m, j, angles[j, 0], angles[j, 1], once, twice, elbow)
        turn_into(twice, m[j, AXIS], u)
        turn_into(twice, m[j, POINT], p)
        for k in range(3):
            p[k] += elbow[k]
        for kind in range(2):
            swing_into(m, j, kind, (once, elbow), u, p, axis, arm, du, dp)
            cross_into(dp, force, moment)
            bulk = size * max(dot(du, du), LEAST_SWEPT)
            for c in range(3):
                row = 0.0
                for k in range(3):
                    row += allowed[j, k, c] * du[k] / bulk
                for k in range(3):
                    q[3 + k, 3 * j + c] += moment[k] * row


@bare
def aimed(
    m: Floats,
    forces: Floats,
    lower: Floats,
    upper: Floats,
    thrust: Floats,
    angles: Floats,
    missed: Floats,
) -> float:
    """Turns angles (Ñ, 2) to forces (3Ñ,); returns how far [rad] the farthest went.

    Thrusts (Ñ,) are the forces' parts along the directions reached, and `missed` (Ñ,) what of
    their size is lost by it; counts as going too.
    """
    u, p, before, moved = scratch(3), scratch(3), scratch(angles.shape), 0.0
    for j in range(thrust.shape[0]):
        for k in range(2):
            before[j, k] = angles[j, k]
    aim_forces(m, forces, lower, upper, thrust, angles)
    for j in range(thrust.shape[0]):
        thrust_line(m, j, angles[j], u, p)
        along = dot(u, forces[3 * j : 3 * j + 3])
        missed[j] = 1.0 - along / thrust[j] if thrust[j] > 1e-9 else 0.0
        thrust[j] = max(along, 0.0)
        moved = max(moved, abs(angles[j, 0] - before[j, 0]), abs(angles[j, 1] - before[j, 1]))
        moved = max(moved, missed[j])
    return moved


@bare(no_cpython_wrapper=True)
def bounded_forces(
    m: Floats,
    task: Task,
    limits: Limits,
    last: Previous,
    loads: JointLoads,
    internal: Floats,
    near: int,
    thrust: Floats,
    angles: Floats,
) -> None:
    """Writes thrust (Ñ,) and angles (Ñ, 2) within limits, nearest to the wrench that is sought.

    Args:
        m: (Ñ, 10, 3) from `mounts`.
        task: its scale decides what is given up when out of limits.
        limits: limits.
        last: the tick before, where the first map is taken.
        loads: bounds of the joints on forces in CoG axes.
        internal: (3Ñ,) N, CoG axes, forces against one another to keep, unless `near` is LEAST.
        near: LEAST for the least forces within the joints' bounds; NEAR, or CALMLY, for
            `near_allocation`, which knows no joints.
        thrust: (Ñ,) N.
        angles: (Ñ, 2) rad, joint order.
    """
    n, limit, wrench, rows = limits.thrust.shape[0], limits.thrust, task.wrench, task.rows
    missed, forces, kept = scratch(n), scratch(3 * n), scratch(3 * n)
    top = scratch(6 + loads.limit.shape[0])  # of a round's dual: the next begins there
    allowed, q = scratch((n, 3, 3)), scratch((6, 3 * n))
    bound = JointLoads(scratch(loads.rows.shape), loads.bias, loads.limit)
    for j in range(n):
        for k in range(2):
            angles[j, k] = last.angles[j, k]
    confinement_into(m, angles, allowed)
    forces_into(m, last.thrust, last.angles, forces)
    top[0] = nan
    for _ in range(ROUNDS):
        turning_map_into(m, angles, forces, allowed, q)
        if near != LEAST:
            confined_forces_into(internal, allowed, kept)
            near_forces_into(q, wrench, rows, limit, kept, near == CALMLY, top, forces)
        else:
            confined_loads_into(loads, allowed, bound.rows)
            ball_forces_into(q, wrench, rows, limit, bound, top, forces)
        moved = aimed(m, forces, limits.lower, limits.upper, thrust, angles, missed)
        confine_at_limits(m, angles, limits.lower, limits.upper, missed, allowed)
        if moved < AT_REST:
            break
