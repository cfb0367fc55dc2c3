"""The two ways to share a wrench among the actuators, and the way between them.

Virtual single rotor: eqs 29-47. Dual rotor: eqs 20-22. While the mode changes, thrusts and gimbal
angles are blended and the thrusts corrected so that ``[f_z; τ]`` is met throughout.
"""

from math import sqrt

import numpy as np

from snakegen.kernels.balls import least_forces
from snakegen.kernels.bounded import box_within
from snakegen.kernels.confined import CALMLY, LEAST, NEAR, bounded_forces
from snakegen.kernels.fully_actuated import (
    confinement,
    forces_of,
    point_map,
    refine,
    spread_forces,
    wrench_jacobian,
    wrench_of,
)
from snakegen.kernels.jit import jit
from snakegen.kernels.joint_loads import JointLoads, overloaded
from snakegen.kernels.linear import turn_back_into, turn_into
from snakegen.kernels.spd import least_norm, least_singular_value
from snakegen.kernels.tree import Floats

LIMIT_SLACK = 1e-9  # N and rad, by which an answer may pass a limit unnoticed
ROUNDS = 20  # of bounded allocation and aiming
DUAL_SIGMA_MIN = 1e-3  # least scaled σ_min(Q_trunc) flown: yaw by drag alone has about 1.5 κ


@jit
def wrench_scale(mass: float, gravity: float, length: float) -> Floats:
    """Returns S (6,): 1 / (m g) for forces, 1 / (m g length) for torques (THEORY A3)."""
    rows = np.empty(6)
    for k in range(3):
        rows[k] = 1.0 / (mass * gravity)
        rows[3 + k] = rows[k] / length
    return rows


@jit
def outside(x: float, lower: float, upper: float) -> bool:
    """Tells whether x passes its limits."""
    return x < lower - LIMIT_SLACK or x > upper + LIMIT_SLACK


@jit
def allocate_virtual(
    m: Floats,
    limit: Floats,
    wrench: Floats,
    rows: Floats,
    last: Floats,
    lower: Floats,
    upper: Floats,
    sweeps: int,
    newton: int,
    residual: float,
    constrained: int,
    loads: JointLoads,
    internal: Floats,
    share: Floats,
) -> tuple[Floats, Floats, float, int, float, Floats, Floats]:
    """Returns thrust (Ñ,), angles (Ñ, 2), σ_min(J_w), Newton steps and ‖ε‖: eqs 29-47.

    Beside them the wrench (6,) within reach, and internal forces for the next tick. The constrained
    allocator takes over where the printed one passes a limit; elsewhere both give the least-norm
    answer. Angles are in joint order; `loads` bounds forces in CoG axes.

    At a limit the bounded answer moves forces ten times as far as the pseudo-inverse for the same
    change of wrench, farther than motors and gimbals follow inside the attitude loop, which then
    swings up. So what sets it apart from the pseudo-inverse, forces against one another that add
    nothing to the wrench, is eased in, and the pseudo-inverse meets the wrench beside them.

    Args:
        internal: (2, Ñ, 3) N, link axes, those forces in the tick before: for the joints' limits,
            then for thrusts' and gimbals' too; NaN for none as yet.
        share: (2,) of the way to the ones wanted now; 1 goes there at once.
    """
    n = limit.shape[0]
    thrust, angles = spread_forces(m, wrench, limit, lower, upper, last, sweeps)
    scale = 1.0 / (rows[0] * n)
    steps, size = refine(m, wrench, thrust, angles, limit, rows, scale, newton, residual)
    columns = np.empty(3 * n)
    beyond = size > residual
    for j in range(n):
        columns[j], columns[n + j], columns[2 * n + j] = limit[j], 1.0, 1.0
        beyond |= outside(thrust[j], 0.0, limit[j])
        for k in range(2):
            beyond |= outside(angles[j, k], lower[j, k], upper[j, k])
    sigma = least_singular_value(wrench_jacobian(m, thrust, angles), rows, columns)
    if constrained:
        beyond |= overloaded(loads, forces_of(m, thrust, angles))
    if not constrained:
        return thrust, angles, sigma, steps, size, wrench, np.zeros((2, n, 3))
    goal = np.zeros(3 * n)
    if beyond:
        thrust, angles = bounded_forces(
            m, wrench, rows, limit, lower, upper, last, ROUNDS, loads, goal, LEAST
        )
        goal = apart_from_least(m, wrench, rows, limit, thrust, angles)
    kept = np.empty_like(internal)
    apart = eased(m, goal, internal[0], share[0], kept[0])
    if apart > LIMIT_SLACK:
        thrust, angles = bounded_forces(
            m, wrench, rows, limit, lower, upper, last, ROUNDS, loads, in_cog_axes(m, kept[0]), NEAR
        )
        goal = apart_from_least(m, wrench, rows, limit, thrust, angles)
    reached = wrench_of(m, thrust, angles)
    apart = eased(m, goal, internal[1], share[1], kept[1])
    if apart > LIMIT_SLACK:
        thrust, angles = bounded_forces(
            m,
            wrench,
            rows,
            limit,
            lower,
            upper,
            last,
            ROUNDS,
            loads,
            in_cog_axes(m, kept[1]),
            CALMLY,
        )
    return thrust, angles, sigma, steps, size, reached, kept


