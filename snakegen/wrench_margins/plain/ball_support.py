"""The least sum of norms, many at a time, in NumPy: supports of slices and rays of ball sets.

A slice of ``{Σ (f_j, p_j × f_j + c_j f_j), ‖f_j‖ ≤ L_j}`` has the support
``min over x of Σ L_j ‖b_j + M_j x‖ - k·x``: the twist is held in what the slice keeps and free in
the rest. Norms are rounded, ``√(‖·‖² + ε²)``, ever less; each minimum of the sum is balanced
by forces ``f_j = L_j (b_j + M_j x)/√(…)`` inside their balls, which give a wrench of the slice. So
every answer is certified from both sides: x from above, f from below, ε Σ L_j apart.
The readable twin of `kernels/margins/norms.py`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from snakegen.base.geometry import cross
from snakegen.base.plain_first import plain_first
from snakegen.kernels.margins import norms, ray_casting

Floats = NDArray[np.float64]
ROUNDINGS = 10.0 ** -np.arange(0.0, 7.5, 1.0)  # ε, of the largest ‖b_j‖
STEPS = 40  # of Newton at one ε
STILL = 1e-16  # over ε, of the largest slope there can be: what rounding leaves of it
BALANCED = 2e-9  # of that slope
FLAT = 1e-13  # of the largest curvature, below which there is none
NOISE = 1e-14  # of the sum, by which rounding may raise it


class Balance(NamedTuple):
    """Minima of m sums: x (m, k), forces (m, n, 3) that balance one, whether there are any (m,)."""

    x: Floats
    forces: Floats
    balanced: NDArray[np.bool_]


def twist_speeds(twists: Floats, p: Floats) -> Floats:
    """Returns ``v + ω × p_j + c_j ω`` (m, n, 3) of twists (m, 6); p (n, 4)."""
    v, w = twists[:, None, :3], twists[:, None, 3:]
    return v + cross(w, p[None, :, :3]) + p[None, :, 3:] * w


def slack(twists: Floats, p: Floats, limit: Floats, hover: Floats) -> Floats:
    """Returns ``h(d) - d·w0`` (m,) of twists (m, 6): how far the set reaches beyond hover."""
    return np.linalg.norm(twist_speeds(twists, p), axis=2) @ limit - twists @ hover


def net_wrench(forces: Floats, p: Floats, hover: Floats) -> Floats:
    """Returns the wrenches (m, 6) of forces (m, n, 3), seen from hover."""
    moment = cross(p[None, :, :3], forces) + p[None, :, 3:] * forces
    return np.hstack([forces.sum(axis=1), moment.sum(axis=1)]) - hover


def balance(
    start: Floats, maps: Floats, limit: Floats, cost: Floats, held: Floats | float = 0.0
) -> Balance:
    """Minimises ``Σ L_j ‖b_j + M_j x‖ - k·x`` for m of them.

    Args:
        start: b, (m, n, 3).
        maps: M, (m, n, 3, k).
        limit: L, (n,).
        cost: k, (m, k).
        held: (m,) what more is taken from each sum; one that falls far below it proves that hover
            is out of reach, and is left there.
    """
    x = np.zeros((len(start), maps.shape[3]))
    held = np.broadcast_to(held, len(x))
    size = np.linalg.norm(start, axis=2).max(axis=1, initial=0.0)
    size[size == 0.0] = 1.0
    steepest = np.einsum("mjck,j->mk", np.abs(maps), limit).max(axis=1, initial=1e-300)
    kept, balanced = np.zeros(start.shape), np.zeros(len(x), bool)
    for rounding in ROUNDINGS:
        open_ = np.arange(len(x))
        for _ in range(STEPS):
            here = (start[open_], maps[open_], limit, cost[open_], rounding * size[open_])
            x[open_], value, slope = _newton(x[open_], *here)
            beyond = value - held[open_] < -0.1 * limit.sum()
            open_ = open_[(slope > STILL / rounding * steepest[open_]) & ~beyond]
            if not open_.size:
                break
        # the sharpest rounding may be too sharp for a sum: what balanced before it still holds
        forces, _ = _forces(x, start, maps, limit, rounding * size)
        gap = np.abs(np.einsum("mjck,mjc->mk", maps, forces) - cost).max(axis=1, initial=0.0)
        good = gap <= BALANCED * steepest
        kept[good], balanced = forces[good], balanced | good
    return Balance(x, kept, balanced)


def _forces(
    x: Floats, start: Floats, maps: Floats, limit: Floats, smooth: Floats
) -> tuple[Floats, Floats]:
    """Returns the rounded sum's forces (m, n, 3), and the rounded norms (m, n)."""
    a = start + np.einsum("mjck,mk->mjc", maps, x)
    norm = np.sqrt((a * a).sum(axis=2) + smooth[:, None] ** 2)
    return a * (limit / norm)[:, :, None], norm


