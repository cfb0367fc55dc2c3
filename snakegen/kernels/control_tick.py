"""One tick of a flight controller, compiled whole: sensors and memory in, command and memory out.

Pose control (eqs 15-19), then allocation: fully actuated (eqs 29-47), under-actuated (eqs 20-28),
or a blend of both while the mode changes.
"""

from math import sqrt

import numpy as np

from snakegen.kernels.bounded import box_allocation
from snakegen.kernels.chain import body_twists, centroidal_motion, forward, mass_properties
from snakegen.kernels.confined import bounded_forces
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
from snakegen.kernels.fully_actuated import refine, spread_forces, wrench_jacobian
from snakegen.kernels.jit import jit
from snakegen.kernels.linear import matmul_into, turn_back_into
from snakegen.kernels.pose_law import attitude_error, desired_force, desired_torque, integrate
from snakegen.kernels.spd import least_norm, least_singular_value
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

LIMIT_SLACK = 1e-9  # N and rad, by which a command may pass a limit before it counts as saturated
ROUNDS = 20  # of bounded allocation and aiming


@jit
def wrench_scale(mass: float, gravity: float, length: float) -> Floats:
    """Returns S (6,): 1 / (m g) for forces, 1 / (m g length) for torques (THEORY A3)."""
    rows = np.full(6, 1.0 / (mass * gravity))
    rows[3:] /= length
    return rows


@jit
def allocate_virtual(
    m: Mounts,
    gimbals: Gimbals,
    wrench: Floats,
    rows: Floats,
    last: Floats,
    lower: Floats,
    upper: Floats,
    law: Law,
) -> tuple[Floats, Floats, float, int, float]:
    """Returns thrust (Ñ,), angles (Ñ, 2), σ_min(J_w), Newton steps and ‖ε‖: eqs 29-47.

    The constrained allocator takes over where the printed one passes a limit; elsewhere both give
    the least-norm answer. Angles are in joint order.
    """
    n = gimbals.limit.shape[0]
    thrust, angles = spread_forces(m, wrench, gimbals.limit, lower, upper, last, law.sweeps)
    scale = 1.0 / (rows[0] * n)
    steps, size = refine(m, wrench, thrust, angles, rows, scale, law.newton, law.residual)
    columns = np.ones(3 * n)
    columns[:n] = gimbals.limit
    sigma = least_singular_value(wrench_jacobian(m, thrust, angles), rows, columns)
    beyond = False
    for j in range(n):
        beyond |= not (-LIMIT_SLACK <= thrust[j] <= gimbals.limit[j] + LIMIT_SLACK)
        for k in range(2):
            beyond |= angles[j, k] < lower[j, k] - LIMIT_SLACK
            beyond |= angles[j, k] > upper[j, k] + LIMIT_SLACK
    if law.constrained and (beyond or size > law.residual):
        thrust, angles = bounded_forces(m, wrench, rows, gimbals.limit, lower, upper, last, ROUNDS)
    return thrust, angles, sigma, steps, size


@jit
def allocate_dual(
    m: Mounts,
    rotors: Rotors,
    angles: Floats,
    wrench: Floats,
    tilt: Floats,
    rows: Floats,
    constrained: int,
) -> tuple[Floats, float]:
    """Returns rotor thrusts (n,) and σ_min(Q_trunc) at the given gimbal angles: eqs 20-22.

    Weights: thrusts are normalised by their limits.
    """
    q = truncated(rotor_map(m, rotors, angles), tilt)
    wanted = truncated(wrench.reshape(6, 1), tilt)[:, 0].copy()
    thrust = least_norm(q, rotors.thrust_max, wanted)
    if constrained:
        beyond = np.any(thrust < rotors.thrust_min) or np.any(thrust > rotors.thrust_max)
        if beyond:
            thrust = box_allocation(
                q, wanted, rows[2:], rotors.thrust_max, rotors.thrust_min, rotors.thrust_max
            )
    return thrust, least_singular_value(q, rows[2:], rotors.thrust_max)


