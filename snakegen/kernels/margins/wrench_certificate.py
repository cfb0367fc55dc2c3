"""Certifies a ball round hover in a wrench set, in all six dimensions, by splitting directions.

The ball of radius r lies in a convex set where ``f(d) = h(d) - d · w0 ≥ r ‖d‖`` for every twist d.
On a cone of six directions d_i it does if one point s of the set has ``s · d_i ≥ r ‖d_i‖`` for all
of them, for then ``f(d) ≥ s · d ≥ r ‖d‖`` on the cone. The points tried are mixtures of those
farthest along the d_i, chosen by a matrix game; a cone that fails is halved across its longest
edge.
"""

import numpy as np

from snakegen.kernels.core.jit import jit
from snakegen.kernels.margins.force_sets import farthest, wrench_into

DEPTH = 4000  # of the stack of cones
ROUNDS = 12  # of the matrix game


@jit
def _support(twist, sets, hover, out, d, u, f, w):
    """Writes the set's point (6,) farthest along a twist, seen from hover."""
    for c in range(6):
        out[c] = -hover[c]
    for j in range(sets.faces.size):
        farthest(j, twist, sets, d, u, f)
        wrench_into(j, f, sets, w)
        for c in range(6):
            out[c] += w[c]


@jit
def _covered(cone, points, r, game, share):
    """Tells whether a mixture of the points (6, 6) reaches r along all directions (6, 6), unit."""
    for i in range(6):
        for k in range(6):
            total = 0.0
            for c in range(6):
                total += points[k, c] * cone[i, c]
            game[i, k] = total - r
    for k in range(6):
        share[k] = 1.0
    total = 6.0
    for _ in range(ROUNDS):
        worst, least = 0, np.inf
        for i in range(6):
            value = 0.0
            for k in range(6):
                value += game[i, k] * share[k]
            if value < least:
                worst, least = i, value
        if least >= 0.0:
            return True
        share[worst] += 0.15 * total
        total *= 1.15
    return False


@jit
def certify(r, sets, hover, budget, lowest):
    """Returns (certified, cones looked at): whether the ball of radius r lies in the convex sets.

    `lowest` (7,) is the least ``f(d)/‖d‖`` met and its unit direction, lowered where one is less.
    """
    cones, points = np.empty((DEPTH, 6, 6)), np.empty((DEPTH, 6, 6))
    game, share, middle, found = np.empty((6, 6)), np.empty(6), np.empty(6), np.empty(6)
    d, u, f, w = np.empty(3), np.empty(3), np.empty(3), np.empty(6)
    count = 0
    for signs in range(64):
        for i in range(6):
            cones[count, i] = 0.0
            cones[count, i, i] = 1.0 if (signs >> i) & 1 else -1.0
            _support(cones[count, i], sets, hover, points[count, i], d, u, f, w)
        count += 1
    looked = 0
    while count > 0:
        looked += 1
        if looked > budget or count + 1 >= DEPTH:
            return False, looked
        top = count - 1
        if _covered(cones[top], points[top], r, game, share):
            count -= 1
            continue
        first, second, apart = 0, 1, np.inf
        for i in range(6):
            for k in range(i):
                along = 0.0
                for c in range(6):
                    along += cones[top, i, c] * cones[top, k, c]
                if along < apart:
                    first, second, apart = i, k, along
        size = 0.0
        for c in range(6):
            middle[c] = cones[top, first, c] + cones[top, second, c]
            size += middle[c] ** 2
        size = np.sqrt(size)
        for c in range(6):
            middle[c] /= size
        _support(middle, sets, hover, found, d, u, f, w)
        value = 0.0
        for c in range(6):
            value += found[c] * middle[c]
        if value < lowest[0]:
            lowest[0] = value
            lowest[1:] = middle
            if value < r:
                return False, looked
        cones[count], points[count] = cones[top], points[top]
        cones[top, first], points[top, first] = middle, found
        cones[count, second], points[count, second] = middle, found
        count += 1
    return True, looked
