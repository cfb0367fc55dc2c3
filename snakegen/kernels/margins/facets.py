"""Facets of a zonotope {Σ t_i a_i, |t_i| ≤ ½} in up to six dimensions, and its margins from them.

Every facet normal d is orthogonal to a rank-(r-1) subset of the columns. Here is the null-space
tree for any n and r, which eliminates one column a level, on rows
``[d·a_1 … d·a_n | d·y | d·u | d]``: row operations carry products and normal together (`gale` has
two quicker enumerations for common sizes). With ``slack = ½ Σ|d·a_i| - |d·y|`` (both signs of d at
once) the margins of THEORY A4 are slack/‖d‖ (wrench), slack/‖d_f‖ (force), slack/‖d_τ‖ (torque).
"""

import numpy as np

from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.no_alloc import bare

FAST = {"reassoc", "contract", "nsz", "arcp"}
DEPENDENT = 1e-10  # a column whose remainder is below this share of itself spans nothing new
FLAT = 1e-18  # a facet tilted less than this (squared) along a slice does not bound it
INSIDE = 1e-12  # of h(d): how far outside a facet rounding alone can put a point
FIRST = 1.0 - 1e-11  # of margin²: where facets tie by symmetry the first is kept


@jit(inline="always")
def _note(stack, at, n, p, q, normals, k):
    for c in range(6):
        normals[k, c] = p * stack[at, 1, n + 2 + c] - q * stack[at, 0, n + 2 + c]


@bare(fastmath=FAST)
def _score(slack, height, stack, at, n, p, q, squared, normals):
    """Takes the facet of normal ``p row_1 - q row_0`` into `squared` (3,) and `normals` (3, 6).

    Returns False where the point lies outside the facet; margins are squared to spare divisions.
    """
    if slack < INSIDE * height:
        if slack < -INSIDE * height:
            return False
        slack = 0.0
    force, torque = 0.0, 0.0
    for c in range(3):
        x = p * stack[at, 1, n + 2 + c] - q * stack[at, 0, n + 2 + c]
        w = p * stack[at, 1, n + 5 + c] - q * stack[at, 0, n + 5 + c]
        force += x * x
        torque += w * w
    both, gap = force + torque, slack * slack
    if gap < FIRST * squared[0] * both:
        squared[0] = gap / both
        _note(stack, at, n, p, q, normals, 0)
    if gap < FIRST * squared[1] * force and force > FLAT * torque:
        squared[1] = gap / force
        _note(stack, at, n, p, q, normals, 1)
    if gap < FIRST * squared[2] * torque and torque > FLAT * force:
        squared[2] = gap / torque
        _note(stack, at, n, p, q, normals, 2)
    return True


@bare(fastmath=FAST)
def _shoot(slack, along, toward, span):
    """Cuts `span` (2,), the t with ``y + t u`` between the facet and its opposite."""
    if abs(toward) > 1e-14:
        if toward < 0.0:
            along, toward = -along, -toward
        height = slack + abs(along)
        span[0] = max(span[0], (-height - along) / toward)
        span[1] = min(span[1], (height - along) / toward)
    elif slack < -INSIDE:
        span[0], span[1] = 1.0, 0.0


@bare(fastmath=FAST)
def _width(stack, at, n, p, q):
    """Returns ``Σ |p row_1 - q row_0|`` over the columns."""
    total = 0.0
    for i in range(n):
        total += abs(p * stack[at, 1, i] - q * stack[at, 0, i])
    return total


@bare(fastmath=FAST)
def _leaf(stack, at, start, n, sizes, squared, normals, span, shoot):
    """Facets of the two rows of ``stack[at]`` and columns from `start` on; False where outside."""
    for j in range(start, n):
        p, q = stack[at, 0, j], stack[at, 1, j]
        if p * p + q * q <= (DEPENDENT * sizes[j]) ** 2:
            continue
        height = _width(stack, at, n, p, q)
        along = p * stack[at, 1, n] - q * stack[at, 0, n]
        if along < 0.0:  # of the facet and its opposite, the one that y is nearer to
            p, q, along = -p, -q, -along
        if shoot:
            square = 0.0
            for c in range(6):
                square += (p * stack[at, 1, n + 2 + c] - q * stack[at, 0, n + 2 + c]) ** 2
            unit = 1.0 / np.sqrt(square)
            toward = p * stack[at, 1, n + 1] - q * stack[at, 0, n + 1]
            _shoot((0.5 * height - along) * unit, along * unit, toward * unit, span)
        elif not _score(0.5 * height - along, height, stack, at, n, p, q, squared, normals):
            return False
    return True


@bare(fastmath=FAST)
def _eliminate(stack, at, k, n, column, size):
    """Writes the k rows of ``stack[at]``, freed of `column`, to the k - 1 rows of the next."""
    pivot, largest = 0, 0.0
    for i in range(k):
        if abs(stack[at, i, column]) > largest:
            pivot, largest = i, abs(stack[at, i, column])
    if largest <= DEPENDENT * size:
        return False
    to, inverse = 0, 1.0 / stack[at, pivot, column]
    for i in range(k):
        if i != pivot:
            factor = stack[at, i, column] * inverse
            for j in range(n + 8):
                stack[at + 1, to, j] = stack[at, i, j] - factor * stack[at, pivot, j]
            to += 1
    return True


@jit
def tree(rows, r, n, stack, sizes, squared, normals, span, shoot):
    """Visits every facet of `n` columns in `r` ≥ 1 dimensions; False where y lies outside.

    `rows` (r, n + 8) = ``[a | y | u | basis]``; `stack` (≥ 5, ≥ 6, n + 8) is work space. With
    `shoot`, fills `span` (2,) along u in place of the margins.
    """
    for j in range(n):
        size = 0.0
        for i in range(r):
            size += rows[i, j] ** 2
        sizes[j] = np.sqrt(size)
    for i in range(r):
        stack[0, i, : n + 8] = rows[i, : n + 8]
    if r == 1:
        height = np.abs(rows[0, :n]).sum()
        slack = 0.5 * height - abs(rows[0, n])
        if shoot:
            _shoot(slack, rows[0, n], rows[0, n + 1], span)
            return True
        stack[0, 1, : n + 8] = 0.0
        sign = 1.0 if rows[0, n] < 0.0 else -1.0
        return _score(slack, height, stack, 0, n, 0.0, sign, squared, normals)
    last = r - 2
    if last == 0:
        return _leaf(stack, 0, 0, n, sizes, squared, normals, span, shoot)
    chosen = np.full(6, -1)
    depth = 0
    while depth >= 0:
        chosen[depth] += 1
        j = chosen[depth]
        if j > n - (r - 1 - depth):
            depth -= 1
            continue
        if not _eliminate(stack, depth, r - depth, n, j, sizes[j]):
            continue
        if depth + 1 < last:
            depth += 1
            chosen[depth] = j
        elif not _leaf(stack, last, j + 1, n, sizes, squared, normals, span, shoot):
            return False
    return True