def _newton(
    x: Floats, start: Floats, maps: Floats, limit: Floats, cost: Floats, smooth: Floats
) -> tuple[Floats, Floats, Floats]:
    """Takes a Newton step of every sum, halved until it falls: x, and value and slope before."""
    forces, norm = _forces(x, start, maps, limit, smooth)
    slope = np.einsum("mjck,mjc->mk", maps, forces) - cost
    weighted = maps * (limit / norm)[:, :, None, None]
    along = np.einsum("mjck,mjc->mjk", maps, forces) / np.sqrt(limit * norm)[:, :, None]
    bend = np.einsum("mjck,mjcl->mkl", weighted, maps) - np.einsum("mjk,mjl->mkl", along, along)
    curves, axes = np.linalg.eigh(bend)
    curves = np.maximum(curves, FLAT * curves[:, -1:] + 1e-300)
    step = -np.einsum("mkl,ml->mk", axes, np.einsum("mil,mi->ml", axes, slope) / curves)
    value, fall = norm @ limit - (cost * x).sum(axis=1), (slope * step).sum(axis=1)
    noise, part, out = NOISE * (norm @ limit), np.ones(len(x)), x.copy()
    left = np.ones(len(x), bool)
    for _ in range(30):
        ahead = x + part[:, None] * step
        there = _forces(ahead, start, maps, limit, smooth)[1] @ limit - (cost * ahead).sum(axis=1)
        good = left & (there <= value + 0.1 * part * fall + noise)
        out[good] = ahead[good]
        left &= ~good
        if not left.any():
            break
        part[left] *= 0.5
    return out, value, np.abs(slope).max(axis=1, initial=0.0)


@plain_first(norms.minimise)
def minimise(
    start: Floats,
    maps: Floats,
    limit: Floats,
    cost: Floats,
    x: Floats,
    f: Floats,
    square: float = 0.0,
) -> float:
    """Minimises one sum of B norms: writes x (k,) and the forces f (B, 3) that balance it.

    Returns the ε of the sum, inf where forces do not balance: the sum at x and the value of the
    forces differ by at most ``ε Σ L_j``. Arguments as in `balance`, without its m; the sum has
    ``½ square ‖x‖²`` too, whose slope the forces then balance. Roundings shrink as the kernel's
    do, so that both end at the same one.
    """
    rounding, reached = norms.ROUNDEST, np.inf
    while rounding > norms.SHARPEST:
        found = _balance_one(x, (start, maps, limit, cost, square), rounding)
        if found is None:
            break
        x[:], f[:] = found
        reached, rounding = rounding, 0.2 * rounding
    return reached


