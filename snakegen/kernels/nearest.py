"""The point of a zonotope nearest to a given one (Wolfe's minimum-norm point, 1976).

Finite and exact for polytopes: it keeps a small simplex of vertices whose affine minimum lies
inside, and asks the support function for the next vertex. Used where hover is infeasible.
"""

import numpy as np

from snakegen.kernels.jit import jit

DONE = 1e-15  # gap in squared distance, in units of the zonotope's squared size


@jit
def _vertex(a, y, x):
    """Returns the vertex of ``{a t, |t_i| ≤ ½} - y`` that lies farthest along -x."""
    d, n = a.shape
    p = -y
    for i in range(n):
        along = 0.0
        for c in range(d):
            along += x[c] * a[c, i]
        sign = -0.5 if along > 0.0 else 0.5
        for c in range(d):
            p[c] += sign * a[c, i]
    return p


@jit
def _affine_minimum(points, k):
    """Returns the weights (k,), summing to 1, of the affine hull's point nearest the origin."""
    gram = np.empty((k, k))
    for i in range(k):
        for j in range(k):
            gram[i, j] = 1.0 + (points[i] * points[j]).sum()
    v = np.linalg.solve(gram, np.ones(k))
    return v / v.sum()


@jit
def _descend(points, weights, k):
    """Moves to the affine minimum, dropping points until it lies inside; returns the new count."""
    while True:
        target = _affine_minimum(points, k)
        if target.min() > 1e-12:
            weights[:k] = target
            return k
        step = 1.0
        for i in range(k):
            if target[i] <= 1e-12 and weights[i] - target[i] > 0.0:
                step = min(step, weights[i] / (weights[i] - target[i]))
        kept = 0
        for i in range(k):
            weight = weights[i] + step * (target[i] - weights[i])
            if weight > 1e-12:
                weights[kept] = weight
                points[kept] = points[i]
                kept += 1
        if kept == k:  # rounding alone held every point: drop the lightest
            kept -= 1
            light = int(np.argmin(weights[:k]))
            weights[light] = weights[kept]
            points[light] = points[kept]
        k = kept
        weights[:k] /= weights[:k].sum()


@jit
def nearest(a, y):
    """Returns x (d,), the shortest vector from `y` (d,) to the zonotope of columns `a` (d, n)."""
    d = a.shape[0]
    scale = np.sqrt((y * y).sum()) + np.sqrt((a * a).sum())
    points = np.zeros((d + 2, d))
    weights = np.zeros(d + 2)
    points[0] = _vertex(a, y, -y)
    weights[0], k = 1.0, 1
    x = points[0].copy()
    for _ in range(1000):
        p = _vertex(a, y, x)
        if (x * (x - p)).sum() <= DONE * scale * np.sqrt((x * x).sum()):
            break
        known = k > d
        for i in range(k):
            known = known or np.abs(points[i] - p).max() <= 1e-14 * scale
        if known:
            break
        points[k], weights[k] = p, 0.0
        k = _descend(points, weights, k + 1)
        for c in range(d):
            x[c] = (weights[:k] * points[:k, c]).sum()
    return x
