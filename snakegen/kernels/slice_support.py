"""Support function of a slice of the vectored wrench set (THEORY A4), with a point that proves it.

The set is ``{(Σ f_j, Σ p_j × f_j), ‖f_j‖ ≤ L_j}``. Its force slice (torque held at τ0) and torque
slice (force held at f0), seen from hover, have along a unit e the support

    g(e) = min over z of  Σ L_j ‖v + ω × p_j‖ - v·f0 - ω·τ0,

(v, ω) = (e, z) for the force slice and (z, e) for the torque slice. Any z bounds g from above; at
the minimum the forces ``f_j = L_j r_j/‖r_j‖``, r_j = v + ω × p_j, balance and give a point of the
slice, which bounds it from below. The minimum often sits on a kink (r_j = 0, an apparatus on the
twist axis): in the torque slice that is Weber's problem, and its vertex test settles it exactly.
"""

import numpy as np

from snakegen.kernels.jit import jit

BALANCED = 1e-10  # residual of the held wrench, in units of the largest forces


@jit(fastmath={"contract", "nsz"})
def _reach(e, z, torque, p, j):
    """Returns r_j = v + ω × p_j."""
    if torque:
        return (
            z[0] + e[1] * p[j, 2] - e[2] * p[j, 1],
            z[1] + e[2] * p[j, 0] - e[0] * p[j, 2],
            z[2] + e[0] * p[j, 1] - e[1] * p[j, 0],
        )
    return (
        e[0] + z[1] * p[j, 2] - z[2] * p[j, 1],
        e[1] + z[2] * p[j, 0] - z[0] * p[j, 2],
        e[2] + z[0] * p[j, 1] - z[1] * p[j, 0],
    )


@jit(fastmath={"contract", "nsz"})
def value(e, z, torque, p, limit, hover, smooth):
    """Returns the objective at z, each norm rounded to ``√(r² + smooth²)``."""
    total = 0.0
    for j in range(limit.size):
        x, y, w = _reach(e, z, torque, p, j)
        total += limit[j] * np.sqrt(x * x + y * y + w * w + smooth * smooth)
    a, b = (3, 0) if torque else (0, 3)
    for c in range(3):
        total -= e[c] * hover[a + c] + z[c] * hover[b + c]
    return total


@jit(fastmath={"contract", "nsz"})
def _derivatives(e, z, torque, p, limit, hover, smooth, f, gradient, hessian):
    """Fills the forces (n, 3), the gradient (3,) and the Hessian (3, 3), flat (6,) upper."""
    held = 0 if torque else 3
    for c in range(3):
        gradient[c] = -hover[held + c]
    hessian[:] = 0.0
    for j in range(limit.size):
        x, y, w = _reach(e, z, torque, p, j)
        size = np.sqrt(x * x + y * y + w * w + smooth * smooth)
        stiff = limit[j] / size
        x, y, w = x / size, y / size, w / size
        f[j, 0], f[j, 1], f[j, 2] = limit[j] * x, limit[j] * y, limit[j] * w
        a, b, c, k = 0.0, 0.0, 0.0, 1.0
        if not torque:
            a, b, c = p[j, 0], p[j, 1], p[j, 2]
            k = a * a + b * b + c * c
            x, y, w = b * w - c * y, c * x - a * w, a * y - b * x
        gradient[0] += limit[j] * x
        gradient[1] += limit[j] * y
        gradient[2] += limit[j] * w
        hessian[0] += stiff * (k - a * a - x * x)
        hessian[1] += stiff * (-a * b - x * y)
        hessian[2] += stiff * (-a * c - x * w)
        hessian[3] += stiff * (k - b * b - y * y)
        hessian[4] += stiff * (-b * c - y * w)
        hessian[5] += stiff * (k - c * c - w * w)


@jit
def _solve(h, g, out):
    """Writes ``-H⁻¹ g`` (3,) by Cramer's rule, H (6,) upper, lightly damped."""
    damp = 1e-13 * (h[0] + h[3] + h[5]) + 1e-300
    a, b, c, d, e, f = h[0] + damp, h[1], h[2], h[3] + damp, h[4], h[5] + damp
    p, q, r = d * f - e * e, c * e - b * f, b * e - c * d
    scale = -1.0 / (a * p + b * q + c * r)
    out[0] = scale * (p * g[0] + q * g[1] + r * g[2])
    out[1] = scale * (q * g[0] + (a * f - c * c) * g[1] + (b * c - a * e) * g[2])
    out[2] = scale * (r * g[0] + (b * c - a * e) * g[1] + (a * d - b * b) * g[2])


