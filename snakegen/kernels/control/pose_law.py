"""Pose control: force and torque that bring the CoG frame to its target (ZN23 eqs 15-19)."""

from snakegen.kernels.allocation.underactuated import between_into, horizontal, tilted_target_into
from snakegen.kernels.control.low_pass import low_pass
from snakegen.kernels.control.types import Law, Measured, State, Target
from snakegen.kernels.core.mat3 import cross_into, matmul_into, turn_back_into, turn_into
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.stack_arrays import scratch
from snakegen.kernels.core.types import Body, Floats, Tree
from snakegen.kernels.kinematics.chain import (
    body_twists_into,
    drift_into,
    forward_into,
    inertia_into,
    weigh,
)


@bare
def attitude_error_into(rotation: Floats, wanted: Floats, error: Floats) -> None:
    """Writes ``e_R = ½ (RᵀR_des - R_desᵀR)^∨`` (3,), in the axes of `rotation`: eq 18."""
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        lower = upper = 0.0
        for a in range(3):
            lower += rotation[a, j] * wanted[a, i]
            upper += rotation[a, i] * wanted[a, j]
        error[k] = 0.5 * (lower - upper)


@bare
def integrate(
    integral: Floats, error: Floats, dt: float, rate: Floats, limit: Floats, held: int
) -> None:
    """Adds `error` over `dt`, times `rate` (3,), to the integral (3,) in place, within ±`limit`.

    While an actuator is saturated (`held`) it may only shrink: the anti-windup rule.
    """
    for k in range(3):
        grown = integral[k] + error[k] * rate[k] * dt
        if held and abs(grown) > abs(integral[k]):
            grown = integral[k]
        integral[k] = min(max(grown, -limit[k]), limit[k])


@bare
def desired_force_into(
    mass: float,
    position: Floats,
    velocity: Floats,
    integral: Floats,
    wanted: Floats,
    wanted_velocity: Floats,
    acceleration: Floats,
    gains: Floats,
    gravity: float,
    force: Floats,
) -> None:
    """Writes the world force ``m (K_p e + K_i ∫e + K_d e' + a_des + g ẑ)`` (3,) [N]: eq 15.

    Args:
        mass: kg.
        position: (3,) m, of the CoG.
        velocity: (3,) m/s, of the CoG, joint rates included.
        integral: (3,) m s, of the position error.
        wanted, wanted_velocity: (3,) m and m/s, where the CoG should be.
        acceleration: (3,) m/s², fed forward.
        gains: (3, 3) rows K_p, K_i, K_d.
        gravity: m/s².
        force: (3,) N.
    """
    for k in range(3):
        force[k] = mass * (
            gains[0, k] * (wanted[k] - position[k])
            + gains[1, k] * integral[k]
            + gains[2, k] * (wanted_velocity[k] - velocity[k])
            + acceleration[k]
        )
    force[2] += mass * gravity


@bare
def desired_torque_into(
    inertia: Floats,
    rotation: Floats,
    angular: Floats,
    integral: Floats,
    wanted: Floats,
    wanted_angular: Floats,
    gains: Floats,
    gyroscopic: int,
    torque: Floats,
) -> None:
    """Writes ``I (K_p e_R + K_i ∫e_R + K_d e_ω) + ω × I ω`` (3,) [N·m], CoG axes: eqs 17-19.

    Args:
        inertia: (3, 3) kg·m², about the CoG, CoG axes.
        rotation: (3, 3) attitude of the CoG frame.
        angular: (3,) rad/s, in CoG axes.
        integral: (3,) rad s, of the attitude error.
        wanted: (3, 3) attitude wanted.
        wanted_angular: (3,) rad/s, in the axes of `wanted`.
        gains: (3, 3) rows K_p, K_i, K_d.
        gyroscopic: 1 adds the last term, which the print drops.
        torque: (3,) N·m.
    """
    error, world, rate = scratch(3), scratch(3), scratch(3)
    attitude_error_into(rotation, wanted, error)
    turn_into(wanted, wanted_angular, world)
    turn_back_into(rotation, world, rate)
    for k in range(3):
        error[k] = (
            gains[0, k] * error[k]
            + gains[1, k] * integral[k]
            + gains[2, k] * (rate[k] - angular[k])
        )
    turn_into(inertia, error, torque)
    if gyroscopic:
        momentum, extra = scratch(3), scratch(3)
        turn_into(inertia, angular, momentum)
        cross_into(angular, momentum, extra)
        for k in range(3):
            torque[k] += extra[k]


