"""What a real robot adds to the ideal one: sensor noise, thrust mismatch, delay, air, battery.

Every value comes from the spec's `plant` section; all random numbers of a run come from one
generator, so that the same seed gives the same run on one machine. A `NoiseStream` draws them as
the run goes: each array has its own place in the generator's sequence, and a copy of the generator
is kept at each place, while the numbers in between are drawn and thrown away.
"""

from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass, fields, replace
from typing import Any, Protocol

import numpy as np
from scipy.special import ndtr, ndtri

from snakegen.base.geometry import Floats, skew
from snakegen.errors import SpecError, near
from snakegen.simulation.flight.wind import dryden, steady

_AT_ONCE = 16_384  # rows drawn and thrown away together
BOUND = 2.0  # standard deviations at which the errors end that have a stated bound (ZN23's sensors)


@dataclass(frozen=True)
class Imperfections:
    """Standard deviations, rates and switches; names and units as in the spec's `plant`.

    `thrust_scale` is what all rotors give of what they are asked; no spec sets it.
    """

    thrust_scale: float = 1.0
    thrust_mismatch: float = 0.03
    drive_mismatch: float = 0.01
    position_noise: float = 0.0005
    attitude_bias: float = 0.00698
    attitude_noise: float = 0.00175
    gyro_noise: float = 0.01
    velocity_noise: float = 0.01
    joint_noise: float = 0.00175
    torque_noise: float = 0.1
    imu_rate: float = 500.0
    delay: float = 0.005
    motor_lag: float = 1.0
    servo_speed: float = 1.0
    gyroscopic: float = 1.0
    air_density: float = 1.2
    drag_coefficient: float = 1.1
    ground_effect: float = 1.0
    downwash: float = 1.0
    wind_speed: float = 0.0
    wind_direction: float = 0.0
    turbulence: float = 0.0
    battery_energy: float = 0.0
    voltage_sag: float = 0.1
    link_stiffness: float = 0.0
    link_damping: float = 2e-4

    @staticmethod
    def of(values: dict[str, Any]) -> "Imperfections":
        """Returns those of a `<plant>` element; absent ones are default."""
        known = [f.name for f in fields(Imperfections) if f.name != "thrust_scale"]
        for name in values:
            if name not in known:
                raise SpecError(f"plant has no field '{name}'.{near(name, known)}")
        return Imperfections(**{k: float(v) for k, v in values.items()})

    def ideal(self) -> "Imperfections":
        """Returns perfect sensors, rotors without lag, still vacuum, an endless battery.

        What is left are servos of finite stiffness and torque, elastic links not among them.
        """
        return replace(self, **{f.name: 0.0 for f in fields(self)} | {"thrust_scale": 1.0})


@dataclass(frozen=True, eq=False)
class Draw:
    """The random numbers of one run of T ticks.

    Attributes:
        thrust_factor: (n_rotors,) what a rotor gives of what it is asked.
        attitude: (T, 3, 3) rotation from the true to the measured attitude, body axes.
        position, velocity, gyro: (T, 3) additive, m, m/s (world), rad/s (body).
        angles: (n-1,) rad, additive; constant in a run: an encoder's error does not dither.
        wind: (T, 3) m/s, world.
        hinges: (T, e) rad/s, additive, of the rates of damped hinges.
        torques: (l,) N·m, offset of each servo's own torque.
    """

    thrust_factor: Floats
    attitude: Floats
    position: Floats
    velocity: Floats
    gyro: Floats
    angles: Floats
    wind: Floats
    hinges: Floats
    torques: Floats

    def rows(self, first: int, last: int) -> "Draw":
        """Returns ticks `first` … `last` − 1."""
        cut = ("attitude", "position", "velocity", "gyro", "wind", "hinges")
        return replace(self, **{name: getattr(self, name)[first:last] for name in cut})


class Noise(Protocol):
    """Noise whose rows are asked for in order: a `Draw` or a `NoiseStream`."""

    @property
    def thrust_factor(self) -> Floats: ...
    @property
    def angles(self) -> Floats: ...
    @property
    def torques(self) -> Floats: ...
    @property
    def wind(self) -> Floats: ...

    def rows(self, first: int, last: int) -> Draw:
        """Returns ticks `first` … `last` − 1."""


