"""The exact optimum of a vectored margin, for a batch (twin of `wrench_margins.saddle_point`).

Balls only. Newton's method on forces, twist and value at once, ``f = Π(f + σ B d)``, Π the
projection on the ball; from the twist of a search to 1e-3 two or three steps end at rounding.
"""

import numpy as np

from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.no_alloc import bare

STEPS = 25
ROUNDED = (3e-3, 0.1, 1e-4)  # of the fastest point: a first guess's forces turn over this speed
SOLVED = 1e-12  # residual, of the sum of limits
DAMPED = 1e-10  # on the diagonal: two apparatuses on one axis share a force that no equation fixes


@bare
def _eliminate(a, b, n):
    """Solves a x = b in place by Gauss elimination with row pivots; x in b; False if singular."""
    for i in range(n):
        p, most = i, abs(a[i, i])
        for r in range(i + 1, n):
            if abs(a[r, i]) > most:
                p, most = r, abs(a[r, i])
        if not most > 1e-300:
            return False
        if p != i:
            for c in range(i, n):
                a[i, c], a[p, c] = a[p, c], a[i, c]
            b[i], b[p] = b[p], b[i]
        unit = 1.0 / a[i, i]
        for r in range(i + 1, n):
            factor = a[r, i] * unit
            if factor != 0.0:
                for c in range(i + 1, n):
                    a[r, c] -= factor * a[i, c]
                b[r] -= factor * b[i]
    for i in range(n - 1, -1, -1):
        total = b[i]
        for c in range(i + 1, n):
            total -= a[i, c] * b[c]
        b[i] = total / a[i, i]
    return True


@bare
def _speed(d, p, j, k):
    """Returns component k of v + ω × p_j + c_j ω."""
    if k == 0:
        return d[0] + d[4] * p[j, 2] - d[5] * p[j, 1] + d[3] * p[j, 3]
    if k == 1:
        return d[1] + d[5] * p[j, 0] - d[3] * p[j, 2] + d[4] * p[j, 3]
    return d[2] + d[3] * p[j, 1] - d[4] * p[j, 0] + d[5] * p[j, 3]


@bare
def _column(p, j, k, c):
    """Returns entry (k, c) of B_j, c = 0…5."""
    if c < 3:
        return 1.0 if c == k else 0.0
    c -= 3
    if c == k:
        return p[j, 3]
    if (c + 1) % 3 == k:
        return -p[j, (c + 2) % 3]
    return p[j, (c + 1) % 3]


@bare
def _residual(x, p, limit, stiff, hover, rows, left, ahead, length):
    """Writes the residual (7 + 3n,), ``y_j = f_j + σ_j B_j d`` and its length; the largest entry.

    x is [d, f, μ].
    """
    n, last = limit.size, x.size - 1
    for c in range(6):
        left[c] = -hover[c] - x[last] * rows[c] * x[c]
    square = 1.0
    for c in range(6):
        square -= rows[c] * x[c] * x[c]
    left[last] = 0.5 * square
    for j in range(n):
        at, size = 6 + 3 * j, 0.0
        for k in range(3):
            ahead[j, k] = x[at + k] + stiff[j] * _speed(x, p, j, k)
            size += ahead[j, k] ** 2
            left[k] += x[at + k]
        size = np.sqrt(size)
        length[j] = size
        share = limit[j] / size if size > limit[j] else 1.0
        for k in range(3):
            left[at + k] = x[at + k] - share * ahead[j, k]
        fx, fy, fz = x[at], x[at + 1], x[at + 2]
        left[3] += p[j, 1] * fz - p[j, 2] * fy + p[j, 3] * fx
        left[4] += p[j, 2] * fx - p[j, 0] * fz + p[j, 3] * fy
        left[5] += p[j, 0] * fy - p[j, 1] * fx + p[j, 3] * fz
    most = 0.0
    for i in range(x.size):
        most = max(most, abs(left[i]))
    return most


@bare
def _matrix(x, p, limit, stiff, rows, ahead, length, a):
    """Writes the derivative (7 + 3n, 7 + 3n) of the residual."""
    n, last = limit.size, x.size - 1
    for i in range(x.size):
        for c in range(x.size):
            a[i, c] = 0.0
    for c in range(6):
        a[c, c] = -x[last] * rows[c] - DAMPED
        a[c, last] = a[last, c] = -rows[c] * x[c]
    for j in range(n):
        at = 6 + 3 * j
        out = length[j] > limit[j]
        share = limit[j] / length[j] if out else 1.0
        for k in range(3):
            for c in range(6):
                a[c, at + k] = _column(p, j, k, c)
            a[at + k, at + k] = 1.0 + DAMPED
            for l in range(3):
                slope = share * (1.0 if k == l else 0.0)
                if out:
                    slope -= share * ahead[j, k] * ahead[j, l] / (length[j] * length[j])
                a[at + k, at + l] -= slope
                for c in range(6):
                    a[at + k, c] -= stiff[j] * slope * _column(p, j, l, c)


