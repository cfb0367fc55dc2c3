"""Allocation of thrusts inside a box, and inside the joints' bounds too: `ascent`'s method."""

from math import nan

import numpy as np

from snakegen.kernels.allocation.dual_newton import (
    Bounded,
    ascend,
    intervals_into,
    scaled_into,
    servos_into,
)
from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.stack_arrays import scratch
from snakegen.kernels.core.types import Floats
from snakegen.kernels.dynamics.joint_loads import JointLoads, no_loads

BOX_STAGES = (1e-4, 1e-3, 1e-10)  # δ: first, factor, last: far below what a rotor can resolve


@bare(no_cpython_wrapper=True)
def box_within_into(
    matrix: Floats,
    wrench: Floats,
    rows: Floats,
    weight: Floats,
    lower: Floats,
    upper: Floats,
    loads: JointLoads,
    out: Floats,
) -> None:
    """Writes the thrusts (n,) in [lower, upper] that give `wrench` with least ``‖x / weight‖``.

    Args:
        matrix: (m, n) allocation map.
        wrench: (m,) wanted.
        rows: (m,) scale S of the wrench's rows; it decides what is given up when out of reach.
        weight: (n,) d, usually the largest thrusts.
        lower, upper: (n,) N.
        loads: bounds of the joints on the thrusts, kept too.
        out: (n,) N.
    """
    m, n = matrix.shape
    k, scale, none = loads.limit.shape[0], rows[m - 1], scratch(0)
    q, w, d = scratch((m + k, n + k)), scratch(m + k), scratch(n + k)
    low, high, mu, x = scratch(n + k), scratch(n + k), scratch(m + k), scratch(n + k)
    scaled_into(matrix, wrench, rows, q, w)
    servos_into(loads, scale, q, w)
    for c in range(n):
        d[c], low[c], high[c] = weight[c], lower[c], upper[c]
    intervals_into(loads, scale, d, low, high)
    soft, factor, hard = BOX_STAGES
    mu[0] = nan
    ascend(Bounded(q, w, none, none, d, low, high), soft, factor, hard, mu, x)
    for c in range(n):
        out[c] = x[c]


@jit
def box_within(
    matrix: Floats,
    wrench: Floats,
    rows: Floats,
    weight: Floats,
    lower: Floats,
    upper: Floats,
    loads: JointLoads,
) -> Floats:
    """Returns the thrusts (n,) of `box_within_into`."""
    out = np.empty(matrix.shape[1])
    box_within_into(matrix, wrench, rows, weight, lower, upper, loads, out)
    return out


@jit
def box_allocation(
    matrix: Floats, wrench: Floats, rows: Floats, weight: Floats, lower: Floats, upper: Floats
) -> Floats:
    """Returns `box_within`'s thrusts (n,) with no joint to keep."""
    return box_within(matrix, wrench, rows, weight, lower, upper, no_loads(matrix.shape[1]))
