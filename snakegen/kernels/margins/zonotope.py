"""Exact margins of a thrust set {Q λ, λ_min ≤ λ ≤ λ_max}: one call for a batch of postures.

Each posture is scaled, tested for rank and handed to `facets`; a set of lower rank is treated in
its own subspace, a hover outside it by `nearest`. Definitions: THEORY A4.
"""

import numpy as np

from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.margins.facets import tree
from snakegen.kernels.margins.facets4 import four, four_within
from snakegen.kernels.margins.gale import gale, invert_basis
from snakegen.kernels.margins.min_norm_point import nearest
from snakegen.kernels.margins.wrench_subspace import OFF, RANK_TOLERANCE, lost_direction, subspace

THIN = 1e-9  # of σ_1: a ray sees a set this thin as it is, though its rank counts as less


@bare
def _fill(rows, a, y, basis):
    """Writes ``basisᵀ [a | y | 0 | E]`` to `rows`, six columns kept for the normal."""
    d, n = a.shape
    r = basis.shape[1]
    for i in range(r):
        for j in range(n):
            rows[i, j] = 0.0
            for c in range(d):
                rows[i, j] += basis[c, i] * a[c, j]
        rows[i, n] = 0.0
        rows[i, n + 1] = 0.0
        for c in range(6):
            rows[i, n + 2 + c] = 0.0
        for c in range(d):
            rows[i, n] += basis[c, i] * y[c]
            rows[i, n + 2 + c + 6 - d] = basis[c, i]


@jit
def _whole(rows, a, y):
    """As `_fill` with the identity for a basis: the set has full rank."""
    d, n = a.shape
    for i in range(d):
        rows[i, :n] = a[i]
        rows[i, n] = y[i]
        rows[i, n + 1 : n + 8] = 0.0
        rows[i, n + 2 + i + 6 - d] = 1.0


@jit
def _outside(a, y, margin, normals):
    """Sets the signed wrench margin of an infeasible hover: minus the distance to the set."""
    d = a.shape[0]
    x, distance = np.empty(d), 0.0
    nearest(a, y, x)
    for c in range(d):
        distance += x[c] * x[c]
    margin[0] = -np.sqrt(distance)
    for c in range(d):
        normals[0, 6 - d + c] = x[c] / margin[0]


@jit
def _within(a, y, margin, normals, squared, spare):
    """Margins (3,) where `a` (d, n) is rank-deficient: in its own subspace. Returns the rank."""
    rows, stack, sizes, span = spare
    d, n = a.shape
    basis, lost = subspace(a, RANK_TOLERANCE)
    r = basis.shape[1]
    for i in range(d - r):
        # a direction counts as lost below the rank tolerance: its set is thin, not without width
        thickness, off = 0.0, 0.0
        for c in range(d):
            off += lost[c, i] * y[c]
        for j in range(n):
            along = 0.0
            for c in range(d):
                along += lost[c, i] * a[c, j]
            thickness += 0.5 * abs(along)
        if abs(off) > thickness + OFF:
            _outside(a, y, margin, normals)
            return r
    if r > 0:
        _fill(rows, a, y, basis)
        state = four_within(rows, n, squared, normals, sizes) if r == 4 and n > 3 else -1
        if state < 0:
            squared[:] = np.inf
            state = int(tree(rows, r, n, stack, sizes, squared, normals, span, False))
        if state == 0:
            normals[:] = 0.0
            _outside(a, y, margin, normals)
            return r
    margin[0], margin[1], margin[2] = np.sqrt(squared[0]), np.sqrt(squared[1]), np.sqrt(squared[2])
    if r < d:
        margin[0] = 0.0
        normals[0] = 0.0
        lost_direction(lost, 0, d, normals[0])
        if d == 6:
            direction = np.zeros(6)
            for k in range(2):
                if lost_direction(lost, 3 * k, 3 * k + 3, direction) > OFF:
                    margin[1 + k] = 0.0
                    normals[1 + k] = direction
    return r


@jit
def _by_tree(a, y, squared, normals, spare):
    """The facets of a set of full rank by the tree; returns 1, or 0 where y lies outside."""
    rows, stack, sizes, span = spare
    squared[:] = np.inf
    _whole(rows, a, y)
    return int(tree(rows, a.shape[0], a.shape[1], stack, sizes, squared, normals, span, False))


@bare
def _six(a, y, margin, normals, squared, table, order, ins, out):
    """The common case of full rank, quickly: margins (3,) and normals (3, 6) of `a` (6, n) about y.

    Returns 1 done, 0 where y lies outside, -1 where the facets need the tree, -2 where the rank
    may be lower.
    """
    _clear(margin, normals, squared)
    if a.shape[1] < 6 or invert_basis(a, table, order) <= RANK_TOLERANCE:
        return -2
    if a.shape[1] != 8:
        return -1
    state = gale(table, order, y, squared, normals, ins, out)
    _roots(margin, squared)
    return state


