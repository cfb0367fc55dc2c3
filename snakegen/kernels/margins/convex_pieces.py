"""Convex pieces of the sets that apparatuses push with, each near a given force.

Within a patch |θ| ≤ π/2 a set is ``tanθ0 ρ ≤ f_x ≤ tanθ1 ρ``, ρ = ‖(f_y, f_z)‖, φ in a wedge and
``least ≤ ‖f‖ ≤ most``. With n a unit vector across x, n · f ≤ ρ: so ``f_x ≤ tanθ1 n · f`` lies
inside for θ1 ≥ 0, as ``m · f ≥ least`` lies outside the small ball; a range of θ that leaves out 0
is bounded by a convex cone, which a polygon of faces is inscribed in (THEORY A4).
"""

from math import atan2, ceil, cos, pi, sin, sqrt, tan

import numpy as np

from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.margins.force_sets import SEGMENT, inside, patch_farthest

FACES = 14  # most of a piece: a wedge's two, a θ limit's one, and a polygon of five a side
RIGHT = 0.5 * pi - 1e-9
CORNER = 0.4  # rad, widest side of an inscribed polygon
CORNERS = 64  # most of a piece; leaving some out makes the piece smaller
SAME = 1e-12  # share of the largest force, by which two corners differ at least


@bare
def _face(sets, j, count, x, y, z):
    """Stores a face's normal, given in the set's own axes; returns the number of faces."""
    size = sqrt(x * x + y * y + z * z)
    turn = sets.frames[j]
    for c in range(3):
        sets.normals[j, count, c] = (turn[c, 0] * x + turn[c, 1] * y + turn[c, 2] * z) / size
    return count + 1


@bare
def _polygon(sets, j, count, start, end, slope, side):
    """Inscribes ``side · f_x ≥ slope ρ`` by faces that touch the cone at both ends of an arc."""
    sides = min(int(ceil((end - start) / CORNER)), 5)
    for k in range(sides):
        step = (end - start) / sides
        middle = start + (k + 0.5) * step
        s = slope / cos(0.5 * step)
        count = _face(sets, j, count, side, s * sin(middle), -s * cos(middle))
    return count


@bare
def _wedge(sets, j, count, start, end):
    """Stores the faces that keep φ between two angles no farther apart than π."""
    count = _face(sets, j, count, 0.0, -cos(start), -sin(start))
    if end - start < pi - 1e-12:
        count = _face(sets, j, count, 0.0, cos(end), sin(end))
    if end - start < 1e-6:  # both are the same plane: the side of it
        count = _face(sets, j, count, 0.0, -sin(start), cos(start))
    return count


@bare
def _cone(sets, j, row, phi):
    """Stores the faces of the piece of a patch about the angle φ; returns how many."""
    start, end, low, high = row[13], row[14], row[15], row[16]
    full, count = row[2] <= -1.0, 0
    if full and low <= -RIGHT and high >= RIGHT:
        return 0
    if full or end - start > pi:
        first = phi - 0.5 * pi
        if not full:
            first = min(max(first, start), end - pi)
        start, end = first, first + pi
    if not full or low > 0.0 or high < 0.0:
        count = _wedge(sets, j, count, start, end)
    if low == 0.0 and high == 0.0:
        count = _face(sets, j, count, 1.0, 0.0, 0.0)
        return _face(sets, j, count, -1.0, 0.0, 0.0)
    for side, limit in ((-1.0, high), (1.0, -low)):  # side · f_x ≥ -tan(limit) ρ
        if limit >= RIGHT:
            continue
        t = tan(limit)
        if limit >= 0.0:
            count = _face(sets, j, count, side, -t * sin(phi), t * cos(phi))
        else:
            count = _polygon(sets, j, count, start, phi, -t, side)
            count = _polygon(sets, j, count, phi, end, -t, side)
    return count


@bare
def _keep(j, x, y, z, sets):
    """Stores a force as a corner of piece j if the piece holds it and it is a new one."""
    count = sets.corners[j]
    if count >= CORNERS or not inside(j, x, y, z, sets):
        return
    slack = SAME * sets.high[j]
    for k in range(count):
        v = sets.corner[j, k]
        if abs(v[0] - x) <= slack and abs(v[1] - y) <= slack and abs(v[2] - z) <= slack:
            return
    sets.corner[j, count, 0], sets.corner[j, count, 1], sets.corner[j, count, 2] = x, y, z
    sets.corners[j] = count + 1


