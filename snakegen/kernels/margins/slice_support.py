"""Support function of a slice of the vectored wrench set (THEORY A4), with a point that proves it.

The set is ``{(Σ f_j, Σ p_j × f_j + c_j f_j), ‖f_j‖ ≤ L_j}``, rows of p being (p_j, c_j). Its force
slice (torque held at τ0) and torque slice (force held at f0), seen from hover, have along a unit e
the support

    g(e) = min over z of  Σ L_j ‖v + ω × p_j + c_j ω‖ - v·f0 - ω·τ0,

(v, ω) = (e, z) for the force slice and (z, e) for the torque slice. Any z bounds g from above; at
the minimum the forces ``f_j = L_j r_j/‖r_j‖``, r_j the argument of the norm, balance and give a
point of the slice, which bounds it from below. The minimum often sits on a kink (r_j = 0, where
c_j = 0 an apparatus on the twist axis): in the torque slice that is Weber's problem, and its vertex
test settles it exactly.

e, z, gradients and points are tuples of floats, which stay in registers; a Hessian is its upper
half (xx, xy, xz, yy, yz, zz).
"""

import numpy as np

from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.vec3 import cross, inner, plus, read, times

BALANCED = 1e-10  # residual of the held wrench, in units of the largest forces
LOOSE = {"contract", "nsz", "arcp"}


@bare(fastmath=LOOSE)
def _turned(w, p, j):
    """Returns w × p_j + c_j w."""
    return plus(cross(w, read(p, j, 0)), times(w, p[j, 3]))


@bare(fastmath=LOOSE)
def _torque(f, p, j):
    """Returns p_j × f + c_j f."""
    return plus(cross(read(p, j, 0), f), times(f, p[j, 3]))


@bare(fastmath=LOOSE)
def _reach(e, z, torque, p, j):
    """Returns r_j = v + ω × p_j + c_j ω."""
    if torque:
        return plus(z, _turned(e, p, j))
    return plus(e, _turned(z, p, j))


@bare(fastmath=LOOSE)
def _offset(e, z, torque, hover):
    """Returns v·f0 + ω·τ0."""
    first = hover[0] * e[0] + hover[1] * e[1] + hover[2] * e[2]
    last = hover[3] * e[0] + hover[4] * e[1] + hover[5] * e[2]
    if torque:
        return last + hover[0] * z[0] + hover[1] * z[1] + hover[2] * z[2]
    return first + hover[3] * z[0] + hover[4] * z[1] + hover[5] * z[2]


@bare(fastmath=LOOSE)
def _force_terms(e, z, p, limit, hover, smooth):
    """Returns objective, gradient and Hessian in z of the force slice, norms ``√(r² + ε²)``."""
    total = -_offset(e, z, False, hover)
    gx, gy, gz = -hover[3], -hover[4], -hover[5]
    xx = xy = xz = yy = yz = zz = 0.0
    for j in range(limit.size):
        a, b, c, d = p[j, 0], p[j, 1], p[j, 2], p[j, 3]
        x = e[0] + z[1] * c - z[2] * b + z[0] * d
        y = e[1] + z[2] * a - z[0] * c + z[1] * d
        w = e[2] + z[0] * b - z[1] * a + z[2] * d
        square = x * x + y * y + w * w + smooth * smooth
        size = np.sqrt(square)
        stiff = limit[j] / size
        total += limit[j] * size
        x, y, w = b * w - c * y + d * x, c * x - a * w + d * y, a * y - b * x + d * w
        gx += stiff * x
        gy += stiff * y
        gz += stiff * w
        k, less = stiff * (a * a + b * b + c * c + d * d), stiff / square
        xx += k - stiff * a * a - less * x * x
        xy -= stiff * a * b + less * x * y
        xz -= stiff * a * c + less * x * w
        yy += k - stiff * b * b - less * y * y
        yz -= stiff * b * c + less * y * w
        zz += k - stiff * c * c - less * w * w
    return total, (gx, gy, gz), (xx, xy, xz, yy, yz, zz)


