"""How far the vectored wrench set reaches along a ray, and how far it is from a point outside.

Along u from hover: ``t = min over d·u = 1 of h(d) - d·w0``, convex in the five free components of
the twist d; at the minimum the forces give ``w0 + t u`` itself. Shooting again along the facet
normal that was hit can only lower slack(d)/‖d‖: that is the search for the wrench margin.
"""

import numpy as np

from snakegen.kernels.jit import jit
from snakegen.kernels.vectored import slack


@jit
def _maps(p, basis):
    """Returns (n, 3, k): how the twist's `basis` columns (6, k) move each point of application."""
    n, k = p.shape[0], basis.shape[1]
    out = np.empty((n, 3, k))
    for j in range(n):
        x, y, z = p[j]
        for i in range(k):
            v, w = basis[:3, i], basis[3:, i]
            out[j, 0, i] = v[0] + w[1] * z - w[2] * y
            out[j, 1, i] = v[1] + w[2] * x - w[0] * z
            out[j, 2, i] = v[2] + w[0] * y - w[1] * x
    return out


@jit
def _rounded(r, limit, smooth):
    total = 0.0
    for j in range(limit.size):
        total += limit[j] * np.sqrt((r[j] * r[j]).sum() + smooth * smooth)
    return total


@jit
def _minimise(start, maps, limit, cost, z, smooth, f, steps):
    """Newton on ``Σ L_j √(‖r_j‖² + smooth²) - cost·z``, r = start + maps z; True if balanced."""
    n, k = limit.size, z.size
    gradient, hessian = np.empty(k), np.empty((k, k))
    r = start.copy()
    for j in range(n):
        r[j] += maps[j] @ z
    now = _rounded(r, limit, smooth) - (cost * z).sum()
    for _ in range(steps):
        gradient[:] = -cost
        hessian[:] = 0.0
        for j in range(n):
            size = np.sqrt((r[j] * r[j]).sum() + smooth * smooth)
            f[j] = r[j] * (limit[j] / size)
            pull = maps[j].T @ (r[j] / size)
            gradient += limit[j] * pull
            hessian += (limit[j] / size) * (maps[j].T @ maps[j] - np.outer(pull, pull))
        if np.abs(gradient).sum() <= 1e-11 * limit.sum():
            return True
        damp = 1e-13 * np.trace(hessian)
        for i in range(k):
            hessian[i, i] += damp
        step = -np.linalg.solve(hessian, gradient)
        slope = (gradient * step).sum()
        share, new, trial = 1.0, now, r
        while share > 1e-5:
            trial = start.copy()
            for j in range(n):
                trial[j] += maps[j] @ (z + share * step)
            new = _rounded(trial, limit, smooth) - (cost * (z + share * step)).sum()
            if new <= now + 1e-4 * share * slope + 1e-15 * abs(now):
                break
            share *= 0.5
        if share <= 1e-5:
            return False
        z += share * step
        r, now = trial, new
    return False


@jit
def shoot(u, p, limit, hover, twist):
    """Returns (lower, upper) of the largest t with ``hover + t u`` in the set, all scaled.

    `twist` (6,) ends as the normal where the ray leaves, ``twist·u = 1``. The set must span u.
    """
    size = np.sqrt((u * u).sum())
    frame = np.zeros((6, 7))
    frame[:, 0] = u / size
    for c in range(6):
        frame[c, c + 1] = 1.0
    q, _ = np.linalg.qr(frame)
    basis = np.ascontiguousarray(q[:, 1:])
    maps = _maps(p, basis)
    start = np.ascontiguousarray(_maps(p, (u / size**2).reshape(6, 1))[:, :, 0])
    z, f = np.zeros(5), np.zeros((limit.size, 3))
    best, forces = z.copy(), f.copy()
    cost = basis.T @ hover
    smooth, balanced = 0.3, False
    while smooth > 1e-11:
        if not _minimise(start, maps, limit, cost, z, smooth, f, 40):
            break
        balanced = True
        best[:], forces[:] = z, f
        smooth *= 0.1
    twist[:] = u / size**2 + basis @ best
    upper = slack(twist, p, limit, hover)
    if not balanced:
        return -np.inf, upper
    reached = -hover
    for j in range(limit.size):
        reached[:3] += forces[j]
        reached[3:] += np.cross(p[j], forces[j])
    return (reached * u).sum() / size**2, upper


@jit
def weakest(starts, p, limit, hover, bound, twist):
    """Lowers `bound` ≥ the wrench margin from each of `starts` (k, 6); `twist` (6,) follows."""
    normal = np.empty(6)
    for k in range(starts.shape[0]):
        u, before = starts[k] / np.sqrt((starts[k] ** 2).sum()), np.inf
        for _ in range(50):
            _, above = shoot(u, p, limit, hover, normal)
            size = np.sqrt((normal * normal).sum())
            radius = above / size
            u = normal / size
            if radius < bound:
                bound = radius
                twist[:] = u
            if radius >= before * (1.0 - 1e-10):
                break
            before = radius
    return bound


@jit
def distance(p, limit, hover, rounds, twist):
    """Returns (lower, upper) of the scaled distance from `hover` to the set (accelerated descent).

    Minimises ``½‖Σ (f_j, p_j × f_j) - w0‖²`` over the balls; `twist` (6,) ends as the unit
    direction from the set to hover. Stops when the bounds agree to 1e-9.
    """
    n = limit.size
    f, ahead = np.zeros((n, 3)), np.zeros((n, 3))
    step = 0.0
    for j in range(n):
        step += 1.0 + (p[j] * p[j]).sum()
    step, momentum = 1.0 / step, 1.0
    low, high = -np.inf, np.inf
    for _ in range(rounds):
        gap = -hover
        for j in range(n):
            gap[:3] += ahead[j]
            gap[3:] += np.cross(p[j], ahead[j])
        fresh = ahead.copy()
        for j in range(n):
            fresh[j] -= step * (gap[:3] + np.cross(gap[3:], p[j]))
            size = np.sqrt((fresh[j] ** 2).sum())
            if size > limit[j]:
                fresh[j] *= limit[j] / size
        # start the momentum again where it leads uphill
        if ((ahead - fresh) * (fresh - f)).sum() > 0.0:
            momentum = 1.0
        faster = 0.5 * (1.0 + np.sqrt(1.0 + 4.0 * momentum * momentum))
        ahead = fresh + ((momentum - 1.0) / faster) * (fresh - f)
        f, momentum = fresh, faster
        residual = -hover
        for j in range(n):
            residual[:3] += f[j]
            residual[3:] += np.cross(p[j], f[j])
        size = np.sqrt((residual * residual).sum())
        if size < 1e-12:
            return 0.0, size
        high = min(high, size)
        unit = -residual / size
        below = -slack(unit, p, limit, hover)
        if below > low:
            low = below
            twist[:] = unit
        if high - low <= 1e-9 * high:
            break
    return max(low, 0.0), high