@jit
def apart_from_least(
    m: Floats, wrench: Floats, rows: Floats, limit: Floats, thrust: Floats, angles: Floats
) -> Floats:
    """Returns what an answer's forces (3Ñ,), CoG axes, have beyond the pseudo-inverse's."""
    q = point_map(m, angles, confinement(m, angles))
    return forces_of(m, thrust, angles) - least_forces(q, wrench, rows, limit)


@jit
def eased(m: Floats, goal: Floats, now: Floats, share: float, out: Floats) -> float:
    """Writes forces (Ñ, 3), link axes, `share` of the way from `now` to `goal` into `out`.

    Returns how far [N] they still are from it. A body that bends carries them along.

    Args:
        m: (Ñ, 10, 3) from `vectoring.mounts`.
        goal: (3Ñ,) N, CoG axes.
        now: (Ñ, 3) N, link axes; NaN takes the goal.
        share: 0 … 1.
        out: (Ñ, 3) N, link axes.
    """
    apart = 0.0
    for j in range(now.shape[0]):
        turn_back_into(m[j], goal[3 * j : 3 * j + 3], out[j])
        for k in range(3):
            gap = now[j, k] - out[j, k]
            if gap == gap:
                out[j, k] += (1.0 - share) * gap
                apart = max(apart, abs((1.0 - share) * gap))
    return apart


@jit
def in_cog_axes(m: Floats, forces: Floats) -> Floats:
    """Returns forces (3Ñ,) in CoG axes of forces (Ñ, 3) in link axes."""
    out = np.empty(forces.size)
    for j in range(forces.shape[0]):
        turn_into(m[j], forces[j], out[3 * j : 3 * j + 3])
    return out


@jit
def allocate_dual(
    q: Floats,
    wanted: Floats,
    rows: Floats,
    thrust_min: Floats,
    thrust_max: Floats,
    constrained: int,
    loads: JointLoads,
) -> tuple[Floats, float]:
    """Returns rotor thrusts (n,) and the scaled σ_min(Q_trunc): eqs 20-22.

    Weights: thrusts are normalised by their limits.

    Args:
        q: (4, n) truncated map at the gimbal angles in use.
        wanted: (4,) ``[f_z; τ]``.
        rows: (4,) their scale.
        thrust_min, thrust_max: (n,) N.
        constrained: 1 keeps the thrusts within limits.
        loads: bounds of the joints on the thrusts, kept likewise.
    """
    thrust, beyond = least_norm(q, thrust_max, wanted), False
    for r in range(thrust.shape[0]):
        beyond |= outside(thrust[r], thrust_min[r], thrust_max[r])
    if constrained and (beyond or overloaded(loads, thrust)):
        thrust = box_within(q, wanted, rows, thrust_max, thrust_min, thrust_max, loads)
    return thrust, least_singular_value(q, rows, thrust_max)


@jit
def smooth(s: float) -> float:
    """Returns ``3 s² - 2 s³``: a blend that starts and ends at rest."""
    return s * s * (3.0 - 2.0 * s)


@jit
def between(a: Floats, b: Floats, share: float) -> Floats:
    """Returns a rotation `share` of the way from a to b, for nearby ones (Gram-Schmidt)."""
    out = np.empty((3, 3))
    size = along = 0.0
    for i in range(3):
        for k in range(2):
            out[i, k] = (1.0 - share) * a[i, k] + share * b[i, k]
        size += out[i, 0] ** 2
        along += out[i, 0] * out[i, 1]
    rest = 0.0
    for i in range(3):
        out[i, 1] -= along / size * out[i, 0]
        rest += out[i, 1] ** 2
    for i in range(3):
        out[i, 0] /= sqrt(size)
        out[i, 1] /= sqrt(rest)
    for i in range(3):
        k, l = (i + 1) % 3, (i + 2) % 3
        out[i, 2] = out[k, 0] * out[l, 1] - out[l, 0] * out[k, 1]
    return out


@jit
def blended(
    q: Floats, wanted: Floats, thrust_max: Floats, virtual: Floats, dual: Floats, share: float
) -> Floats:
    """Returns the thrusts between two modes, corrected so that ``q x = wanted`` stays exact.

    Args:
        q: (4, n) truncated map at the blended gimbal angles.
        wanted: (4,) ``[f_z; τ]``.
        thrust_max: (n,) N, weights of the correction.
        virtual, dual: (n,) thrusts of the two modes.
        share: 0 dual … 1 virtual.
    """
    thrust, lack = np.empty(virtual.shape[0]), wanted.copy()
    for r in range(thrust.shape[0]):
        thrust[r] = share * virtual[r] + (1.0 - share) * dual[r]
        for k in range(4):
            lack[k] -= q[k, r] * thrust[r]
    extra = least_norm(q, thrust_max, lack)
    for r in range(thrust.shape[0]):
        thrust[r] += extra[r]
    return thrust
