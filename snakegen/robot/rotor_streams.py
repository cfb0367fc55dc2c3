"""Streams of rotors on other rotors, in NumPy: the twin of `kernels.flight.aerodynamics`."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.base.geometry import Floats

SPREAD = 0.1  # growth of a free jet's radius per metre


def mean_inflow(
    down: ArrayLike, offset: ArrayLike, source: ArrayLike, hit: ArrayLike, spread: float = SPREAD
) -> Floats:
    """Returns the mean flow of a stream through a level disc over the source's induced velocity.

    ``min(2R b / s, 1 + a/√(a² + R²), (R/r)²) · exp(−e²/s)``, ``b = R + 0.1 a``, ``s = b² + r²/2``:
    a round jet far away, a contracting wake (McCormick) and continuity near the rotor.

    Args:
        down: m, a, downstream; 0 or less is upstream.
        offset: m, e, from the stream's axis.
        source: m, R of the rotor that blows.
        hit: m, r of the disc.
        spread: growth of the jet's radius per metre.
    """
    a, e, big, small = (np.asarray(x, float) for x in (down, offset, source, hit))
    inside = np.maximum(a, 0.0)
    width = big + spread * inside
    size = width**2 + 0.5 * small**2
    near = np.minimum(1.0 + inside / np.hypot(inside, big), (big / small) ** 2)
    flow = np.minimum(2.0 * big * width / size, near) * np.exp(-(e**2) / size)
    return np.asarray(np.where(a > 1e-9, flow, 0.0))


def thrust_kept(inflow: ArrayLike) -> Floats:
    """Returns thrust in a stream over thrust in still air, at the same power.

    ``x (μ + x)² = 1``, ``T'/T = x (μ + x)``: momentum theory with the flow μ v_h through the disc
    besides its own (Leishman and Ananthan, Aerodynamic Optimization of a Coaxial Proprotor, AHS
    62nd Forum, 2006). The lower of two equal coaxial rotors has μ = 1 and keeps 0.682.

    Args:
        inflow: μ ≥ 0.
    """
    mu = np.asarray(inflow, float)
    x = 1.0 / (1.0 + mu) ** 2
    for _ in range(8):
        x = x - (x * (mu + x) ** 2 - 1.0) / ((mu + x) ** 2 + 2.0 * x * (mu + x))
    return np.asarray(x * (mu + x))


def kept_in_streams(
    points: Floats, axes: Floats, radius: Floats, thrust: Floats, blows: NDArray[np.bool_]
) -> Floats:
    """Returns the share (n,) of its thrust that each rotor keeps in the streams of others.

    Args:
        points, axes: (n, 3) m and unit, discs and directions of thrust.
        radius: (n,) m.
        thrust: (n,) N in still air; rotors that push nothing blow nothing.
        blows: (n, n) which rotor (row) blows on which (column); itself it never does.
    """
    away = points[None] - points[:, None]
    down = -np.einsum("rpi,ri->rp", away, axes)
    offset = np.sqrt(np.maximum(np.sum(away**2, axis=2) - down**2, 0.0))
    speed = np.sqrt(np.maximum(thrust, 0.0)) / radius  # of the induced velocity, to a factor
    mean = speed[:, None] * mean_inflow(down, offset, radius[:, None], radius[None])
    mean[~blows | np.eye(len(points), dtype=bool)] = 0.0
    through = np.sum(mean * (axes @ axes.T), axis=0)
    inflow = np.where(speed > 0, through / np.where(speed > 0, speed, 1.0), 0.0)
    return thrust_kept(np.maximum(inflow, 0.0))
