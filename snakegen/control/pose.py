"""Pose control on plain arrays: the wrench that brings the CoG frame to its target (eqs 15-19).

The readable twin of `kernels/control/pose_law.py`, which flies.
"""

from typing import Any

import numpy as np

from snakegen.base.geometry import cross, unskew
from snakegen.control.gains import Floats, Gains


def attitude_error(rotation: Any, wanted: Any) -> Floats:
    """Returns ``e_R = ½ (RᵀR_des - R_desᵀR)^∨`` (3,) in the axes of `rotation` (ZN23 eq 18)."""
    now, there = _matrix(rotation), _matrix(wanted)
    return unskew(now.T @ there)  # of the skew part: the half is in it


def desired_force(
    gains: Gains,
    mass: float,
    error: Any,
    rate: Any,
    integral: Any = (0.0, 0.0, 0.0),
    acceleration: Any = (0.0, 0.0, 0.0),
    gravity: float = 9.81,
) -> Floats:
    """Returns ``m (K_p e + K_i ∫e + K_d e' + a_des + g ẑ)`` (3,) [N] in the world (ZN23 eq 15).

    ``Rᵀ`` of it is the force in the CoG frame: gravity is rotated too, which the print omits.

    Args:
        gains: K_f.
        mass: kg.
        error: (3,) m, wanted position minus the CoG's.
        rate: (3,) m/s, its rate; the CoG's velocity contains the joint rates.
        integral: (3,) m s.
        acceleration: (3,) m/s², fed forward.
        gravity: m/s².
    """
    e, rate, sum_, ahead = (_vector(x) for x in (error, rate, integral, acceleration))
    pull = gains.force_p * e + gains.force_i * sum_ + gains.force_d * rate + ahead
    return np.asarray(mass * (pull + np.array([0.0, 0.0, gravity])))


def desired_torque(
    gains: Gains,
    inertia: Any,
    rotation: Any,
    wanted: Any,
    angular: Any,
    wanted_angular: Any = (0.0, 0.0, 0.0),
    integral: Any = (0.0, 0.0, 0.0),
    gyroscopic: bool = True,
) -> Floats:
    """Returns ``I (K_p e_R + K_i ∫e_R + K_d e_ω) + ω × I ω`` (3,) [N·m], CoG axes (eqs 17-19).

    Args:
        gains: K_τ.
        inertia: (3, 3) kg·m², about the CoG, CoG axes.
        rotation, wanted: (3, 3) attitudes of the CoG frame, now and wanted.
        angular: (3,) rad/s, CoG axes.
        wanted_angular: (3,) rad/s, axes of `wanted`.
        integral: (3,) rad s.
        gyroscopic: False drops the last term, as the print does.
    """
    body, now, there, w = _matrix(inertia), _matrix(rotation), _matrix(wanted), _vector(angular)
    rate = now.T @ there @ _vector(wanted_angular) - w  # e_ω = RᵀR_des ω_des - ω
    turn = gains.torque_p * attitude_error(now, there)
    turn = turn + gains.torque_i * _vector(integral) + gains.torque_d * rate
    gyration = cross(w, body @ w) if gyroscopic else 0.0
    return np.asarray(body @ turn + gyration)


def _vector(value: Any) -> Floats:
    return np.array(value, dtype=float).reshape(3)


def _matrix(value: Any) -> Floats:
    return np.array(value, dtype=float).reshape(3, 3)
