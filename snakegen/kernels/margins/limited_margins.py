"""Two-sided margins of limited force sets for a batch of postures (THEORY A4).

From above: the sets' hulls, whose support at any twist bounds a margin. From below: a product of
convex pieces of the sets that can hold hover is a convex body inside, whose slices are measured.
Two products are tried: pieces along the hover force, and along forces whose mixture holds hover.
Everything is scaled: forces by F0, lengths by T0/F0.
"""

import numpy as np

from snakegen.kernels.core.jit import jit
from snakegen.kernels.margins.convex_pieces import CORNERS, FACES, pieces_into
from snakegen.kernels.margins.force_sets import Sets, slack, wrench_into
from snakegen.kernels.margins.ray_casting import _across
from snakegen.kernels.margins.section_radius import GAP, outer_radius, polytope, radius, reach
from snakegen.kernels.margins.set_distance import distance
from snakegen.kernels.margins.settle_forces import settle, wrench_inverse
from snakegen.kernels.margins.slice_program import maximise, new_basis, start
from snakegen.kernels.margins.wrench_subspace import OFF, RANK_TOLERANCE, subspace

STARTS, ROUNDS = 8, 400  # of the search for forces that hold hover where no pieces did
SUPPORTS = 1000  # of one slice's radius: bodies of rotation take up to 930 to close by 1e-3


@jit
def span_columns(sets, spans):
    """Returns (6, 3n): the wrenches that span each set, from `spans` (n, 3, 3), its limit long."""
    n = sets.faces.size
    out, f, w = np.zeros((6, 3 * n)), np.empty(3), np.empty(6)
    for j in range(n):
        most = max(sets.high[j], -sets.low[j])
        for k in range(3):
            for c in range(3):
                f[c] = 0.0
                for i in range(3):
                    f[c] += most * sets.frames[j, c, i] * spans[j, i, k]
            wrench_into(j, f, sets, w)
            out[:, 3 * j + k] = w
    return out


@jit
def ray(u, sets, hover, gap, forces, twist):
    """Returns (lower, upper) of the largest t with ``hover + t u`` in the convex sets' wrenches.

    `forces` (n, 3) ends as those at the lower bound, `twist` (6,) as the upper one's, twist·u = 1.
    """
    across, square = np.empty((5, 6)), (u**2).sum()
    _across(u, across)
    basis = new_basis(5, sets.faces.size)
    start(across, sets, hover, basis)
    return maximise(u / square, across, hover, sets, gap, basis, forces, twist)


@jit
def empty_pieces(hull):
    """Returns arrays for convex pieces of `hull`, to be filled by `pieces_into`."""
    n = hull.faces.size
    return Sets(
        hull.points,
        hull.frames,
        hull.rows,
        hull.first,
        np.zeros(n, np.int64),
        np.zeros((n, FACES, 3)),
        np.zeros((n, 3)),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n, np.int64),
        np.zeros((n, CORNERS, 3)),
    )


@jit
def _lower(row, above, twist, bounds, twists):
    """Lowers the upper one of a margin's `bounds` to that of `twist`; False if out of reach."""
    if above < bounds[row, 1]:
        bounds[row, 1] = above
        twists[row] = twist
    return not above < -OFF


@jit
def _slices(sets, hull, hover, tolerance, bounds, twists, counts, low, weak, bodies):
    """Measures both slices of convex sets: lowers the upper `bounds`, fills `low` (2,).

    Fills `weak` (2, 6), the twists in which these sets are weakest, and `bodies`. Returns False
    where a twist proves hover out of the hull's reach.
    """
    frame, outer = np.eye(3), np.empty(6)
    for k in range(2):
        low[k], _, above, used = radius(
            k == 1, sets, hull, hover, frame, tolerance, bodies[k], weak[k], outer
        )
        counts[k] += used
        if not _lower(1 + k, above, outer, bounds, twists):
            return False
    return True


@jit
def _no_better(sets, hover, tolerance, low, weak):
    """Tells whether convex sets reach no farther than `low` (2,) where others are weakest."""
    for k in range(2):
        e = weak[k, 3 * k : 3 * k + 3]
        size = np.sqrt((e**2).sum())
        if not size > 0.0 or not low[k] >= 0.0:
            return False
        above = reach(k == 1, e / size, sets, hover, GAP * tolerance)
        if above > low[k] * (1.0 + tolerance):
            return False
    return True


@jit
def _close_from_above(hull, hover, tolerance, bounds, twists, counts, bodies):
    """Lowers the upper `bounds` to those of the hulls where they are apart; as `_slices`."""
    outer = np.empty(6)
    for k in range(2):
        if bounds[1 + k, 1] - bounds[1 + k, 0] <= tolerance * bounds[1 + k, 1]:
            continue
        above, used = outer_radius(k == 1, hull, hover, tolerance, bodies[k], outer)
        counts[k] += used
        if not _lower(1 + k, above, outer, bounds, twists):
            return False
    return True


@jit
def _raise(low, bounds):
    """Raises the lower bounds to those of one convex body's slices, `low` (2,), scaled."""
    for k in range(2):
        bounds[1 + k, 0] = max(bounds[1 + k, 0], min(low[k], bounds[1 + k, 1]))
    if min(low[0], low[1]) >= 0.0:
        size = np.sqrt(low[0] ** 2 + low[1] ** 2)
        below = low[0] * low[1] / size if size > 0.0 else 0.0
        bounds[0, 0] = max(bounds[0, 0], below)


