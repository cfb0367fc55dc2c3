"""Pose control: force and torque that bring the CoG frame to its target (ZN23 eqs 15-19)."""

import numpy as np

from snakegen.kernels.jit import jit
from snakegen.kernels.linear import cross_into, turn_back_into, turn_into
from snakegen.kernels.tree import Floats


@jit
def attitude_error(rotation: Floats, wanted: Floats) -> Floats:
    """Returns ``e_R = ½ (RᵀR_des - R_desᵀR)^∨`` (3,), in the axes of `rotation`: eq 18."""
    error = np.empty(3)
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        lower = upper = 0.0
        for a in range(3):
            lower += rotation[a, j] * wanted[a, i]
            upper += rotation[a, i] * wanted[a, j]
        error[k] = 0.5 * (lower - upper)
    return error


@jit
def integrate(integral: Floats, error: Floats, dt: float, limit: Floats, held: int) -> Floats:
    """Returns the integral after `dt`, within ±`limit`.

    While an actuator is saturated (`held`) it may only shrink: the anti-windup rule.
    """
    out = np.empty(3)
    for k in range(3):
        grown = integral[k] + error[k] * dt
        if held and abs(grown) > abs(integral[k]):
            grown = integral[k]
        out[k] = min(max(grown, -limit[k]), limit[k])
    return out


@jit
def desired_force(
    mass: float,
    position: Floats,
    velocity: Floats,
    integral: Floats,
    wanted: Floats,
    wanted_velocity: Floats,
    acceleration: Floats,
    gains: Floats,
    gravity: float,
) -> Floats:
    """Returns the world force ``m (K_p e + K_i ∫e + K_d e' + a_des + g ẑ)`` (3,) [N]: eq 15.

    Args:
        mass: kg.
        position: (3,) m, of the CoG.
        velocity: (3,) m/s, of the CoG, joint rates included.
        integral: (3,) m s, of the position error.
        wanted, wanted_velocity: (3,) m and m/s, where the CoG should be.
        acceleration: (3,) m/s², fed forward.
        gains: (3, 3) rows K_p, K_i, K_d.
        gravity: m/s².
    """
    force = np.empty(3)
    for k in range(3):
        force[k] = mass * (
            gains[0, k] * (wanted[k] - position[k])
            + gains[1, k] * integral[k]
            + gains[2, k] * (wanted_velocity[k] - velocity[k])
            + acceleration[k]
        )
    force[2] += mass * gravity
    return force


@jit
def desired_torque(
    inertia: Floats,
    rotation: Floats,
    angular: Floats,
    integral: Floats,
    wanted: Floats,
    wanted_angular: Floats,
    gains: Floats,
    gyroscopic: int,
) -> Floats:
    """Returns ``I (K_p e_R + K_i ∫e_R + K_d e_ω) + ω × I ω`` (3,) [N m], CoG axes: eqs 17-19.

    Args:
        inertia: (3, 3) kg m², about the CoG, CoG axes.
        rotation: (3, 3) attitude of the CoG frame.
        angular: (3,) rad/s, in CoG axes.
        integral: (3,) rad s, of the attitude error.
        wanted: (3, 3) attitude wanted.
        wanted_angular: (3,) rad/s, in the axes of `wanted`.
        gains: (3, 3) rows K_p, K_i, K_d.
        gyroscopic: 1 adds the last term, which the print drops.
    """
    error = attitude_error(rotation, wanted)
    world, rate = np.empty(3), np.empty(3)
    turn_into(wanted, wanted_angular, world)
    turn_back_into(rotation, world, rate)
    for k in range(3):
        error[k] = (
            gains[0, k] * error[k]
            + gains[1, k] * integral[k]
            + gains[2, k] * (rate[k] - angular[k])
        )
    torque = np.empty(3)
    turn_into(inertia, error, torque)
    if gyroscopic:
        momentum, extra = np.empty(3), np.empty(3)
        turn_into(inertia, angular, momentum)
        cross_into(angular, momentum, extra)
        for k in range(3):
            torque[k] += extra[k]
    return torque
