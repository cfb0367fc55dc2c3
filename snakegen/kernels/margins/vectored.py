"""Margins of vectored apparatuses for a batch of postures: rank first, then the certified search.

Everything here is scaled: forces by F0, lengths by T0/F0; the set is
``{(Σ f_j, Σ p_j × f_j + c_j f_j), ‖f_j‖ ≤ L_j}`` and a row of p is (p_j, c_j): where the force acts
and the drag torque along it per newton. Definitions: THEORY A4.
"""

import numpy as np

from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.margins.gale import invert_basis
from snakegen.kernels.margins.inner_radius import radius, work_space
from snakegen.kernels.margins.ray_casting import slack
from snakegen.kernels.margins.wrench_subspace import OFF, RANK_TOLERANCE, lost_direction, subspace

SAFE = 1e-11  # squared: a bound of σ_6/σ_1 above 3e-6 spares the exact test


@jit
def columns(p, limit):
    """Returns the scaled map times limits, (6, 3n): ``[E; p× + c E] L_j`` per apparatus."""
    n = limit.size
    a = np.zeros((6, 3 * n))
    for j in range(n):
        x, y, z = p[j, 0], p[j, 1], p[j, 2]
        for c in range(3):
            a[c, 3 * j + c] = limit[j]
            a[3 + c, 3 * j + c] = p[j, 3] * limit[j]
        a[3, 3 * j + 1], a[3, 3 * j + 2] = -z * limit[j], y * limit[j]
        a[4, 3 * j], a[4, 3 * j + 2] = z * limit[j], -x * limit[j]
        a[5, 3 * j], a[5, 3 * j + 1] = -y * limit[j], x * limit[j]
    return a


@bare
def _full_rank(p, limit, gram, table, order):
    """True where a bound of σ_6/σ_1 shows rank 6; False leaves the question to the exact test."""
    gram[:] = 0.0
    for j in range(limit.size):
        x, y, z = p[j, 0], p[j, 1], p[j, 2]
        s = limit[j] ** 2
        size = x * x + y * y + z * z + p[j, 3] ** 2
        for c in range(3):
            gram[c, c] += s
            gram[c, 3 + c] += s * p[j, 3]
            gram[3 + c, 3 + c] += s * size
            for k in range(3):
                gram[3 + c, 3 + k] -= s * p[j, c] * p[j, k]
        gram[0, 4] += s * z
        gram[0, 5] -= s * y
        gram[1, 3] -= s * z
        gram[1, 5] += s * x
        gram[2, 3] += s * y
        gram[2, 4] -= s * x
    for i in range(3):
        for j in range(3):
            gram[3 + j, i] = gram[i, 3 + j]
    return invert_basis(gram, table, order) > SAFE


@bare
def _first_axis(frame, x, y, z):
    """Fills `frame` (3, 3) with orthonormal rows, the first along (x, y, z)."""
    size = np.sqrt(x * x + y * y + z * z)
    if size < 1e-12:
        x, y, z, size = 0.0, 0.0, 1.0, 1.0
    x, y, z = x / size, y / size, z / size
    frame[0, 0], frame[0, 1], frame[0, 2] = x, y, z
    # a second axis from the coordinate axis least along the first
    if abs(x) <= abs(y) and abs(x) <= abs(z):
        a, b, c = 0.0, -z, y
    elif abs(y) <= abs(z):
        a, b, c = z, 0.0, -x
    else:
        a, b, c = -y, x, 0.0
    size = np.sqrt(a * a + b * b + c * c)
    a, b, c = a / size, b / size, c / size
    frame[1, 0], frame[1, 1], frame[1, 2] = a, b, c
    frame[2, 0], frame[2, 1], frame[2, 2] = y * c - z * b, z * a - x * c, x * b - y * a


@jit
def _body_frame(frame, p):
    """Fills `frame` (3, 3): along the farthest pair of points, then across it."""
    far, a, b = -1.0, 0, 0
    for i in range(p.shape[0]):
        for j in range(i):
            gap = (p[i, 0] - p[j, 0]) ** 2 + (p[i, 1] - p[j, 1]) ** 2 + (p[i, 2] - p[j, 2]) ** 2
            if gap > far:
                far, a, b = gap, i, j
    _first_axis(frame, p[a, 0] - p[b, 0], p[a, 1] - p[b, 1], p[a, 2] - p[b, 2])
    wide, away = 0.0, np.empty(3)
    for i in range(p.shape[0]):
        along, size = 0.0, 0.0
        for c in range(3):
            along += (p[i, c] - p[a, c]) * frame[0, c]
        for c in range(3):
            away[c] = p[i, c] - p[a, c] - along * frame[0, c]
            size += away[c] ** 2
        if size > wide:
            wide = size
            for c in range(3):
                frame[1, c] = away[c] / np.sqrt(size)
    x, y = frame[0], frame[1]
    frame[2, 0], frame[2, 1] = x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2]
    frame[2, 2] = x[0] * y[1] - x[1] * y[0]


