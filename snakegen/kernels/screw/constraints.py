"""Compiled parts of the screw drive: no-slip constraints and chords on a path.

HA eqs 1-6 as THEORY part B reads them. A path is an array with a row per piece,
``[s0, x0, y0, heading0, curvature, length]``; its first and last rows are lines that have no end.
"""

import math

import numpy as np
from numpy.typing import NDArray

from snakegen.kernels.core.jit import jit

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@jit
def no_slip_rows(w: Floats, alpha: Floats, link: Ints, offset: Floats, lengths: Floats) -> Floats:
    """Returns the no-slip rows of A, (n, m + 2): ``row_i · ẇ = -r sin(α_i) θ̇_i``.

    Unit i stands `offset[i]` along link `link[i]` (from 0) of m links; with HA's chain, a unit on
    every link, ``ℓ_ij = lengths[j]`` for j < i and ``offset[i]`` for j = i.
    """
    m = lengths.shape[0]
    psi = np.empty(m)
    psi[0] = w[2]
    for j in range(1, m):
        psi[j] = psi[j - 1] + w[2 + j]
    rows = np.zeros((alpha.shape[0], m + 2))
    for i in range(alpha.shape[0]):
        direction = alpha[i] + psi[link[i]]
        rows[i, 0] = math.cos(direction)
        rows[i, 1] = math.sin(direction)
        lever = 0.0
        for j in range(link[i], -1, -1):
            length = offset[i] if j == link[i] else lengths[j]
            lever += length * math.sin(direction - psi[j])
            rows[i, 2 + j] = lever
    return rows


@jit
def unit_rows(
    shape: Floats, alpha: Floats, link: Ints, offset: Floats, lengths: Floats, scale: float
) -> Floats:
    """Returns the body-twist columns of A at ψ_p = 0, (n, 3), the lever divided by `scale`."""
    w = np.zeros(lengths.shape[0] + 2)
    w[3:] = shape
    rows = no_slip_rows(w, alpha, link, offset, lengths)[:, :3].copy()
    rows[:, 2] /= scale
    return rows


@jit
def path_point(pieces: Floats, s: float) -> tuple[float, float, float]:
    """Returns x, y and the (unwrapped) heading of the path at arc length s."""
    k = 0
    while k < pieces.shape[0] - 1 and s >= pieces[k + 1, 0]:
        k += 1
    return piece_point(pieces, k, s)


@jit
def piece_point(pieces: Floats, k: int, s: float) -> tuple[float, float, float]:
    """Returns x, y and heading at arc length s of piece k, continued beyond its ends."""
    t = s - pieces[k, 0]
    x, y, heading, curvature = pieces[k, 1], pieces[k, 2], pieces[k, 3], pieces[k, 4]
    if curvature == 0.0:
        return x + t * math.cos(heading), y + t * math.sin(heading), heading
    half = 0.5 * curvature * t
    chord = 2.0 * math.sin(half) / curvature
    return (
        x + chord * math.cos(heading + half),
        y + chord * math.sin(heading + half),
        heading + curvature * t,
    )


@jit
def _crossing(pieces: Floats, k: int, s_high: float, px: float, py: float, chord: float) -> float:
    """Returns where piece k, going back from s_high, leaves the circle round p; else nan."""
    if pieces[k, 4] == 0.0:
        hx, hy = math.cos(pieces[k, 3]), math.sin(pieces[k, 3])
        qx, qy, _ = piece_point(pieces, k, s_high)
        ex, ey = qx - px, qy - py
        b = hx * ex + hy * ey
        across = hx * ey - hy * ex
        root = chord * chord - across * across
        if root < 0.0:
            return math.nan
        return min(s_high, s_high - b - math.sqrt(root))
    radius, side = 1.0 / abs(pieces[k, 4]), math.copysign(1.0, pieces[k, 4])
    cx = pieces[k, 1] - side * radius * math.sin(pieces[k, 3])
    cy = pieces[k, 2] + side * radius * math.cos(pieces[k, 3])
    gap = math.hypot(px - cx, py - cy)
    if gap == 0.0:
        return math.nan
    squared = (chord * chord - (gap - radius) ** 2) / (4.0 * radius * gap)
    if squared < 0.0 or squared > 1.0:
        return math.nan
    half_width = 2.0 * math.asin(math.sqrt(squared))
    qx, qy, _ = piece_point(pieces, k, s_high)
    lead = side * (math.atan2(qy - cy, qx - cx) - math.atan2(py - cy, px - cx))
    lead = math.atan2(math.sin(lead), math.cos(lead))
    return min(s_high, s_high - (lead + half_width) * radius)


@jit
def chord_behind(pieces: Floats, s: float, chord: float) -> float:
    """Returns the nearest arc length behind s whose point lies `chord` away from the point at s."""
    k = pieces.shape[0] - 1
    while k > 0 and s < pieces[k, 0]:
        k -= 1
    px, py, _ = piece_point(pieces, k, s)
    high = s
    while k > 0:
        found = _crossing(pieces, k, high, px, py, chord)
        if not math.isnan(found) and found >= pieces[k, 0]:
            return found
        high = pieces[k, 0]
        k -= 1
    return _crossing(pieces, 0, high, px, py, chord)


@jit
def follow(pieces: Floats, s: float, links: Floats) -> tuple[Floats, Floats]:
    """Returns the follow-the-leader state w_d (n + 2,) at arc length s of P, and dw_d/ds.

    Node i + 1 is put on the path a chord behind node i; with d the chord, t the path's tangents:
    ``ds_{i+1}/ds_i = (d·t_i)/(d·t_{i+1})`` and ``dψ/ds = d × ḋ / d²``.
    """
    n = links.shape[0]
    w, rate = np.empty(n + 2), np.empty(n + 2)
    x, y, heading = path_point(pieces, s)
    w[0], w[1], rate[0], rate[1] = x, y, math.cos(heading), math.sin(heading)
    tx, ty, ds = rate[0], rate[1], 1.0
    before, before_rate = 0.0, 0.0
    for i in range(n):
        s_next = chord_behind(pieces, s, links[i])
        xn, yn, heading_next = path_point(pieces, s_next)
        txn, tyn = math.cos(heading_next), math.sin(heading_next)
        dx, dy = x - xn, y - yn
        ds_next = ds * (dx * tx + dy * ty) / (dx * txn + dy * tyn)
        middle = 0.5 * (heading + heading_next)
        turn = math.atan2(dy, dx) - middle
        psi = middle + math.atan2(math.sin(turn), math.cos(turn)) - math.pi
        vx, vy = tx * ds - txn * ds_next, ty * ds - tyn * ds_next
        psi_rate = (dx * vy - dy * vx) / (dx * dx + dy * dy)
        w[2 + i], rate[2 + i] = psi - before, psi_rate - before_rate
        before, before_rate = psi, psi_rate
        s, x, y, heading, tx, ty, ds = s_next, xn, yn, heading_next, txn, tyn, ds_next
    return w, rate
