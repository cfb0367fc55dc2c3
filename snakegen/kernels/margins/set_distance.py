"""How far a wrench lies outside a wrench set of any convex kind (Wolfe's minimum-norm point)."""

import numpy as np

from snakegen.kernels.core.jit import jit
from snakegen.kernels.margins.force_sets import farthest, slack, wrench_into
from snakegen.kernels.margins.min_norm_point import _descend

ROUNDS = 2000
AGREED = 1e-9  # relative, of both bounds
NOTHING = 1e-10  # scaled: a distance that rounding makes


@jit
def distance(sets, hover, twist):
    """Returns (lower, upper) of the scaled distance from `hover` (6,) to the set.

    `twist` (6,) ends as the unit direction from the set to hover that proves the lower bound.
    """
    n = sets.faces.size
    points, weights = np.zeros((9, 6)), np.zeros(9)
    h, target, x, best = np.empty((9, 9)), np.empty(9), np.empty(6), np.empty(6)
    d, u, f, w, back = np.empty(3), np.empty(3), np.empty(3), np.empty(6), np.empty(6)
    twist[:] = 0.0
    for c in range(6):
        x[c] = -hover[c]
    k, low, high = 0, 0.0, np.inf
    for _ in range(ROUNDS):
        for c in range(6):
            back[c] = -x[c]
            best[c] = -hover[c]
        for j in range(n):
            farthest(j, back, sets, d, u, f)
            wrench_into(j, f, sets, w)
            for c in range(6):
                best[c] += w[c]
        if k > 0:
            size = np.sqrt((x**2).sum())
            high = min(high, size)
            if size <= NOTHING:
                return 0.0, size
            below = (x * best).sum() / size
            if below > low:
                low = below
                twist[:] = back / size
            if high - low <= AGREED * high or k > 7:
                break
        points[k], weights[k] = best, 1.0 if k == 0 else 0.0
        if k == 0:
            high = min(high, np.sqrt((best**2).sum()))
        k = _descend(points, weights, k + 1, h, target)
        if k == 0:  # rounding: no better point can be distinguished
            break
        for c in range(6):
            x[c] = 0.0
            for i in range(k):
                x[c] += weights[i] * points[i, c]
    if low > 0.0:
        low = max(-slack(twist, sets, hover), 0.0)
    return low, high
