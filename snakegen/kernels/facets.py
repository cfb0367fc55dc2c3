"""Facets of a zonotope {Σ t_i a_i, |t_i| ≤ ½} in up to six dimensions, and its margins from them.

Every facet normal d is orthogonal to a rank-(r-1) subset of the columns. Two enumerations: the
Gale dual where n - r = 2 (a facet is a triple of rows of the null space), and a null-space tree
for any n and r, which eliminates one column a level. Work happens on rows
``[d·a_1 … d·a_n | d·y | d·u | d]``: row operations on them carry products and normal together.
With ``slack = ½ Σ|d·a_i| - |d·y|`` (both signs of d at once) the margins of THEORY A4 are
slack/‖d‖ (wrench), slack/‖d_f‖ (force), slack/‖d_τ‖ (torque).
"""

import numpy as np

from snakegen.kernels.jit import jit

FAST = {"reassoc", "contract", "nsz", "arcp"}
DEPENDENT = 1e-10  # a column whose remainder is below this share of itself spans nothing new
GREY = 1e-5  # triples of the Gale dual below this share lose digits: the tree takes over
FLAT = 1e-18  # a facet tilted less than this (squared) along a slice does not bound it
INSIDE = 1e-12  # of h(d): how far outside a facet rounding alone can put a point


@jit(fastmath=FAST)
def score(slack, height, d, squared, normals):
    """Takes one facet into `squared` (3,), the smallest margins², and their `normals` (3, 6).

    Returns False where the point lies outside the facet; margins are squared to spare divisions.
    """
    if slack < 0.0:
        if slack < -INSIDE * height:
            return False
        slack = 0.0
    force = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    torque = d[3] * d[3] + d[4] * d[4] + d[5] * d[5]
    both = force + torque
    gap = slack * slack
    if gap < squared[0] * both:
        squared[0] = gap / both
        normals[0] = d
    if gap < squared[1] * force and force > FLAT * torque:
        squared[1] = gap / force
        normals[1] = d
    if gap < squared[2] * torque and torque > FLAT * force:
        squared[2] = gap / torque
        normals[2] = d
    return True


@jit
def invert_basis(a, table, order):
    """Inverts the best-conditioned square part of `a` (r, n) by full-pivot Gauss-Jordan.

    `table` (r, n + r) ends as ``[B⁻¹a | B⁻¹]``, row i belonging to column ``order[i]``.
    Returns ``1/(‖B⁻¹‖ ‖a‖)`` (Frobenius), a lower bound of σ_r/σ_1; 0 where it breaks down.
    """
    r, n = a.shape
    total = 0.0
    for i in range(r):
        order[i] = -1
        for j in range(n):
            table[i, j] = a[i, j]
            total += a[i, j] * a[i, j]
        for j in range(r):
            table[i, n + j] = 0.0
        table[i, n + i] = 1.0
    for _ in range(r):
        row, column, largest = -1, -1, 0.0
        for i in range(r):
            if order[i] < 0:
                for j in range(n):
                    if abs(table[i, j]) > largest:
                        row, column, largest = i, j, abs(table[i, j])
        if largest <= 1e-13 * np.sqrt(total):
            return 0.0
        order[row] = column
        pivot = 1.0 / table[row, column]
        for j in range(n + r):
            table[row, j] *= pivot
        for i in range(r):
            if i != row and table[i, column] != 0.0:
                factor = table[i, column]
                for j in range(n + r):
                    table[i, j] -= factor * table[row, j]
    size = 0.0
    for i in range(r):
        for j in range(r):
            size += table[i, n + j] ** 2
    return 1.0 / np.sqrt(size * total)


@jit(fastmath=FAST)
def _dual(table, order, y, null, right, minors):
    """Fills the null space (8, 2), the right inverse with `y` (7·8) and the minors (8·8), flat.

    Returns the size of the largest minor that could occur.
    """
    null[:] = 0.0
    right[:] = 0.0
    free, largest = 0, 1.0
    for j in range(8):
        taken = False
        for i in range(6):
            taken = taken or order[i] == j
        if not taken:
            null[j, free] = 1.0
            for i in range(6):
                null[order[i], free] = -table[i, j]
                largest = max(largest, abs(table[i, j]))
            free += 1
    for i in range(6):
        at = order[i]
        for j in range(6):
            right[8 * j + at] = table[i, 8 + j]
            right[48 + at] += table[i, 8 + j] * y[j]
    for i in range(8):
        for j in range(8):
            minors[8 * i + j] = null[i, 0] * null[j, 1] - null[i, 1] * null[j, 0]
    return largest * largest


