"""Largest ball round hover in a slice of a wrench set, bracketed by a growing polytope.

As `sandwich`, for convex sets of any kind: see `slice_program`.
"""

from typing import NamedTuple

import numpy as np

from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.types import Floats, Ints
from snakegen.kernels.margins.force_sets import slack
from snakegen.kernels.margins.inner_radius import insert, simplex
from snakegen.kernels.margins.slice_program import maximise, new_basis, refresh, start

POINTS = 300  # then the search says that it did not close
GAP = 0.1  # of the tolerance: of one support
FLAT = 1e-9  # share of the largest wrench below which a slice has no thickness
ROUGH = 1e-9  # share of the largest wrench by which rounding moves points: faces are flat to that
FRESH = 8  # supports between two inversions of the basis
USED, COUNT, WEAKEST = range(3)  # of a polytope's state


class Polytope(NamedTuple):
    """A polytope in a slice, grown from inside; its arrays are used over and over."""

    points: Floats  # (k, 3) from hover
    facets: Ints  # (2k, 3) corners
    planes: Floats  # (2k, 4) unit normals and offsets
    edges: Ints  # (6k, 2) work space
    state: Ints  # (3,) points, facets, and the facet nearest to hover


@jit
def polytope(most):
    """Returns an empty polytope of up to `most` supports."""
    return Polytope(
        np.empty((most + 4, 3)),
        np.empty((2 * most + 16, 3), np.int64),
        np.empty((2 * most + 16, 4)),
        np.empty((6 * most + 24, 2), np.int64),
        np.zeros(3, np.int64),
    )


@jit
def section(torque):
    """Returns H (3, 6), the rows that the torque slice, or the force slice, holds."""
    held, first = np.zeros((3, 6)), 0 if torque else 3
    for c in range(3):
        held[c, first + c] = 1.0
    return held


@jit
def _point(torque, forces, sets, hover, out):
    """Writes to `out` (3,) where forces (n, 3) lie in the slice, from hover; its largest part."""
    part = 3 if torque else 0
    for c in range(3):
        out[c] = -hover[part + c]
    for j in range(sets.faces.size):
        x, y, z = sets.points[j, 0], sets.points[j, 1], sets.points[j, 2]
        f = forces[j]
        if torque:
            out[0] += y * f[2] - z * f[1] + sets.points[j, 3] * f[0]
            out[1] += z * f[0] - x * f[2] + sets.points[j, 3] * f[1]
            out[2] += x * f[1] - y * f[0] + sets.points[j, 3] * f[2]
        else:
            for c in range(3):
                out[c] += f[c]
    return max(abs(out[0]), abs(out[1]), abs(out[2]))


@bare
def _closed(count, used):
    """Tells whether a polytope of `used` points can have `count` facets: 2 V - 4 of V corners."""
    return 0 < count <= 2 * used - 4


@jit
def reach(torque, normal, sets, hover, gap):
    """Returns an upper bound of how far convex sets reach along a direction (3,) of a slice."""
    n, part = sets.faces.size, 3 if torque else 0
    held, basis, cost = section(torque), new_basis(3, n), np.zeros(6)
    cost[part : part + 3] = normal
    start(held, sets, hover, basis)
    return maximise(cost, held, hover, sets, gap, basis, np.empty((n, 3)), np.empty(6))[1]


