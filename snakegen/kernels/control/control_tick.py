"""One tick of a flight controller, compiled whole: sensors and memory in, command and memory out.

Pose control (eqs 15-19), then allocation: fully actuated (eqs 29-47), under-actuated (eqs 20-28),
or a blend of both while the mode changes.
"""

import numpy as np

from snakegen.kernels.allocation.constrained_allocation import keep_limits
from snakegen.kernels.allocation.gimbals import joint_order_into, mounts_into
from snakegen.kernels.allocation.mode_blending import (
    DUAL_SIGMA_MIN,
    allocate_leaning,
    least_answer,
    smooth,
    wrench_scale_into,
)
from snakegen.kernels.allocation.types import (
    DualAnswer,
    Iteration,
    Level,
    Limits,
    Previous,
    Task,
    VirtualAnswer,
)
from snakegen.kernels.allocation.underactuated import (
    level_axes_into,
    rotor_map_into,
    truncated_wrench_into,
)
from snakegen.kernels.control.external_torque import update_external_torque
from snakegen.kernels.control.pose_law import pose_wrench
from snakegen.kernels.control.types import (
    FLOWN,
    REFUSED,
    VIRTUAL,
    Command,
    Law,
    Measured,
    State,
    Target,
    copied,
    with_flags,
)
from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.stack_arrays import scratch
from snakegen.kernels.core.types import Body, Floats, Mechanism

SATURATION = 1e-6  # scaled wrench by which a command may fall short before it counts as saturated


@bare
def spread_thrust(rotor: Floats, pushes: Floats, thrust: Floats) -> None:
    """Writes rotor thrusts (n,) that share each apparatus' thrust (Ñ,) equally."""
    count = scratch(pushes.shape[0])
    for j in range(pushes.shape[0]):
        count[j] = 0.0
    for r in range(thrust.shape[0]):
        count[int(rotor[r, 2, 1])] += 1.0
    for r in range(thrust.shape[0]):
        j = int(rotor[r, 2, 1])
        thrust[r] = pushes[j] / count[j]


@bare
def gather_thrust(rotor: Floats, thrust: Floats, pushes: Floats) -> None:
    """Writes the thrusts (Ñ,) of apparatuses whose rotors give (n,); 0 before the first tick."""
    for j in range(pushes.shape[0]):
        pushes[j] = 0.0
    for r in range(thrust.shape[0]):
        if thrust[r] == thrust[r]:
            pushes[int(rotor[r, 2, 1])] += thrust[r]


@bare
def clip_to(lower: Floats, upper: Floats, x: Floats) -> None:
    """Clips x to its limits in place; all one-dimensional."""
    for i in range(x.shape[0]):
        x[i] = min(max(x[i], lower[i]), upper[i])


@bare
def is_unachieved(wanted: Floats, given: Floats, rows: Floats) -> int:
    """Tells whether a wrench misses what was wanted by more than SATURATION, rows scaled."""
    for k in range(rows.shape[0]):
        if abs(rows[k] * (wanted[k] - given[k])) > SATURATION:
            return 1
    return 0


@bare
def reset_internal_forces(internal: Floats, value: float) -> None:
    """Sets all internal forces (2, Ñ, 3) to one value: 0 for none, NaN for none as yet."""
    for i in range(2):
        for j in range(internal.shape[1]):
            for k in range(3):
                internal[i, j, k] = value


@bare
def achieved_wrench_into(
    m: Floats, rotor: Floats, angles: Floats, thrust: Floats, given: Floats
) -> None:
    """Writes the wrench (6,), CoG axes, of rotor thrusts (n,) at angles in joint order: eq 7."""
    full = scratch((6, thrust.shape[0]))
    rotor_map_into(m, rotor, angles, full)
    for k in range(6):
        given[k] = 0.0
        for r in range(thrust.shape[0]):
            given[k] += full[k, r] * thrust[r]


@bare
def is_unachieved_level(wanted: Floats, given: Floats, tilt: Floats, rows: Floats) -> int:
    """Tells as `is_unachieved` does of ``[f_z; τ]`` alone, z the level axis."""
    one, two = scratch(4), scratch(4)
    truncated_wrench_into(wanted, tilt, one)
    truncated_wrench_into(given, tilt, two)
    return is_unachieved(one, two, rows[2:])


