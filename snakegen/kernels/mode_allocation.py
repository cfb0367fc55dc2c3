"""The two ways to share a wrench among the actuators, and the way between them.

Virtual single rotor: eqs 29-47. Dual rotor: eqs 20-22. While the mode changes, thrusts and gimbal
angles are blended and the thrusts corrected so that ``[f_z; τ]`` is met throughout.
"""

from math import sqrt

import numpy as np

from snakegen.kernels.bounded import box_allocation
from snakegen.kernels.confined import bounded_forces
from snakegen.kernels.control_types import Law, Mounts
from snakegen.kernels.fully_actuated import refine, spread_forces, wrench_jacobian
from snakegen.kernels.jit import jit
from snakegen.kernels.spd import least_norm, least_singular_value
from snakegen.kernels.tree import Floats, Gimbals, Rotors
from snakegen.kernels.underactuated import rotor_map, truncated

LIMIT_SLACK = 1e-9  # N and rad, by which an answer may pass a limit unnoticed
ROUNDS = 20  # of bounded allocation and aiming


@jit
def wrench_scale(mass: float, gravity: float, length: float) -> Floats:
    """Returns S (6,): 1 / (m g) for forces, 1 / (m g length) for torques (THEORY A3)."""
    rows = np.full(6, 1.0 / (mass * gravity))
    rows[3:] /= length
    return rows


@jit
def allocate_virtual(
    m: Mounts,
    gimbals: Gimbals,
    wrench: Floats,
    rows: Floats,
    last: Floats,
    lower: Floats,
    upper: Floats,
    law: Law,
) -> tuple[Floats, Floats, float, int, float]:
    """Returns thrust (Ñ,), angles (Ñ, 2), σ_min(J_w), Newton steps and ‖ε‖: eqs 29-47.

    The constrained allocator takes over where the printed one passes a limit; elsewhere both give
    the least-norm answer. Angles are in joint order.
    """
    n = gimbals.limit.shape[0]
    thrust, angles = spread_forces(m, wrench, gimbals.limit, lower, upper, last, law.sweeps)
    scale = 1.0 / (rows[0] * n)
    steps, size = refine(m, wrench, thrust, angles, rows, scale, law.newton, law.residual)
    columns = np.ones(3 * n)
    columns[:n] = gimbals.limit
    sigma = least_singular_value(wrench_jacobian(m, thrust, angles), rows, columns)
    beyond = False
    for j in range(n):
        beyond |= not (-LIMIT_SLACK <= thrust[j] <= gimbals.limit[j] + LIMIT_SLACK)
        for k in range(2):
            beyond |= angles[j, k] < lower[j, k] - LIMIT_SLACK
            beyond |= angles[j, k] > upper[j, k] + LIMIT_SLACK
    if law.constrained and (beyond or size > law.residual):
        thrust, angles = bounded_forces(m, wrench, rows, gimbals.limit, lower, upper, last, ROUNDS)
    return thrust, angles, sigma, steps, size


@jit
def allocate_dual(
    m: Mounts,
    rotors: Rotors,
    angles: Floats,
    wrench: Floats,
    tilt: Floats,
    rows: Floats,
    constrained: int,
) -> tuple[Floats, float]:
    """Returns rotor thrusts (n,) and σ_min(Q_trunc) at the given gimbal angles: eqs 20-22.

    Weights: thrusts are normalised by their limits.
    """
    q = truncated(rotor_map(m, rotors, angles), tilt)
    wanted = truncated(wrench.reshape(6, 1), tilt)[:, 0].copy()
    thrust = least_norm(q, rotors.thrust_max, wanted)
    if constrained:
        beyond = np.any(thrust < rotors.thrust_min) or np.any(thrust > rotors.thrust_max)
        if beyond:
            thrust = box_allocation(
                q, wanted, rows[2:], rotors.thrust_max, rotors.thrust_min, rotors.thrust_max
            )
    return thrust, least_singular_value(q, rows[2:], rotors.thrust_max)


@jit
def smooth(s: float) -> float:
    """Returns ``3 s² - 2 s³``: a blend that starts and ends at rest."""
    return s * s * (3.0 - 2.0 * s)


@jit
def between(a: Floats, b: Floats, share: float) -> Floats:
    """Returns a rotation `share` of the way from a to b, for nearby ones (Gram-Schmidt)."""
    mixed = (1.0 - share) * a + share * b
    x = mixed[:, 0] / sqrt(np.sum(mixed[:, 0] ** 2))
    y = mixed[:, 1] - np.sum(mixed[:, 1] * x) * x
    y = y / sqrt(np.sum(y * y))
    out = np.empty((3, 3))
    for i in range(3):
        k, l = (i + 1) % 3, (i + 2) % 3
        out[i, 0], out[i, 1], out[i, 2] = x[i], y[i], x[k] * y[l] - x[l] * y[k]
    return out


@jit
def blended(
    m: Mounts,
    rotors: Rotors,
    angles: Floats,
    virtual: Floats,
    dual: Floats,
    share: float,
    wrench: Floats,
    tilt: Floats,
) -> Floats:
    """Returns the thrusts between two modes, corrected so that ``[f_z; τ]`` stays exact."""
    thrust = share * virtual + (1.0 - share) * dual
    q = rotor_map(m, rotors, angles)
    given = np.zeros((6, 1))
    for k in range(6):
        given[k, 0] = wrench[k]
        for r in range(thrust.shape[0]):
            given[k, 0] -= q[k, r] * thrust[r]
    lack = truncated(given, tilt)[:, 0].copy()
    return thrust + least_norm(truncated(q, tilt), rotors.thrust_max, lack)
