"""Distance from the origin to a quadric: how large a disturbance may be before a limit is met.

A limit on an affine function of the disturbance d is a quadric ``dᵀA d + 2 bᵀd + c = 0``: a length
``‖f0 + K d‖ = L``, a cone, a plane. The nearest point solves ``(ν - A) d = b`` with the smallest
ν ≥ max(λ_max(A), 0) that lies on the quadric (a trust-region secular equation).
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
FLAT = 1e-14  # share of the largest term below which a coefficient counts as zero


def nearest_exit(square: Floats, linear: Floats, constant: float) -> Floats:
    """Returns the shortest d (m,) with ``dᵀA d + 2 bᵀd + c = 0``, where c ≤ 0.

    Args:
        square: A, (m, m), symmetric.
        linear: b, (m,).
        constant: c; its negative is the slack at d = 0.

    Returns:
        d; of inf where the quadric is never met, of nan where c > 0.
    """
    size = len(linear)
    if constant > 0.0:
        return np.full(size, np.nan)
    if constant == 0.0:
        return np.zeros(size)
    values, axes = np.linalg.eigh(0.5 * (square + square.T))
    part, top = axes.T @ linear, max(float(values[-1]), 0.0)
    gaps = top - values
    unit = max(float(np.abs(values).max()), float(np.linalg.norm(part)), 1e-300)

    def at(excess: float) -> Floats:
        return np.asarray(part / (gaps + excess))

    def value(excess: float) -> float:
        d = at(excess)
        return float(values @ d**2 + 2.0 * part @ d + constant)

    low, high = 1e-15 * unit, unit
    while value(high) > 0.0 and high < 1e18 * unit:
        high *= 16.0
    if value(low) > 0.0:
        from scipy.optimize import brentq

        log = brentq(lambda x: value(np.exp(x)), np.log(low), np.log(high), xtol=1e-13, rtol=1e-14)
        return np.asarray(axes @ at(np.exp(log)))
    if values[-1] <= FLAT * unit:
        return np.full(size, np.inf)  # bends away from the origin in every direction
    # the hard case: no part along the steepest axis, which the rest then falls short of
    d = np.where(gaps > FLAT * unit, part / np.where(gaps > FLAT * unit, gaps, 1.0), 0.0)
    missing = -float(values @ d**2 + 2.0 * part @ d + constant)
    d[-1] = np.sqrt(max(missing, 0.0) / values[-1])
    return np.asarray(axes @ d)


def leaves_ball(start: Floats, gain: Floats, limit: float) -> Floats:
    """Returns the shortest d (m,) with ``‖f0 + K d‖ = L``; nan where ‖f0‖ > L, inf for K = 0."""
    if np.abs(gain).max(initial=0.0) <= 1e-14:
        return np.full(gain.shape[1], np.nan if np.linalg.norm(start) > limit else np.inf)
    return nearest_exit(gain.T @ gain, gain.T @ start, float(start @ start - limit**2))


def leaves_plane(gain: Floats, room: float) -> Floats:
    """Returns the shortest d (m,) with ``k·d = room``: nan for a negative room, inf for k = 0."""
    if room < 0.0:
        return np.full(len(gain), np.nan)
    square = float(gain @ gain)
    return np.asarray(gain * (room / square)) if square > 1e-28 else np.full(len(gain), np.inf)
