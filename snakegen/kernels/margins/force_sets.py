"""Support of what one apparatus can push with: of its hull, and of a convex piece of it.

An apparatus pushes with λ u(φ, θ), u = Rx(φ) Ry(θ) e_z in the set's own axes. Its set is the union
of patches with |θ| ≤ π/2, each a row of constants (`PATCH` numbers), so that the farthest force
along a direction has a closed form. A convex piece of it is a polyhedral cone ``a_i · f ≥ 0`` cut
by ``‖f‖ ≤ L`` and ``m · f ≥ floor``, or a segment along m. Definitions: THEORY A4.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.types import Floats, Ints

# sin, cos of mid φ; cos of half its width; sin, cos of φ0, φ1, θ0, θ1; least, most λ; φ0, φ1, θ0,
# θ1; -1 for the far side of a reversible rotor
PATCH = 18
SEGMENT, HULL = -1, -2
OUT = 1e-10  # share of the largest force by which rounding may pass a face


class Sets(NamedTuple):
    """What n apparatuses push with: hulls of patches (faces = HULL), or convex pieces of them."""

    points: Floats  # (n, 4) where a force acts, and the drag torque along it per newton
    frames: Floats  # (n, 3, 3) the set's own axes in CoG axes
    rows: Floats  # (k, PATCH), patches in the set's own axes
    first: Ints  # (n + 1,) patches of apparatus j are rows first[j] … first[j + 1]
    faces: Ints  # (n,) of the piece's cone; SEGMENT, or HULL for the patches' hull
    normals: Floats  # (n, k, 3) of the cone's faces, pointing inside, CoG axes
    axis: Floats  # (n, 3) m, unit, CoG axes
    low: Floats  # (n,) floor along m
    high: Floats  # (n,) largest force
    corners: Ints  # (n,) of the piece
    corner: Floats  # (n, k, 3) forces at which its edges meet, CoG axes


@bare
def patch_farthest(x, y, z, row, u):
    """Writes the unit thrust (3,) of a patch that lies farthest along (x, y, z); their product."""
    flat = sqrt(y * y + z * z)
    sine, cosine = row[0], row[1]
    across = z * cosine - y * sine
    if flat > 0.0 and across >= flat * row[2]:
        sine, cosine, across = -y / flat, z / flat, flat
    else:
        first, last = z * row[4] - y * row[3], z * row[6] - y * row[5]
        if first >= last:
            sine, cosine, across = row[3], row[4], first
        else:
            sine, cosine, across = row[5], row[6], last
    size = sqrt(x * x + across * across)
    if (
        size > 0.0
        and across >= 0.0
        and x * row[10] <= across * row[9]
        and x * row[8] >= across * row[7]
    ):
        rise, level = x / size, across / size
    elif x * row[7] + across * row[8] >= x * row[9] + across * row[10]:
        rise, level = row[7], row[8]
    else:
        rise, level = row[9], row[10]
    u[0], u[1], u[2] = rise, -sine * level, cosine * level
    return x * rise + across * level


@bare
def hull_farthest(j, d, sets, u, f):
    """Writes the force (3,) of apparatus j that lies farthest along d, CoG axes; their product."""
    turn = sets.frames[j]
    x = turn[0, 0] * d[0] + turn[1, 0] * d[1] + turn[2, 0] * d[2]
    y = turn[0, 1] * d[0] + turn[1, 1] * d[1] + turn[2, 1] * d[2]
    z = turn[0, 2] * d[0] + turn[1, 2] * d[1] + turn[2, 2] * d[2]
    best = -np.inf
    for i in range(sets.first[j], sets.first[j + 1]):
        row = sets.rows[i]
        along = patch_farthest(x, y, z, row, u)
        strength = row[12] if along > 0.0 else row[11]
        if along * strength > best:
            best = along * strength
            for c in range(3):
                f[c] = turn[c, 0] * u[0] + turn[c, 1] * u[1] + turn[c, 2] * u[2]
                f[c] *= strength
    return best


@bare
def inside(j, x, y, z, sets):
    """Tells whether piece j holds a force no larger than its largest, but for rounding."""
    slack = OUT * sets.high[j]
    m, low = sets.axis[j], sets.low[j]
    if low > 0.0 and m[0] * x + m[1] * y + m[2] * z < low - slack:
        return False
    for i in range(sets.faces[j]):
        a = sets.normals[j, i]
        if a[0] * x + a[1] * y + a[2] * z < -slack:
            return False
    return True


@bare
def piece_farthest(j, d, sets, f):
    """Writes the force (3,) of piece j that lies farthest along d, CoG axes; their product.

    It is d itself, as long as can be, or else a corner, on a face's arc, or on the floor's rim.
    """
    m, most, low = sets.axis[j], sets.high[j], sets.low[j]
    rise = m[0] * d[0] + m[1] * d[1] + m[2] * d[2]
    if sets.faces[j] == SEGMENT:
        strength = most if rise > 0.0 else low
        f[0], f[1], f[2] = m[0] * strength, m[1] * strength, m[2] * strength
        return rise * strength
    size = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    if size > 0.0:
        s = most / size
        if inside(j, d[0] * s, d[1] * s, d[2] * s, sets):
            f[0], f[1], f[2] = d[0] * s, d[1] * s, d[2] * s
            return size * most
    best = -np.inf
    for k in range(sets.corners[j]):
        v = sets.corner[j, k]
        along = d[0] * v[0] + d[1] * v[1] + d[2] * v[2]
        if along > best:
            best = along
            f[0], f[1], f[2] = v[0], v[1], v[2]
    if low > 0.0:
        wide = sqrt(max(most * most - low * low, 0.0))
        x, y, z = d[0] - rise * m[0], d[1] - rise * m[1], d[2] - rise * m[2]
        across = sqrt(x * x + y * y + z * z)
        s = wide / across if across > 0.0 else 0.0
        x, y, z = low * m[0] + s * x, low * m[1] + s * y, low * m[2] + s * z
        along = d[0] * x + d[1] * y + d[2] * z
        if along > best and inside(j, x, y, z, sets):
            best = along
            f[0], f[1], f[2] = x, y, z
    for i in range(sets.faces[j]):
        a = sets.normals[j, i]
        out = a[0] * d[0] + a[1] * d[1] + a[2] * d[2]
        x, y, z = d[0] - out * a[0], d[1] - out * a[1], d[2] - out * a[2]
        out = a[0] * x + a[1] * y + a[2] * z  # once more, for what d across the face rounds off
        x, y, z = x - out * a[0], y - out * a[1], z - out * a[2]
        square = x * x + y * y + z * z
        if square <= 1e-28 * size * size or most * most * square <= best * max(best, 0.0):
            continue
        s = most / sqrt(square)
        x, y, z = x * s, y * s, z * s
        along = d[0] * x + d[1] * y + d[2] * z
        if along > best and inside(j, x, y, z, sets):
            best = along
            f[0], f[1], f[2] = x, y, z
    return best


@bare
def farthest(j, twist, sets, d, u, f):
    """Writes the force (3,) of apparatus j that lies farthest along a twist (6,); their product."""
    x, y, z, drag = sets.points[j, 0], sets.points[j, 1], sets.points[j, 2], sets.points[j, 3]
    d[0] = twist[0] + twist[4] * z - twist[5] * y + drag * twist[3]
    d[1] = twist[1] + twist[5] * x - twist[3] * z + drag * twist[4]
    d[2] = twist[2] + twist[3] * y - twist[4] * x + drag * twist[5]
    if sets.faces[j] == HULL:
        return hull_farthest(j, d, sets, u, f)
    return piece_farthest(j, d, sets, f)


@bare
def wrench_into(j, f, sets, out):
    """Writes the wrench (6,) of a force (3,) of apparatus j."""
    x, y, z, drag = sets.points[j, 0], sets.points[j, 1], sets.points[j, 2], sets.points[j, 3]
    out[0], out[1], out[2] = f[0], f[1], f[2]
    out[3] = y * f[2] - z * f[1] + drag * f[0]
    out[4] = z * f[0] - x * f[2] + drag * f[1]
    out[5] = x * f[1] - y * f[0] + drag * f[2]


@jit
def slack(twist, sets, hover):
    """Returns ``Σ h_j(d) - d · w0`` of the twist d (6,): how far the set reaches past hover."""
    d, u, f = np.empty(3), np.empty(3), np.empty(3)
    total = 0.0
    for j in range(sets.faces.size):
        total += farthest(j, twist, sets, d, u, f)
    for c in range(6):
        total -= twist[c] * hover[c]
    return total


@jit
def piece_support(j, d, sets, f):
    """Writes the force (3,) of piece j that lies farthest along d, CoG axes; their product.

    `piece_farthest` for callers from Python.
    """
    return piece_farthest(j, d, sets, f)
