"""Certified radius of the largest ball round the origin in a convex body known by its support.

A polytope of points of the body grows from inside: its nearest facet's distance is a lower bound
of the radius, the support along that facet's normal an upper bound and the next point. Each step
works where the bound is weakest (a facet is a spherical triangle of directions); flat bodies need
no whitening, as the polytope takes their shape.
"""

import numpy as np

from snakegen.kernels.jit import jit
from snakegen.kernels.slice_support import scratch_space, support

POINTS = 400  # then the search says that it did not close


@jit
def _between(points, i, j):
    """Returns the vector from point i to point j."""
    return points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]


@jit
def _plane(points, facet, plane):
    """Writes unit normal and offset (4,) of the facet (3,) through three points."""
    a, b, c = points[facet[0]], points[facet[1]], points[facet[2]]
    ux, uy, uz = _between(points, facet[0], facet[1])
    vx, vy, vz = _between(points, facet[0], facet[2])
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    size = np.sqrt(x * x + y * y + z * z)
    if size <= 1e-300:  # a sliver bounds nothing
        plane[:] = 0.0
        plane[3] = np.inf
        return
    plane[0], plane[1], plane[2] = x / size, y / size, z / size
    # the mean of the three keeps the digits of a thin body
    plane[3] = (
        plane[0] * (a[0] + b[0] + c[0])
        + plane[1] * (a[1] + b[1] + c[1])
        + plane[2] * (a[2] + b[2] + c[2])
    ) / 3.0


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
        facets[k, 0], facets[k, 1], facets[k, 2] = corners[a], corners[b], corners[c]
        _plane(points, facets[k], planes[k])
    return 4, first, second, third, fourth


@jit
def insert(points, new, facets, planes, count, edges, slack):
    """Adds point `new`: its visible facets give way to a fan; returns the new facet count."""
    x, y, z = points[new]
    open_edges, i = 0, 0
    while i < count:
        height = planes[i, 0] * x + planes[i, 1] * y + planes[i, 2] * z - planes[i, 3]
        if height <= slack:
            i += 1
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
        count -= 1
        for k in range(3):
            facets[i, k] = facets[count, k]
        for k in range(4):
            planes[i, k] = planes[count, k]
    for m in range(open_edges):
        facets[count, 0], facets[count, 1], facets[count, 2] = edges[m, 0], edges[m, 1], new
        _plane(points, facets[count], planes[count])
        count += 1
    return count


@jit
def _triple(a, b, c):
    """Returns det [a b c]."""
    x, y, z = b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]
    return a[0] * x + a[1] * y + a[2] * z


@jit
def _guess(directions, multipliers, facet, e, z):
    """Writes to `z` the multiplier along `e`, interpolated (it is homogeneous in e)."""
    a, b, c = directions[facet[0]], directions[facet[1]], directions[facet[2]]
    volume, first, second = _triple(a, b, c), _triple(e, b, c), _triple(a, e, c)
    u, v, w = 1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0
    if abs(volume) > 1e-12:
        u, v, w = first / volume, second / volume, _triple(a, b, e) / volume
        if min(u, v, w) < -0.5 or max(u, v, w) > 1.5:
            u, v, w = 1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0
    for k in range(3):
        z[k] = u * multipliers[facet[0], k] + v * multipliers[facet[1], k]
        z[k] += w * multipliers[facet[2], k]


@jit
def work_space(n):
    """Returns the arrays that `radius` uses over and over, for n apparatuses."""
    return (
        np.empty((POINTS, 3)),
        np.empty((POINTS, 3)),
        np.empty((POINTS, 3)),
        np.empty((2 * POINTS + 8, 3), np.int64),
        np.empty((2 * POINTS + 8, 4)),
        np.empty((6 * POINTS, 2), np.int64),
        np.empty((n, 3)),
        np.empty(3),
        scratch_space(),
    )


@jit
def radius(torque, p, limit, hover, frame, tolerance, work, worst):
    """Returns (lower, upper, points used) of the slice's inner radius; `worst` (6,) its twist.

    `frame` (3, 3): orthonormal rows to start with. Stops at upper - lower ≤ tolerance · upper, or
    as soon as the upper bound is negative (hover lies outside). ``lower`` is -inf where it fails.
    """
    points, directions, multipliers, facets, planes, edges, f, z, scratch = work
    upper, used, size = np.inf, 0, 0.0
    e = np.empty(3)
    for k in range(6):
        for c in range(3):
            e[c] = frame[k // 2, c] if k % 2 == 0 else -frame[k // 2, c]
            z[c] = -multipliers[k - 1, c] if k % 2 == 1 else 0.0
        above, _, balanced = support(e, torque, p, limit, hover, z, f, points[used], scratch)
        if above < upper:
            upper = above
            worst[:3], worst[3:] = (z, e) if torque else (e, z)
        if not balanced:
            return -np.inf, upper, k + 1
        directions[k], multipliers[k] = e, z
        for c in range(3):
            size = max(size, abs(points[k, c]))
        used += 1
        if upper < -1e-12 * size:
            return -np.inf, upper, used
    count, first, second, third, fourth = simplex(points, used, facets, planes)
    if count == 0:
        return -np.inf, upper, used
    slack = 1e-13 * size
    for k in range(used):
        if k not in (first, second, third, fourth):
            count = insert(points, k, facets, planes, count, edges, slack)
    while True:
        weakest = int(np.argmin(planes[:count, 3]))
        lower = planes[weakest, 3]
        if upper - lower <= tolerance * upper or used == POINTS:
            return lower, upper, used
        for c in range(3):
            e[c] = planes[weakest, c]
        _guess(directions, multipliers, facets[weakest], e, z)
        above, below, balanced = support(e, torque, p, limit, hover, z, f, points[used], scratch)
        if above < upper:
            upper = above
            worst[:3], worst[3:] = (z, e) if torque else (e, z)
        if not balanced or below - lower <= slack or upper < -1e-12 * size:
            return lower, upper, used
        directions[used], multipliers[used] = e, z
        used += 1
        count = insert(points, used - 1, facets, planes, count, edges, slack)