@jit(fastmath=FAST)
def gale(table, order, y, squared, normals, null, right, minors, lanes):
    """Facets of rank 6 with 8 columns, from `invert_basis`; 1 done, 0 outside, -1 ask the tree.

    A facet's five columns leave a triple (i, j, k); ``d·a`` there is the cross product of the
    null space's two columns (8, 2) restricted to the triple, and 0 on the other five. For each
    (i, j) all eight k are worked at once, in `lanes` (5·8): one vector instruction serves several.
    """
    grey = GREY * _dual(table, order, y, null, right, minors)
    best = np.full(3, -1)
    for i in range(6):
        for j in range(i + 1, 7):
            z_k = minors[8 * i + j]
            for k in range(8):
                z_i, z_j = minors[8 * j + k], -minors[8 * i + k]
                force, torque = 0.0, 0.0
                for c in range(3):
                    d = z_i * right[8 * c + i] + z_j * right[8 * c + j] + z_k * right[8 * c + k]
                    force += d * d
                for c in range(3, 6):
                    d = z_i * right[8 * c + i] + z_j * right[8 * c + j] + z_k * right[8 * c + k]
                    torque += d * d
                along = z_i * right[48 + i] + z_j * right[48 + j] + z_k * right[48 + k]
                lanes[k] = force
                lanes[8 + k] = torque
                lanes[16 + k] = abs(z_i) + abs(z_j) + abs(z_k)
                lanes[24 + k] = 0.5 * lanes[16 + k] - abs(along)
            for k in range(j + 1, 8):
                height, slack = lanes[16 + k], lanes[24 + k]
                if height < grey:
                    if height < 1e-9 * grey:
                        continue
                    return -1
                if slack < 0.0:
                    if slack < -INSIDE * height:
                        return 0
                    slack = 0.0
                force, torque, gap = lanes[k], lanes[8 + k], slack * slack
                if gap < squared[0] * (force + torque):
                    squared[0] = gap / (force + torque)
                    best[0] = 64 * i + 8 * j + k
                if gap < squared[1] * force and force > FLAT * torque:
                    squared[1] = gap / force
                    best[1] = 64 * i + 8 * j + k
                if gap < squared[2] * torque and torque > FLAT * force:
                    squared[2] = gap / torque
                    best[2] = 64 * i + 8 * j + k
    for b in range(3):
        i, j, k = best[b] // 64, best[b] // 8 % 8, best[b] % 8
        for c in range(6 if best[b] >= 0 else 0):
            normals[b, c] = (
                minors[8 * j + k] * right[8 * c + i]
                - minors[8 * i + k] * right[8 * c + j]
                + minors[8 * i + j] * right[8 * c + k]
            )
    return 1


@jit(fastmath=FAST)
def _cross4(a, i, j, d, k):
    """Writes to `d` (4,) the generalised cross product of columns i, j, k of `a` (4, n)."""
    p01, p02 = a[0, i] * a[1, j] - a[1, i] * a[0, j], a[0, i] * a[2, j] - a[2, i] * a[0, j]
    p03, p12 = a[0, i] * a[3, j] - a[3, i] * a[0, j], a[1, i] * a[2, j] - a[2, i] * a[1, j]
    p13, p23 = a[1, i] * a[3, j] - a[3, i] * a[1, j], a[2, i] * a[3, j] - a[3, i] * a[2, j]
    d[0] = p12 * a[3, k] - p13 * a[2, k] + p23 * a[1, k]
    d[1] = p03 * a[2, k] - p02 * a[3, k] - p23 * a[0, k]
    d[2] = p01 * a[3, k] - p03 * a[1, k] + p13 * a[0, k]
    d[3] = p02 * a[1, k] - p01 * a[2, k] - p12 * a[0, k]


@jit(fastmath=FAST)
def four(a, y, squared, normals, heights, sizes):
    """Facets of a full set `a` (4, n), wrench margin alone; returns as `gale` does.

    |det| of every four columns is worked once and added to `heights` (n, n, n) of the triples
    that see it; a triple's normal is the generalised cross product of its columns.
    """
    n = a.shape[1]
    d = np.empty(4)
    for k in range(n):
        sizes[k] = np.sqrt(a[0, k] ** 2 + a[1, k] ** 2 + a[2, k] ** 2 + a[3, k] ** 2)
        for i in range(k):
            for j in range(i + 1, k):
                heights[i, j, k] = 0.0
    for i in range(n):
        for j in range(i + 1, n):
            for k in range(j + 1, n):
                _cross4(a, i, j, d, k)
                for l in range(k + 1, n):
                    det = abs(d[0] * a[0, l] + d[1] * a[1, l] + d[2] * a[2, l] + d[3] * a[3, l])
                    heights[i, j, k] += det
                    heights[i, j, l] += det
                    heights[i, k, l] += det
                    heights[j, k, l] += det
                # the later columns have all been added by now, the earlier ones before
                both = d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + d[3] * d[3]
                whole = (GREY * sizes[i] * sizes[j] * sizes[k]) ** 2
                if both < whole:
                    if both < 1e-12 * whole:
                        continue
                    return -1
                height = heights[i, j, k]
                slack = 0.5 * height - abs(d[0] * y[0] + d[1] * y[1] + d[2] * y[2] + d[3] * y[3])
                if slack < 0.0:
                    if slack < -INSIDE * height:
                        return 0
                    slack = 0.0
                if slack * slack < squared[0] * both:
                    squared[0] = slack * slack / both
                    normals[0, 2:6] = d
    return 1


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
        for c in range(6):
            d[c] = p * rows[1, n + 2 + c] - q * rows[0, n + 2 + c]
        if shoot:
            length = np.sqrt(d @ d)
            toward = p * rows[1, n + 1] - q * rows[0, n + 1]
            _shoot((0.5 * height - abs(along)) / length, along / length, toward / length, span)
        elif not score(0.5 * height - abs(along), height, d, squared, normals):
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
        return score(slack, height, rows[0, n + 2 : n + 8].copy(), squared, normals)
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