@jit
def _lost(p, limit, hover, tilts, directions):
    """Returns (rank, inside): `tilts` (2,) of the two slices out of the set's own subspace."""
    a = columns(p, limit)
    basis, lost = subspace(a, RANK_TOLERANCE)
    inside = True
    for i in range(lost.shape[1]):
        thickness, off = 0.0, 0.0
        for j in range(limit.size):
            part = 0.0
            for k in range(3 * j, 3 * j + 3):
                along = 0.0
                for c in range(6):
                    along += lost[c, i] * a[c, k]
                part += along * along
            thickness += np.sqrt(part)
        for c in range(6):
            off += lost[c, i] * hover[c]
        inside = inside and abs(off) <= thickness + OFF
    lost_direction(lost, 0, 6, directions[0])
    for k in range(2):
        tilts[k] = lost_direction(lost, 3 * k, 3 * k + 3, directions[1 + k])
    return basis.shape[1], inside


@jit
def batch(points, limit, hover, tolerance, bounds, directions, ranks, counts):
    """Fills for each of m postures what can be certified, all scaled.

    `points` (m, n, 4), `limit` (n,), `hover` (m, 6). `bounds` (m, 3, 2): lower and upper bound of
    wrench, force, torque; `directions` (m, 3, 6) the twists of the upper bounds, or the lost
    directions; `ranks` (m,); `counts` (m, 2) support calls. Where the force slice shows hover to
    be infeasible, or the set is flat and hover off it, ``bounds[i, 0]`` is (-inf, -1) and the
    rest nan: the distance is another search.
    """
    n = limit.size
    work, moved = work_space(), np.empty((n, 3))
    gram, table, order = np.empty((6, 6)), np.empty((6, 12)), np.empty(6, np.int64)
    frame, tilts, twist = np.empty((3, 3)), np.zeros(2), np.empty(6)
    for i in range(points.shape[0]):
        p, held = points[i], hover[i]
        tilts[:] = 0.0
        ranks[i], inside = 6, True
        directions[i] = np.nan
        if not _full_rank(p, limit, gram, table, order):
            ranks[i], inside = _lost(p, limit, held, tilts, directions[i])
        bounds[i] = np.nan
        counts[i] = 0
        for k in range(2 if inside else 0):
            if tilts[k] > RANK_TOLERANCE:
                bounds[i, 1 + k] = 0.0
                continue
            if k == 0:
                _first_axis(frame, held[0], held[1], held[2])
            else:
                _body_frame(frame, p)
            low, high, used = radius(k == 1, p, limit, held, frame, tolerance, work, twist)
            counts[i, k] = used
            directions[i, 1 + k] = twist
            bounds[i, 1 + k, 0], bounds[i, 1 + k, 1] = max(low, 0.0), high
            inside = inside and high >= -1e-12
            if not inside:
                break
        if not inside:
            bounds[i] = np.nan
            bounds[i, 0, 0], bounds[i, 0, 1] = -np.inf, -1.0
            continue
        _bracket(p, limit, held, bounds[i], directions[i], ranks[i], moved)


@jit
def _bracket(p, limit, hover, bounds, directions, rank, r):
    """Bounds the wrench margin by the two slices: a b/√(a² + b²) below, known twists above."""
    if rank < 6:
        bounds[0] = 0.0
        return
    a, b = bounds[1, 0], bounds[2, 0]
    bounds[0, 0] = a * b / np.sqrt(a * a + b * b) if a + b > 0.0 else 0.0
    bounds[0, 1] = np.inf
    for k in range(1, 3):
        size = 0.0
        for c in range(6):
            size += directions[k, c] ** 2
        above = max(slack(directions[k], p, limit, hover, 0.0, r), 0.0) / np.sqrt(size)
        if above < bounds[0, 1]:
            bounds[0, 1] = above
            directions[0] = directions[k]
