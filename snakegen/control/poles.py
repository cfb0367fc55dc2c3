"""Closed-loop poles and delay margins of the linearised flight loops, one axis at a time.

At hover the inertia in eq 17 and the allocation cancel the body, so each axis is a double
integrator under its PID law, behind the motors' lag and a delay (Padé), with the low-pass on
measured rates in its D part. In dual-rotor mode x and y go through the attitude loop (k_θ, k_φ) and
the gimbals (k_θi, k_φi), eqs 23-28.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import comb, factorial

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from snakegen.control.controller import Controller
from snakegen.control.gains import Floats, Gains
from snakegen.control.gimbal_reach import vectoring_share
from snakegen.kernels.control.types import VIRTUAL

AXES = ("x", "y", "z", "roll", "pitch", "yaw")
NO_EFFECT = 1e-6  # sideways acceleration per g below which gimbals do not move an axis
LONGEST = 3.0  # s, delays beyond which a loop counts as indifferent to delay
NDComplex = NDArray[np.complex128]
S = Polynomial([0.0, 1.0])
# of a delay [s]: numerator and characteristic polynomial, of the way from a target to its axis,
# and the factor of s² in the latter
System = Callable[[float], tuple[Polynomial, Polynomial, Polynomial]]


@dataclass(frozen=True, eq=False)
class Loop:
    """One linearised loop.

    Attributes:
        axis: x, y, z [position] or roll, pitch, yaw.
        poles: closed-loop poles [1/s], slowest first; of x and y in dual-rotor mode they include
            the attitude loop that they go through.
        delay_margin: s, further delay at which the loop stays stable; 0 when it is unstable
            already, inf above 3 s.
        flown: whether thrust or attitude act on the axis at all; else poles are empty.
    """

    axis: str
    poles: NDComplex
    delay_margin: float
    flown: bool = True

    @property
    def stable(self) -> bool:
        """True when every pole is in the left half plane."""
        return self.flown and bool(np.all(self.poles.real < 0))


def pade(delay: float, order: int = 5) -> tuple[Polynomial, Polynomial]:
    """Returns numerator and denominator of the Padé approximant of ``exp(-s delay)``."""
    if delay == 0.0:
        return Polynomial([1.0]), Polynomial([1.0])
    terms = [
        comb(order, k) * factorial(2 * order - k) / factorial(2 * order) * delay**k
        for k in range(order + 1)
    ]
    signs = [(-1.0) ** k for k in range(order + 1)]
    return Polynomial(np.multiply(terms, signs)), Polynomial(terms)


def flight_loops(
    controller: Controller,
    gains: Gains,
    mode: int,
    *,
    lag: float,
    delay: float = 0.0,
    angles: Floats | None = None,
) -> tuple[Loop, ...]:
    """Returns the six loops of a robot's controller in a mode, at joint `angles`; see `loops`."""
    left, ahead = vectoring_share(controller, angles)
    return loops(
        gains,
        mode,
        lag=lag,
        delay=delay,
        vectoring=(float(left), float(ahead)),
        rate_filter=controller.law.rate_filter,
    )


def loops(
    gains: Gains,
    mode: int,
    *,
    lag: float = 0.0,
    delay: float = 0.0,
    vectoring: tuple[float, float] | None = None,
    integral: bool = True,
    rate_filter: float = 0.0,
) -> tuple[Loop, ...]:
    """Returns the closed loops of x, y, z, roll, pitch, yaw.

    Args:
        gains: the gain set.
        mode: VIRTUAL or DUAL.
        lag: s, first-order lag of motors and gimbals alike.
        delay: s, from sensing to command.
        vectoring: mean k_φi and k_θi over the apparatuses (thrusts shared equally), 0 of those that
            no gimbal turns that way; taken from `gains` if not given. (0, 0) leaves the attitude
            alone to move x and y.
        integral: False leaves the integral terms out.
        rate_filter: Hz, cut-off of the second-order Butterworth low-pass on rates; 0: none.
    """
    out = []
    systems = _systems(gains, mode, lag, vectoring, integral, rate_filter)
    for axis, system in zip(AXES, systems, strict=True):
        if system is None:
            out.append(Loop(axis, np.zeros(0, complex), 0.0, flown=False))
        else:
            out.append(Loop(axis, _poles(system(delay)[1]), _delay_margin(system, delay)))
    return tuple(out)


def settling_times(
    controller: Controller,
    gains: Gains,
    mode: int,
    *,
    lag: float,
    delay: float = 0.0,
    band: float = 0.05,
) -> dict[str, float]:
    """Returns when a step of each axis' target stays within `band` of it [s]; inf if unstable.

    The sum of ``Res T(p)/p e^{pt}`` over the loop's poles p, T its transfer function; arguments as
    in `flight_loops`.
    """
    left, ahead = vectoring_share(controller)
    cutoff = controller.law.rate_filter
    systems = _systems(gains, mode, lag, (float(left), float(ahead)), True, cutoff)
    return {
        a: np.inf if s is None else _settling(*s(delay)[:2], band)
        for a, s in zip(AXES, systems, strict=True)
    }


def compliances(
    controller: Controller, gains: Gains, mode: int, *, lag: float, delay: float = 0.0
) -> list[tuple[NDComplex, NDComplex] | None]:
    """Returns poles and residues of each axis' displacement by an acceleration that acts on it.

    ``e(t) = Σ r ∫ e^{p (t - u)} a(u) du``; None for an axis that nothing moves. Arguments as in
    `flight_loops`.
    """
    left, ahead = vectoring_share(controller)
    cutoff = controller.law.rate_filter
    systems = _systems(gains, mode, lag, (float(left), float(ahead)), True, cutoff)
    out: list[tuple[NDComplex, NDComplex] | None] = []
    for s in systems:
        if s is None:
            out.append(None)
            continue
        _, bottom, free = s(delay)
        poles = _poles(bottom)
        out.append((poles, free(poles) / bottom.deriv()(poles)))
    return out