@bare(no_cpython_wrapper=True)
def decide(
    mechanism: Mechanism,
    law: Law,
    mode: int,
    measured: Measured,
    target: Target,
    state: State,
    dt: float,
    force_dt: float,
    command: Command,
) -> tuple[float, int, float, int, float, int]:
    """Does one tick in place: writes the arrays of `state` and of `command`.

    Arguments as in `control_tick`. Returns what no array holds: the state's blend and whether it
    is saturated, then the command's σ_min, Newton steps, residual and status.
    """
    tree, rotors, gimbals = mechanism
    n, bodies, count = gimbals.limit.shape[0], tree.parent.shape[0], rotors.body.shape[0]
    rotation, position, cog = scratch((bodies, 3, 3)), scratch((bodies, 3)), scratch(3)
    body = Body(rotation, position, cog, scratch((3, 3)))
    wrench, thrust, rows = command.wanted, command.thrust, scratch(6)
    stride = dt / law.blend_time if law.blend_time > 0.0 else 1.0
    blend = min(state.blend + stride, 1.0) if mode == VIRTUAL else max(state.blend - stride, 0.0)
    share = smooth(blend)
    mass, ahead, left = pose_wrench(
        tree, law, measured, target, state, share, dt, force_dt, body, wrench
    )
    wrench_scale_into(mass, law.gravity, law.length, rows)
    m, rotor = scratch((n, 10, 3)), scratch((count, 3, 3))
    mounts_into(tree, rotors, gimbals, rotation, position, cog, body.axes, m, rotor)
    lower, upper, last = scratch((n, 2)), scratch((n, 2)), scratch((n, 2))
    joint_order_into(m, law.gimbal_lower, lower)
    joint_order_into(m, law.gimbal_upper, upper)
    joint_order_into(m, state.gimbals, last)
    if law.constrained:
        update_external_torque(tree, gimbals, law, body, m, rotor, last, measured, state, dt)
    angles, pushes, reached, given = scratch((n, 2)), scratch(n), scratch(6), command.given
    sigma, steps, size, status = np.inf, 0, 0.0, FLOWN
    task, limits, before = Task(wrench, rows), Limits(gimbals.limit, lower, upper), scratch(n)
    previous = Previous(last, before, state.strain)
    if share > 0.0:
        iteration = Iteration(law.sweeps, law.newton, law.residual)
        sigma, steps, size, beyond = least_answer(m, task, limits, last, iteration, pushes, angles)
        if law.constrained:
            gather_thrust(rotor, state.thrust, before)
            virtual = VirtualAnswer(pushes, angles, state.internal, reached)
            keep_limits(mechanism, law, body, m, task, limits, previous, beyond, dt, virtual)
        spread_thrust(rotor, pushes, thrust)
        if sigma < law.sigma_min:
            status = REFUSED
    tilt, stands = scratch((3, 3)), scratch((n, 2))
    if share < 1.0:
        level_axes_into(target.rotation, tilt)
        level = Level(ahead, left, mass * law.gravity, tilt)
        dual = DualAnswer(thrust, angles, stands)
        dual_sigma = allocate_leaning(
            mechanism, law, body, (m, rotor), level, task, limits, previous, share, dual
        )
        sigma = min(sigma, dual_sigma)
        if dual_sigma < DUAL_SIGMA_MIN:
            status = REFUSED
    if share == 0.0 or not law.constrained:
        reset_internal_forces(state.internal, np.nan if share == 0.0 else 0.0)
    clip_to(rotors.thrust_min, rotors.thrust_max, thrust)
    for j in range(n):
        clip_to(lower[j], upper[j], angles[j])
    achieved_wrench_into(m, rotor, stands if share < 1.0 else angles, thrust, given)
    if share < 1.0:
        short = is_unachieved_level(wrench, given, tilt, rows)
    else:
        short = is_unachieved(wrench, reached if law.constrained else given, rows)
    for r in range(count):
        state.thrust[r] = thrust[r]
    joint_order_into(m, angles, state.gimbals)
    joint_order_into(m, angles, command.gimbals)
    return blend, short, sigma, steps, size, status


@jit
def control_tick(
    mechanism: Mechanism,
    law: Law,
    mode: int,
    measured: Measured,
    target: Target,
    state: State,
    dt: float,
    force_dt: float,
) -> tuple[State, Command]:
    """Returns the controller's memory after this tick, and the command.

    Args:
        mechanism: the robot.
        law: gains, limits and options.
        mode: VIRTUAL or DUAL, the mode to be in or to blend into.
        measured: sensors.
        target: where the CoG frame should be.
        state: memory of the tick before.
        dt: s since then.
        force_dt: s of position error to add to its integral (0 between ticks of a slower loop).
    """
    after, turns = copied(state), state.gimbals.copy()
    thrust = np.empty(mechanism.rotors.body.shape[0])
    wanted, given = np.empty(6), np.empty(6)
    command = Command(thrust, turns, wanted, given, np.inf, 0, 0.0, FLOWN)
    blend, short, sigma, steps, size, status = decide(
        mechanism, law, mode, measured, target, after, dt, force_dt, command
    )
    return (
        with_flags(after, blend, short),
        Command(thrust, turns, wanted, given, sigma, steps, size, status),
    )