@jit
def _settled(hull, convex, hover, tolerance, bounds, twists, counts, anchors, bodies):
    """Measures pieces about forces that `settle` finds to hold hover; False if out of reach."""
    inverse, low, weak = wrench_inverse(hull), np.empty(2), np.empty((2, 6))
    for k in range(STARTS):
        for j in range(hull.faces.size):
            for c in range(3):
                spread = np.sin(12.9898 * (k + 1) * (3 * j + c + 1))  # starts spread anyhow
                anchors[j, c] = hull.high[j] * spread if k % 2 else hover[c] + 0.3 * spread
        if settle(hover, hull, inverse, ROUNDS, anchors) > OFF:
            continue
        pieces_into(anchors, hull, convex)
        if not _slices(convex, hull, hover, tolerance, bounds, twists, counts, low, weak, bodies):
            return False
        _raise(low, bounds)
        if bounds[1, 0] > -np.inf:
            break
    return True


@jit
def posture(hull, hover, tolerance, flat, bounds, twists, counts):
    """Fills the bounds (3, 2) of wrench, force and torque of one posture; False if out of reach.

    Lower bounds are -inf where no convex pieces that hold hover were found.
    """
    n = hull.faces.size
    convex, low, anchors = empty_pieces(hull), np.empty(2), np.empty((n, 3))
    twist, nearest, inside = np.empty(6), np.inf, True
    weak = np.zeros((2, 6))
    bodies = (polytope(SUPPORTS), polytope(SUPPORTS))
    bounds[:, 0], bounds[:, 1] = -np.inf, np.inf
    low[:] = -np.inf
    for tried in range(2):
        if tried == 0:
            for j in range(n):
                anchors[j] = hover[:3]
        else:
            ray(hover, hull, hover, tolerance, anchors, twist)
        pieces_into(anchors, hull, convex)
        if tried == 1 and _no_better(convex, hover, tolerance, low, weak):
            break
        inside = _slices(convex, hull, hover, tolerance, bounds, twists, counts, low, weak, bodies)
        if not inside:
            break
        _raise(low, bounds)
        if low[0] == -np.inf:
            nearest = min(nearest, distance(convex, hover, twist)[1])
        gap = max(
            bounds[1, 1] * (1.0 - tolerance) - bounds[1, 0],
            bounds[2, 1] * (1.0 - tolerance) - bounds[2, 0],
        )
        if gap <= 0.0:
            break
    if inside and bounds[1, 0] == -np.inf:
        inside = _settled(hull, convex, hover, tolerance, bounds, twists, counts, anchors, bodies)
    if inside and gap > 0.0:
        inside = _close_from_above(hull, hover, tolerance, bounds, twists, counts, bodies)
    if not inside or bounds[1, 0] == -np.inf:
        apart = distance(hull, hover, twist)
        if not inside or apart[0] > OFF:
            nearest = min(nearest, distance(convex, hover, twist)[1])
            distance(hull, hover, twists[0])
            bounds[:] = np.nan
            twists[1:] = np.nan
            bounds[0, 0], bounds[0, 1] = -nearest, -apart[0]
            return False
    bounds[0, 1] = 0.0 if flat else np.inf
    for k in range(1, 3):
        if bounds[k, 0] >= -OFF and bounds[k, 1] <= OFF:  # no thickness but for rounding
            bounds[k] = 0.0
        above = max(slack(twists[k], hull, hover), 0.0) / np.sqrt((twists[k] ** 2).sum())
        if above < bounds[0, 1] or (flat and k == 1):
            bounds[0, 1] = above if not flat else 0.0
            twists[0] = twists[k]
    if bounds[1, 0] == -np.inf:  # within the hull, but no pieces that hold it
        bounds[0, 0] = -nearest
        bounds[1, 0], bounds[2, 0] = np.nan, np.nan
        if nearest <= OFF:  # at the very edge of the pieces
            bounds[:, 0] = 0.0
    elif flat:
        bounds[0, 0] = 0.0
    return True


@jit
def batch(hull, points, frames, spans, hover, tolerance, bounds, twists, ranks, counts):
    """Fills the bounds (m, 3, 2), twists (m, 3, 6), ranks (m,) and supports (m, 2) of m postures.

    Args:
        hull: the sets' hulls; points and frames are those of the postures.
        points: (m, n, 4) scaled points and drags.
        frames: (m, n, 3, 3).
        spans: (n, 3, 3) columns that span each set, in its own axes.
        hover: (m, 6) scaled.
        tolerance: relative gap asked.
    """
    for i in range(points.shape[0]):
        sets = Sets(
            points[i],
            frames[i],
            hull.rows,
            hull.first,
            hull.faces,
            hull.normals,
            hull.axis,
            hull.low,
            hull.high,
            hull.corners,
            hull.corner,
        )
        basis, _ = subspace(span_columns(sets, spans), RANK_TOLERANCE)
        ranks[i], counts[i], twists[i] = basis.shape[1], 0, np.nan
        posture(sets, hover[i], tolerance, ranks[i] < 6, bounds[i], twists[i], counts[i])
