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
    State,
    Target,
)
from snakegen.kernels.jit import jit
from snakegen.kernels.joint_loads import force_loads, rotor_loads
from snakegen.kernels.linear import matmul_into, turn_back_into
from snakegen.kernels.mode_allocation import (
    DUAL_SIGMA_MIN,
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
    horizontal,
    level_axes,
    rotor_map,
    tilted_target,
    truncated,
    truncated_wrench,
    vectored_gimbals,
)
from snakegen.kernels.vectoring import joint_order, mounts

SATURATION = 1e-6  # scaled wrench by which a command may fall short before it counts as saturated


@jit
def spread_thrust(rotor: Floats, pushes: Floats) -> Floats:
    """Returns rotor thrusts (n,) that share each apparatus' thrust (Ñ,) equally."""
    count, thrust = np.zeros(pushes.shape[0]), np.empty(rotor.shape[0])
    for r in range(thrust.shape[0]):
        count[int(rotor[r, 2, 1])] += 1.0
    for r in range(thrust.shape[0]):
        j = int(rotor[r, 2, 1])
        thrust[r] = pushes[j] / count[j]
    return thrust


@jit
def clip_to(lower: Floats, upper: Floats, x: Floats) -> None:
    """Clips x to its limits in place; all one-dimensional."""
    for i in range(x.shape[0]):
        x[i] = min(max(x[i], lower[i]), upper[i])


@jit
def falls_short(wanted: Floats, given: Floats, rows: Floats) -> int:
    """Tells whether a wrench misses what was wanted by more than SATURATION, rows scaled."""
    for k in range(rows.shape[0]):
        if abs(rows[k] * (wanted[k] - given[k])) > SATURATION:
            return 1
    return 0


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
    force = desired_force(
        mass,
        cog,
        speed,
        pulled,
        target.position,
        target.velocity,
        target.acceleration,
        law.force,
        law.gravity,
    )
    wanted = target.rotation
    ahead, left = horizontal(force, axes)
    if share < 1.0:
        leaning = tilted_target(
            ahead, left, target.rotation, mass * law.gravity, law.attitude, law.tilt_limit
        )
        wanted = between(target.rotation, leaning, 1.0 - share)
    error = attitude_error(axes, wanted)
    wound = integrate(state.torque_integral, error, dt, law.torque_integral_limit, held)
    wrench = np.empty(6)
    turn_back_into(axes, force, wrench[:3])
    torque = desired_torque(
        inertia, axes, angular, wound, wanted, target.angular, law.torque, law.gyroscopic
    )
    for k in range(3):
        wrench[3 + k] = torque[k]

    rows = wrench_scale(mass, law.gravity, length)
    m, rotor = mounts(tree, rotors, gimbals, rotation, position, cog, axes)
    lower, upper = joint_order(m, law.gimbal_lower), joint_order(m, law.gimbal_upper)
    last = joint_order(m, state.gimbals)
    thrust, angles, sigma, steps, size = np.empty(rotor.shape[0]), last, np.inf, 0, 0.0
    reached, status, internal = wrench, FLOWN, np.full((2, gimbals.limit.shape[0], 3), np.nan)
    bounded = law.joints if law.constrained else law.joints[:0]
    most = law.joint_limit if law.constrained else law.joint_limit[:0]
    if share > 0.0:
        held_up = force_loads(
            tree, gimbals, m, last, rotation, position, cog, axes, law.gravity, bounded, most
        )
        pushes, angles, sigma, steps, size, reached, internal = allocate_virtual(
            m,
            gimbals.limit,
            wrench,
            rows,
            last,
            lower,
            upper,
            law.sweeps,
            law.newton,
            law.residual,
            law.constrained,
            held_up,
            state.internal,
            dt / (dt + law.internal_time),
        )
        thrust = spread_thrust(rotor, pushes)
        if sigma < law.sigma_min:
            status = REFUSED
    tilt = level_axes(target.rotation)
    if share < 1.0:
        leaned = vectored_gimbals(
            m, ahead, left, tilt, mass * law.gravity, law.vectoring, lower, upper, last
        )
        for j in range(leaned.shape[0]):
            for k in range(2):
                leaned[j, k] += share * (angles[j, k] - leaned[j, k])
        angles = leaned
        q = truncated(rotor_map(m, rotor, angles), tilt)
        part = truncated_wrench(wrench, tilt)
        bent = rotor_loads(
            tree,
            gimbals,
            m,
            rotor,
            angles,
            rotation,
            position,
            cog,
            axes,
            law.gravity,
            bounded,
            most,
        )
        split, dual_sigma = allocate_dual(
            q, part, rows[2:], rotors.thrust_min, rotors.thrust_max, law.constrained, bent
        )
        if share > 0.0:
            split = blended(q, part, rotors.thrust_max, thrust, split, share)
        thrust, sigma = split, min(sigma, dual_sigma)
        if dual_sigma < DUAL_SIGMA_MIN:
            status = REFUSED
    clip_to(rotors.thrust_min, rotors.thrust_max, thrust)
    for j in range(angles.shape[0]):
        clip_to(lower[j], upper[j], angles[j])
    given, full = np.zeros(6), rotor_map(m, rotor, angles)
    for k in range(6):
        for r in range(thrust.shape[0]):
            given[k] += full[k, r] * thrust[r]
    short = falls_short(wrench, reached if law.constrained else given, rows)
    if share < 1.0:
        short = falls_short(truncated_wrench(wrench, tilt), truncated_wrench(given, tilt), rows[2:])
    turns = joint_order(m, angles)
    return (
        State(pulled, wound, turns, blend, short, internal),
        Command(thrust, turns, wrench, given, sigma, steps, size, status),
    )
