"""The two ways to share a wrench among the actuators, and the way between them.

Virtual single rotor: eqs 29-47. Dual rotor: eqs 20-22. While the mode changes, thrusts and gimbal
angles are blended and the thrusts corrected so that ``[f_z; τ]`` is met throughout.
"""

import numpy as np

from snakegen.kernels.bare import bare
from snakegen.kernels.borrowed import scratch
from snakegen.kernels.bounded import box_within
from snakegen.kernels.control_types import Body, Law
from snakegen.kernels.fully_actuated import refine, spread_forces, wrench_jacobian_into
from snakegen.kernels.jit import jit
from snakegen.kernels.joint_loads import JointLoads, overloaded, rotor_loads
from snakegen.kernels.limited import LIMIT_SLACK, bounded_answer
from snakegen.kernels.spd import least_norm, least_singular_value
from snakegen.kernels.tree import Floats, Gimbals, Rotors, Tree
from snakegen.kernels.underactuated import (
    rotor_map,
    truncated,
    truncated_wrench,
    vectored_gimbals,
)

DUAL_SIGMA_MIN = 1e-3  # least scaled σ_min(Q_trunc) flown: yaw by drag alone has about 1.5 κ


@bare
def wrench_scale_into(mass: float, gravity: float, length: float, rows: Floats) -> None:
    """Writes S (6,): 1 / (m g) for forces, 1 / (m g length) for torques (THEORY A3)."""
    for k in range(3):
        rows[k] = 1.0 / (mass * gravity)
        rows[3 + k] = rows[k] / length


@jit
def wrench_scale(mass: float, gravity: float, length: float) -> Floats:
    """Returns S (6,) of `wrench_scale_into`."""
    rows = np.empty(6)
    wrench_scale_into(mass, gravity, length, rows)
    return rows


@bare
def outside(x: float, lower: float, upper: float) -> bool:
    """Tells whether x passes its limits."""
    return x < lower - LIMIT_SLACK or x > upper + LIMIT_SLACK


@bare
def least_answer(
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
    thrust: Floats,
    angles: Floats,
) -> tuple[float, int, float, bool]:
    """Writes the printed allocator's thrust (Ñ,) and angles (Ñ, 2), joint order: eqs 29-47.

    Returns σ_min(J_w), Newton steps, ‖ε‖, and whether a limit of thrust or angle is passed or ε
    is left.
    """
    n = limit.shape[0]
    columns, jacobian = scratch(3 * n), scratch((6, 3 * n))
    spread_forces(m, wrench, limit, lower, upper, last, sweeps, thrust, angles)
    scale = 1.0 / (rows[0] * n)
    steps, size = refine(m, wrench, thrust, angles, limit, rows, scale, newton, residual)
    beyond = size > residual
    for j in range(n):
        columns[j], columns[n + j], columns[2 * n + j] = limit[j], 1.0, 1.0
        beyond |= outside(thrust[j], 0.0, limit[j])
        for k in range(2):
            beyond |= outside(angles[j, k], lower[j, k], upper[j, k])
    wrench_jacobian_into(m, thrust, angles, jacobian)
    return least_singular_value(jacobian, rows, columns), steps, size, beyond


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

    Beside them the wrench (6,) within reach, and internal forces for the next tick; arguments as
    in `least_answer` and `bounded_answer`.
    """
    n = limit.shape[0]
    thrust, angles, reached, kept = np.empty(n), np.empty((n, 2)), wrench.copy(), internal.copy()
    sigma, steps, size, beyond = least_answer(
        m, limit, wrench, rows, last, lower, upper, sweeps, newton, residual, thrust, angles
    )
    if constrained:
        bounded_answer(
            m,
            limit,
            wrench,
            rows,
            last,
            lower,
            upper,
            beyond,
            loads,
            share,
            thrust,
            angles,
            kept,
            reached,
        )
    else:
        kept[:] = 0.0
    return thrust, angles, sigma, steps, size, reached, kept


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


@bare
def smooth(s: float) -> float:
    """Returns ``3 s² - 2 s³``: a blend that starts and ends at rest."""
    return s * s * (3.0 - 2.0 * s)


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


@jit
def lean(
    tree: Tree,
    rotors: Rotors,
    gimbals: Gimbals,
    law: Law,
    body: Body,
    m: Floats,
    rotor: Floats,
    ahead: float,
    left: float,
    tilt: Floats,
    weight: float,
    wrench: Floats,
    rows: Floats,
    last: Floats,
    lower: Floats,
    upper: Floats,
    share: float,
    thrust: Floats,
    angles: Floats,
) -> float:
    """Writes thrust (n,) and angles (Ñ, 2) of dual-rotor mode, or `share` of the way from it.

    There what the virtual mode asks stands in them on entry. Returns σ_min: eqs 20-28.
    """
    leaned = vectored_gimbals(m, ahead, left, tilt, weight, law.vectoring, lower, upper, last)
    for j in range(leaned.shape[0]):
        for k in range(2):
            near = share * (angles[j, k] - leaned[j, k]) if share > 0.0 else 0.0
            angles[j, k] = leaned[j, k] + near
    q = truncated(rotor_map(m, rotor, angles), tilt)
    part = truncated_wrench(wrench, tilt)
    bent = rotor_loads(
        tree,
        gimbals,
        m,
        rotor,
        angles,
        body.rotation,
        body.position,
        body.cog,
        body.axes,
        law.gravity,
        law.joints if law.constrained else law.joints[:0],
        law.joint_limit if law.constrained else law.joint_limit[:0],
    )
    split, sigma = allocate_dual(
        q, part, rows[2:], rotors.thrust_min, rotors.thrust_max, law.constrained, bent
    )
    if share > 0.0:
        split = blended(q, part, rotors.thrust_max, thrust, split, share)
    thrust[:] = split
    return sigma
