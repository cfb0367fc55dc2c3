"""What a real robot adds to the ideal one: sensor noise, thrust mismatch, delay.

Every value comes from the spec's `plant` section; all random numbers of a run are drawn before it
starts, from one generator, so that the same seed gives the same run.
"""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from snakegen.errors import SpecError, near
from snakegen.geometry import Floats, skew


@dataclass(frozen=True)
class Imperfections:
    """Standard deviations and delays; names and units as in the spec's `plant`."""

    thrust_mismatch: float = 0.03
    position_noise: float = 0.001
    attitude_bias: float = 0.00698
    attitude_noise: float = 0.00175
    gyro_noise: float = 0.01
    velocity_noise: float = 0.01
    joint_noise: float = 0.00175
    delay: float = 0.0

    @staticmethod
    def of(values: dict[str, Any]) -> "Imperfections":
        """Returns those of a `<plant>` element; absent ones are default."""
        known = [f.name for f in fields(Imperfections)]
        for name in values:
            if name not in known:
                raise SpecError(f"plant has no field '{name}'.{near(name, known)}")
        return Imperfections(**{k: float(v) for k, v in values.items()})

    def ideal(self) -> "Imperfections":
        """Returns perfect sensors and rotors."""
        return replace(self, **{f.name: 0.0 for f in fields(self)})


@dataclass(frozen=True, eq=False)
class Draw:
    """The random numbers of one run of T ticks.

    Attributes:
        thrust_factor: (n_rotors,) what a rotor gives of what it is asked.
        attitude: (T, 3, 3) rotation from the true to the measured attitude, body axes.
        position, velocity, gyro: (T, 3) additive, m, m/s (world), rad/s (body).
        angles: (T, n-1) rad, additive; constant in a run: an encoder's error does not dither.
    """

    thrust_factor: Floats
    attitude: Floats
    position: Floats
    velocity: Floats
    gyro: Floats
    angles: Floats


def draw(
    what: Imperfections, rng: np.random.Generator, ticks: int, rotors: int, joints: int
) -> Draw:
    """Draws the noise of one run."""
    factor = 1.0 + what.thrust_mismatch * rng.standard_normal(rotors)
    bias = what.attitude_bias * rng.standard_normal(3)
    tilt = bias + what.attitude_noise * rng.standard_normal((ticks, 3))
    return Draw(
        np.clip(factor, 0.5, 1.5),
        _small_rotations(tilt),
        what.position_noise * rng.standard_normal((ticks, 3)),
        what.velocity_noise * rng.standard_normal((ticks, 3)),
        what.gyro_noise * rng.standard_normal((ticks, 3)),
        np.repeat(what.joint_noise * rng.standard_normal((1, joints)), ticks, axis=0),
    )


def _small_rotations(vectors: Floats) -> Floats:
    """Returns (T, 3, 3) rotations ``exp(v×)`` of rotation vectors (T, 3)."""
    angle = np.linalg.norm(vectors, axis=1)
    safe = np.maximum(angle, 1e-12)
    k = skew(vectors / safe[:, None])
    sine, cosine = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + sine * k + (1.0 - cosine) * (k @ k)
