"""The wrench margin of one vectored set: a search from many starts, and the distance outside.

The ball round hover is a non-convex minimum over six-dimensional twists: every start gives an upper
bound, the best of them is the margin named; the slices bound it from below (THEORY A4).
"""

import numpy as np
from numpy.typing import NDArray

from snakegen.kernels.margins import ray_casting

Floats = NDArray[np.float64]


def start_directions(count: int, twists: Floats) -> Floats:
    """Returns (≤ count, 6) start directions: the slices' twists, then axes and mixtures."""
    known = twists[1:][np.isfinite(twists[1:]).all(axis=1)]
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (max(count - 12, 0), 6))
    return np.ascontiguousarray(np.vstack([known, np.eye(6), -np.eye(6), signs])[:count])


def fall(
    u: Floats, p: Floats, limit: Floats, hover: Floats, bounds: Floats, twists: Floats
) -> None:
    """Lowers the wrench bound from direction u: shoot, turn to the normal that was hit, repeat."""
    normal, before = np.empty(6), np.inf
    for _ in range(50):
        above = ray_casting.shoot(u, p, limit, hover, normal)[1]
        size = np.linalg.norm(normal)
        radius, u = above / size, normal / size
        if radius < bounds[0, 1]:
            bounds[0, 1], twists[0] = radius, u
        if radius >= before * (1.0 - 1e-10):
            return
        before = radius


def _separating(p: Floats, limit: Floats, hover: Floats, twists: Floats) -> tuple[float, Floats]:
    """Returns the distance that the known twists prove at least, and the unit twist that does."""
    units = twists[np.isfinite(twists).all(axis=1)]
    units = units / np.linalg.norm(units, axis=1, keepdims=True)
    work = np.empty((len(limit), 3))
    proofs = [(-ray_casting.slack(u, p, limit, hover, 0.0, work), u) for u in units]
    return max(proofs, key=lambda proof: proof[0], default=(0.0, np.zeros(6)))


def refine(
    p: Floats, limit: Floats, hover: Floats, bounds: Floats, twists: Floats, rank: int, starts: int
) -> None:
    """Searches the wrench margin from many starts, or measures the distance where infeasible."""
    if bounds[0, 1] < 0.0:
        known = _separating(p, limit, hover, twists)
        low, high = ray_casting.distance(p, limit, hover, 20000, twists[0])
        if known[0] > low:  # a thin set, which the descent is slow to leave behind
            low, twists[0] = known
        bounds[0] = -high, -low
    elif rank == 6 and starts:
        for start in start_directions(starts, twists):
            fall(start, p, limit, hover, bounds, twists)
        bounds[0, 0] = min(bounds[0, 0], bounds[0, 1])
