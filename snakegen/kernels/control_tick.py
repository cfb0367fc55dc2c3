"""One tick of a flight controller, compiled whole: sensors and memory in, command and memory out.

Pose control (eqs 15-19), then allocation: fully actuated (eqs 29-47), under-actuated (eqs 20-28),
or a blend of both while the mode changes.
"""

import numpy as np

from snakegen.kernels.chain import body_twists, centre_velocity, forward, mass_properties
from snakegen.kernels.control_types import (
    FLOWN,
    REFUSED,
    VIRTUAL,
    Command,
    Law,
    Measured,
    Mounts,
    State,
    Target,
)
from snakegen.kernels.jit import jit
from snakegen.kernels.linear import matmul_into, turn_back_into
from snakegen.kernels.mode_allocation import (
    allocate_dual,
    allocate_virtual,
    between,
    blended,
    smooth,
    wrench_scale,
)
from snakegen.kernels.pose_law import attitude_error, desired_force, desired_torque, integrate
from snakegen.kernels.tree import Floats, Gimbals, Rotors, Tree
from snakegen.kernels.underactuated import (
    level_axes,
    rotor_map,
    tilted_target,
    truncated,
    vectored_gimbals,
)
from snakegen.kernels.vectoring import joint_order, mounts
from snakegen.kernels.wrench_map import rotor_counts

SATURATION = 1e-6  # scaled wrench by which a command may fall short before it counts as saturated


@jit
def spread_thrust(rotors: Rotors, pushes: Floats) -> Floats:
    """Returns rotor thrusts (n,) that share each apparatus' thrust (Ñ,) equally."""
    count = rotor_counts(rotors, pushes.shape[0])
    thrust = np.empty(rotors.body.shape[0])
    for r in range(thrust.shape[0]):
        thrust[r] = pushes[rotors.apparatus[r]] / count[rotors.apparatus[r]]
    return thrust


@jit
def allocate(
    m: Mounts,
    rotors: Rotors,
    gimbals: Gimbals,
    law: Law,
    share: float,
    wrench: Floats,
    force: Floats,
    axes: Floats,
    wanted_axes: Floats,
    rows: Floats,
    last: Floats,
    lower: Floats,
    upper: Floats,
) -> tuple[Floats, Floats, float, int, float]:
    """Returns rotor thrusts, gimbal angles, σ_min, Newton steps and ‖ε‖ in mode `share`.

    `share` is 0 in dual-rotor mode, 1 in virtual-single-rotor mode, between while blending.
    """
    tilt, weight = level_axes(wanted_axes), 1.0 / rows[0]
    thrust, angles, sigma, steps, size = np.zeros(rotors.body.shape[0]), last, np.inf, 0, 0.0
    if share > 0.0:
        pushes, angles, sigma, steps, size = allocate_virtual(
            m, gimbals, wrench, rows, last, lower, upper, law
        )
        thrust = spread_thrust(rotors, pushes)
    if share < 1.0:
        leaning = vectored_gimbals(m, force, axes, tilt, weight, law, lower, upper, last)
        mixed = share * angles + (1.0 - share) * leaning
        split, dual_sigma = allocate_dual(m, rotors, mixed, wrench, tilt, rows, law.constrained)
        if share > 0.0:
            split = blended(m, rotors, mixed, thrust, split, share, wrench, tilt)
        thrust, angles, sigma = split, mixed, min(sigma, dual_sigma)
    return thrust, angles, sigma, steps, size


@jit
def clip_command(
    rotors: Rotors, lower: Floats, upper: Floats, thrust: Floats, angles: Floats
) -> None:
    """Clips thrusts and gimbal angles (joint order) to their limits, in place."""
    for r in range(thrust.shape[0]):
        thrust[r] = min(max(thrust[r], rotors.thrust_min[r]), rotors.thrust_max[r])
    for j in range(angles.shape[0]):
        for k in range(2):
            angles[j, k] = min(max(angles[j, k], lower[j, k]), upper[j, k])


@jit
def falls_short(lack: Floats, rows: Floats, share: float, tilt: Floats) -> int:
    """Tells whether a wrench falls short: in all rows, or in [f_z; τ] unless fully actuated."""
    if share >= 1.0:
        return int(np.max(np.abs(rows * lack)) > SATURATION)
    return int(np.max(np.abs(rows[2:] * truncated(lack.reshape(6, 1), tilt)[:, 0])) > SATURATION)


@jit
def control_tick(
    tree: Tree,
    rotors: Rotors,
    gimbals: Gimbals,
    law: Law,
    length: float,
    mode: int,
    measured: Measured,
    target: Target,
    state: State,
    dt: float,
    force_dt: float,
) -> tuple[State, Command]:
    """Returns the controller's memory after this tick, and the command.

    Args:
        tree, rotors, gimbals: the robot.
        law: gains, limits and options.
        length: m, the torque scale's lever (mean link length).
        mode: VIRTUAL or DUAL, the mode to be in or to blend into.
        measured: sensors.
        target: where the CoG frame should be.
        state: memory of the tick before.
        dt: s since then.
        force_dt: s of position error to add to its integral (0 between ticks of a slower loop).
    """
    rotation, position = forward(tree, measured.rotation, measured.position, measured.angles)
    linear, spins = body_twists(
        tree, rotation, position, measured.linear, measured.angular, measured.rates
    )
    mass, cog, world_inertia = mass_properties(tree, rotation, position)
    speed = centre_velocity(tree, rotation, linear, spins)
    axes, half, inertia = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    matmul_into(rotation[law.axes_body], law.axes_rotation, axes)
    matmul_into(world_inertia, axes, half)
    matmul_into(axes.T, half, inertia)
    angular = np.empty(3)
    turn_back_into(axes, spins[law.axes_body], angular)

    stride = dt / law.blend_time if law.blend_time > 0.0 else 1.0
    blend = min(state.blend + stride, 1.0) if mode == VIRTUAL else max(state.blend - stride, 0.0)
    share, held = smooth(blend), state.saturated
    pulled = integrate(
        state.force_integral, target.position - cog, force_dt, law.force_integral_limit, held
    )
    force = desired_force(mass, cog, speed, pulled, target, law)
    wanted = target.rotation
    if share < 1.0:
        leaning = tilted_target(force, axes, target.rotation, mass * law.gravity, law)
        wanted = between(target.rotation, leaning, 1.0 - share)
    error = attitude_error(axes, wanted)
    wound = integrate(state.torque_integral, error, dt, law.torque_integral_limit, held)
    wrench = np.empty(6)
    turn_back_into(axes, force, wrench[:3])
    wrench[3:] = desired_torque(inertia, axes, angular, wound, wanted, target.angular, law)

    rows = wrench_scale(mass, law.gravity, length)
    m = mounts(tree, rotors, gimbals, rotation, position, cog, axes)
    lower, upper = joint_order(m, law.gimbal_lower), joint_order(m, law.gimbal_upper)
    last = joint_order(m, state.gimbals)
    thrust, angles, sigma, steps, size = allocate(
        m,
        rotors,
        gimbals,
        law,
        share,
        wrench,
        force,
        axes,
        target.rotation,
        rows,
        last,
        lower,
        upper,
    )
    clip_command(rotors, lower, upper, thrust, angles)
    given = rotor_map(m, rotors, angles) @ thrust
    short = falls_short(wrench - given, rows, share, level_axes(target.rotation))
    turns = joint_order(m, angles)
    status = FLOWN if sigma >= law.sigma_min else REFUSED
    return (
        State(pulled, wound, turns, blend, short),
        Command(thrust, turns, wrench, given, sigma, steps, size, status),
    )
