"""Certified radius of the largest ball round the origin in a convex body known by its support.

A polytope of points of the body grows from inside: its nearest facet's distance is a lower bound
of the radius, the support along that facet's normal an upper bound and the next point. Each step
works where the bound is weakest (a facet is a spherical triangle of directions); flat bodies need
no whitening, as the polytope takes their shape.
"""

import numpy as np

from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.vec3 import cross, inner, minus, plus, read, times, write
from snakegen.kernels.margins.slice_support import support, torque_start

POINTS = 400  # then the search says that it did not close


@bare
def _between(points, i, j):
    """Returns the vector from point i to point j."""
    return points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]


@bare
def _facet(points, i, j, k, facets, planes, at):
    """Stores the facet of three points in row `at`: unit normal and offset (4,) of its plane."""
    facets[at, 0], facets[at, 1], facets[at, 2] = i, j, k
    a, b, c = read(points, i, 0), read(points, j, 0), read(points, k, 0)
    x, y, z = cross(minus(b, a), minus(c, a))
    size = np.sqrt(x * x + y * y + z * z)
    if size <= 1e-300:  # a sliver bounds nothing
        planes[at, 0], planes[at, 1], planes[at, 2], planes[at, 3] = 0.0, 0.0, 0.0, np.inf
        return
    unit = 1.0 / size
    # the mean of the three keeps the digits of a thin body
    total = x * (a[0] + b[0] + c[0]) + y * (a[1] + b[1] + c[1]) + z * (a[2] + b[2] + c[2])
    planes[at, 0], planes[at, 1], planes[at, 2] = x * unit, y * unit, z * unit
    planes[at, 3] = total * unit / 3.0


@jit
def simplex(points, count, facets, planes):
    """Starts the polytope with four far points; returns the number of facets, 0 if too flat."""
    first, second, far = 0, 0, -1.0
    for i in range(count):
        for j in range(i):
            x, y, z = _between(points, j, i)
            if x * x + y * y + z * z > far:
                first, second, far = i, j, x * x + y * y + z * z
    a, b, c = _between(points, first, second)
    third, wide, normal = 0, -1.0, np.zeros(3)
    for i in range(count):
        x, y, z = _between(points, first, i)
        u, v, w = b * z - c * y, c * x - a * z, a * y - b * x
        if u * u + v * v + w * w > wide:
            third, wide = i, u * u + v * v + w * w
            normal[0], normal[1], normal[2] = u, v, w
    fourth, high = 0, 0.0
    for i in range(count):
        x, y, z = _between(points, first, i)
        height = normal[0] * x + normal[1] * y + normal[2] * z
        if abs(height) > abs(high):
            fourth, high = i, height
    if abs(high) <= 1e-14 * np.sqrt(wide * far):
        return 0, first, second, third, fourth
    if high > 0.0:
        second, third = third, second
    corners = (first, second, third, fourth)
    for k, (a, b, c) in enumerate(((0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2))):
        _facet(points, corners[a], corners[b], corners[c], facets, planes, k)
    return 4, first, second, third, fourth


@bare
def insert(points, new, facets, planes, count, edges, slack):
    """Adds point `new`: a fan replaces its visible facets.

    Returns the number of facets and the one nearest to the origin; 0 facets where rounding has
    torn the polytope and they outgrow their arrays.
    """
    x, y, z = points[new, 0], points[new, 1], points[new, 2]
    open_edges, kept, weakest, least = 0, 0, 0, np.inf
    for i in range(count):
        offset = planes[i, 3]
        if planes[i, 0] * x + planes[i, 1] * y + planes[i, 2] * z - offset <= slack:
            if kept < i:
                for k in range(3):
                    facets[kept, k], planes[kept, k] = facets[i, k], planes[i, k]
                planes[kept, 3] = offset
            if offset < least:
                weakest, least = kept, offset
            kept += 1
            continue
        for k in range(3):
            a, b = facets[i, k], facets[i, (k + 1) % 3]
            twin = -1
            for m in range(open_edges):
                if edges[m, 0] == b and edges[m, 1] == a:
                    twin = m
            if twin >= 0:
                open_edges -= 1
                edges[twin, 0], edges[twin, 1] = edges[open_edges, 0], edges[open_edges, 1]
            else:
                edges[open_edges, 0], edges[open_edges, 1] = a, b
                open_edges += 1
    if kept + open_edges > len(facets):
        return 0, weakest
    for m in range(open_edges):
        _facet(points, edges[m, 0], edges[m, 1], new, facets, planes, kept)
        if planes[kept, 3] < least:
            weakest, least = kept, planes[kept, 3]
        kept += 1
    return kept, weakest


