"""Facets of a zonotope of 8 columns and full rank in 6-D, by its Gale dual.

A facet is a triple of rows of the null space, an (8, 2) matrix. Where a triple is nearly
dependent and would lose digits this gives up; then the tree of `facets` takes over.
"""

import numpy as np

from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.margins.facets import FAST, FIRST, FLAT, INSIDE

GREY = 1e-5  # triples below this share (but not zero) lose digits
NULL, MINOR = 112, 152  # where the null space and its minors stand in `ins`
ORBITS = ((1, 2), (1, 3), (1, 4), (1, 5), (1, 6), (2, 4), (2, 5))  # triples up to rotation


def _triples():
    """Returns (56, 4): place in the orbits, then i < j < k, in the order of i, j, k."""
    place = {
        tuple(sorted((a, (a + s) % 8, (a + t) % 8))): 8 * orbit + a
        for orbit, (s, t) in enumerate(ORBITS)
        for a in range(8)
    }
    return np.array([(place[triple], *triple) for triple in sorted(place)])


TRIPLES = _triples()


@bare
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


@bare(fastmath=FAST)
def _dual(table, order, y, ins):
    """Fills `ins` (236,), every row of eight repeated so that it can be read from any start.

    From 0 the right inverse, six rows of 16, and the right inverse times `y`; from 112 the null
    space's two columns, 20 long; from 152, twelve long, the minors of its rows a and a + s for
    s = 1…6. Returns the size of the largest minor that could occur.
    """
    ins[:152] = 0.0
    free, largest = 0, 1.0
    for j in range(8):
        taken = False
        for i in range(6):
            taken = taken or order[i] == j
        if not taken:
            ins[NULL + 20 * free + j] = 1.0
            for i in range(6):
                ins[NULL + 20 * free + order[i]] = -table[i, j]
                largest = max(largest, abs(table[i, j]))
            free += 1
    for i in range(6):
        along = 0.0
        for j in range(6):
            ins[16 * j + order[i]] = table[i, 8 + j]
            along += table[i, 8 + j] * y[j]
        ins[96 + order[i]] = along
    for c in range(7):
        for a in range(8):
            ins[16 * c + 8 + a] = ins[16 * c + a]
    for f in range(2):
        for a in range(12):
            ins[NULL + 20 * f + 8 + a] = ins[NULL + 20 * f + a]
    for s in range(1, 7):
        for a in range(12):
            whole = ins[NULL + a] * ins[NULL + 20 + a + s]
            ins[MINOR + 12 * s + a] = whole - ins[NULL + a + s] * ins[NULL + 20 + a]
    return largest * largest


@bare(fastmath=FAST)
def _orbits(ins, out, grey):
    """Writes margin² of wrench, force and torque of all 56 facets to `out` (3·56).

    Eight triples (a, a + s, a + t), a = 0…7 modulo 8, are worked at once: one vector instruction
    serves several. Returns how many facets have y outside, and how many are too nearly dependent.
    """
    outside, dull = 0.0, 0.0
    for orbit in range(7):
        s, t = ORBITS[orbit]
        for a in range(8):
            z_i, z_j = ins[MINOR + 12 * (t - s) + a + s], -ins[MINOR + 12 * t + a]
            z_k = ins[MINOR + 12 * s + a]
            force, torque = 0.0, 0.0
            for c in range(3):
                d = z_i * ins[16 * c + a] + z_j * ins[16 * c + a + s] + z_k * ins[16 * c + a + t]
                force += d * d
            for c in range(3, 6):
                d = z_i * ins[16 * c + a] + z_j * ins[16 * c + a + s] + z_k * ins[16 * c + a + t]
                torque += d * d
            along = z_i * ins[96 + a] + z_j * ins[96 + a + s] + z_k * ins[96 + a + t]
            height = abs(z_i) + abs(z_j) + abs(z_k)
            slack, rounding = 0.5 * height - abs(along), INSIDE * height
            none = height < 1e-9 * grey
            outside += 1.0 if slack < -rounding and not none else 0.0
            dull += 1.0 if height < grey and not none else 0.0
            gap = 0.0 if slack < rounding else slack * slack
            at = 8 * orbit + a
            out[at] = np.inf if none else gap / (force + torque)
            out[56 + at] = np.inf if none or force <= FLAT * torque else gap / force
            out[112 + at] = np.inf if none or torque <= FLAT * force else gap / torque
    return outside, dull


@bare(fastmath=FAST)
def gale(table, order, y, squared, normals, ins, out):
    """Facets of rank 6 with 8 columns, from `invert_basis`; 1 done, 0 outside, -1 ask the tree.

    A facet's five columns leave a triple (i, j, k); ``d·a`` there is the cross product of the
    null space's two columns (8, 2) restricted to the triple, and 0 on the other five. `ins` (236,)
    and `out` (168,) are work space.
    """
    outside, dull = _orbits(ins, out, GREY * _dual(table, order, y, ins))
    if dull > 0.0:
        return -1
    if outside > 0.0:
        return 0
    first, second, third = -1, -1, -1
    wrench, force, torque = np.inf, np.inf, np.inf
    for m in range(56):
        at = TRIPLES[m, 0]
        if out[at] < FIRST * wrench:
            wrench, first = out[at], m
        if out[56 + at] < FIRST * force:
            force, second = out[56 + at], m
        if out[112 + at] < FIRST * torque:
            torque, third = out[112 + at], m
    squared[0], squared[1], squared[2] = wrench, force, torque
    _normal6(ins, first, normals[0])
    _normal6(ins, second, normals[1])
    _normal6(ins, third, normals[2])
    return 1


@bare(fastmath=FAST)
def _normal6(ins, m, out):
    """Writes the normal (6,) of the facet that leaves triple m (none: -1), on the side of y."""
    if m < 0:
        return
    i, j, k = TRIPLES[m, 1], TRIPLES[m, 2], TRIPLES[m, 3]
    z_i = ins[NULL + j] * ins[NULL + 20 + k] - ins[NULL + k] * ins[NULL + 20 + j]
    z_j = ins[NULL + k] * ins[NULL + 20 + i] - ins[NULL + i] * ins[NULL + 20 + k]
    z_k = ins[NULL + i] * ins[NULL + 20 + j] - ins[NULL + j] * ins[NULL + 20 + i]
    if z_i * ins[96 + i] + z_j * ins[96 + j] + z_k * ins[96 + k] < 0.0:
        z_i, z_j, z_k = -z_i, -z_j, -z_k
    for c in range(6):
        out[c] = z_i * ins[16 * c + i] + z_j * ins[16 * c + j] + z_k * ins[16 * c + k]
