"""Minimum of a sum of norms, ``Σ L_b ‖s_b + M_b x‖ - c·x + ½ q ‖x‖²``, with its dual point.

Each norm is rounded to ``√(r² + ε²)`` and ε driven down; at every ε Newton's method balances
``Σ M_bᵀ f_b + q x = c`` with ‖f_b‖ ≤ L_b, so the forces of the last ε are feasible whatever it is.
Rays through the vectored set, slices under joint limits (q = 0) and the distance from the set to
a point (q = 1) are problems of this form.
"""

import numpy as np

from snakegen.kernels.core.jit import jit

BALANCED, STILL = 1e-11, 1e-9  # of the largest forces: sought, and where rounding ends it
NOISE = 1e-15  # of the sum and of the largest forces, by which rounding may raise it
ROUNDEST, SHARPEST = 0.3, 1e-11


@jit
def _reach(start, maps, x, r):
    """Writes ``s_b + M_b x`` (B, 3) to `r`."""
    for b in range(start.shape[0]):
        for c in range(3):
            r[b, c] = start[b, c]
            for k in range(x.size):
                r[b, c] += maps[b, c, k] * x[k]


@jit
def objective(start, maps, limit, cost, square, x, smooth, r):
    """Returns the rounded objective at x (k,); `r` (B, 3) ends as the arguments of the norms."""
    _reach(start, maps, x, r)
    total = 0.0
    for k in range(x.size):
        total += (0.5 * square * x[k] - cost[k]) * x[k]
    for b in range(limit.size):
        size = r[b, 0] ** 2 + r[b, 1] ** 2 + r[b, 2] ** 2 + smooth * smooth
        total += limit[b] * np.sqrt(size)
    return total


@jit
def _derivatives(maps, limit, cost, square, x, smooth, r, f, g, h):
    """Fills the forces (B, 3), the gradient (k,) and the lower Hessian (k, k) at r."""
    size_x = g.size
    pull = np.empty(size_x)
    for k in range(size_x):
        g[k] = square * x[k] - cost[k]
        for l in range(k + 1):
            h[k, l] = square if k == l else 0.0
    for b in range(limit.size):
        size = np.sqrt(r[b, 0] ** 2 + r[b, 1] ** 2 + r[b, 2] ** 2 + smooth * smooth)
        stiff = limit[b] / size
        for c in range(3):
            f[b, c] = stiff * r[b, c]
        for k in range(size_x):
            pull[k] = 0.0
            for c in range(3):
                pull[k] += maps[b, c, k] * f[b, c]
            g[k] += pull[k]
            for l in range(k + 1):
                dot = 0.0
                for c in range(3):
                    dot += maps[b, c, k] * maps[b, c, l]
                h[k, l] += stiff * dot - pull[k] * pull[l] / (limit[b] * size)


@jit
def _solve(h, g, step):
    """Writes ``-H⁻¹ g`` (k,) by Cholesky's method, H's lower half lightly damped, overwritten."""
    n = g.size
    trace = 0.0
    for i in range(n):
        trace += h[i, i]
    for i in range(n):
        h[i, i] += 1e-13 * trace
        for j in range(i + 1):
            total = h[i, j]
            for k in range(j):
                total -= h[i, k] * h[j, k]
            h[i, j] = np.sqrt(max(total, 1e-15 * trace)) if i == j else total / h[j, j]
    for i in range(n):
        total = -g[i]
        for k in range(i):
            total -= h[i, k] * step[k]
        step[i] = total / h[i, i]
    for i in range(n - 1, -1, -1):
        total = step[i]
        for k in range(i + 1, n):
            total -= h[k, i] * step[k]
        step[i] = total / h[i, i]


@jit
def _newton(start, maps, limit, cost, square, x, smooth, f):
    """Newton's method with halved steps at one rounding, x in place; True if balanced."""
    n = x.size
    r, trial = np.empty(start.shape), np.empty(n)
    g, h, step = np.empty(n), np.empty((n, n)), np.empty(n)
    total, left = limit.sum(), np.inf
    now = objective(start, maps, limit, cost, square, x, smooth, r)
    for _ in range(60):
        _derivatives(maps, limit, cost, square, x, smooth, r, f, g, h)
        left = 0.0
        for k in range(n):
            left += abs(g[k])
        if left <= BALANCED * total:
            return True
        _solve(h, g, step)
        slope = 0.0
        for k in range(n):
            slope += g[k] * step[k]
        share, new = 1.0, now
        while share > 1e-6:
            for k in range(n):
                trial[k] = x[k] + share * step[k]
            new = objective(start, maps, limit, cost, square, trial, smooth, r)
            if new <= now + 1e-4 * share * slope + NOISE * (abs(now) + total):
                break
            share *= 0.5
        if share <= 1e-6 or (left <= STILL * total and share < 1.0):
            break
        x[:] = trial
        now = new
    return left <= STILL * total  # rounding: as flat as it gets


@jit
def minimise(start, maps, limit, cost, x, f, square=0.0, roundest=ROUNDEST, sharpest=SHARPEST):
    """Minimises from x (k,), in place; `f` (B, 3) ends as the balanced forces.

    `square` is q; ε goes from `roundest`, less where x is near the minimum, to `sharpest`.

    Returns the ε of the last balanced round, inf where none was: the objective at x and the value
    of the forces differ by at most ``ε Σ L_b``.
    """
    trial, forces = x.copy(), np.empty(f.shape)
    smooth, reached = roundest, np.inf
    while smooth > sharpest:
        if not _newton(start, maps, limit, cost, square, trial, smooth, forces):
            break
        reached = smooth
        x[:] = trial
        f[:] = forces
        smooth *= 0.2
    return reached
