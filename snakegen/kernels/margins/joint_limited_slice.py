"""Force or torque margin with joint torques within limits, for a batch of postures of ball sets.

A slice's support is ``min Σ L_j ‖v + ω × p_j + c_j ω + M_jᵀμ‖ + Σ limit_i |μ_i| + μ·bias - d·w0``
over the held half of the twist and the joint multipliers μ: joint i is one more norm, of μ_i. The
twin of `wrench_margins.joint_limited.vectored_joint_limited`; everything is scaled.
"""

import numpy as np

from snakegen.kernels.core.jit import jit
from snakegen.kernels.margins.inner_radius import POINTS, insert, simplex
from snakegen.kernels.margins.norms import ROUNDEST, minimise

SHARP = 1e-3  # of the tolerance: by how much norms are rounded at last
NEAR = 1e-2  # of the first rounding, at least, where a direction nearby is known


@jit
def _support(first, e, moves, limit, hover, problem, roundness, point):
    """Returns the support along e (3,), and writes the slice's point there (3,).

    `first` is the slice's first row: 0 of forces, 3 of torques; `roundness` what the norms are
    rounded by, first and last, from the multipliers that `problem` holds.
    """
    start, maps, cost, x, f = problem
    n, k = moves.shape[0], cost.size - 3
    for j in range(n):
        for c in range(3):
            start[j, c] = 0.0
            for a in range(3):
                start[j, c] += moves[j, c, first + a] * e[a]
    minimise(start, maps, limit, cost, x, f, 0.0, roundness[0], roundness[1])
    upper = 0.0
    for a in range(3):
        upper -= e[a] * hover[first + a]
        point[a] = -hover[first + a]
    for i in range(3 + k):
        upper -= cost[i] * x[i]
    for b in range(n + k):
        size = 0.0
        for c in range(3):
            reach = start[b, c]
            for i in range(3 + k):
                reach += maps[b, c, i] * x[i]
            size += reach * reach
        upper += limit[b] * np.sqrt(size)
    for j in range(n):
        for c in range(3):
            for a in range(3):
                point[a] += moves[j, c, first + a] * f[j, c]
    return upper


@jit
def _radius(first, moves, bends, limit, hover, bias, tolerance, work):
    """Returns (lower, upper) of the slice's inner radius; an upper below 0: no hover in reach."""
    points, known, facets, planes, edges = work
    n, k, held = moves.shape[0], bias.size, 3 - first
    start, maps = np.zeros((n + k, 3)), np.zeros((n + k, 3, 3 + k))
    cost, x, f = np.empty(3 + k), np.zeros(3 + k), np.zeros((n + k, 3))
    for a in range(3):
        cost[a] = hover[held + a]
        for j in range(n):
            for c in range(3):
                maps[j, c, a] = moves[j, c, held + a]
    for i in range(k):
        cost[3 + i] = -bias[i]
        maps[n + i, 0, 3 + i] = 1.0
        for j in range(n):
            for c in range(3):
                maps[j, c, 3 + i] = bends[j, c, i]
    problem, sharpest = (start, maps, cost, x, f), SHARP * tolerance
    e, point, upper, size = np.zeros(3), np.empty(3), np.inf, 0.0
    for s in range(6):
        e[:] = 0.0
        e[s // 2] = 1.0 - 2.0 * (s % 2)
        x[:] = 0.0
        rounded = (ROUNDEST, sharpest)
        upper = min(upper, _support(first, e, moves, limit, hover, problem, rounded, point))
        if upper < 0.0:
            return -np.inf, upper
        points[s], known[s, :3], known[s, 3:] = point, e, x
        size = max(size, np.abs(point).max())
    count, one, two, three, four = simplex(points, 6, facets, planes)
    if count == 0:
        return 0.0, upper
    slack, weakest = 1e-13 * size, 0
    for s in range(6):
        if s not in (one, two, three, four):
            count, weakest = insert(points, s, facets, planes, count, edges, slack)
    used = 6
    while True:
        lower = planes[weakest, 3]
        if upper - lower <= tolerance * upper or used == POINTS or count == 0:
            return lower, upper
        for a in range(3):
            e[a] = planes[weakest, a]
        close, nearest = -1.0, 0
        for s in range(used):
            cosine = known[s, 0] * e[0] + known[s, 1] * e[1] + known[s, 2] * e[2]
            if cosine > close:
                close, nearest = cosine, s
        x[:] = known[nearest, 3:]
        rounded = (ROUNDEST * max(1.0 - close, NEAR), sharpest)
        above = _support(first, e, moves, limit, hover, problem, rounded, point)
        upper = min(upper, above)
        reach = point[0] * e[0] + point[1] * e[1] + point[2] * e[2]
        if upper < 0.0 or reach - lower <= slack:
            return lower, upper
        points[used], known[used, :3], known[used, 3:] = point, e, x
        count, weakest = insert(points, used, facets, planes, count, edges, slack)
        used += 1


@jit
def batch(torque, moves, bends, limit, hover, bias, free, tolerance, bounds):
    """Fills the certified bounds (m, 2) of one margin of m postures; nan: hover breaks a limit.

    Args:
        torque: True for the torque margin, False for the force margin.
        moves: (m, n, 3, 6), what a twist moves each thrust point by.
        bends: (m, n, 3, k), joint torques per unit of each force.
        limit: (n + k,), of the apparatuses' forces and of the joints' torques.
        hover, bias: (m, 6) and (m, k).
        free: (m, 2), bounds without joint limits; 0 or nan stays.
        tolerance: relative gap.
        bounds: filled.
    """
    facets, edges = np.empty((2 * POINTS + 8, 3), np.int64), np.empty((6 * POINTS, 2), np.int64)
    known, planes = np.empty((POINTS, 6 + bias.shape[1])), np.empty((2 * POINTS + 8, 4))
    work = (np.empty((POINTS, 3)), known, facets, planes, edges)
    for i in range(moves.shape[0]):
        bounds[i] = free[i]
        if not free[i, 1] > 0.0:
            continue
        low, high = _radius(
            3 if torque else 0, moves[i], bends[i], limit, hover[i], bias[i], tolerance, work
        )
        bounds[i] = np.nan
        if high >= 0.0:
            bounds[i, 0], bounds[i, 1] = max(low, 0.0), min(high, free[i, 1])