@jit
def _kink(e, z, p, limit, hover, f, v, rest):
    """Weber's vertex test (torque slice) at the apparatus nearest to the twist axis.

    True where r_j = 0 is the minimum: then z is set there and f (n, 3) balances exactly.
    """
    n = limit.size
    nearest, least = 0, np.inf
    for j in range(n):
        x, y, w = _reach(e, z, True, p, j)
        if x * x + y * y + w * w < least:
            nearest, least = j, x * x + y * y + w * w
    x, y, w = _reach(e, z, True, p, nearest)
    room = 0.0
    v[0], v[1], v[2] = z[0] - x, z[1] - y, z[2] - w
    rest[0], rest[1], rest[2] = hover[0], hover[1], hover[2]
    for j in range(n):
        x, y, w = _reach(e, v, True, p, j)
        size = np.sqrt(x * x + y * y + w * w)
        if j == nearest or size < 1e-13:
            f[j, 0] = np.nan
            room += limit[j]
            continue
        f[j, 0], f[j, 1], f[j, 2] = limit[j] * x / size, limit[j] * y / size, limit[j] * w / size
        for c in range(3):
            rest[c] -= f[j, c]
    if rest[0] * rest[0] + rest[1] * rest[1] + rest[2] * rest[2] > room * room:
        return False
    for j in range(n):
        if np.isnan(f[j, 0]):
            for c in range(3):
                f[j, c] = rest[c] * limit[j] / room
    z[0], z[1], z[2] = v[0], v[1], v[2]
    return True


@jit
def _newton(e, z, torque, p, limit, hover, smooth, f, steps, scratch):
    """Newton's method with halved steps from z, in place; 1 converged, 2 at a kink, 0 neither."""
    gradient, hessian, step, trial, v, rest = scratch
    now = value(e, z, torque, p, limit, hover, smooth)
    small = BALANCED * limit.sum()
    noise = 1e-15 * (abs(now) + limit.sum())  # the terms cancel: more than that of their sum
    for _ in range(steps):
        _derivatives(e, z, torque, p, limit, hover, smooth, f, gradient, hessian)
        if abs(gradient[0]) + abs(gradient[1]) + abs(gradient[2]) <= small:
            return 1
        _solve(hessian, gradient, step)
        slope = gradient[0] * step[0] + gradient[1] * step[1] + gradient[2] * step[2]
        share = 1.0
        while share > 1e-4:
            for c in range(3):
                trial[c] = z[c] + share * step[c]
            new = value(e, trial, torque, p, limit, hover, smooth)
            if new <= now + 1e-4 * share * slope + noise:
                break
            share *= 0.5
        if torque and share < 1.0 and _kink(e, trial, p, limit, hover, f, v, rest):
            z[:] = trial
            return 2
        if share <= 1e-4:
            return 0
        z[0], z[1], z[2] = trial[0], trial[1], trial[2]
        now = new
    return 0


@jit
def scratch_space():
    """Returns the small arrays that `support` uses over and over."""
    return np.empty(3), np.empty(6), np.empty(3), np.empty(3), np.empty(3), np.empty(3)


@jit
def support(e, torque, p, limit, hover, z, f, point, scratch):
    """Bounds g along the unit `e` (3,); returns (upper, lower, balanced).

    `z` (3,) is the start and ends as the minimum; `f` (n, 3) the forces; `point` (3,) the slice's
    point seen from hover, meaningful where `balanced`; `scratch` comes from `scratch_space`.
    """
    state = 0
    if torque and _kink(e, z, p, limit, hover, f, scratch[4], scratch[5]):
        state = 2
    else:
        state = _newton(e, z, torque, p, limit, hover, 1e-10, f, 12, scratch)
    if state == 0:  # close to a kink: approach it through rounder and rounder norms, backwards
        smooth, shrink = 0.1, 0.1
        best = z.copy()
        kept = f.copy()
        while smooth > 1e-10:
            if _newton(e, z, torque, p, limit, hover, smooth, f, 25, scratch) == 0:
                if shrink > 0.5 or smooth < 1e-7:
                    break
                z[:] = best  # too far at once: a smaller change of roundness
                smooth, shrink = smooth / np.sqrt(shrink), np.sqrt(shrink)
                continue
            state = 1
            best[:], kept[:] = z, f
            smooth *= shrink
        z[:], f[:] = best, kept
    upper = value(e, z, torque, p, limit, hover, 0.0)
    held = 3 if torque else 0
    for c in range(3):
        point[c] = -hover[held + c]
    for j in range(limit.size):
        if torque:
            point[0] += p[j, 1] * f[j, 2] - p[j, 2] * f[j, 1]
            point[1] += p[j, 2] * f[j, 0] - p[j, 0] * f[j, 2]
            point[2] += p[j, 0] * f[j, 1] - p[j, 1] * f[j, 0]
        else:
            point[0] += f[j, 0]
            point[1] += f[j, 1]
            point[2] += f[j, 2]
    lower = e[0] * point[0] + e[1] * point[1] + e[2] * point[2]
    return upper, lower, state > 0
