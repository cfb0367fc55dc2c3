"""The subspace that a wrench set spans, and the directions that it has lost (THEORY A3).

Rank is a matter of singular values. Most sets are far from the tolerance, one way or the other:
there a pivoted Gram-Schmidt process proves the rank at a fraction of the SVD's cost.
"""

import numpy as np

from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.no_alloc import bare

RANK_TOLERANCE = 1e-6  # of σ_1, THEORY A3
OFF = 1e-9  # how far from its own subspace rounding can put a point of it, scaled
NOTHING = 1e-14  # of the largest column: what is left of columns that depend on the others
AMPLE = 50.0  # times √n: a last pivot overstates σ_r / σ_1 by at most √(4⁶ + 35) / 3 · √n, r ≤ 6


@bare
def _project(columns, k, basis, r):
    """Takes the first r columns of `basis` (d, d) out of column k, twice against rounding."""
    d = basis.shape[0]
    for _ in range(2):
        for i in range(r):
            along = 0.0
            for c in range(d):
                along += basis[c, i] * columns[c, k]
            for c in range(d):
                columns[c, k] -= along * basis[c, i]


@bare
def _longest(columns):
    """Returns the index and the length of the longest column."""
    at, largest = 0, -1.0
    for k in range(columns.shape[1]):
        size = 0.0
        for c in range(columns.shape[0]):
            size += columns[c, k] ** 2
        if size > largest:
            at, largest = k, size
    return at, np.sqrt(largest)


@bare
def _append(columns, k, basis, r):
    """Makes column k column r of `basis`, unit length, and takes it out of all the others."""
    d, n = columns.shape
    size = 0.0
    for c in range(d):
        size += columns[c, k] ** 2
    size = np.sqrt(size)
    for c in range(d):
        basis[c, r] = columns[c, k] / size
        columns[c, k] = 0.0
    for j in range(n):
        along = 0.0
        for c in range(d):
            along += basis[c, r] * columns[c, j]
        for c in range(d):
            columns[c, j] -= along * basis[c, r]


@jit
def _clear_rank(a, tolerance, basis):
    """Fills `basis` (d, d): r columns that span `a` (d, n), then the rest; r, -1 if unclear."""
    d, n = a.shape
    columns, axes = a.copy(), np.eye(d)
    largest, r = 0.0, 0
    while r < min(d, n):
        k, size = _longest(columns)
        largest = max(largest, size)
        if size <= NOTHING * largest or size == 0.0:
            break
        if size <= AMPLE * np.sqrt(float(n)) * tolerance * largest:
            return -1
        _project(columns, k, basis, r)
        _append(columns, k, basis, r)
        r += 1
    for i in range(d):
        _project(axes, i, basis, r)
    for i in range(r, d):
        k, _ = _longest(axes)
        _project(axes, k, basis, i)
        _append(axes, k, basis, i)
    return r


@jit
def subspace(a, tolerance):
    """Returns (range, lost): orthonormal columns spanning `a` (d, n), and their complement."""
    d, n = a.shape
    whole = np.empty((d, d))
    r = _clear_rank(a, tolerance, whole)
    if r < 0:
        padded = np.zeros((d, max(n, d)))
        padded[:, :n] = a
        u, s, _ = np.linalg.svd(padded)
        whole[:] = u
        r = 0
        while r < d and s[r] > tolerance * s[0] and s[r] > 0.0:
            r += 1
    return np.ascontiguousarray(whole[:, :r]), np.ascontiguousarray(whole[:, r:])


@bare
def lost_direction(lost, first, last, out):
    """Writes to `out` (6,) the lost direction that is nearest to one of the axes first…last-1.

    `lost` (d, k) has orthonormal columns. An axis' projection on their span does not depend on
    which basis of it the SVD chose. Returns its part along that axis, 0 where no direction is
    lost along any of them: then a slice along these axes keeps all its dimensions.
    """
    d = lost.shape[0]
    axis, largest = -1, 0.0
    for c in range(first, last):
        size = 0.0
        for k in range(lost.shape[1]):
            size += lost[c, k] ** 2
        if size > largest * (1.0 + OFF):
            axis, largest = c, size
    if axis < 0:
        return 0.0
    tilt = np.sqrt(largest)
    for c in range(d):
        part = 0.0
        for k in range(lost.shape[1]):
            part += lost[c, k] * lost[axis, k]
        out[6 - d + c] = part / tilt
    return tilt
