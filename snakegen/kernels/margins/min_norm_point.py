"""The point of a zonotope nearest to a given one (Wolfe's minimum-norm point, 1976).

Finite and exact for polytopes: it keeps a small simplex of vertices whose affine minimum lies
inside, and asks the support function for the next vertex. Used where hover is infeasible.
"""

import numpy as np

from snakegen.kernels.core.jit import jit

DONE = 1e-15  # gap in distance, in units of the zonotope's size


@jit
def _vertex(a, y, x, p):
    """Writes to `p` the vertex of ``{a t, |t_i| ≤ ½} - y`` that lies farthest along -x."""
    d, n = a.shape
    for c in range(d):
        p[c] = -y[c]
    for i in range(n):
        along = 0.0
        for c in range(d):
            along += x[c] * a[c, i]
        sign = -0.5 if along > 0.0 else 0.5
        for c in range(d):
            p[c] += sign * a[c, i]


@jit
def _affine_minimum(points, k, h, target):
    """Fills `target` (k,), summing to 1: the affine hull's point nearest the origin.

    Solves ``(1 1ᵀ + P Pᵀ) v = 1`` by Cholesky's method in `h`; False where points depend.
    """
    for i in range(k):
        for j in range(i + 1):
            total = 1.0
            for c in range(points.shape[1]):
                total += points[i, c] * points[j, c]
            whole = total
            for m in range(j):
                total -= h[i, m] * h[j, m]
            if i == j:
                if total <= 1e-14 * whole:
                    return False
                h[i, i] = np.sqrt(total)
            else:
                h[i, j] = total / h[j, j]
    total = 0.0
    for i in range(k):
        target[i] = 1.0
        for m in range(i):
            target[i] -= h[i, m] * target[m]
        target[i] /= h[i, i]
    for i in range(k - 1, -1, -1):
        for m in range(i + 1, k):
            target[i] -= h[m, i] * target[m]
        target[i] /= h[i, i]
        total += target[i]
    for i in range(k):
        target[i] /= total
    return True


@jit
def _descend(points, weights, k, h, target):
    """Moves to the affine minimum, dropping points until it lies inside; the new count, 0 stuck."""
    while True:
        if not _affine_minimum(points, k, h, target):
            return 0
        step, blocked = 1.0, -1
        for i in range(k):
            if target[i] <= 0.0 and weights[i] / (weights[i] - target[i]) < step:
                step, blocked = weights[i] / (weights[i] - target[i]), i
        for i in range(k):
            weights[i] += step * (target[i] - weights[i])
        if blocked < 0:
            return k
        weights[blocked] = 0.0
        kept = 0
        for i in range(k):
            if weights[i] > 0.0:
                weights[kept] = weights[i]
                for c in range(points.shape[1]):
                    points[kept, c] = points[i, c]
                kept += 1
        k = kept


@jit
def nearest(a, y, x):
    """Writes to x (d,) the shortest vector from `y` (d,) to the zonotope of columns `a` (d, n)."""
    d, n = a.shape
    scale = 0.0
    for c in range(d):
        scale += y[c] * y[c]
        for i in range(n):
            scale += a[c, i] * a[c, i]
    scale = np.sqrt(scale)
    unit, at = a / scale, y / scale
    points, weights, p = np.zeros((d + 2, d)), np.zeros(d + 2), np.empty(d)
    h, target, best = np.empty((d + 2, d + 2)), np.empty(d + 2), np.empty(d)
    for c in range(d):
        x[c] = -at[c]
    _vertex(unit, at, x, points[0])
    weights[0], k = 1.0, 1
    for _ in range(1000):
        length, along = 0.0, 0.0
        for c in range(d):
            x[c] = 0.0
            for i in range(k):
                x[c] += weights[i] * points[i, c]
            length += x[c] * x[c]
        _vertex(unit, at, x, p)
        for c in range(d):
            along += x[c] * p[c]
        if length - along <= DONE * np.sqrt(length) or k > d:
            break
        for c in range(d):
            points[k, c], best[c] = p[c], x[c]
        weights[k] = 0.0
        k = _descend(points, weights, k + 1, h, target)
        if k == 0:  # rounding: no better point can be distinguished
            x[:] = best
            break
    for c in range(d):
        x[c] *= scale