def _balance_one(
    x: Floats, problem: tuple[Floats, Floats, Floats, Floats, float], rounding: float
) -> tuple[Floats, Floats] | None:
    """Returns x (k,) and forces (B, 3) that balance one rounded sum, by Newton's method."""
    start, maps, limit, cost, square = problem

    def at(x: Floats) -> tuple[Floats, Floats, float]:
        a = start + maps @ x
        norm = np.sqrt((a * a).sum(axis=1) + rounding**2)
        return a, norm, float(norm @ limit - cost @ x + 0.5 * square * (x @ x))

    a, norm, value = at(x)
    for _ in range(60):
        forces = a * (limit / norm)[:, None]
        pull = np.einsum("jck,jc->jk", maps, forces)
        slope = pull.sum(axis=0) - cost + square * x
        left = np.abs(slope).sum() / limit.sum()
        if left <= norms.BALANCED:
            return x, forces
        along = pull / np.sqrt(limit * norm)[:, None]
        bend = np.einsum("jck,jcl->kl", maps * (limit / norm)[:, None, None], maps)
        bend -= along.T @ along
        bend += (square + 1e-13 * np.trace(bend)) * np.eye(len(x))
        try:
            step = -np.linalg.solve(bend, slope)
        except np.linalg.LinAlgError:  # flat in some direction
            break
        part, noise = 1.0, norms.NOISE * (abs(value) + limit.sum())
        while part > 1e-6:
            a, norm, there = at(x + part * step)
            if there <= value + 1e-4 * part * (slope @ step) + noise:
                break
            part *= 0.5
        if part <= 1e-6 or (left <= norms.STILL and part < 1.0):
            break
        x, value = x + part * step, there
    return (x, forces) if left <= norms.STILL else None  # rounding: as flat as it gets


def _compiled_shoot(
    u: Floats, p: Floats, limit: Floats, hover: Floats
) -> tuple[Floats, Floats, Floats]:
    twists = np.empty_like(u)
    reach = [ray_casting.shoot(a, p, limit, hover, d) for a, d in zip(u, twists, strict=True)]
    lower, upper = np.array(reach).T
    return lower, upper, twists


def _compiled_distance(p: Floats, limit: Floats, hover: Floats) -> tuple[float, float, Floats]:
    twist = np.zeros(6)
    low, high = ray_casting.distance(p, limit, hover, twist)
    return low, high, twist


@plain_first(_compiled_shoot)
def shoot(u: Floats, p: Floats, limit: Floats, hover: Floats) -> tuple[Floats, Floats, Floats]:
    """Returns lower and upper (m,) of the largest t with ``hover + t u`` in reach, twists (m, 6).

    ``t = min over d·u = 1 of h(d) - d·w0``, for m directions u (m, 6) that the set spans; a twist
    is the normal where its ray leaves, ``twist·u = 1``. The lower bound is -inf where forces do
    not balance.
    """
    square = (u * u).sum(axis=1)[:, None]
    across = np.linalg.svd(u[:, None, :])[2][:, 1:]  # (m, 5, 6)
    n, twists = len(p), u / square
    maps = twist_speeds(across.reshape(-1, 6), p).reshape(len(u), 5, n, 3).transpose(0, 2, 3, 1)
    found = balance(twist_speeds(twists, p), maps, limit, across @ hover, twists @ hover)
    twists = twists + np.einsum("mk,mkc->mc", found.x, across)
    lower = (net_wrench(found.forces, p, hover) * u).sum(axis=1) / square[:, 0]
    return np.where(found.balanced, lower, -np.inf), slack(twists, p, limit, hover), twists


@plain_first(_compiled_distance)
def distance(p: Floats, limit: Floats, hover: Floats) -> tuple[float, float, Floats]:
    """Returns (lower, upper) of the scaled distance from `hover` to the set; its unit direction.

    Least ``½‖Σ (f_j, p_j × f_j + c_j f_j) - w0‖²`` over the balls by its dual, the least of
    ``½‖d‖² + h(d) - d·w0`` over twists: at it d is what the forces leave of w0.
    """
    maps = twist_speeds(np.eye(6), p).transpose(1, 2, 0)
    twist, forces, start = np.zeros(6), np.zeros((len(p), 3)), np.zeros((len(p), 3))
    minimise.__wrapped__(start, maps, limit, hover, twist, forces, 1.0)  # type: ignore[attr-defined]
    gap = net_wrench(forces[None], p, hover)[0]
    apart = float(np.linalg.norm(gap))
    if apart < ray_casting.NOTHING:
        return 0.0, apart, np.zeros(6)
    low = -float(slack(-gap[None] / apart, p, limit, hover)[0])
    return max(low, 0.0), apart, -gap / apart if low > 0.0 else np.zeros(6)