@bare(fastmath=LOOSE)
def _torque_terms(e, z, p, limit, hover, smooth):
    """Returns objective, gradient and Hessian in z of the torque slice, norms ``√(r² + ε²)``."""
    total = -_offset(e, z, True, hover)
    gx, gy, gz = -hover[0], -hover[1], -hover[2]
    xx = xy = xz = yy = yz = zz = 0.0
    for j in range(limit.size):
        a, b, c, d = p[j, 0], p[j, 1], p[j, 2], p[j, 3]
        x = z[0] + e[1] * c - e[2] * b + e[0] * d
        y = z[1] + e[2] * a - e[0] * c + e[1] * d
        w = z[2] + e[0] * b - e[1] * a + e[2] * d
        square = x * x + y * y + w * w + smooth * smooth
        size = np.sqrt(square)
        stiff = limit[j] / size
        total += limit[j] * size
        gx += stiff * x
        gy += stiff * y
        gz += stiff * w
        less = stiff / square
        xx += stiff - less * x * x
        xy -= less * x * y
        xz -= less * x * w
        yy += stiff - less * y * y
        yz -= less * y * w
        zz += stiff - less * w * w
    return total, (gx, gy, gz), (xx, xy, xz, yy, yz, zz)


@bare(fastmath=LOOSE)
def _terms(e, z, torque, p, limit, hover, smooth):
    if torque:
        return _torque_terms(e, z, p, limit, hover, smooth)
    return _force_terms(e, z, p, limit, hover, smooth)


@bare
def _solve(h, g):
    """Returns ``-H⁻¹ g`` by Cramer's rule, H lightly damped."""
    damp = 1e-13 * (h[0] + h[3] + h[5]) + 1e-300
    a, b, c, d, e, f = h[0] + damp, h[1], h[2], h[3] + damp, h[4], h[5] + damp
    p, q, r = d * f - e * e, c * e - b * f, b * e - c * d
    scale = -1.0 / (a * p + b * q + c * r)
    return (
        scale * (p * g[0] + q * g[1] + r * g[2]),
        scale * (q * g[0] + (a * f - c * c) * g[1] + (b * c - a * e) * g[2]),
        scale * (r * g[0] + (b * c - a * e) * g[1] + (a * d - b * b) * g[2]),
    )


@bare(fastmath=LOOSE)
def _kink(e, z, p, limit, hover):
    """Weber's vertex test (torque slice) at the apparatus nearest to the twist axis.

    Returns (found, v, upper, point): where r_j = 0 is the minimum, it, the objective there and
    the slice's point, the apparatuses on the axis taking what the others leave of f0.
    """
    nearest, least = 0, np.inf
    for j in range(limit.size):
        r = _reach(e, z, True, p, j)
        if inner(r, r) < least:
            nearest, least = j, inner(r, r)
    v = times(_turned(e, p, nearest), -1.0)
    rest, point = (hover[0], hover[1], hover[2]), (-hover[3], -hover[4], -hover[5])
    room, upper = 0.0, -_offset(e, v, True, hover)
    on, spun = (0.0, 0.0, 0.0), 0.0  # Σ L_j p_j and Σ L_j c_j of those on the axis
    for j in range(limit.size):
        r = _reach(e, v, True, p, j)
        size = np.sqrt(inner(r, r))
        if j == nearest or size < 1e-13:
            room += limit[j]
            on = plus(on, times(read(p, j, 0), limit[j]))
            spun += limit[j] * p[j, 3]
            continue
        upper += limit[j] * size
        f = times(r, limit[j] / size)
        rest = plus(rest, times(f, -1.0))
        point = plus(point, _torque(f, p, j))
    if inner(rest, rest) > room * room:
        return False, v, upper, point
    taken = plus(cross(times(on, 1.0 / room), rest), times(rest, spun / room))
    return True, v, upper, plus(point, taken)


