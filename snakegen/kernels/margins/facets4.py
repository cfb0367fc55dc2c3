"""Facets of zonotopes in four dimensions: [f_z; τ] of any body, and sets whose rank is four.

A facet's normal is the generalised cross product of three columns. Where three are nearly
dependent and would lose digits both enumerations give up; the tree of `facets` takes over.
"""

import numpy as np

from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.margins.facets import FAST, FIRST, FLAT, INSIDE

GREY = 1e-5  # normals below this share of their columns' volume (but not zero) lose digits


@bare(fastmath=FAST)
def _pair(a, i, j):
    """Returns the six 2×2 minors of columns i, j of `a` (4, …)."""
    return (
        a[0, i] * a[1, j] - a[1, i] * a[0, j],
        a[0, i] * a[2, j] - a[2, i] * a[0, j],
        a[0, i] * a[3, j] - a[3, i] * a[0, j],
        a[1, i] * a[2, j] - a[2, i] * a[1, j],
        a[1, i] * a[3, j] - a[3, i] * a[1, j],
        a[2, i] * a[3, j] - a[3, i] * a[2, j],
    )


@bare(fastmath=FAST)
def _cross4(m, a, k):
    """Returns the generalised cross product of the pair with minors m and column k of `a`."""
    x, y, z, w = a[0, k], a[1, k], a[2, k], a[3, k]
    return (
        m[3] * w - m[4] * z + m[5] * y,
        m[2] * z - m[1] * w - m[5] * x,
        m[0] * w - m[2] * y + m[4] * x,
        m[1] * y - m[0] * z - m[3] * x,
    )


@bare(fastmath=FAST)
def _width(a, n, d):
    """Returns ``Σ |d·a_l|`` over the first n columns of `a` (4, …)."""
    total = 0.0
    for l in range(n):
        total += abs(d[0] * a[0, l] + d[1] * a[1, l] + d[2] * a[2, l] + d[3] * a[3, l])
    return total


@bare(fastmath=FAST)
def _sizes(a, n, sizes):
    for k in range(n):
        sizes[k] = np.sqrt(a[0, k] ** 2 + a[1, k] ** 2 + a[2, k] ** 2 + a[3, k] ** 2)


@bare(fastmath=FAST)
def _dull(square, size):
    """Tells of a normal of length² `square` from columns of volume `size`: 0 good, 1 none, 2 bad.

    None where the columns depend on each other; bad where they nearly do, and digits are lost.
    """
    whole = (GREY * size) ** 2
    if square >= whole:
        return 0
    return 1 if square < 1e-12 * whole else 2


@bare(fastmath=FAST)
def four(a, y, squared, normals, sizes):
    """Facets of a full set `a` (4, n), wrench margin alone; returns as `gale` does."""
    n, least = a.shape[1], np.inf
    _sizes(a, n, sizes)
    for i in range(n):
        for j in range(i + 1, n):
            minors = _pair(a, i, j)
            for k in range(j + 1, n):
                d = _cross4(minors, a, k)
                both = d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + d[3] * d[3]
                dull = _dull(both, sizes[i] * sizes[j] * sizes[k])
                if dull == 1:
                    continue
                if dull == 2:
                    return -1
                height = _width(a, n, d)
                along = d[0] * y[0] + d[1] * y[1] + d[2] * y[2] + d[3] * y[3]
                slack = 0.5 * height - abs(along)
                if slack < INSIDE * height:
                    if slack < -INSIDE * height:
                        return 0
                    slack = 0.0
                if slack * slack < FIRST * least * both:
                    least = slack * slack / both
                    sign = -1.0 if along < 0.0 else 1.0
                    for c in range(4):
                        normals[0, 2 + c] = sign * d[c]
    squared[0] = least
    return 1


@bare(fastmath=FAST)
def _lifted(rows, n, d):
    """Returns |d_f|² and |d_τ|² of the normal d, given in a basis that `rows` carry."""
    force, torque = 0.0, 0.0
    for c in range(n + 2, n + 5):
        x = d[0] * rows[0, c] + d[1] * rows[1, c] + d[2] * rows[2, c] + d[3] * rows[3, c]
        w = d[0] * rows[0, c + 3] + d[1] * rows[1, c + 3]
        w += d[2] * rows[2, c + 3] + d[3] * rows[3, c + 3]
        force += x * x
        torque += w * w
    return force, torque


@bare(fastmath=FAST)
def _note(rows, n, d, out):
    """Writes the normal d to `out` (6,) in the coordinates that `rows` carry, on the side of y."""
    along = d[0] * rows[0, n] + d[1] * rows[1, n] + d[2] * rows[2, n] + d[3] * rows[3, n]
    sign = -1.0 if along < 0.0 else 1.0
    for c in range(6):
        at = n + 2 + c
        out[c] = d[0] * rows[0, at] + d[1] * rows[1, at] + d[2] * rows[2, at] + d[3] * rows[3, at]
        out[c] *= sign


@bare(fastmath=FAST)
def four_within(rows, n, squared, normals, sizes):
    """All margins of a full set in a 4-D subspace, `rows` as in `facets`; result as of `gale`."""
    none = (0.0, 0.0, 0.0, 0.0)
    first, second, third = none, none, none
    wrench, force, torque = np.inf, np.inf, np.inf
    _sizes(rows, n, sizes)
    for i in range(n):
        for j in range(i + 1, n):
            minors = _pair(rows, i, j)
            for k in range(j + 1, n):
                d = _cross4(minors, rows, k)
                both = d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + d[3] * d[3]
                dull = _dull(both, sizes[i] * sizes[j] * sizes[k])
                if dull == 1:
                    continue
                if dull == 2:
                    return -1
                height = _width(rows, n, d)
                along = d[0] * rows[0, n] + d[1] * rows[1, n]
                along += d[2] * rows[2, n] + d[3] * rows[3, n]
                slack = 0.5 * height - abs(along)
                if slack < INSIDE * height:
                    if slack < -INSIDE * height:
                        return 0
                    slack = 0.0
                gap = slack * slack
                linear, angular = _lifted(rows, n, d)
                if gap < FIRST * wrench * both:
                    wrench, first = gap / both, d
                if gap < FIRST * force * linear and linear > FLAT * angular:
                    force, second = gap / linear, d
                if gap < FIRST * torque * angular and angular > FLAT * linear:
                    torque, third = gap / angular, d
    squared[0], squared[1], squared[2] = wrench, force, torque
    _note(rows, n, first, normals[0])
    _note(rows, n, second, normals[1])
    _note(rows, n, third, normals[2])
    return 1
