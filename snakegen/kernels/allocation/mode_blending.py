"""The two ways to share a wrench among the actuators, and the way between them.

Virtual single rotor: eqs 29-47. Dual rotor: eqs 20-22. While the mode changes, thrusts and gimbal
angles are blended and the thrusts corrected so that ``[f_z; τ]`` is met throughout.
"""

import numpy as np

from snakegen.kernels.allocation.compliance import yielding_answer
from snakegen.kernels.allocation.constrained_allocation import bounded_answer
from snakegen.kernels.allocation.dual_rotor import dual_answer, outside
from snakegen.kernels.allocation.fully_actuated import refine, spread_forces, wrench_jacobian_into
from snakegen.kernels.allocation.gimbals import joint_order_into
from snakegen.kernels.allocation.underactuated import (
    rotor_map_into,
    truncated_into,
    truncated_wrench_into,
    vectored_gimbals_into,
)
from snakegen.kernels.control.types import Body, Law
from snakegen.kernels.core.cholesky import least_norm_into, least_singular_value
from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.stack_arrays import scratch
from snakegen.kernels.core.types import Floats, Gimbals, Rotors, Tree
from snakegen.kernels.dynamics.joint_loads import JointLoads, rotor_loads_into

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


@bare(no_cpython_wrapper=True)
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
            np.zeros(n),
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


@bare
def smooth(s: float) -> float:
    """Returns ``3 s² - 2 s³``: a blend that starts and ends at rest."""
    return s * s * (3.0 - 2.0 * s)


@bare
def blend(
    q: Floats, wanted: Floats, thrust_max: Floats, virtual: Floats, dual: Floats, share: float
) -> None:
    """Writes into `virtual` the thrusts between two modes, corrected so that ``q x = wanted``.

    Args:
        q: (4, n) truncated map at the blended gimbal angles.
        wanted: (4,) ``[f_z; τ]``.
        thrust_max: (n,) N, weights of the correction.
        virtual, dual: (n,) thrusts of the two modes.
        share: 0 dual … 1 virtual.
    """
    n, lack = virtual.shape[0], scratch(4)
    extra = scratch(n)
    for k in range(4):
        lack[k] = wanted[k]
    for r in range(n):
        virtual[r] = share * virtual[r] + (1.0 - share) * dual[r]
        for k in range(4):
            lack[k] -= q[k, r] * virtual[r]
    least_norm_into(q, thrust_max, lack, extra)
    for r in range(n):
        virtual[r] += extra[r]


@bare(no_cpython_wrapper=True)
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
    strain: Floats,
    share: float,
    thrust: Floats,
    angles: Floats,
    stands: Floats,
) -> float:
    """Writes thrust (n,) and angles (Ñ, 2) of dual-rotor mode, or `share` of the way from it.

    There what the virtual mode asks stands in them on entry. Returns σ_min: eqs 20-28. Besides,
    the angles (Ñ, 2) at which gimbals `stands` under the thrusts, as far as the allocator knows.
    """
    n, count = angles.shape[0], thrust.shape[0]
    k = law.joints.shape[0] if law.constrained else 0
    leaned, full, q, part = scratch((n, 2)), scratch((6, count)), scratch((4, count)), scratch(4)
    vectored_gimbals_into(m, ahead, left, tilt, weight, law.vectoring, lower, upper, last, leaned)
    for j in range(n):
        for i in range(2):
            near = share * (angles[j, i] - leaned[j, i]) if share > 0.0 else 0.0
            angles[j, i] = leaned[j, i] + near
    rotor_map_into(m, rotor, angles, full)
    truncated_into(full, tilt, q)
    truncated_wrench_into(wrench, tilt, part)
    bent = JointLoads(scratch((k, count)), scratch(k), law.joint_limit[:k])
    rotor_loads_into(
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
        law.joints[:k],
        bent.rows,
        bent.bias,
    )
    for i in range(k):
        bent.bias[i] += strain[i]
    split, least, most = scratch(count), rotors.thrust_min, rotors.thrust_max
    if law.constrained:
        give = scratch((n, 2))
        joint_order_into(m, law.gimbal_give, give)
        sigma = yielding_answer(
            m,
            rotor,
            angles,
            give,
            tilt,
            part,
            rows[2:],
            least,
            most,
            law.constrained,
            bent,
            split,
            stands,
        )
    else:
        for j in range(n):
            stands[j, 0], stands[j, 1] = angles[j, 0], angles[j, 1]
        sigma = dual_answer(q, part, rows[2:], least, most, law.constrained, bent, split)
    if share > 0.0:
        blend(q, part, most, thrust, split, share)
    else:
        for r in range(count):
            thrust[r] = split[r]
    return sigma
