"""The exact optimum of a vectored margin whose sets are limited: Newton over thrusts and angles.

As `saddle_point`, for sets whose projection has no closed form: each force is λ R u(φ, θ), and at
the optimum each of λ, φ, θ is stationary for ``y_j · f_j``, y_j = B_j d, or stands at an end of its
range with the slope outwards. With x all of them,

    Σ B_jᵀ f_j(x) - w0 = μ M d,     x = clip(x + s ∂(y · f)/∂x),     dᵀM d = 1.

The forces lie in the sets as they are, not in their hulls: μ is how far the sets reach along d.
Source: THEORY A9.
"""

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.kernels.margins.force_sets import Sets
from snakegen.kernels.margins.limited_margins import ray
from snakegen.wrench_margins.force_sets import ForceSets
from snakegen.wrench_margins.saddle_point import (
    DAMPED,
    SOLVED,
    Saddle,
    damped_newton,
    force_jacobians,
)

STEPS = 60
TURNS = 40  # of a ray to the normal that was hit
STILL = 1e-7  # change of a direction at which turning ends
FINE = 1e-10  # relative gap of those rays
WHOLE = 2.0 * np.pi - 1e-9  # a range as wide has no ends


def turned_start(hull: Sets, hover: Floats, rows: Floats, d: Floats) -> tuple[Floats, Floats]:
    """Returns a twist (6,) and forces (n, 3) of the hulls near a weakest direction, from d.

    A ray is shot along the direction, which turns to the normal that was hit, until it rests.
    """
    u, forces, twist = rows * d, np.empty((hull.faces.size, 3)), np.empty(6)
    u /= np.linalg.norm(u)
    for _ in range(TURNS):
        if not ray(u, hull, hover, FINE, forces, twist)[0] > -np.inf:
            break
        after = rows * twist
        after /= np.linalg.norm(after)
        still = float(np.abs(after - u).max())
        u = after
        if still < STILL:
            break
    return twist, forces


def set_saddle(sets: ForceSets, scale: Floats, hover: Floats, rows: Floats, d: Floats) -> Saddle:
    """Returns the stationary point that Newton's method reaches from near the twist d.

    Args:
        sets: of one posture.
        scale: (6,) F0 and T0.
        hover: (6,) scaled.
        rows: (6,) diagonal of M.
        d: (6,) start, scaled.
    """
    hull = sets.hull((scale[0], scale[3]))
    d, forces = turned_start(hull, hover, rows, d)
    d = d / np.sqrt(d @ (rows * d))
    jacobians = force_jacobians(hull.points)
    n = len(sets)
    low, high = ranges(sets)
    low[0] /= scale[0]
    high[0] /= scale[0]
    for k in (1, 2):
        whole = high[k] - low[k] >= WHOLE
        low[k, whole], high[k, whole] = -np.inf, np.inf
    x = angles_of(sets, forces * scale[0])
    x[0] /= scale[0]
    size = float((sets.strengths / scale[0]).sum())
    stiff = np.vstack(
        [sets.strengths / scale[0] / max(_speed(jacobians, d), 1e-12), *np.ones((2, n))]
    )

    def split(z: Floats) -> tuple[Floats, Floats, float]:
        """Returns d (6,), x (3, n) and μ of z, all of them in a row."""
        return z[:6], z[6:-1].reshape(3, n), float(z[-1])

    def residual(z: Floats) -> tuple[Floats, tuple[Floats, ...]]:
        d, x, mu = split(z)
        f, first = force_derivatives(sets.frames, x)
        speed = jacobians @ d
        slope = np.einsum("ajc,jc->aj", first, speed)
        moved = x + stiff * slope
        inside = (moved > low) & (moved < high)
        gap = np.einsum("jck,jc->k", jacobians, f) - hover - mu * rows * d
        rest = np.where(inside, stiff * slope, np.clip(moved, low, high) - x)
        left = np.concatenate([gap, rest.ravel(), [0.5 * (1.0 - d @ (rows * d))]])
        return left, (f, first, np.einsum("abjc,jc->abj", curvature(sets.frames, x), speed), inside)

    def matrix(z: Floats, parts: tuple[Floats, ...]) -> Floats:
        d, _, mu = split(z)
        _, first, curved, inside = parts
        a = np.zeros((len(z), len(z)))
        a[:6, :6] = -mu * np.diag(rows)
        a[:6, -1] = a[-1, :6] = -rows * d
        work = np.einsum("ajc,jck->ajk", first, jacobians)  # (3, n, 6)
        a[:6, 6:-1] = work.reshape(3 * n, 6).T
        for j in range(n):
            for p in range(3):
                row = 6 + p * n + j
                if not inside[p, j]:
                    a[row, row] = -1.0
                    continue
                a[row, :6] = stiff[p, j] * work[p, j]
                a[row, [6 + q * n + j for q in range(3)]] += stiff[p, j] * curved[p, :, j]
        a -= DAMPED * np.diag(np.r_[np.ones(6 + 3 * n), 0.0])
        return a

    mu = float(
        np.einsum("jc,jck,k", force_derivatives(sets.frames, x)[0], jacobians, d) - d @ hover
    )
    z, left, parts = damped_newton(residual, matrix, np.r_[d, x.ravel(), mu], SOLVED * size, STEPS)
    d, x, mu = split(z)
    solved = bool(np.abs(left).max() < SOLVED * size) and bool(
        ((x >= low - 1e-9) & (x <= high + 1e-9)).all()
    )
    return Saddle(mu, d, parts[0], solved)


