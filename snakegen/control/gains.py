"""Gains of the flight laws (ZN23 Tables 3 and 5) and the limits that go with them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snakegen.errors import SpecError, near

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Gains:
    """Gains of eqs 15-19, per axis x, y, z, and of eqs 23-28; the defaults are Table 5's.

    Attributes:
        force_p: (3,) K_f,p [1/s²], world axes.
        force_i: (3,) K_f,i [1/s³].
        force_d: (3,) K_f,d [1/s].
        torque_p: (3,) K_τ,p [1/s²], CoG axes; the law multiplies by the inertia.
        torque_i: (3,) K_τ,i [1/s³].
        torque_d: (3,) K_τ,d [1/s].
        attitude_roll: k_φ, attitude from sideways force.
        attitude_pitch: k_θ, attitude from forward force.
        vectoring_roll: k_φi, gimbals from sideways force; a number, or one per apparatus.
        vectoring_pitch: k_θi, gimbals from forward force.
        force_integral_limit: (3,) m s, clamp of ∫e_r. With Table 5's K_f,i of 1.2 along z, 2 m s
            make up for a quarter of the weight; with its 0.03 along x and y, for an IMU's tilt of
            0.35° (assumed).
        torque_integral_limit: (3,) rad s, clamp of ∫e_R (assumed).
        tilt_limit: rad, clamp of the roll and pitch asked for by eqs 23-24 (assumed).
    """

    force_p: Floats = field(default_factory=lambda: np.array([3.6, 3.6, 2.8]))
    force_i: Floats = field(default_factory=lambda: np.array([0.03, 0.03, 1.2]))
    force_d: Floats = field(default_factory=lambda: np.array([4.0, 4.0, 2.8]))
    torque_p: Floats = field(default_factory=lambda: np.array([15.0, 15.0, 10.0]))
    torque_i: Floats = field(default_factory=lambda: np.array([0.3, 0.3, 0.1]))
    torque_d: Floats = field(default_factory=lambda: np.array([5.0, 5.0, 5.0]))
    attitude_roll: float = 1.0
    attitude_pitch: float = 0.0
    vectoring_roll: float | Sequence[float] = 1.0
    vectoring_pitch: float | Sequence[float] = 1.0
    force_integral_limit: Floats = field(default_factory=lambda: np.array([2.0, 2.0, 2.0]))
    torque_integral_limit: Floats = field(default_factory=lambda: np.array([2.0, 2.0, 2.0]))
    tilt_limit: float = 0.35

    def __post_init__(self) -> None:
        for f in fields(self):
            value = np.asarray(getattr(self, f.name), float)
            if f.name.startswith(("force_", "torque_")):
                object.__setattr__(self, f.name, value)
                if value.shape != (3,):
                    raise SpecError(f"gains.{f.name}: {value.size} numbers, not 3 (x, y, z)")
            if not np.all(np.isfinite(value)):
                raise SpecError(f"gains.{f.name}: {value.tolist()} is not finite")
            if f.name.endswith("limit") and np.any(value < 0):
                raise SpecError(f"gains.{f.name}: {value.tolist()} must not be negative")

    def vectoring(self, apparatuses: int) -> Floats:
        """Returns k_φi, k_θi as (Ñ, 2).

        Raises:
            SpecError: a list has another length than the robot has apparatuses.
        """
        out = np.empty((apparatuses, 2))
        for k, name in enumerate(("vectoring_roll", "vectoring_pitch")):
            value = np.atleast_1d(np.asarray(getattr(self, name), float))
            if value.size not in (1, apparatuses):
                raise SpecError(
                    f"gains.{name}: {value.size} numbers for {apparatuses} apparatuses; "
                    f"one for all, or {apparatuses}, would do"
                )
            out[:, k] = value
        return out


def gains_from(mapping: Mapping[str, Any]) -> Gains:
    """Returns the gains that a spec's or a URDF's `<control>` names; absent ones are default.

    Raises:
        SpecError: an unknown name, or a value of the wrong shape.
    """
    known = [f.name for f in fields(Gains)]
    for name in mapping:
        if name not in known:
            raise SpecError(f"gains have no field '{name}'.{near(name, known)}")
    return Gains(**mapping)
