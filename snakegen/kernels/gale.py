"""Facets of full-rank zonotopes of common sizes: 8 columns in 6-D, any number in 4-D.

In 6-D the Gale dual makes facets cheap: each is a triple of rows of the null space, an (8, 2)
matrix. In 4-D, products of facets are 4×4 determinants, each shared by four facets. Both give up
where a triple is nearly dependent and would lose digits; then the tree of `facets` takes over.
"""

import numpy as np

from snakegen.kernels.facets import FAST, FIRST, FLAT, INSIDE
from snakegen.kernels.jit import jit

GREY = 1e-5  # triples below this share (but not zero) lose digits


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
                if slack < INSIDE * height:
                    if slack < -INSIDE * height:
                        return 0
                    slack = 0.0
                force, torque, gap = lanes[k], lanes[8 + k], slack * slack
                if gap < FIRST * squared[0] * (force + torque):
                    squared[0] = gap / (force + torque)
                    best[0] = 64 * i + 8 * j + k
                if gap < FIRST * squared[1] * force and force > FLAT * torque:
                    squared[1] = gap / force
                    best[1] = 64 * i + 8 * j + k
                if gap < FIRST * squared[2] * torque and torque > FLAT * force:
                    squared[2] = gap / torque
                    best[2] = 64 * i + 8 * j + k
    for b in range(3):
        i, j, k = best[b] // 64, best[b] // 8 % 8, best[b] % 8
        if best[b] < 0:
            continue
        z_i, z_j, z_k = minors[8 * j + k], -minors[8 * i + k], minors[8 * i + j]
        if z_i * right[48 + i] + z_j * right[48 + j] + z_k * right[48 + k] < 0.0:
            z_i, z_j, z_k = -z_i, -z_j, -z_k  # the facet that y is nearer to, not its opposite
        for c in range(6):
            normals[b, c] = z_i * right[8 * c + i] + z_j * right[8 * c + j] + z_k * right[8 * c + k]
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
                along = d[0] * y[0] + d[1] * y[1] + d[2] * y[2] + d[3] * y[3]
                slack = 0.5 * height - abs(along)
                if slack < INSIDE * height:
                    if slack < -INSIDE * height:
                        return 0
                    slack = 0.0
                if slack * slack < FIRST * squared[0] * both:
                    squared[0] = slack * slack / both
                    for c in range(4):
                        normals[0, 2 + c] = -d[c] if along < 0.0 else d[c]
    return 1