def _settling(top: Polynomial, bottom: Polynomial, band: float) -> float:
    poles = _poles(bottom)
    if not np.all(poles.real < 0.0):
        return float("inf")
    time = np.linspace(0.0, 8.0 / abs(poles[0].real), 20001)
    parts = top(poles) / (poles * bottom.deriv()(poles))
    grown = np.outer(time, poles)
    grown = np.exp(np.maximum(grown.real, -100.0) + 1j * grown.imag)  # e^-100 is nothing
    away = np.abs((grown @ parts).real)
    return float(time[np.flatnonzero(away > band)[-1]])


def _systems(
    gains: Gains,
    mode: int,
    lag: float,
    vectoring: tuple[float, float] | None,
    integral: bool,
    rate_filter: float,
) -> list[System | None]:
    """Returns the loops of the six axes, None where nothing acts; arguments as in `loops`."""
    if vectoring is None:
        means = [float(np.mean(v)) for v in (gains.vectoring_roll, gains.vectoring_pitch)]
        vectoring = (means[0], means[1])
    force = np.stack([gains.force_p, gains.force_i * integral, gains.force_d])
    torque = np.stack([gains.torque_p, gains.torque_i * integral, gains.torque_d])
    tilts = (gains.attitude_pitch, gains.attitude_roll)
    out: list[System | None] = []
    for i in range(len(AXES)):
        row = force[:, i] if i < 3 else torque[:, i - 3]
        if mode == VIRTUAL or i >= 2:
            out.append(_single(row, lag, rate_filter))
            continue
        vector = vectoring[1 - i]  # x tilts by pitch (torque y), y by roll (torque x)
        if tilts[i] != 0.0:
            out.append(_cascade(row, torque[:, 1 - i], tilts[i], vector, lag, rate_filter))
        elif abs(vector) > NO_EFFECT:
            out.append(_single(vector * row, lag, rate_filter))
        else:
            out.append(None)
    return out


def _actuator(lag: float, delay: float) -> tuple[Polynomial, Polynomial]:
    top, bottom = pade(delay)
    return top, bottom * (1.0 + lag * S)


def _pid(row: Floats, cutoff: float = 0.0) -> tuple[Polynomial, Polynomial, Polynomial]:
    """Returns numerators of ``C = K_p + K_i/s + K_d s L(s)`` and of its ``K_p + K_i/s``.

    Their denominator comes last; L is the low-pass, ``ω² / (s² + √2 ω s + ω²)``, 1 for a cut-off
    of 0.
    """
    low = Polynomial([1.0])
    if cutoff > 0.0:
        w = 2.0 * np.pi * cutoff
        low = Polynomial([1.0, np.sqrt(2.0) / w, 1.0 / w**2])
    if row[1] == 0.0:
        return row[2] * S + row[0] * low, row[0] * low, low
    slow = (row[0] * S + row[1]) * low
    return row[2] * S**2 + slow, slow, S * low


def _single(row: Floats, lag: float, cutoff: float) -> System:
    """Returns ``H (K_p + K_i/s) / (s² + H C)``: the target's way to the axis.

    With it the characteristic polynomial, and the factor of s² in that.
    """
    top_c, slow_c, bottom_c = _pid(row, cutoff)

    def system(delay: float) -> tuple[Polynomial, Polynomial, Polynomial]:
        top, bottom = _actuator(lag, delay)
        free = bottom * bottom_c
        return top * slow_c, S**2 * free + top * top_c, free

    return system


def _cascade(
    outer: Floats, inner: Floats, tilt: float, vector: float, lag: float, cutoff: float
) -> System:
    """Returns the same of ``s² + (k T(s) + v H(s)) C(s)``, T the attitude loop, H the actuators.

    The target's rate is not fed forward:
    ``T = H (K_p + K_i/s) / (s² + H (K_p + K_i/s + K_d s L))``.
    """
    top_f, slow_f, bottom_f = _pid(outer, cutoff)
    top_t, slow_t, bottom_t = _pid(inner, cutoff)

    def system(delay: float) -> tuple[Polynomial, Polynomial, Polynomial]:
        top, bottom = _actuator(lag, delay)
        below = S**2 * bottom * bottom_t + top * top_t
        reach = tilt * top * slow_t * bottom + vector * top * below
        free = bottom * bottom_f * below
        return reach * slow_f, S**2 * free + reach * top_f, free

    return system


def _poles(system: Polynomial) -> NDComplex:
    """Returns the roots, slowest first; of a pair the one with positive imaginary part first."""
    roots = system.roots().astype(complex)
    real = np.array([float(f"{x:.6g}") for x in roots.real])  # roots of a pair tie
    return np.asarray(roots[np.lexsort([-roots.imag, -real])])


def _delay_margin(system: System, delay: float) -> float:
    """Returns the further delay at which the first pole crosses, by scan and bisection."""

    def stable(extra: float) -> bool:
        return bool(np.all(_poles(system(delay + extra)[1]).real < 0))

    if not stable(0.0):
        return 0.0
    low, high = 0.0, 0.0
    while stable(high):
        if high >= LONGEST:
            return float("inf")
        low, high = high, max(1.1 * high, 0.005)
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low