@bare
def _guess(directions, multipliers, facet, e):
    """Returns the multiplier along `e`, interpolated in its facet (it is homogeneous in e)."""
    i, j, k = facet
    a, b, c = read(directions, i, 0), read(directions, j, 0), read(directions, k, 0)
    across = cross(b, c)
    volume = inner(a, across)
    u, v, w = 1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0
    if abs(volume) > 1e-12:
        u, v = inner(e, across) / volume, inner(e, cross(c, a)) / volume
        w = inner(e, cross(a, b)) / volume
        if min(u, v, w) < -0.5 or max(u, v, w) > 1.5:
            u, v, w = 1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0
    a, b, c = read(multipliers, i, 0), read(multipliers, j, 0), read(multipliers, k, 0)
    return plus(plus(times(a, u), times(b, v)), times(c, w))


@bare
def _note(worst, e, z, torque):
    """Writes the twist (6,) of direction e and multiplier z."""
    for k in range(3):
        worst[k], worst[3 + k] = (z[k], e[k]) if torque else (e[k], z[k])


@bare
def _keep(points, directions, multipliers, at, point, e, z):
    """Stores what one support call found in row `at`."""
    write(points, at, 0, point)
    write(directions, at, 0, e)
    write(multipliers, at, 0, z)


@jit
def work_space():
    """Returns the arrays that `radius` uses over and over."""
    return (
        np.empty((POINTS, 3)),
        np.empty((POINTS, 3)),
        np.empty((POINTS, 3)),
        np.empty((2 * POINTS + 8, 3), np.int64),
        np.empty((2 * POINTS + 8, 4)),
        np.empty((6 * POINTS, 2), np.int64),
    )


@jit
def radius(torque, p, limit, hover, frame, tolerance, work, worst):
    """Returns (lower, upper, points used) of the slice's inner radius; `worst` (6,) its twist.

    `frame` (3, 3): orthonormal rows to start with. Stops at upper - lower ≤ tolerance · upper, or
    as soon as the upper bound is negative (hover lies outside). ``lower`` is -inf where it fails.
    """
    points, directions, multipliers, facets, planes, edges = work
    upper, size = np.inf, 0.0
    z = (0.0, 0.0, 0.0)
    for k in range(6):
        e = read(frame, k // 2, 0)
        if k % 2 == 1:
            e = times(e, -1.0)
        if torque:
            z = torque_start(e, p, limit, hover)
        else:
            z = (-z[0], -z[1], -z[2]) if k % 2 == 1 else (0.0, 0.0, 0.0)
        above, _, balanced, z, point = support(e, z, torque, p, limit, hover)
        if above < upper:
            upper = above
            _note(worst, e, z, torque)
        if not balanced:
            return -np.inf, upper, k + 1
        _keep(points, directions, multipliers, k, point, e, z)
        size = max(size, abs(point[0]), abs(point[1]), abs(point[2]))
        if upper < -1e-12 * size:
            return -np.inf, upper, k + 1
    count, first, second, third, fourth = simplex(points, 6, facets, planes)
    if count == 0:
        return -np.inf, upper, 6
    slack, weakest = 1e-13 * size, 0
    for k in range(6):
        if k not in (first, second, third, fourth):
            count, weakest = insert(points, k, facets, planes, count, edges, slack)
    used = 6
    while True:
        lower = planes[weakest, 3]
        if upper - lower <= tolerance * upper or used == POINTS:
            return lower, upper, used
        e = read(planes, weakest, 0)
        z = _guess(directions, multipliers, facets[weakest], e)
        above, below, balanced, z, point = support(e, z, torque, p, limit, hover)
        if above < upper:
            upper = above
            _note(worst, e, z, torque)
        if not balanced or below - lower <= slack or upper < -1e-12 * size:
            return lower, upper, used
        _keep(points, directions, multipliers, used, point, e, z)
        count, weakest = insert(points, used, facets, planes, count, edges, slack)
        used += 1
        if count == 0:
            return lower, upper, used