@bare
def _four(a, y, known, margin, normals, squared, table, order, sizes):
    """As `_six` for `a` (4, n), the wrench margin alone; `known` says that its rank is full."""
    _clear(margin, normals, squared)
    if not known and (a.shape[1] < 4 or invert_basis(a, table, order) <= RANK_TOLERANCE):
        return -2
    state = four(a, y, squared, normals, sizes)
    _roots(margin, squared)
    return state


@bare
def _clear(margin, normals, squared):
    for i in range(3):
        squared[i], margin[i] = np.inf, np.nan
        for c in range(6):
            normals[i, c] = 0.0


@bare
def _roots(margin, squared):
    for i in range(3):
        margin[i] = np.sqrt(squared[i])


@jit
def _slowly(state, a, y, margin, normals, squared, spare):
    """Finishes what `_six` or `_four` left with `state` below 1; returns the rank."""
    d = a.shape[0]
    _clear(margin, normals, squared)
    if state == -2:
        return _within(a, y, margin, normals, squared, spare)
    if state == -1 and _by_tree(a, y, squared, normals, spare) == 1:
        _roots(margin, squared)
        return d
    _clear(margin, normals, squared)
    _outside(a, y, margin, normals)
    return d


@jit
def spare_space(n):
    """Returns the arrays that the slower ways and `along` use over and over, for `n` columns."""
    return np.zeros((6, n + 8)), np.zeros((6, 6, n + 8)), np.zeros(n), np.zeros(2)


@bare
def scaled_set(q, half, middle, hover, scale, a, y):
    """Writes the scaled columns (6, n) of full width and the hover seen from their centre (6,)."""
    n = half.size
    for c in range(6):
        shift = 0.0
        for j in range(n):
            a[c, j] = q[c, j] * half[j] * (2.0 / scale[c])
            shift += q[c, j] * middle[j]
        y[c] = (hover[c] - shift) / scale[c]


@jit
def batch(q, half, middle, hover, scale, margins, normals, ranks):
    """Margins (m, 4) and normals (m, 4, 6), scaled: wrench, force, torque, attitude_altitude.

    `q` (m, 6, n), `half` and `middle` (n,) of the limits, `hover` (m, 6), `scale` (6,). Where
    hover is infeasible the first is minus the distance and force and torque are nan.
    """
    n = q.shape[2]
    a, y, a4, y4 = np.empty((6, n)), np.empty(6), np.empty((4, n)), np.empty(4)
    margin, normal, squared = np.empty(3), np.empty((3, 6)), np.empty(3)
    table, order, ins, out = (
        np.empty((6, n + 6)),
        np.empty(6, np.int64),
        np.empty(236),
        np.empty(168),
    )
    table4, order4, spare = np.empty((4, n + 4)), np.empty(4, np.int64), spare_space(n)
    for i in range(q.shape[0]):
        scaled_set(q[i], half, middle, hover[i], scale, a, y)
        state = _six(a, y, margin, normal, squared, table, order, ins, out)
        rank = 6 if state == 1 else _slowly(state, a, y, margin, normal, squared, spare)
        ranks[i] = rank
        for k in range(3):
            margins[i, k] = margin[k]
            for c in range(6):
                normals[i, k, c] = normal[k, c]
        for c in range(4):
            y4[c] = y[2 + c]
            for j in range(n):
                a4[c, j] = a[2 + c, j]
        # σ_4 of four of its rows is no less than σ_6 of all, nor σ_1 more
        state = _four(a4, y4, rank == 6, margin, normal, squared, table4, order4, spare[2])
        if state < 1:
            _slowly(state, a4, y4, margin, normal, squared, spare)
        margins[i, 3] = margin[0]
        for c in range(6):
            normals[i, 3, c] = normal[0, c]


@jit
def along(q, half, middle, hover, scale, u):
    """Largest t with ``hover + t u`` in the set, nan where the line misses it; `u` (6,) scaled."""
    n = q.shape[1]
    a, y = np.empty((6, n)), np.empty(6)
    scaled_set(q, half, middle, hover, scale, a, y)
    basis, lost = subspace(a, THIN)
    span = np.array([-np.inf, np.inf])
    for i in range(lost.shape[1]):
        toward, off = 0.0, 0.0
        for c in range(6):
            toward += lost[c, i] * u[c]
            off += lost[c, i] * y[c]
        thickness = 0.0  # of a set too thin for facets, and not flat
        for j in range(n):
            part = 0.0
            for c in range(6):
                part += lost[c, i] * a[c, j]
            thickness += 0.5 * abs(part)
        if abs(toward) > OFF:
            near, far = (-thickness - off) / toward, (thickness - off) / toward
            span[0], span[1] = max(span[0], min(near, far)), min(span[1], max(near, far))
        elif abs(off) > thickness + OFF:
            return np.nan
    r = basis.shape[1]
    if r > 0:
        rows, stack, sizes, _ = spare_space(n)
        _fill(rows, a, y, basis)
        for i in range(r):
            for c in range(6):
                rows[i, n + 1] += basis[c, i] * u[c]
        tree(rows, r, n, stack, sizes, np.zeros(3), np.zeros((3, 6)), span, True)
    return span[1] if span[1] >= span[0] - OFF * (1.0 + abs(span[0])) else np.nan
