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
from snakegen.kernels.allocation.types import (
    DualAnswer,
    Iteration,
    Level,
    Limits,
    Previous,
    RotorBounds,
    Task,
    VirtualAnswer,
)
from snakegen.kernels.allocation.underactuated import (
    rotor_map_into,
    truncated_into,
    truncated_wrench_into,
    vectored_gimbals_into,
)
from snakegen.kernels.control.types import Law
from snakegen.kernels.core.cholesky import least_norm_into, least_singular_value
from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.stack_arrays import scratch
from snakegen.kernels.core.types import Body, Floats, Mechanism
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
    task: Task,
    limits: Limits,
    last: Floats,
    iteration: Iteration,
    thrust: Floats,
    angles: Floats,
) -> tuple[float, int, float, bool]:
    """Writes the printed allocator's thrust (Ñ,) and angles (Ñ, 2), joint order: eqs 29-47.

    Begins at the angles `last` (Ñ, 2). Returns σ_min(J_w), Newton steps, ‖ε‖, and whether a limit
    of thrust or angle is passed or ε is left.
    """
    limit, lower, upper, rows = limits.thrust, limits.lower, limits.upper, task.rows
    n, residual = limit.shape[0], iteration.residual
    columns, jacobian = scratch(3 * n), scratch((6, 3 * n))
    spread_forces(m, task.wrench, limit, lower, upper, last, iteration.sweeps, thrust, angles)
    scale = 1.0 / (rows[0] * n)
    steps, size = refine(
        m, task.wrench, thrust, angles, limit, rows, scale, iteration.newton, residual
    )
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
    task: Task,
    limits: Limits,
    last: Floats,
    iteration: Iteration,
    constrained: int,
    loads: JointLoads,
    internal: Floats,
    share: Floats,
) -> tuple[Floats, Floats, float, int, float, Floats, Floats]:
    """Returns thrust (Ñ,), angles (Ñ, 2), σ_min(J_w), Newton steps and ‖ε‖: eqs 29-47.

    Beside them the wrench (6,) within limits, and internal forces for the next tick; arguments as
    in `least_answer` and `bounded_answer`.
    """
    n = limits.thrust.shape[0]
    answer = VirtualAnswer(np.empty(n), np.empty((n, 2)), internal.copy(), task.wrench.copy())
    thrust, angles, kept, reached = answer
    sigma, steps, size, beyond = least_answer(m, task, limits, last, iteration, thrust, angles)
    if constrained:
        before = Previous(last, np.zeros(n), np.zeros(0))
        bounded_answer(m, task, limits, before, beyond, loads, share, answer)
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
def allocate_leaning(
    mechanism: Mechanism,
    law: Law,
    body: Body,
    geometry: tuple[Floats, Floats],
    level: Level,
    task: Task,
    limits: Limits,
    last: Previous,
    share: float,
    answer: DualAnswer,
) -> float:
    """Writes thrust and angles of dual-rotor mode, or `share` of the way from it: eqs 20-28.

    There what the virtual mode asks is the `answer` on entry. Returns σ_min. `geometry` is of
    `mounts`; deflections are as far as the allocator knows.
    """
    m, rotor = geometry
    thrust, angles, deflected = answer
    rotors, rows, tilt = mechanism.rotors, task.rows, level.tilt
    n, count = angles.shape[0], thrust.shape[0]
    k = law.joints.shape[0] if law.constrained else 0
    leaned, full, q, part = scratch((n, 2)), scratch((6, count)), scratch((4, count)), scratch(4)
    vectored_gimbals_into(
        m, level.ahead, level.left, tilt, level.weight, law.vectoring, limits.lower, limits.upper,
        last.angles, leaned,
    )  # fmt: skip
    for j in range(n):
        for i in range(2):
            near = share * (angles[j, i] - leaned[j, i]) if share > 0.0 else 0.0
            angles[j, i] = leaned[j, i] + near
    rotor_map_into(m, rotor, angles, full)
    truncated_into(full, tilt, q)
    truncated_wrench_into(task.wrench, tilt, part)
    bent = JointLoads(scratch((k, count)), scratch(k), law.joint_limit[:k])
    rotor_loads_into(
        mechanism.tree, mechanism.gimbals, body, m, rotor, angles, law.gravity, law.joints[:k],
        bent.rows, bent.bias,
    )  # fmt: skip
    for i in range(k):
        bent.bias[i] += last.external[i]
    split = scratch(count)
    bounds = RotorBounds(rotors.thrust_min, rotors.thrust_max, law.constrained, bent)
    if law.constrained:
        give = scratch((n, 2))
        joint_order_into(m, law.gimbal_give, give)
        sigma = yielding_answer(
            m, rotor, angles, give, tilt, part, rows[2:], bounds, split, deflected
        )
    else:
        for j in range(n):
            deflected[j, 0], deflected[j, 1] = angles[j, 0], angles[j, 1]
        sigma = dual_answer(q, part, rows[2:], bounds, split)
    if share > 0.0:
        blend(q, part, rotors.thrust_max, thrust, split, share)
    else:
        for r in range(count):
            thrust[r] = split[r]
    return sigma
