"""Facets of a zonotope {Σ t_i a_i, |t_i| ≤ ½} in up to six dimensions, and its margins from them.

Every facet normal d is orthogonal to a rank-(r-1) subset of the columns. Here is the null-space
tree for any n and r, which eliminates one column a level, on rows
``[d·a_1 … d·a_n | d·y | d·u | d]``: row operations carry products and normal together (`gale` has
two quicker enumerations for common sizes). With ``slack = ½ Σ|d·a_i| - |d·y|`` (both signs of d at
once) the margins of THEORY A4 are slack/‖d‖ (wrench), slack/‖d_f‖ (force), slack/‖d_τ‖ (torque).
"""

import numpy as np

from snakegen.kernels.jit import jit

FAST = {"reassoc", "contract", "nsz", "arcp"}
DEPENDENT = 1e-10  # a column whose remainder is below this share of itself spans nothing new
FLAT = 1e-18  # a facet tilted less than this (squared) along a slice does not bound it
INSIDE = 1e-12  # of h(d): how far outside a facet rounding alone can put a point
FIRST = 1.0 - 1e-11  # of margin²: where facets tie by symmetry the first is kept


@jit(fastmath=FAST)
def score(slack, height, d, squared, normals):
    """Takes one facet into `squared` (3,), the smallest margins², and their `normals` (3, 6).

    Returns False where the point lies outside the facet; margins are squared to spare divisions.
    """
    if slack < INSIDE * height:
        if slack < -INSIDE * height:
            return False
        slack = 0.0
    force = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    torque = d[3] * d[3] + d[4] * d[4] + d[5] * d[5]
    both = force + torque
    gap = slack * slack
    if gap < FIRST * squared[0] * both:
        squared[0] = gap / both
        normals[0] = d
    if gap < FIRST * squared[1] * force and force > FLAT * torque:
        squared[1] = gap / force
        normals[1] = d
    if gap < FIRST * squared[2] * torque and torque > FLAT * force:
        squared[2] = gap / torque
        normals[2] = d
    return True


@jit(fastmath=FAST)
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


@jit(fastmath=FAST)
def _leaf(rows, start, n, sizes, squared, normals, span, shoot):
    """Facets from two remaining rows and the columns from `start` on; False where outside."""
    d = np.empty(6)
    for j in range(start, n):
        p, q = rows[0, j], rows[1, j]
        if p * p + q * q <= (DEPENDENT * sizes[j]) ** 2:
            continue
        height = 0.0
        for i in range(n):
            height += abs(p * rows[1, i] - q * rows[0, i])
        along = p * rows[1, n] - q * rows[0, n]
        if along < 0.0:  # of the facet and its opposite, the one that y is nearer to
            p, q, along = -p, -q, -along
        for c in range(6):
            d[c] = p * rows[1, n + 2 + c] - q * rows[0, n + 2 + c]
        if shoot:
            length = np.sqrt(d @ d)
            toward = p * rows[1, n + 1] - q * rows[0, n + 1]
            _shoot((0.5 * height - along) / length, along / length, toward / length, span)
        elif not score(0.5 * height - along, height, d, squared, normals):
            return False
    return True


@jit(fastmath=FAST)
def _eliminate(above, below, k, n, column, size):
    """Writes the `k` rows `above`, freed of `column`, to the k - 1 rows `below`."""
    pivot, largest = 0, 0.0
    for i in range(k):
        if abs(above[i, column]) > largest:
            pivot, largest = i, abs(above[i, column])
    if largest <= DEPENDENT * size:
        return False
    to = 0
    for i in range(k):
        if i != pivot:
            factor = above[i, column] / above[pivot, column]
            for j in range(n + 8):
                below[to, j] = above[i, j] - factor * above[pivot, j]
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
        sign = -1.0 if rows[0, n] < 0.0 else 1.0
        return score(slack, height, sign * rows[0, n + 2 : n + 8], squared, normals)
    last = r - 2
    if last == 0:
        return _leaf(stack[0], 0, n, sizes, squared, normals, span, shoot)
    chosen = np.full(6, -1)
    depth = 0
    while depth >= 0:
        chosen[depth] += 1
        j = chosen[depth]
        if j > n - (r - 1 - depth):
            depth -= 1
            continue
        if not _eliminate(stack[depth], stack[depth + 1], r - depth, n, j, sizes[j]):
            continue
        if depth + 1 < last:
            depth += 1
            chosen[depth] = j
        elif not _leaf(stack[last], j + 1, n, sizes, squared, normals, span, shoot):
            return False
    return True
