"""Forces at which the edges of a convex piece meet: no direction changes them.

The extreme rays of the piece's cone, where they meet the largest force and the floor; the points
at which the floor's rim meets a face; no force at all where the floor does not leave it out.
"""

from math import sqrt

from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.margins.force_sets import SEGMENT, inside

CORNERS = 64  # most of a piece; leaving some out makes the piece smaller
SAME = 1e-12  # share of the largest force, by which two corners differ at least


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
    """Fills the corners of piece j from its faces, axis, floor and largest force."""
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
