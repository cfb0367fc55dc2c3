"""The wrench margin of one vectored set: a search from many starts, and the distance outside.

The ball round hover is a non-convex minimum over six-dimensional twists: every start gives an upper
bound, the best of them is the margin named; the slices bound it from below (THEORY A4).
"""

import numpy as np
from numpy.typing import NDArray

from snakegen.wrench_margins.plain.ball_support import distance, shoot, slack

Floats = NDArray[np.float64]
TURNS = 50  # of a ray to the normal that was hit


def start_directions(count: int, twists: Floats) -> Floats:
    """Returns (≤ count, 6) start directions: the slices' twists, then axes and mixtures."""
    known = twists[1:][np.isfinite(twists[1:]).all(axis=1)]
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (max(count - 12, 0), 6))
    return np.ascontiguousarray(np.vstack([known, np.eye(6), -np.eye(6), signs])[:count])


def fall(
    u: Floats, p: Floats, limit: Floats, hover: Floats, bounds: Floats, twists: Floats
) -> None:
    """Lowers the wrench bound from directions u (6,) or (m, 6).

    Shoot, turn to the normal that was hit, repeat while the radius falls.
    """
    u, before = np.atleast_2d(u), np.full(np.atleast_2d(u).shape[0], np.inf)
    for _ in range(TURNS):
        _, above, normals = shoot(u, p, limit, hover)
        size = np.linalg.norm(normals, axis=1)
        radius, u = above / size, normals / size[:, None]
        best = int(np.argmin(radius))
        if radius[best] < bounds[0, 1]:
            bounds[0, 1], twists[0] = radius[best], u[best]
        falling = radius < before * (1.0 - 1e-10)
        if not falling.any():
            return
        u, before = u[falling], radius[falling]


def _separating(p: Floats, limit: Floats, hover: Floats, twists: Floats) -> tuple[float, Floats]:
    """Returns the distance that the known twists prove at least, and the unit twist that does."""
    units = twists[np.isfinite(twists).all(axis=1)]
    if not len(units):
        return 0.0, np.zeros(6)
    units = units / np.linalg.norm(units, axis=1, keepdims=True)
    proofs = -slack(units, p, limit, hover)
    return float(proofs.max()), units[int(np.argmax(proofs))]


def refine(
    p: Floats, limit: Floats, hover: Floats, bounds: Floats, twists: Floats, rank: int, starts: int
) -> None:
    """Searches the wrench margin from many starts, or measures the distance where infeasible."""
    if bounds[0, 1] < 0.0:
        known = _separating(p, limit, hover, twists)
        low, high, twists[0] = distance(p, limit, hover)
        if known[0] > low:  # a thin set, which the descent is slow to leave behind
            low, twists[0] = known
        bounds[0] = -high, -low
    elif rank == 6 and starts:
        fall(start_directions(starts, twists), p, limit, hover, bounds, twists)
        bounds[0, 0] = min(bounds[0, 0], bounds[0, 1])