@jit
def radius(torque, sets, hull, hover, frame, tolerance, body, worst, outer):
    """Returns (lower, upper, hull's upper, supports) of a slice's inner radius.

    Args:
        torque: the torque slice (force held), else the force slice.
        sets: convex sets whose radius it is.
        hull: sets that hold these, bounded by the twists that the search meets.
        hover: (6,) scaled.
        frame: (3, 3) orthonormal rows to start with.
        tolerance: relative gap at which to stop.
        body: from `polytope`, filled anew: its size is the most supports after which to stop.
        worst, outer: (6,), filled: the twists of the two upper bounds.

    Returns:
        ``upper < 0`` proves hover out of reach; lower is -inf where it fails.
    """
    n, part = sets.faces.size, 3 if torque else 0
    points, facets, planes, edges, state = body
    most = len(points) - 4
    held, basis = section(torque), new_basis(3, n)
    cost, twist, normal, forces = np.zeros(6), np.zeros(6), np.zeros(3), np.empty((n, 3))
    start(held, sets, hover, basis)
    upper, beyond, size, count, lower = np.inf, np.inf, 0.0, 0, -np.inf
    first = second = third = fourth = used = weakest = tries = 0
    state[:] = 0
    while used < most:
        if used < 6:
            sign = 1.0 if used % 2 == 0 else -1.0
            normal[:] = sign * frame[used // 2]
        elif count == 0:
            count, first, second, third, fourth = simplex(points, used, facets, planes)
            for q in range(used):
                if count > 0 and q not in (first, second, third, fourth):
                    count, weakest = insert(points, q, facets, planes, count, edges, ROUGH * size)
            if _closed(count, used):
                continue
            count = 0  # flat as yet, but for rounding: look across the plane of the points
            if tries == 4:
                return 0.0, upper if upper > FLAT * size else 0.0, beyond, used
            _across(points, first, second, third, frame, tries, normal)
            tries += 1
        else:
            lower = planes[weakest, 3]
            if upper - lower <= tolerance * upper:
                break
            normal[:] = planes[weakest, :3]
        for c in range(3):
            cost[part + c] = normal[c]
        if used % FRESH == FRESH - 1 and not refresh(held, basis):
            start(held, sets, hover, basis)
        below, above = maximise(cost, held, hover, sets, GAP * tolerance, basis, forces, twist)
        if above < upper:
            upper = above
            worst[:] = twist
        wider = slack(twist, hull, hover)
        if wider < beyond:
            beyond = wider
            outer[:] = twist
        if upper < -FLAT * max(size, 1e-3) or (below == -np.inf and count == 0):
            return -np.inf, upper, beyond, used
        if below == -np.inf:  # the polytope so far lies in the sets all the same
            break
        size = max(size, _point(torque, forces, sets, hover, points[used]))
        used += 1
        if count > 0:
            if below - lower <= ROUGH * size:
                break
            count, weakest = insert(points, used - 1, facets, planes, count, edges, ROUGH * size)
            if not _closed(count, used):
                count = 0
                break
            lower = planes[weakest, 3]
    state[USED], state[COUNT], state[WEAKEST] = used, count, weakest
    return lower, upper, beyond, used


@jit
def outer_radius(torque, hull, hover, tolerance, body, outer):
    """Returns (upper bound of a slice's inner radius, supports), `outer` (6,) its twist.

    Args:
        hull: convex sets.
        body: a polytope in their slice, from `radius` of sets inside them; grown, or grown anew
            where it is empty.
    """
    n, part, twist, other = hull.faces.size, 3 if torque else 0, np.zeros(6), np.zeros(6)
    points, facets, planes, edges, state = body
    used, count, weakest = state
    if count == 0:
        _, upper, _, used = radius(
            torque, hull, hull, hover, np.eye(3), tolerance, body, outer, other
        )
        return upper, used
    held, basis = section(torque), new_basis(3, n)
    cost, forces, begun = np.zeros(6), np.empty((n, 3)), used
    start(held, hull, hover, basis)
    upper, size = np.inf, np.abs(points[:used]).max()
    while used < len(points) - 4:
        lower = planes[weakest, 3]
        if upper < np.inf and upper - lower <= tolerance * upper:
            break
        for c in range(3):
            cost[part + c] = planes[weakest, c]
        if used % FRESH == FRESH - 1 and not refresh(held, basis):
            start(held, hull, hover, basis)
        below, above = maximise(cost, held, hover, hull, GAP * tolerance, basis, forces, twist)
        if above < upper:
            upper = above
            outer[:] = twist
        if below - lower <= ROUGH * size:
            break
        size = max(size, _point(torque, forces, hull, hover, points[used]))
        used += 1
        count, weakest = insert(points, used - 1, facets, planes, count, edges, ROUGH * size)
        if not _closed(count, used):
            count = 0
            break
    state[USED], state[COUNT], state[WEAKEST] = used, count, weakest
    return upper, used - begun


@jit
def _across(points, first, second, third, frame, tries, normal):
    """Writes the unit normal (3,) of three points' plane, its sign by `tries`, for flat slices."""
    a, b = points[second] - points[first], points[third] - points[first]
    normal[0] = a[1] * b[2] - a[2] * b[1]
    normal[1] = a[2] * b[0] - a[0] * b[2]
    normal[2] = a[0] * b[1] - a[1] * b[0]
    size = np.sqrt((normal**2).sum())
    length = np.sqrt((a**2).sum())
    if size <= 1e-9 * length * length or length == 0.0:  # a line, or a point: any way across it
        least = 0
        for c in range(3):
            if abs(a[c]) < abs(a[least]):
                least = c
        normal[:] = 0.0
        normal[least] = 1.0
        if length > 0.0:
            normal -= a * a[least] / length**2
        size = np.sqrt((normal**2).sum())
    normal *= (1.0 if tries % 2 == 0 else -1.0) / size