@bare
def _edge(j, x, y, z, sets):
    """Stores the corners of piece j on the ray of a unit vector."""
    m, most, low = sets.axis[j], sets.high[j], sets.low[j]
    _keep(j, x * most, y * most, z * most, sets)
    along = m[0] * x + m[1] * y + m[2] * z
    if low > 0.0 and along * most >= low:
        s = low / along
        _keep(j, x * s, y * s, z * s, sets)


@bare
def corners_into(j, sets):
    """Fills the corners of piece j: forces at which its edges meet, which no direction changes.

    The extreme rays of the cone, where they meet the largest force and the floor; the points at
    which the floor's rim meets a face; no force at all where the floor does not leave it out.
    """
    sets.corners[j] = 0
    if sets.faces[j] == SEGMENT:
        return
    m, most, low = sets.axis[j], sets.high[j], sets.low[j]
    if low <= 0.0:
        _keep(j, 0.0, 0.0, 0.0, sets)
    for i in range(sets.faces[j]):
        a = sets.normals[j, i]
        for k in range(i):
            b = sets.normals[j, k]
            x, y = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2]
            z = a[0] * b[1] - a[1] * b[0]
            square = x * x + y * y + z * z
            if square < 1e-16:
                continue
            s = 1.0 / sqrt(square)
            _edge(j, x * s, y * s, z * s, sets)
            _edge(j, -x * s, -y * s, -z * s, sets)
        if low <= 0.0:
            continue
        along = a[0] * m[0] + a[1] * m[1] + a[2] * m[2]
        x, y, z = a[0] - along * m[0], a[1] - along * m[1], a[2] - along * m[2]
        square = x * x + y * y + z * z
        if square < 1e-20:
            continue
        s = low * along / square
        x, y, z = low * m[0] - s * x, low * m[1] - s * y, low * m[2] - s * z
        rest = most * most - x * x - y * y - z * z
        if rest < 0.0:
            continue
        s = sqrt(rest / square)
        p = s * (m[1] * a[2] - m[2] * a[1])
        q = s * (m[2] * a[0] - m[0] * a[2])
        r = s * (m[0] * a[1] - m[1] * a[0])
        _keep(j, x + p, y + q, z + r, sets)
        _keep(j, x - p, y - q, z - r, sets)


@jit
def pieces_into(anchors, hull, out):
    """Fills the convex pieces near the forces `anchors` (n, 3), CoG axes.

    Args:
        anchors: (n, 3); each piece holds the force of its set's directions nearest to its anchor.
        hull: the sets.
        out: the same with arrays of its own for faces, normals (n, FACES, 3), axis, low, high and
            corners (n, CORNERS, 3).
    """
    u, best = np.empty(3), np.empty(3)
    for j in range(hull.faces.size):
        turn, a = hull.frames[j], anchors[j]
        x = turn[0, 0] * a[0] + turn[1, 0] * a[1] + turn[2, 0] * a[2]
        y = turn[0, 1] * a[0] + turn[1, 1] * a[1] + turn[2, 1] * a[2]
        z = turn[0, 2] * a[0] + turn[1, 2] * a[1] + turn[2, 2] * a[2]
        most, at = -np.inf, 0
        for i in range(hull.first[j], hull.first[j + 1]):
            along = patch_farthest(x, y, z, hull.rows[i], u)
            if along > most and (hull.rows[i, 12] > 0.0 or most == -np.inf):
                most, at = along, i
                best[:] = u
        row = hull.rows[at]
        phi = 0.5 * (row[13] + row[14])
        if best[1] != 0.0 or best[2] != 0.0:
            phi = row[13] + (atan2(-best[1], best[2]) - row[13]) % (2.0 * pi)
        if phi > row[14]:  # by rounding, at one end or the other
            phi = row[14] if phi - row[14] < row[13] + 2.0 * pi - phi else row[13]
        for c in range(3):
            out.axis[j, c] = turn[c, 0] * best[0] + turn[c, 1] * best[1] + turn[c, 2] * best[2]
        if row[15] == row[16] and (row[15] != 0.0 or row[13] == row[14]):
            out.faces[j] = SEGMENT
            out.low[j], out.high[j] = hull.low[j], hull.high[j]
            if row[17] < 0.0:
                out.low[j], out.high[j] = -hull.high[j], -hull.low[j]
        else:
            out.low[j], out.high[j] = row[11], row[12]
            out.faces[j] = _cone(out, j, row, phi)
        corners_into(j, out)
