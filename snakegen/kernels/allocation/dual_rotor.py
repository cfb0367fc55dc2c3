"""Dual-rotor mode's thrusts at held gimbals: ZN23 eqs 20-22."""

import numpy as np

from snakegen.kernels.allocation.box_allocation import box_within_into
from snakegen.kernels.allocation.constrained_allocation import LIMIT_SLACK
from snakegen.kernels.core.cholesky import least_norm_into, least_singular_value
from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.types import Floats
from snakegen.kernels.dynamics.joint_loads import JointLoads, overloaded


@bare
def outside(x: float, lower: float, upper: float) -> bool:
    """Tells whether x passes its limits."""
    return x < lower - LIMIT_SLACK or x > upper + LIMIT_SLACK


@bare
def dual_answer(
    q: Floats,
    wanted: Floats,
    rows: Floats,
    thrust_min: Floats,
    thrust_max: Floats,
    constrained: int,
    loads: JointLoads,
    thrust: Floats,
) -> float:
    """Writes rotor thrusts (n,) and returns the scaled σ_min(Q_trunc): eqs 20-22.

    Weights: thrusts are normalised by their limits.

    Args:
        q: (4, n) truncated map at the gimbal angles in use.
        wanted: (4,) ``[f_z; τ]``.
        rows: (4,) their scale.
        thrust_min, thrust_max: (n,) N.
        constrained: 1 keeps the thrusts within limits.
        loads: bounds of the joints on the thrusts, kept likewise.
        thrust: (n,) N.
    """
    beyond = False
    least_norm_into(q, thrust_max, wanted, thrust)
    for r in range(thrust.shape[0]):
        beyond |= outside(thrust[r], thrust_min[r], thrust_max[r])
    if constrained and (beyond or overloaded(loads, thrust)):
        box_within_into(q, wanted, rows, thrust_max, thrust_min, thrust_max, loads, thrust)
    return least_singular_value(q, rows, thrust_max)


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
    """Returns rotor thrusts (n,) and the scaled σ_min(Q_trunc) of `dual_answer`."""
    thrust = np.empty(q.shape[1])
    sigma = dual_answer(q, wanted, rows, thrust_min, thrust_max, constrained, loads, thrust)
    return thrust, sigma
