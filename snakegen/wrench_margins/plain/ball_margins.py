"""Certified margins of ball sets in NumPy, one posture (THEORY A4): the twin of a kernel.

The radius of a slice is bracketed by a polytope that grows from inside: the distance from hover to
its nearest facets is a lower bound, the support along their normals an upper bound and the next
points. The slices bound the wrench margin; `wrench_search` lowers its upper bound.
Everything is scaled: forces by F0, lengths by T0/F0; rows of p (n, 4) are (p_j, c_j).
`kernels/margins/vectored.py` serves batches.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from snakegen.wrench_margins.inner_ball import facets
from snakegen.wrench_margins.plain.ball_support import balance, net_wrench, slack, twist_speeds
from snakegen.wrench_margins.plain.zonotope import OFF, RANK_TOLERANCE, lost_direction, subspace

Floats = NDArray[np.float64]
SUPPORTS = 400  # then a slice says that it did not close
OUT = 1e-12  # scaled, by which a support below 0 proves hover out of reach
SURE = 1e-9  # of the forces, by which points may miss the slice that they are taken to lie in
FACETS = 16  # looked at in one round
SLICES = (slice(0, 3), slice(3, 6))


class Bracket(NamedTuple):
    """Bounds (3, 2) of wrench, force, torque, their twists (3, 6), rank, supports (2,)."""

    bounds: Floats
    twists: Floats
    rank: int
    calls: NDArray[np.int64]


def columns(p: Floats, limit: Floats) -> Floats:
    """Returns the scaled map times limits, (6, 3n): ``[E; p× + c E] L_j`` per apparatus."""
    speeds = twist_speeds(np.eye(6), p)  # (6, n, 3): row i is what twist i does
    return (speeds * limit[:, None]).reshape(6, -1)


def margins(p: Floats, limit: Floats, hover: Floats, tolerance: float) -> Bracket:
    """Returns what can be certified of one posture; ``bounds[0]`` is (-inf, -1) out of reach.

    Args:
        p: (n, 4) points and drags.
        limit: (n,) largest forces, positive.
        hover: (6,) wrench.
        tolerance: relative gap (upper - lower)/upper of the slices.
    """
    bounds, twists, calls = np.full((3, 2), np.nan), np.full((3, 6), np.nan), np.zeros(2, np.int64)
    a = columns(p, limit)
    basis, lost = subspace(a)
    rank = basis.shape[1]
    thickness = np.linalg.norm((lost.T @ a).reshape(6 - rank, len(p), 3), axis=2).sum(axis=1)
    inside = bool((np.abs(lost.T @ hover) <= thickness + OFF).all())
    for k, part in enumerate((slice(0, 6), *SLICES)):
        direction = lost_direction(lost, part)
        twists[k] = np.nan if direction is None else direction
    for k, part in enumerate(SLICES):
        if not inside:
            break
        if np.linalg.norm(lost[part], axis=1).max(initial=0.0) > RANK_TOLERANCE:
            bounds[1 + k] = 0.0
            continue
        low, high, twists[1 + k], calls[k] = slice_radius(part, p, limit, hover, tolerance)
        bounds[1 + k] = max(low, 0.0), high
        inside = high >= -OUT
    if not inside:
        bounds[:] = np.nan
        bounds[0] = -np.inf, -1.0
    elif rank < 6:
        bounds[0] = 0.0
    else:
        size = float(np.hypot(*bounds[1:, 0]))
        bounds[0, 0] = bounds[1, 0] * bounds[2, 0] / size if size > 0.0 else 0.0
        above = np.maximum(slack(twists[1:], p, limit, hover), 0.0)
        above /= np.linalg.norm(twists[1:], axis=1)
        bounds[0, 1], twists[0] = above.min(), twists[1 + int(np.argmin(above))]
    return Bracket(bounds, twists, rank, calls)


def slice_support(
    part: slice, e: Floats, p: Floats, limit: Floats, hover: Floats
) -> tuple[Floats, Floats, Floats, NDArray[np.bool_]]:
    """Returns the supports of a slice along unit directions e (m, 3) from above, and points of it.

    ``min over z of h(e, z) - (e, z)·w0``, z the other half of the twist.

    Returns:
        supports (m,), their twists (m, 6), attained points (m, 3), whether they are good (m,).
    """
    twists, free = np.zeros((len(e), 6)), SLICES[1] if part.start == 0 else SLICES[0]
    twists[:, part] = e
    maps = twist_speeds(np.eye(6)[free], p).transpose(1, 2, 0)  # (n, 3, 3)
    found = balance(
        twist_speeds(twists, p),
        np.broadcast_to(maps, (len(e), *maps.shape)),
        limit,
        np.broadcast_to(hover[free], (len(e), 3)),
        twists @ hover,
    )
    twists[:, free] = found.x
    points = net_wrench(found.forces, p, hover)[:, part]
    return slack(twists, p, limit, hover), twists, points, found.balanced


def slice_radius(
    part: slice, p: Floats, limit: Floats, hover: Floats, tolerance: float
) -> tuple[float, float, Floats, int]:
    """Returns (lower, upper, twist, supports) of the largest ball round hover in a slice.

    Stops at upper - lower ≤ tolerance · upper, or as soon as the upper bound is negative (hover
    lies outside); the lower bound is -inf where it fails.
    """
    directions = np.vstack([np.eye(3), -np.eye(3)])
    points, used, upper, worst, lower = np.empty((0, 3)), 0, np.inf, np.full(6, np.nan), -np.inf
    while True:
        above, twists, there, good = slice_support(part, directions, p, limit, hover)
        used += len(directions)
        at = int(np.argmin(above))
        if above[at] < upper:
            upper, worst = float(above[at]), twists[at]
        points = np.vstack([points, there[good]])
        if upper < -OUT * np.abs(points).max(initial=1.0):
            return -np.inf, upper, worst, used
        normals, offsets = facets(points)
        if not len(normals):  # flat so far: look across
            if used > 8 or len(points) < 3:
                return lower, upper, worst, used
            spread = np.linalg.svd(points - points.mean(axis=0))[2][-1]
            directions = np.vstack([spread, -spread])
            continue
        before, lower = lower, float(offsets.min()) - SURE * limit.sum()
        open_ = np.flatnonzero(offsets - SURE * limit.sum() < upper * (1.0 - tolerance))
        if not open_.size or used >= SUPPORTS or (used > 60 and lower <= before):
            return lower, upper, worst, used
        directions = normals[open_[np.argsort(offsets[open_])[:FACETS]]]