@jit
def work_space(n):
    """Returns the arrays that `saddle` uses over and over, for n apparatuses."""
    m = 7 + 3 * n
    return (
        np.empty(m),
        np.empty(m),
        np.empty(m),
        np.empty((m, m)),
        np.empty((n, 3)),
        np.empty(n),
        np.empty(n),
    )


@bare
def saddle(p, limit, hover, rows, rounded, d, f, work):
    """Moves twist d (6,) and forces f (n, 3) to the stationary point near d; (value, solved).

    Args:
        p: (n, 4) scaled points and drags.
        limit: (n,) scaled.
        hover: (6,) scaled.
        rows: (6,) diagonal of M: which rows the margin measures.
        rounded: one of `ROUNDED`, to be tried in turn.
        d: (6,) start, moved.
        f: (n, 3), filled.
        work: from `work_space`.
    """
    x, left, trial, a, ahead, length, stiff = work
    n, m = limit.size, x.size
    size, square, reach = 0.0, 0.0, 1e-12
    for c in range(6):
        square += rows[c] * d[c] * d[c]
    unit = 1.0 / np.sqrt(square)
    for c in range(6):
        x[c] = d[c] * unit
    x[m - 1] = 0.0
    for c in range(6):
        x[m - 1] -= x[c] * hover[c]
    for j in range(n):
        length[j] = 0.0
        for k in range(3):
            ahead[j, k] = _speed(x, p, j, k)
            length[j] += ahead[j, k] ** 2
        length[j] = np.sqrt(length[j])
        reach = max(reach, length[j])
        size += limit[j]
    for j in range(n):
        stiff[j] = limit[j] / reach
        share = limit[j] / max(length[j], rounded * reach)
        x[m - 1] += share * length[j] * length[j]
        for k in range(3):
            x[6 + 3 * j + k] = share * ahead[j, k]
    most = _residual(x, p, limit, stiff, hover, rows, left, ahead, length)
    for _ in range(STEPS):
        if most < 0.01 * SOLVED * size:
            break
        before = 0.0
        for i in range(m):
            before += left[i] * left[i]
        _matrix(x, p, limit, stiff, rows, ahead, length, a)
        for i in range(m):
            trial[i] = -left[i]
        if not _eliminate(a, trial, m):
            break
        share, after = 1.0, before
        for i in range(m):
            a[0, i] = x[i]  # the matrix is spent: its rows keep the point and the step
            a[1, i] = trial[i]
        while True:
            for i in range(m):
                x[i] = a[0, i] + share * a[1, i]
            most = _residual(x, p, limit, stiff, hover, rows, left, ahead, length)
            after = 0.0
            for i in range(m):
                after += left[i] * left[i]
            if after < before * (1.0 - 1e-4 * share) or share < 1e-3:
                break
            share *= 0.5
        if after >= before:  # rounding, or lost
            break
    for c in range(6):
        d[c] = x[c]
    for j in range(n):
        for k in range(3):
            f[j, k] = x[6 + 3 * j + k]
    return x[m - 1], most < SOLVED * size


@jit
def batch(points, limit, hover, rows, bounds, twists, values, forces, solved):
    """Sharpens one margin of m postures: exact values, twists (in place) and forces, all scaled.

    Args:
        points: (m, n, 4).
        limit: (n,).
        hover: (m, 6).
        rows: (6,) which rows the margin measures.
        bounds: (m, 2) certified bounds of the margin.
        twists: (m, 6) of the upper bounds, moved.
        values: (m,), filled; 0 where a direction is lost, nan where hover is out of reach.
        forces: (m, n, 3), filled.
        solved: (m,), filled: 1 exact; 0 no derivative (0 or nan as above, or not found, when the
            value is the upper bound).
    """
    d, work = np.empty(6), work_space(limit.size)
    for i in range(points.shape[0]):
        solved[i], values[i] = 0, bounds[i, 1]
        if not bounds[i, 1] > 0.0:
            continue
        for rounded in ROUNDED:
            d[:] = twists[i]
            value, done = saddle(points[i], limit, hover[i], rows, rounded, d, forces[i], work)
            if done and bounds[i, 0] * (1.0 - 1e-9) <= value <= bounds[i, 1] * (1.0 + 1e-9):
                solved[i], values[i] = 1, value
                twists[i] = d
                break