@jit
def smooth(s: float) -> float:
    """Returns ``3 s² - 2 s³``: a blend that starts and ends at rest."""
    return s * s * (3.0 - 2.0 * s)


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
    mass, cog, world_inertia = mass_properties(tree, rotation, position)
    speed, _, _ = centroidal_motion(
        tree, rotation, position, measured.linear, measured.angular, measured.rates
    )
    _, spins = body_twists(
        tree, rotation, position, measured.linear, measured.angular, measured.rates
    )
    axes, half, inertia = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    matmul_into(rotation[law.axes_body], law.axes_rotation, axes)
    matmul_into(world_inertia, axes, half)
    matmul_into(axes.T, half, inertia)
    angular = np.empty(3)
    turn_back_into(axes, spins[law.axes_body], angular)

    held = state.saturated
    pulled = integrate(
        state.force_integral, target.position - cog, force_dt, law.force_integral_limit, held
    )
    force = desired_force(mass, cog, speed, pulled, target, law)
    blend = state.blend
    stride = dt / law.blend_time if law.blend_time > 0.0 else 1.0
    blend = min(blend + stride, 1.0) if mode == VIRTUAL else max(blend - stride, 0.0)
    share = smooth(blend)
    weight = mass * law.gravity
    leaning = tilted_target(force, axes, target.rotation, weight, law)
    tilt = level_axes(target.rotation)
    wanted_axes = target.rotation
    if share < 1.0:
        wanted_axes = between(target.rotation, leaning, 1.0 - share)
    wound = integrate(
        state.torque_integral,
        attitude_error(axes, wanted_axes),
        dt,
        law.torque_integral_limit,
        held,
    )
    torque = desired_torque(inertia, axes, angular, wound, wanted_axes, target.angular, law)
    wrench = np.empty(6)
    turn_back_into(axes, force, wrench[:3])
    wrench[3:] = torque

    rows = wrench_scale(mass, law.gravity, length)
    m = mounts(tree, rotors, gimbals, rotation, position, cog, axes)
    lower, upper = joint_order(m, law.gimbal_lower), joint_order(m, law.gimbal_upper)
    last = joint_order(m, state.gimbals)
    thrust, angles, sigma, steps, size = np.zeros(rotors.body.shape[0]), last, np.inf, 0, 0.0
    count = rotor_counts(rotors, gimbals.limit.shape[0])
    if share > 0.0:
        pushes, angles, sigma, steps, size = allocate_virtual(
            m, gimbals, wrench, rows, last, lower, upper, law
        )
        for r in range(thrust.shape[0]):
            j = rotors.apparatus[r]
            thrust[r] = pushes[j] / count[j]
    if share < 1.0:
        held_gimbals = vectored_gimbals(m, force, axes, tilt, weight, law, lower, upper, last)
        mixed = share * angles + (1.0 - share) * held_gimbals if share > 0.0 else held_gimbals
        split, dual_sigma = allocate_dual(m, rotors, mixed, wrench, tilt, rows, law.constrained)
        if share > 0.0:
            split = blended(m, rotors, mixed, thrust, split, share, wrench, tilt)
        thrust, angles, sigma = split, mixed, min(sigma, dual_sigma)
    return finish(
        m,
        rotors,
        law,
        wrench,
        thrust,
        angles,
        lower,
        upper,
        pulled,
        wound,
        blend,
        sigma,
        steps,
        size,
    )


@jit
def between(a: Floats, b: Floats, share: float) -> Floats:
    """Returns a rotation `share` of the way from a to b, for nearby ones (Gram-Schmidt)."""
    mixed = (1.0 - share) * a + share * b
    x = mixed[:, 0] / sqrt(np.sum(mixed[:, 0] ** 2))
    y = mixed[:, 1] - np.sum(mixed[:, 1] * x) * x
    y = y / sqrt(np.sum(y * y))
    out = np.empty((3, 3))
    for i in range(3):
        k, l = (i + 1) % 3, (i + 2) % 3
        out[i, 0], out[i, 1], out[i, 2] = x[i], y[i], x[k] * y[l] - x[l] * y[k]
    return out


@jit
def blended(
    m: Mounts,
    rotors: Rotors,
    angles: Floats,
    virtual: Floats,
    dual: Floats,
    share: float,
    wrench: Floats,
    tilt: Floats,
) -> Floats:
    """Returns the thrusts between two modes, corrected so that ``[f_z; τ]`` stays exact."""
    thrust = share * virtual + (1.0 - share) * dual
    q = rotor_map(m, rotors, angles)
    given = np.zeros((6, 1))
    for k in range(6):
        given[k, 0] = wrench[k]
        for r in range(thrust.shape[0]):
            given[k, 0] -= q[k, r] * thrust[r]
    lack = truncated(given, tilt)[:, 0].copy()
    return thrust + least_norm(truncated(q, tilt), rotors.thrust_max, lack)


@jit
def finish(
    m: Mounts,
    rotors: Rotors,
    law: Law,
    wrench: Floats,
    thrust: Floats,
    angles: Floats,
    lower: Floats,
    upper: Floats,
    pulled: Floats,
    wound: Floats,
    blend: float,
    sigma: float,
    steps: int,
    size: float,
) -> tuple[State, Command]:
    """Clips the command to the limits, notes saturation, and packs memory and command."""
    saturated = 0
    for r in range(thrust.shape[0]):
        low, high = rotors.thrust_min[r], rotors.thrust_max[r]
        if thrust[r] < low - LIMIT_SLACK or thrust[r] > high - LIMIT_SLACK:
            saturated = 1
        thrust[r] = min(max(thrust[r], low), high)
    for j in range(angles.shape[0]):
        for k in range(2):
            if not lower[j, k] - LIMIT_SLACK <= angles[j, k] <= upper[j, k] + LIMIT_SLACK:
                saturated = 1
            angles[j, k] = min(max(angles[j, k], lower[j, k]), upper[j, k])
    given, q = np.zeros(6), rotor_map(m, rotors, angles)
    for k in range(6):
        for r in range(thrust.shape[0]):
            given[k] += q[k, r] * thrust[r]
    turns = joint_order(m, angles)
    status = FLOWN if sigma >= law.sigma_min else REFUSED
    return (
        State(pulled, wound, turns, blend, saturated),
        Command(thrust, turns, wrench, given, sigma, steps, size, status),
    )
