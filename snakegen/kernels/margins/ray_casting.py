"""How far the vectored wrench set reaches along a ray, and how far it is from a point outside.

Along u from hover: ``t = min over d·u = 1 of h(d) - d·w0``, convex in the five free components of
the twist d; at the minimum the forces give ``w0 + t u`` itself. Shooting again along the facet
normal that was hit can only lower slack(d)/‖d‖: that is the search for the wrench margin.
"""

import numpy as np

from snakegen.kernels.core.jit import jit
from snakegen.kernels.margins.norms import minimise

FREE = 5  # components of a twist d with d·u = 1
NOTHING = 1e-10  # scaled: a distance that rounding makes


@jit
def moved(d, p, r):
    """Writes to `r` (n, 3) ``v + ω × p_j + c_j ω`` of the twist d (6,), rows of p (p_j, c_j)."""
    for j in range(p.shape[0]):
        r[j, 0] = d[0] + d[4] * p[j, 2] - d[5] * p[j, 1] + d[3] * p[j, 3]
        r[j, 1] = d[1] + d[5] * p[j, 0] - d[3] * p[j, 2] + d[4] * p[j, 3]
        r[j, 2] = d[2] + d[3] * p[j, 1] - d[4] * p[j, 0] + d[5] * p[j, 3]


@jit
def _across(u, basis):
    """Fills `basis` (5, 6): orthonormal rows orthogonal to u (a Householder reflection)."""
    size, at = 0.0, 0
    for c in range(6):
        size += u[c] * u[c]
        if abs(u[c]) > abs(u[at]):
            at = c
    size = np.sqrt(size)
    sign = 1.0 if u[at] >= 0.0 else -1.0
    w = u / size
    w[at] += sign
    half = 1.0 + sign * u[at] / size
    row = 0
    for k in range(6):
        if k != at:
            for c in range(6):
                basis[row, c] = (1.0 if c == k else 0.0) - w[k] * w[c] / half
            row += 1


@jit
def slack(d, p, limit, hover, smooth, r):
    """Returns ``h(d) - d·w0`` of the twist d (6,), norms rounded; `r` (n, 3) is work space."""
    moved(d, p, r)
    total = 0.0
    for c in range(6):
        total -= d[c] * hover[c]
    for j in range(limit.size):
        size = r[j, 0] ** 2 + r[j, 1] ** 2 + r[j, 2] ** 2 + smooth * smooth
        total += limit[j] * np.sqrt(size)
    return total


@jit
def shoot(u, p, limit, hover, twist):
    """Returns (lower, upper) of the largest t with ``hover + t u`` in the set, all scaled.

    `twist` (6,) ends as the normal where the ray leaves, ``twist·u = 1``. The set must span u.
    """
    n = limit.size
    square = 0.0
    for c in range(6):
        square += u[c] * u[c]
    basis, start, f = np.empty((FREE, 6)), np.empty((n, 3)), np.empty((n, 3))
    maps, cost, x, reached = np.empty((n, 3, FREE)), np.zeros(FREE), np.zeros(FREE), np.empty(6)
    _across(u, basis)
    for k in range(FREE):
        moved(basis[k], p, start)
        for c in range(6):
            cost[k] += basis[k, c] * hover[c]
        for j in range(n):
            for c in range(3):
                maps[j, c, k] = start[j, c]
    for c in range(6):
        twist[c] = u[c] / square
    moved(twist, p, start)
    balanced = minimise(start, maps, limit, cost, x, f) < np.inf
    for k in range(FREE):
        for c in range(6):
            twist[c] += x[k] * basis[k, c]
    lower = 0.0
    residual(f, p, hover, reached)
    for c in range(6):
        lower += reached[c] * u[c] / square
    return lower if balanced else -np.inf, slack(twist, p, limit, hover, 0.0, start)


@jit
def residual(f, p, hover, gap):
    """Writes the wrench of the forces f (n, 3), seen from hover, to `gap` (6,); its length."""
    for c in range(6):
        gap[c] = -hover[c]
    for j in range(p.shape[0]):
        for c in range(3):
            gap[c] += f[j, c]
        gap[3] += p[j, 1] * f[j, 2] - p[j, 2] * f[j, 1] + p[j, 3] * f[j, 0]
        gap[4] += p[j, 2] * f[j, 0] - p[j, 0] * f[j, 2] + p[j, 3] * f[j, 1]
        gap[5] += p[j, 0] * f[j, 1] - p[j, 1] * f[j, 0] + p[j, 3] * f[j, 2]
    size = 0.0
    for c in range(6):
        size += gap[c] * gap[c]
    return np.sqrt(size)


@jit
def distance(p, limit, hover, twist):
    """Returns (lower, upper) of the scaled distance from `hover` to the set.

    Least ``½‖Σ (f_j, p_j × f_j + c_j f_j) - w0‖²`` over the balls by its dual, the least of
    ``½‖d‖² + h(d) - d·w0`` over twists: at it d is what the forces leave of w0. `twist` (6,) ends
    as the unit direction from the set to hover that proves the lower bound, 0 if that is 0.
    """
    n = limit.size
    start, maps, f = np.zeros((n, 3)), np.empty((n, 3, 6)), np.zeros((n, 3))
    d, gap, pull = np.zeros(6), np.zeros(6), np.empty((n, 3))
    for k in range(6):
        gap[k] = 1.0
        moved(gap, p, pull)
        gap[k] = 0.0
        for j in range(n):
            for c in range(3):
                maps[j, c, k] = pull[j, c]
    minimise(start, maps, limit, hover, d, f, 1.0)
    twist[:] = 0.0
    apart = residual(f, p, hover, gap)
    if apart < NOTHING:
        return 0.0, apart
    for c in range(6):
        gap[c] /= -apart
    below = -slack(gap, p, limit, hover, 0.0, pull)
    if below <= 0.0:
        return 0.0, apart
    twist[:] = gap
    return below, apart