@bare
def locate(
    tree: Tree,
    law: Law,
    measured: Measured,
    body: Body,
    inertia: Floats,
    speed: Floats,
    angular: Floats,
) -> float:
    """Writes where the robot is and how it moves; returns its mass [kg].

    Inertia (3, 3) about the CoG and angular velocity (3,) of the CoG frame in CoG axes, velocity
    (3,) of the CoG in world axes, joint rates included.
    """
    rotation, position = body.rotation, body.position
    n = tree.parent.shape[0]
    linear, spins = scratch((n, 3)), scratch((n, 3))
    world, half = scratch((3, 3)), scratch((3, 3))
    forward_into(tree, measured.rotation, measured.position, measured.angles, rotation, position)
    body_twists_into(
        tree,
        rotation,
        position,
        measured.linear,
        measured.angular,
        measured.rates,
        linear,
        spins,
    )
    mass, centre = weigh(tree, rotation, position)
    body.cog[0], body.cog[1], body.cog[2] = centre
    inertia_into(tree, rotation, position, body.cog, world)
    drift_into(tree, rotation, linear, spins, speed)
    matmul_into(rotation[law.axes_body], law.axes_rotation, body.axes)
    matmul_into(world, body.axes, half)
    matmul_into(body.axes.T, half, inertia)
    turn_back_into(body.axes, spins[law.axes_body], angular)
    return mass


@bare
def pose_wrench(
    tree: Tree,
    law: Law,
    measured: Measured,
    target: Target,
    state: State,
    share: float,
    dt: float,
    force_dt: float,
    body: Body,
    wrench: Floats,
) -> tuple[float, float, float]:
    """Writes the wrench (6,) wanted, CoG axes, `body`, and the integrals of `state`: eqs 15-24.

    Returns the mass [kg] and the horizontal force, ahead and left [N], of `horizontal`; `share` is
    0 in dual-rotor mode, which leans to move, … 1.
    """
    inertia, speed, angular = scratch((3, 3)), scratch(3), scratch(3)
    force, error, wanted = scratch(3), scratch(3), scratch((3, 3))
    mass = locate(tree, law, measured, body, inertia, speed, angular)
    if law.rate_filter > 0.0:
        low_pass(angular, state.rates[0], law.rate_filter, dt)
        low_pass(speed, state.rates[1], law.rate_filter, dt)
    for k in range(3):
        error[k] = target.position[k] - body.cog[k]
        for i in range(3):
            wanted[k, i] = target.rotation[k, i]
    held = state.saturated
    rate, limit = law.integral_rate, law.force_integral_limit
    integrate(state.force_integral, error, force_dt, rate[0], limit, held)
    desired_force_into(
        mass,
        body.cog,
        speed,
        state.force_integral,
        target.position,
        target.velocity,
        target.acceleration,
        law.force,
        law.gravity,
        force,
    )
    ahead, left = horizontal(force, body.axes)
    if share < 1.0:
        leaning, weight = scratch((3, 3)), mass * law.gravity
        tilted_target_into(
            ahead, left, target.rotation, weight, law.attitude, law.tilt_limit, leaning
        )
        between_into(target.rotation, leaning, 1.0 - share, wanted)
    attitude_error_into(body.axes, wanted, error)
    integrate(state.torque_integral, error, dt, rate[1], law.torque_integral_limit, held)
    turn_back_into(body.axes, force, wrench[:3])
    desired_torque_into(
        inertia,
        body.axes,
        angular,
        state.torque_integral,
        wanted,
        target.angular,
        law.torque,
        law.gyroscopic,
        wrench[3:],
    )
    return mass, ahead, left
