"""Bounds of one posture's margins where apparatuses cannot push anywhere alike (THEORY A4).

What a batch leaves out (`kernels.limited_margins`): the search of the wrench margin, and rays.
"""

import numpy as np
from numpy.typing import NDArray

from snakegen.kernels.margins import ray_casting
from snakegen.kernels.margins.convex_pieces import pieces_into
from snakegen.kernels.margins.force_sets import Sets, slack
from snakegen.kernels.margins.limited_margins import empty_pieces, ray, span_columns
from snakegen.kernels.margins.wrench_certificate import certify
from snakegen.kernels.margins.wrench_subspace import RANK_TOLERANCE, subspace
from snakegen.wrench_margins.force_sets import ForceSets
from snakegen.wrench_margins.wrench_search import start_directions

Floats = NDArray[np.float64]
TURNS = 30  # of a ray to the normal that was hit
CONES = 1_000_000  # looked at for a wrench certificate, times apparatuses: some .2 s
TRIES = 6  # of pieces along one ray


def refine_limited(
    hull: Sets, hover: Floats, bounds: Floats, twists: Floats, tolerance: float, starts: int
) -> None:
    """Lowers the upper bound of the wrench margin by rays of the hull, turned to their normals."""
    forces, normal = np.empty((hull.faces.size, 3)), np.empty(6)
    for u in start_directions(starts, twists):
        before = np.inf
        for _ in range(TURNS):
            if ray(u, hull, hover, 0.1 * tolerance, forces, normal)[1] == np.inf:
                break
            size = np.linalg.norm(normal)
            radius, u = max(slack(normal, hull, hover), 0.0) / size, normal / size
            if radius < bounds[0, 1]:
                bounds[0, 1], twists[0] = radius, u
            if radius >= before * (1.0 - 1e-4):
                break
            before = radius
    bounds[0, 0] = min(bounds[0, 0], bounds[0, 1])


def certify_wrench(
    hull: Sets, hover: Floats, bounds: Floats, twists: Floats, tolerance: float
) -> None:
    """Raises the lower bound of the wrench margin to near the upper one, where pieces reach it.

    Tried are pieces along hover, to shares of the upper bound that the cones looked at allow.
    """
    convex, lowest = empty_pieces(hull), np.full(7, np.inf)
    pieces_into(np.tile(hover[:3], (hull.faces.size, 1)), hull, convex)
    for short in (0.3 * tolerance, 0.05):
        while not bounds[0, 0] >= bounds[0, 1] * (1.0 - short):
            radius = bounds[0, 1] * (1.0 - short)
            if certify(radius, convex, hover, CONES // hull.faces.size, lowest)[0]:
                bounds[0, 0] = radius
                return
            if lowest[0] >= radius:
                break
            above = slack(lowest[1:], hull, hover)  # the pieces' least is not the hull's
            if above >= bounds[0, 1]:
                break
            bounds[0, 1], twists[0] = above, lowest[1:]


def ray_bounds(
    sets: ForceSets, u: Floats, hover: Floats, scale: Floats, tolerance: float
) -> tuple[float, float]:
    """Returns lower and upper bound of the largest t with ``hover + t u`` in reach, all scaled.

    From below pieces are moved to the forces that the pieces before them gave.
    """
    hull = sets.hull((scale[0], scale[3]))
    span = span_columns(hull, sets.spans)
    lost = subspace(span, RANK_TOLERANCE)[1]
    if np.abs(lost.T @ u).max(initial=0.0) > 1e-9 * np.linalg.norm(u):
        return 0.0, 0.0
    forces, twist = np.empty((len(sets), 3)), np.empty(6)
    if sets.balls.all():
        limit = sets.strengths / scale[0]
        low, high = ray_casting.shoot(u, hull.points, limit, hover, twist)
        return min(max(low, 0.0), high), high
    upper = ray(u, hull, hover, 0.1 * tolerance, forces, twist)[1]
    best = 0.0
    convex = empty_pieces(hull)
    for anchor in (forces, np.tile(hover[:3], (len(sets), 1))):
        near, before = anchor.copy(), -np.inf
        for _ in range(TRIES):
            pieces_into(near, hull, convex)
            low = ray(u, convex, hover, 0.1 * tolerance, near, twist)[0]
            best = max(best, low)
            if low <= before * (1.0 + 0.1 * tolerance) or low == -np.inf:
                break
            before = low
        if upper - best <= tolerance * upper:
            break
    return min(best, upper), upper