class NoiseStream:
    """Draws the noise of one run of `ticks` at `rate` Hz, rows when they are asked for.

    Attributes and arguments as of `Draw` and `draw`.
    """

    def __init__(
        self,
        what: Imperfections,
        rng: np.random.Generator,
        ticks: int,
        rotors: int,
        joints: int,
        *,
        rate: float = 200.0,
        hinges: Sequence[float] = (),
        servos: int = 0,
    ) -> None:
        self.what = what
        factor = what.thrust_scale * (1.0 + what.thrust_mismatch * rng.standard_normal(rotors))
        self.thrust_factor = np.clip(factor, 0.5, 1.5)
        self.bias = what.attitude_bias * bounded_normal(rng, 3)
        self.share = np.asarray(hinges, float)
        self.tilt = _kept(rng, ticks, lambda g, n: g.random((n, 3)))
        self.position = _kept(rng, ticks, lambda g, n: g.random((n, 3)))
        self.velocity = _kept(rng, ticks, lambda g, n: g.standard_normal((n, 3)))
        self.gyro = _kept(rng, ticks, lambda g, n: g.standard_normal((n, 3)))
        self.angles = what.joint_noise * rng.standard_normal(joints)
        self.wind = steady(ticks, what.wind_speed, what.wind_direction)
        if what.turbulence > 0.0:
            mean = what.turbulence, what.wind_speed, what.wind_direction
            self.wind = self.wind + dryden(ticks, rate, rng, *mean)
        wide = len(self.share)
        self.bends = _kept(rng, ticks, lambda g, n: g.standard_normal((n, wide)))
        self.torques = what.torque_noise * rng.standard_normal(servos)
        self.done = 0

    def rows(self, first: int, last: int) -> Draw:
        """Returns ticks `first` … `last` − 1, which must follow those asked for before."""
        if first != self.done:
            raise ValueError(f"rows from {first} on were asked for; {self.done} comes next")
        self.done, n, what = last, last - first, self.what
        size = (n, 3)
        return Draw(
            self.thrust_factor,
            small_rotations(self.bias + what.attitude_noise * bounded_normal(self.tilt, size)),
            what.position_noise * bounded_normal(self.position, size),
            what.velocity_noise * self.velocity.standard_normal(size),
            what.gyro_noise * self.gyro.standard_normal(size),
            self.angles,
            self.wind[first:last],
            what.gyro_noise * self.share * self.bends.standard_normal((n, len(self.share))),
            self.torques,
        )


def draw(
    what: Imperfections,
    rng: np.random.Generator,
    ticks: int,
    rotors: int,
    joints: int,
    *,
    rate: float = 200.0,
    hinges: Sequence[float] = (),
    servos: int = 0,
) -> Draw:
    """Draws the noise of one run of `ticks` at `rate` Hz.

    `hinges` are shares of the gyro's noise that the rate of each damped hinge has: √2 where two
    links' gyros tell it, 0 where an encoder does; `servos` tell their torque.
    """
    return NoiseStream(
        what, rng, ticks, rotors, joints, rate=rate, hinges=hinges, servos=servos
    ).rows(0, ticks)


def bounded_normal(rng: np.random.Generator, size: int | tuple[int, ...]) -> Floats:
    """Returns standard normal numbers, truncated at two standard deviations.

    ZN23 states bounds of its sensors (IMU < 1°, motion capture < 1 mm): 0.4° of bias and 0.1° of
    noise stay below 1°, 0.5 mm below 1 mm.
    """
    return np.asarray(ndtri(rng.uniform(ndtr(-BOUND), ndtr(BOUND), size)))


def small_rotations(vectors: Floats) -> Floats:
    """Returns (T, 3, 3) rotations ``exp(v×)`` of rotation vectors (T, 3)."""
    angle = np.linalg.norm(vectors, axis=1)
    safe = np.maximum(angle, 1e-12)
    k = skew(vectors / safe[:, None])
    sine, cosine = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.asarray(np.eye(3) + sine * k + (1.0 - cosine) * (k @ k))


def _kept(
    rng: np.random.Generator, ticks: int, skip: Callable[[np.random.Generator, int], object]
) -> np.random.Generator:
    """Returns a copy of a generator as it is, and moves `rng` past `ticks` rows."""
    copy = deepcopy(rng)
    for first in range(0, ticks, _AT_ONCE):
        skip(rng, min(_AT_ONCE, ticks - first))
    return copy