@bare
def _newton(e, z, torque, p, limit, hover, smooth, steps):
    """Newton's method with halved steps from z; returns (1 balanced, 2 by a kink, 0 neither; z)."""
    now, g, h = _terms(e, z, torque, p, limit, hover, smooth)
    most = limit.sum()
    small, noise = BALANCED * most, 1e-15 * (abs(now) + most)  # the terms cancel: more than now's
    for _ in range(steps):
        if abs(g[0]) + abs(g[1]) + abs(g[2]) <= small:
            return 1, z
        step = _solve(h, g)
        slope, share = inner(g, step), 1.0
        while True:
            trial = plus(z, times(step, share))
            new, g, h = _terms(e, trial, torque, p, limit, hover, smooth)
            if new <= now + 1e-4 * share * slope + noise:
                break
            share *= 0.5
            if share <= 1e-4:
                break
        if torque and share < 1.0 and _kink(e, trial, p, limit, hover)[0]:
            return 2, trial
        if share <= 1e-4:
            return 0, z
        z, now = trial, new
    return 0, z


@bare
def _rounded(e, z, torque, p, limit, hover):
    """Approaches a kink through norms ever less rounded; returns (state, z, last rounding)."""
    smooth, shrink, reached, best, state = 0.1, 0.1, 0.1, z, 0
    while smooth > 1e-10:
        found, z = _newton(e, z, torque, p, limit, hover, smooth, 25)
        if found == 0:
            if shrink > 0.5 or smooth < 1e-7:
                break
            z = best  # too far at once: a smaller change of roundness
            smooth, shrink = smooth / np.sqrt(shrink), np.sqrt(shrink)
            continue
        state, best, reached = found, z, smooth
        if found == 2:
            break
        smooth *= shrink
    return state, best, reached


@bare(fastmath=LOOSE)
def _reached(e, z, torque, p, limit, hover, smooth):
    """Returns (upper, point): the objective at z, and where forces along the rounded r_j lead."""
    upper = -_offset(e, z, torque, hover)
    first = 3 if torque else 0
    point = (-hover[first], -hover[first + 1], -hover[first + 2])
    for j in range(limit.size):
        r = _reach(e, z, torque, p, j)
        square = inner(r, r)
        upper += limit[j] * np.sqrt(square)
        f = times(r, limit[j] / np.sqrt(square + smooth * smooth))
        point = plus(point, _torque(f, p, j) if torque else f)
    return upper, point


@bare(fastmath=LOOSE)
def torque_start(e, p, limit, hover):
    """Returns a start for the torque slice: the minimum, were all r_j - v as far from their mean.

    Then ``Σ L_j v/√(v² + s²) = f0`` holds at ``v = s ρ/√(1 - ρ²)``, ρ = ‖f0‖/Σ L_j, along f0.
    """
    total, square, middle = 0.0, 0.0, (0.0, 0.0, 0.0)
    for j in range(limit.size):
        at = times(_turned(e, p, j), -1.0)
        total += limit[j]
        square += limit[j] * inner(at, at)
        middle = plus(middle, times(at, limit[j]))
    middle = times(middle, 1.0 / total)
    spread = max(square / total - inner(middle, middle), 0.0)
    f = (hover[0] / total, hover[1] / total, hover[2] / total)
    return plus(middle, times(f, np.sqrt(spread / max(1.0 - inner(f, f), 1e-3))))


@bare
def support(e, z, torque, p, limit, hover):
    """Bounds g along the unit `e`; returns (upper, lower, balanced, z, point).

    `z` is the start and is returned as the minimum, `point` the slice's point seen from hover.
    Lower bound and point mean something where `balanced`.
    """
    smooth = 1e-10
    hit = False
    if torque:
        hit, v, upper, point = _kink(e, z, p, limit, hover)
    if not hit:
        state, found = _newton(e, z, torque, p, limit, hover, smooth, 12)
        if state == 0:  # close to a kink
            state, found, smooth = _rounded(e, z, torque, p, limit, hover)
        if state == 2:
            hit, v, upper, point = _kink(e, found, p, limit, hover)
        else:
            v = found
            upper, point = _reached(e, found, torque, p, limit, hover, smooth)
            if state == 0:
                return upper, -np.inf, False, v, point
    return upper, inner(e, point), True, v, point
