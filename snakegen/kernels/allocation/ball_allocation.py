"""Allocation of forces inside balls: the exact one of least forces, and calm ones beside others.

The method is `ascent`'s; a ball's nearest point is a shrunken one. Near its edge the exact answer
moves far for little: a force at its limit can only turn, and the rest must make up for it.
"""

import numpy as np

from snakegen.kernels.allocation.dual_newton import (
    Bounded,
    ascend,
    intervals_into,
    scaled_into,
    servos_into,
)
from snakegen.kernels.core.cholesky import gram_into, solve_spd_into
from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.stack_arrays import scratch
from snakegen.kernels.core.types import Floats
from snakegen.kernels.dynamics.joint_loads import JointLoads

BALL_STAGES = (1e-4, 1e-2, 1e-8)  # δ: first, factor, last: round sets bend the dual; less stalls it
CALM = 1e-2  # δ that gives up what would cost more force than a pseudo-inverse takes


@bare(no_cpython_wrapper=True)
def ball_forces_into(
    matrix: Floats,
    wrench: Floats,
    rows: Floats,
    limit: Floats,
    loads: JointLoads,
    top: Floats,
    forces: Floats,
) -> None:
    """Writes the forces (3Ñ,) of `ball_allocation`.

    Args:
        top: (6 + k,) of the dual, of a problem near by on entry; NaN for none.
        forces: (3Ñ,) N.
    """
    n, k = forces.shape[0], loads.limit.shape[0]
    q, w, x, nowhere = scratch((6 + k, n + k)), scratch(6 + k), scratch(n + k), scratch(n)
    spread, lower, upper = scratch(k), scratch(k), scratch(k)
    scaled_into(matrix, wrench, rows, q, w)
    servos_into(loads, rows[3], q, w)
    intervals_into(loads, rows[3], spread, lower, upper)
    for c in range(n):
        nowhere[c] = 0.0
    p = Bounded(q, w, limit, nowhere, spread, lower, upper)
    soft, factor, hard = BALL_STAGES
    ascend(p, soft, factor, hard, top, x)
    for c in range(n):
        forces[c] = x[c]


@jit
def ball_allocation(
    matrix: Floats, wrench: Floats, rows: Floats, limit: Floats, loads: JointLoads
) -> Floats:
    """Returns forces (3Ñ,), ``‖f_j‖ ≤ limit_j``, giving `wrench` with least ``Σ (‖f_j‖/limit_j)²``.

    Args:
        matrix: (6, 3Ñ) force map; three columns an apparatus, projected where it is confined.
        wrench: (6,) wanted.
        rows: (6,) scale S of the wrench's rows.
        limit: (Ñ,) N.
        loads: bounds of the joints on the forces, k ≥ 0 of them.
    """
    forces, top = np.empty(matrix.shape[1]), np.full(6 + loads.limit.shape[0], np.nan)
    ball_forces_into(matrix, wrench, rows, limit, loads, top, forces)
    return forces


@bare
def least_forces_into(
    matrix: Floats, wrench: Floats, rows: Floats, limit: Floats, forces: Floats
) -> None:
    """Writes the forces (3Ñ,) of a pseudo-inverse, which may pass their limits: eq 36.

    Least ``Σ (‖f_j‖/limit_j)²``; of a rank-deficient map the nearest wrench in the norm of S.
    """
    n = forces.shape[0]
    q, w, weight = scratch((6, n)), scratch(6), scratch(n)
    square, mu = scratch((6, 6)), scratch(6)
    scaled_into(matrix, wrench, rows, q, w)
    for c in range(n):
        weight[c] = limit[c // 3]
    gram_into(q, weight, square)
    for i in range(6):
        square[i, i] += BALL_STAGES[2]
    solve_spd_into(square, w, mu)
    for c in range(n):
        forces[c] = 0.0
        for i in range(6):
            forces[c] += q[i, c] * mu[i] * weight[c] * weight[c]


@bare(no_cpython_wrapper=True)
def near_forces_into(
    matrix: Floats,
    wrench: Floats,
    rows: Floats,
    limit: Floats,
    internal: Floats,
    calm: bool,
    top: Floats,
    forces: Floats,
) -> None:
    """Writes the forces (3Ñ,) of `near_allocation`; `top` (6,) as in `ball_forces_into`."""
    n, beyond = forces.shape[0], False
    lack, centre = scratch(6), scratch(n)
    for i in range(6):
        lack[i] = wrench[i]
        for c in range(n):
            lack[i] -= matrix[i, c] * internal[c]
    least_forces_into(matrix, lack, rows, limit, forces)
    for j in range(limit.shape[0]):
        size = 0.0
        for c in range(3 * j, 3 * j + 3):
            forces[c] += internal[c]
            centre[c] = forces[c]
            size += forces[c] * forces[c]
        beyond |= size > limit[j] * limit[j]
    if not beyond:
        top[0] = np.nan
        return
    q, w, none = scratch((6, n)), scratch(6), scratch(0)
    scaled_into(matrix, wrench, rows, q, w)
    p = Bounded(q, w, limit, centre, none, none, none)
    soft, factor, hard = BALL_STAGES
    if calm:
        soft = hard = CALM
    ascend(p, soft, factor, hard, top[:6], forces)


@jit
def near_allocation(
    matrix: Floats, wrench: Floats, rows: Floats, limit: Floats, internal: Floats, calm: bool
) -> Floats:
    """Returns forces (3Ñ,) that give `wrench` beside `internal` ones, and move little with it.

    The pseudo-inverse's answer plus what of `internal` (3Ñ,) [N] adds nothing to the wrench. Where
    that passes a limit, the nearest answer inside: exact, or with `calm` as far as it is cheap.
    Arguments else as `ball_allocation`.
    """
    forces, top = np.empty(matrix.shape[1]), np.full(6, np.nan)
    near_forces_into(matrix, wrench, rows, limit, internal, calm, top, forces)
    return forces
