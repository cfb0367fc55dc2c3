"""Dual-rotor mode's thrusts at held gimbals: ZN23 eqs 20-22."""

import numpy as np

from snakegen.kernels.allocation.box_allocation import box_within_into
from snakegen.kernels.allocation.constrained_allocation import LIMIT_SLACK
from snakegen.kernels.allocation.types import RotorBounds
from snakegen.kernels.core.cholesky import least_norm_into, least_singular_value
from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.types import Floats
from snakegen.kernels.dynamics.joint_loads import overloaded


@bare
def outside(x: float, lower: float, upper: float) -> bool:
    """Tells whether x passes its limits."""
    return x < lower - LIMIT_SLACK or x > upper + LIMIT_SLACK


@bare
def dual_answer(
    q: Floats, wanted: Floats, rows: Floats, bounds: RotorBounds, thrust: Floats
) -> float:
    """Writes rotor thrusts (n,) and returns the scaled σ_min(Q_trunc): eqs 20-22.

    Weights: thrusts are normalised by their limits.

    Args:
        q: (4, n) truncated map at the gimbal angles in use.
        wanted: (4,) ``[f_z; τ]``.
        rows: (4,) their scale.
        bounds: of thrusts and joints.
        thrust: (n,) N.
    """
    beyond, least, most = False, bounds.least, bounds.most
    least_norm_into(q, most, wanted, thrust)
    for r in range(thrust.shape[0]):
        beyond |= outside(thrust[r], least[r], most[r])
    if bounds.constrained and (beyond or overloaded(bounds.loads, thrust)):
        box_within_into(q, wanted, rows, most, least, most, bounds.loads, thrust)
    return least_singular_value(q, rows, most)


@jit
def allocate_dual(
    q: Floats, wanted: Floats, rows: Floats, bounds: RotorBounds
) -> tuple[Floats, float]:
    """Returns rotor thrusts (n,) and the scaled σ_min(Q_trunc) of `dual_answer`."""
    thrust = np.empty(q.shape[1])
    sigma = dual_answer(q, wanted, rows, bounds, thrust)
    return thrust, sigma
