"""Certifies a ball round hover in the wrench set of balls, in all six dimensions, in NumPy.

The ball of radius r lies in the set where ``h(d) - d·w0 ≥ r ‖d‖`` for every twist d. On a cone of
six unit directions d_i it does if a mixture s of the points of the set that lie farthest along
them has ``s·d_i ≥ r`` for all six, for then ``h(d) - d·w0 ≥ s·d ≥ r ‖d‖`` on the cone. The mixture
is chosen by a matrix game; cones that fail are halved across their longest edge, many at a time.
The readable twin of `kernels/margins/wrench_certificate.py`.
"""

import numpy as np
from numpy.typing import NDArray

from snakegen.wrench_margins.plain.ball_support import net_wrench, twist_speeds

Floats = NDArray[np.float64]
CONES = 1_000_000  # looked at for one radius, times apparatuses: some 1 s
TOGETHER = 4096  # cones in one round
ROUNDS = 12  # of the matrix game


def farthest(d: Floats, p: Floats, limit: Floats, hover: Floats) -> Floats:
    """Returns the set's points (m, 6) farthest along twists d (m, 6), seen from hover."""
    speed = twist_speeds(d, p)
    size = np.linalg.norm(speed, axis=2)
    return net_wrench(speed * (limit / np.maximum(size, 1e-300))[:, :, None], p, hover)


def covered(cones: Floats, points: Floats, r: float) -> NDArray[np.bool_]:
    """Tells of which cones (m, 6, 6) a mixture of the points (m, 6, 6) reaches r along all rows."""
    game = np.einsum("mkc,mic->mik", points, cones) - r
    share, out, rows = np.ones((len(cones), 6)), np.zeros(len(cones), bool), np.arange(len(cones))
    for _ in range(ROUNDS):
        value = np.einsum("mik,mk->mi", game, share)
        worst = value.argmin(axis=1)
        out |= value[rows, worst] >= 0.0
        share[rows, worst] += 0.15 * share.sum(axis=1)
    return out


def certify(r: float, p: Floats, limit: Floats, hover: Floats) -> tuple[bool, float, Floats]:
    """Returns whether the ball of radius r is certified, the least h(d) - d·w0 met, its twist."""
    signs = np.array(np.meshgrid(*[[1.0, -1.0]] * 6, indexing="ij")).reshape(6, -1).T
    waiting = signs[:, :, None] * np.eye(6)
    reach = farthest(waiting.reshape(-1, 6), p, limit, hover).reshape(-1, 6, 6)
    looked, least, twist = 0, np.inf, np.zeros(6)
    while len(waiting):
        cones, points = waiting[-TOGETHER:], reach[-TOGETHER:]
        waiting, reach = waiting[:-TOGETHER], reach[:-TOGETHER]
        looked += len(cones)
        if looked > CONES // len(p):
            return False, least, twist
        left = ~covered(cones, points, r)
        cones, points = cones[left], points[left]
        if not len(cones):
            continue
        along = np.einsum("mic,mkc->mik", cones, cones).reshape(len(cones), 36)
        first, second = np.divmod(along.argmin(axis=1), 6)  # the longest edge
        at = np.arange(len(cones))
        middle = cones[at, first] + cones[at, second]
        middle /= np.linalg.norm(middle, axis=1, keepdims=True)
        found = farthest(middle, p, limit, hover)
        value = np.einsum("mc,mc->m", found, middle)
        if value.min() < least:
            least, twist = float(value.min()), middle[int(value.argmin())]
            if least < r:
                return False, least, twist
        halves = [cones, cones.copy()], [points, points.copy()]
        for k, corner in enumerate((first, second)):
            halves[0][k][at, corner], halves[1][k][at, corner] = middle, found
        waiting = np.concatenate([waiting, *halves[0]])
        reach = np.concatenate([reach, *halves[1]])
    return True, least, twist


def certify_balls(
    p: Floats, limit: Floats, hover: Floats, bounds: Floats, twists: Floats, tolerance: float
) -> None:
    """Raises the lower bound of the wrench margin to near the upper one where that is certified.

    Args:
        p: (n, 4) scaled points and drags.
        limit: (n,) scaled; those of 0 are left out.
        hover: (6,) scaled.
        bounds, twists: (3, 2) and (3, 6), scaled; the first rows are brought up to date.
        tolerance: relative gap asked.
    """
    live = limit > 0.0
    p, limit = p[live], limit[live]
    for short in (0.3 * tolerance, 0.05):
        while not bounds[0, 0] >= bounds[0, 1] * (1.0 - short):
            radius = bounds[0, 1] * (1.0 - short)
            done, least, twist = certify(radius, p, limit, hover)
            if done:
                bounds[0, 0] = radius
                return
            if least >= radius or least >= bounds[0, 1]:
                break
            bounds[0, 1], twists[0] = least, twist