def _speed(jacobians: Floats, d: Floats) -> float:
    return float(np.linalg.norm(jacobians @ d, axis=1).max())


def angles_of(sets: ForceSets, forces: Floats) -> Floats:
    """Returns thrusts and angles (3, n) in range, whose forces lie nearest to `forces` (n, 3)."""
    out = np.empty((3, len(sets)))
    for j, local in enumerate(np.einsum("nij,ni->nj", sets.frames, forces)):
        best = np.inf
        for side in (1.0, -1.0):
            d = side * local / max(float(np.linalg.norm(local)), 1e-12)
            theta, phi = np.arcsin(np.clip(d[0], -1.0, 1.0)), np.arctan2(-d[1], d[2])
            for a, b in ((phi, theta), (phi + np.pi, np.pi - theta)):
                a, b = _near(a, sets.phi[j]), _near(b, sets.theta[j])
                u = np.array([np.sin(b), -np.sin(a) * np.cos(b), np.cos(a) * np.cos(b)])
                thrust = float(np.clip(u @ local, sets.low[j], sets.high[j]))
                miss = float(np.linalg.norm(thrust * u - local))
                if miss < best:
                    best, out[:, j] = miss, (thrust, a, b)
    return out


def _near(angle: float, ends: Floats) -> float:
    """Returns the angle of a range that is nearest to `angle`, whole turns apart."""
    middle = 0.5 * float(ends[0] + ends[1])
    turned = middle + (angle - middle + np.pi) % (2.0 * np.pi) - np.pi
    return float(np.clip(turned, *ends))


def ranges(sets: ForceSets) -> tuple[Floats, Floats]:
    """Returns the least and the largest x, (3, n) each."""
    low = np.vstack([sets.low, sets.phi[:, 0], sets.theta[:, 0]])
    high = np.vstack([sets.high, sets.phi[:, 1], sets.theta[:, 1]])
    return low, high


def force_derivatives(frames: Floats, x: Floats) -> tuple[Floats, Floats]:
    """Returns forces (n, 3) of x, CoG axes, and their derivatives by x, (3, n, 3)."""
    thrust, phi, theta = x
    s, c, st, ct = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    local = np.zeros((3, len(phi), 3))
    local[0] = np.stack([st, -s * ct, c * ct], axis=1)
    local[1, :, 1:] = thrust[:, None] * np.stack([-c * ct, -s * ct], axis=1)
    local[2] = thrust[:, None] * np.stack([ct, s * st, -c * st], axis=1)
    first = np.einsum("ajk,jik->aji", local, frames)
    return thrust[:, None] * first[0], first


def curvature(frames: Floats, x: Floats) -> Floats:
    """Returns the second derivatives of the forces by x, (3, 3, n, 3)."""
    thrust, phi, theta = x
    s, c, st, ct = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    zero = np.zeros_like(s)
    by_phi = np.stack([zero, -c * ct, -s * ct], axis=1)
    by_theta = np.stack([ct, s * st, -c * st], axis=1)
    out = np.zeros((3, 3, len(phi), 3))
    out[0, 1] = out[1, 0] = by_phi
    out[0, 2] = out[2, 0] = by_theta
    push = thrust[:, None]
    out[1, 1] = push * np.stack([zero, s * ct, -c * ct], axis=1)
    out[1, 2] = out[2, 1] = push * np.stack([zero, c * st, s * st], axis=1)
    out[2, 2] = -push * np.stack([st, -s * ct, c * ct], axis=1)
    return np.einsum("abjk,jik->abji", out, frames)
