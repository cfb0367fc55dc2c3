"""Wind over a run: steady, a 1-cos gust, and Dryden turbulence; velocity (T, 3) in world axes."""

import numpy as np

from snakegen.base.geometry import Floats

DRYDEN_LENGTHS = (10.0, 10.0, 5.0)  # m, along, across, up; near the ground (assumed)
_SLOWEST = 1.0  # m/s, at which turbulence is carried past a robot in still air (assumed)


def steady(ticks: int, speed: float, direction: float) -> Floats:
    """Returns a constant horizontal wind; `direction` [rad] is where it blows to, from +x."""
    way = np.array([np.cos(direction), np.sin(direction), 0.0])
    return np.broadcast_to(speed * way, (ticks, 3))


def one_minus_cosine(time: Floats, start: float, length: float, peak: Floats) -> Floats:
    """Returns ``peak (1 − cos 2π (t − start)/length) / 2`` while it lasts [s], else 0.

    The discrete gust of FAR 25.341, here over time at a point instead of over distance.

    Args:
        time: (T,) s.
        start, length: s.
        peak: (3,) m/s.
    """
    phase = np.clip((np.asarray(time) - start) / length, 0.0, 1.0)
    return np.asarray(0.5 * (1.0 - np.cos(2.0 * np.pi * phase))[:, None] * np.asarray(peak))


def dryden(
    ticks: int,
    rate: float,
    rng: np.random.Generator,
    intensity: float,
    speed: float = 0.0,
    direction: float = 0.0,
) -> Floats:
    """Returns turbulence of standard deviation `intensity` [m/s] on each axis.

    MIL-F-8785C's forms with ``τ = L/V``: along the wind ``1/(1 + τs)``, across it and up
    ``(1 + √3 τs)/(1 + τs)²``, driven by white noise; V is the wind's speed (turbulence is carried
    past a hovering robot), at least 1 m/s. Each shape is discretised exactly for noise that is
    held during a tick and scaled to its own stationary variance.

    Args:
        ticks: T.
        rate: Hz.
        rng: drawn from: 3 (T + burn-in) normals.
        intensity: m/s.
        speed, direction: m/s, rad, of the mean wind.
    """
    from scipy.signal import cont2discrete, lfilter

    out = np.empty((ticks, 3))
    for i, length in enumerate(DRYDEN_LENGTHS):
        tau = length / max(speed, _SLOWEST)
        top, bottom = [1.0], [tau, 1.0]
        if i > 0:
            top, bottom = [np.sqrt(3.0) * tau, 1.0], [tau * tau, 2.0 * tau, 1.0]
        b, a, _ = cont2discrete((top, bottom), 1.0 / rate, method="zoh")
        b = np.ravel(b)
        settle = int(np.ceil(8.0 * tau * rate))
        noise = rng.standard_normal(ticks + settle)
        answer = lfilter(b, a, np.eye(1, 4 * settle + 1)[0])
        out[:, i] = intensity * lfilter(b, a, noise)[settle:] / np.sqrt(np.sum(answer**2))
    turn = np.array(
        [[np.cos(direction), np.sin(direction)], [-np.sin(direction), np.cos(direction)]]
    )
    out[:, :2] = out[:, :2] @ turn
    return out
