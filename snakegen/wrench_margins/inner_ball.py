"""Certified inner radius of a 3-D slice whose support function is a small optimisation.

The same growing polytope as `kernels.sandwich`, for sets that have no compiled support: those
with joint limits or gimbal limits.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Support = Callable[[Floats], tuple[float, Floats]]
THIN = 1e-12  # of the widest extent, below which three dimensions have no facets
FLAT = 1e-9  # share of the widest extent below which a body has none


def facets(points: Floats) -> tuple[Floats, Floats]:
    """Returns unit normals (f, 3) and offsets (f,) of the hull of points (m, 3); none if flat.

    Thin hulls are stretched to a round shape first: qhull's tolerance is of the widest extent.
    """
    from scipy.spatial import ConvexHull

    if len(points) < 4:
        return np.empty((0, 3)), np.empty(0)
    middle = points.mean(axis=0)
    _, spread, axes = np.linalg.svd(points - middle, full_matrices=False)
    if spread[2] <= THIN * spread[0]:
        return np.empty((0, 3)), np.empty(0)
    stretch = axes.T / spread
    normals = ConvexHull((points - middle) @ stretch).equations[:, :3] @ stretch.T
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return normals, (points @ normals.T).max(axis=0)


def inner_ball(support: Support, tolerance: float, most: int = 300) -> tuple[float, float, Floats]:
    """Returns (lower, upper, direction) of the largest ball round the origin inside a body.

    Args:
        support: e (3,) unit → (upper bound of the support along e, a point of the body (3,)).
        tolerance: relative gap at which to stop.
        most: support calls after which to stop all the same.

    Returns:
        Bounds of the radius and the unit direction of the upper one. ``upper < 0`` proves that
        the origin lies outside; ``lower`` is then nan, and -inf where the body is too flat.
    """
    points: list[Floats] = []
    upper, worst = np.inf, np.zeros(3)
    for e in np.vstack([np.eye(3), -np.eye(3)]):
        above, point = support(e)
        points.append(point)
        if above < upper:
            upper, worst = above, e
        if upper < 0.0:
            return np.nan, upper, worst
    lower, size = 0.0, np.abs(points).max()
    while True:
        normals, offsets = facets(np.array(points))
        if not offsets.size:
            return -np.inf, upper, worst
        weakest = int(np.argmin(offsets))
        lower, e = float(offsets[weakest]), normals[weakest]
        if upper - lower <= tolerance * upper or len(points) >= most:
            break
        above, point = support(e)
        if above < upper:
            upper, worst = above, e
        if upper < 0.0:
            return np.nan, upper, worst
        if point @ e - lower <= 1e-12 * size:
            break
        points.append(point)
    return max(lower, 0.0), upper, worst


def inner_ball_of(
    support: Support, size: int, tolerance: float, most: int = 600
) -> tuple[float, float, Floats]:
    """Returns (lower, upper, direction) as `inner_ball`, for a body of any dimension `size`.

    Qhull joggles the points by rounding, since facets of these bodies meet in many of them.
    """
    from scipy.spatial import ConvexHull

    points: list[Floats] = []
    lower, upper, worst = -np.inf, np.inf, np.zeros(size)
    tried, rank = [*np.eye(size), *-np.eye(size)], 0
    while len(points) < most:
        if not tried:
            _, spread, axes = np.linalg.svd(points - np.mean(points, axis=0))
            extent = int(np.sum(spread > FLAT * spread[0]))
            if extent < size:  # of the points so far: looks across them
                if extent == rank:
                    return -np.inf, upper, worst
                tried, rank = [axes[-1], -axes[-1]], extent
            else:
                planes = ConvexHull(points, qhull_options="QJ").equations
                weakest = int(np.argmax(planes[:, -1]))
                tried, lower = [planes[weakest, :-1]], -float(planes[weakest, -1])
                if upper - lower <= tolerance * upper:
                    break
        e, flat = tried.pop(0), len(tried) > 0
        above, point = support(e)
        if above < upper:
            upper, worst = above, e
        if upper < 0.0:
            return np.nan, upper, worst
        if not flat and len(points) >= 2 * size and _passes(points, point, e):
            break
        points.append(point)
    return (max(lower, 0.0) if np.isfinite(lower) else lower), upper, worst


def _passes(points: list[Floats], point: Floats, e: Floats) -> bool:
    """Tells whether a point goes no farther along e than those before."""
    reach = max(float(p @ e) for p in points)
    return float(point @ e) - reach <= 1e-10 * float(np.abs(point).max())
