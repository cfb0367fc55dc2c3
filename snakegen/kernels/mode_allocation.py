"""The two ways to share a wrench among the actuators, and the way between them.

Virtual single rotor: eqs 29-47. Dual rotor: eqs 20-22. While the mode changes, thrusts and gimbal
angles are blended and the thrusts corrected so that ``[f_z; τ]`` is met throughout.
"""

from math import sqrt

import numpy as np

from snakegen.kernels.bounded import box_within
from snakegen.kernels.confined import bounded_forces
from snakegen.kernels.fully_actuated import forces_of, refine, spread_forces, wrench_jacobian
from snakegen.kernels.jit import jit
from snakegen.kernels.joint_loads import JointLoads, overloaded
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
) -> tuple[Floats, Floats, float, int, float]:
    """Returns thrust (Ñ,), angles (Ñ, 2), σ_min(J_w), Newton steps and ‖ε‖: eqs 29-47.

    The constrained allocator takes over where the printed one passes a limit; elsewhere both give
    the least-norm answer. Angles are in joint order; `loads` bounds forces in CoG axes.
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
    if constrained and beyond:
        thrust, angles = bounded_forces(m, wrench, rows, limit, lower, upper, last, ROUNDS, loads)
    return thrust, angles, sigma, steps, size


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
