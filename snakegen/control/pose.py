"""Pose control on plain arrays: the wrench that brings the CoG frame to its target (eqs 15-19)."""

from typing import Any

import numpy as np

from snakegen.control.gains import Floats, Gains
from snakegen.kernels.control import pose_law


def attitude_error(rotation: Any, wanted: Any) -> Floats:
    """Returns ``e_R = ½ (RᵀR_des - R_desᵀR)^∨`` (3,) in the axes of `rotation` (ZN23 eq 18)."""
    error = np.empty(3)
    pose_law.attitude_error_into(_matrix(rotation), _matrix(wanted), error)
    return error


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
    still = np.zeros(3)
    table = np.stack([gains.force_p, gains.force_i, gains.force_d])
    force = np.empty(3)
    pose_law.desired_force_into(
        float(mass),
        still,
        still,
        _vector(integral),
        _vector(error),
        _vector(rate),
        _vector(acceleration),
        table,
        float(gravity),
        force,
    )
    return force


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
    """Returns ``I (K_p e_R + K_i ∫e_R + K_d e_ω) + ω × I ω`` (3,) [N m], CoG axes (eqs 17-19).

    Args:
        gains: K_τ.
        inertia: (3, 3) kg m², about the CoG, CoG axes.
        rotation, wanted: (3, 3) attitudes of the CoG frame, now and wanted.
        angular: (3,) rad/s, CoG axes.
        wanted_angular: (3,) rad/s, axes of `wanted`.
        integral: (3,) rad s.
        gyroscopic: False drops the last term, as the print does.
    """
    table = np.stack([gains.torque_p, gains.torque_i, gains.torque_d])
    torque = np.empty(3)
    pose_law.desired_torque_into(
        _matrix(inertia),
        _matrix(rotation),
        _vector(angular),
        _vector(integral),
        _matrix(wanted),
        _vector(wanted_angular),
        table,
        int(gyroscopic),
        torque,
    )
    return torque


def _vector(value: Any) -> Floats:
    return np.array(value, dtype=float).reshape(3)


def _matrix(value: Any) -> Floats:
    return np.array(value, dtype=float).reshape(3, 3)
