"""Thrusts of one wrench within their limits, by bounded least squares (THEORY A7).

The readable twin of `kernels/allocation/box_allocation.py`.
"""

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.kernels.allocation.box_allocation import BOX_STAGES


def box_allocation(
    matrix: Floats, wrench: Floats, rows: Floats, weight: Floats, lower: Floats, upper: Floats
) -> Floats:
    """Returns the thrusts (n,) in [lower, upper] that give `wrench` with least ``‖x / weight‖``.

    ``min ‖x / d‖² + ‖S (w - Q x)‖² / δ`` with a δ far below what a rotor can resolve; beyond reach
    that is the nearest wrench in the scaled norm.

    Args:
        matrix: (m, n) allocation map Q.
        wrench: (m,) wanted, w.
        rows: (m,) scale S of the wrench's rows; it decides what is given up when out of reach.
        weight: (n,) d, usually the largest thrusts.
        lower, upper: (n,) N.
    """
    from scipy.optimize import lsq_linear

    out, free = np.array(lower, float), (weight > 0.0) & (upper > lower)
    d, stiff = weight[free], rows / np.sqrt(BOX_STAGES[-1])
    rest = wrench - matrix[:, ~free] @ out[~free]
    a = np.vstack([stiff[:, None] * matrix[:, free] * d, np.eye(d.size)])
    b = np.concatenate([stiff * rest, np.zeros(d.size)])
    if d.size:
        limits = (lower[free] / d, upper[free] / d)
        out[free] = d * lsq_linear(a, b, limits, method="bvls", tol=1e-15, max_iter=1000).x
    return np.clip(out, lower, upper)
