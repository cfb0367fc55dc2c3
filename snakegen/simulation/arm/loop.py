"""The loop of an arm on a fixed base: its servos are led along a motion in MuJoCo.

Beside the servos' torque it asks MuJoCo's inverse dynamics for the torque of the same motion, so
that the law of `statics` is held against both, as ZS24 compares with ADAMS.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from snakegen.base.geometry import Floats
from snakegen.errors import MissionError
from snakegen.inverse_kinematics.torques_along import Along
from snakegen.simulation.arm.plant import ArmPlant
from snakegen.simulation.flight.world import World

LEADS = ("none", "speed", "law")
_LOST = 100.0  # rad/s: a run this fast has diverged


@dataclass(frozen=True, eq=False)
class Moved:
    """What a run left behind: a row an instant, before the step that begins there.

    Attributes:
        ticks: instants run.
        qpos: (T, nq) MuJoCo's configuration.
        rates, accelerations: (T, k) rad/s and rad/s² of the chain's joints; Δq̇/Δt of the step.
        torque: (T, k) N·m that the servos gave over the step.
        friction: (T, k) N·m that dry friction gave over the step.
        deflection: (T, k) rad, what the servos are commanded, lead included, minus the angle.
        inverse: (T, k) N·m of MuJoCo's inverse dynamics of the motion asked for.
        contacts: (T,) how many contacts there were.
        stopped: "" or why the run ended early.
    """

    ticks: int
    qpos: Floats
    rates: Floats
    accelerations: Floats
    torque: Floats
    friction: Floats
    deflection: Floats
    inverse: Floats
    contacts: Floats
    stopped: str


def inverse_dynamics(world: World, along: Along, gravity: Floats) -> Floats:
    """Returns MuJoCo's inverse dynamics (T, k) [N·m] of a motion, friction left out."""
    model, data = world.model, mujoco.MjData(world.model)
    model.opt.gravity[:] = gravity
    off = int(mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS) | int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    flags = model.opt.disableflags
    model.opt.disableflags = flags | off
    at, dof = world.qpos[world.chain], world.qvel[world.chain]
    out = np.empty_like(along.angles)
    for k in range(len(along.time)):
        data.qpos[at], data.qvel[dof] = along.angles[k], along.rates[k]
        data.qacc[:] = 0.0
        data.qacc[dof] = along.accelerations[k]
        mujoco.mj_inverse(model, data)
        out[k] = data.qfrc_inverse[dof]
    model.opt.disableflags = flags
    return out


def move(
    world: World,
    along: Along,
    gravity: Floats,
    *,
    plant: ArmPlant,
    lead: str = "speed",
    simulated: mujoco.MjModel | None = None,
    offset: Floats | float = 0.0,
    progress: Callable[[int, int], Any] | None = None,
) -> Moved:
    """Runs the servos along a motion, one command an instant of `along`, one step between two.

    A servo gives ``k_p (u - q) - k_v q̇``; so u = q_d alone lags by k_v q̇_d / k_p. `lead` adds to
    u what takes the lag away: ``speed`` k_v q̇_d / k_p; ``law`` also τ_law / k_p, with which the
    spring has nothing left to do but correct. The torque read is the one that the step applied:
    the integrator takes the damping at the step's end, so ``k_v Δq̇`` comes off the sensor's value
    of a servo that is not at its limit.

    Args:
        world: whose timestep is the spacing of `along`.
        along: the motion, at the world's steps.
        gravity: (3,) m/s².
        plant: the arm's hardware, which the law does not know. Its friction is applied as a torque
            of each joint's rate. (MuJoCo's own dry friction is solved for before the servos'
            damping, and pushes where that alone, k_v Δt / I above 1, would turn a joint round
            within the step: measured at 40 mrad/s.)
        lead: one of `LEADS`.
        simulated: a model off the nominal values, that commands know nothing of; the world's own
            if absent.
        offset: (k,) rad, by which joint sensors are off.
        progress: called with instants run and instants in all.

    Raises:
        MissionError: a lead that is not known, a chain joint without a servo.
    """
    if lead not in LEADS:
        raise MissionError(f"lead must be one of {', '.join(LEADS)} (got '{lead}').")
    model, friction = plant.world(world).model, plant.friction
    data = mujoco.MjData(model)
    model.opt.gravity[:] = gravity
    at, dof, servo = world.qpos[world.chain], world.qvel[world.chain], world.servos
    stiffness, damping = model.actuator_gainprm[servo, 0], -model.actuator_biasprm[servo, 2]
    law = along.torque()
    command = along.angles.copy()
    if lead != "none":
        # The step takes the damping at its end, so it is led by the speed that it should end with.
        last = along.rates[-1:] + model.opt.timestep * along.accelerations[-1:]
        command += damping / stiffness * np.vstack([along.rates[1:], last])
    if lead == "law":
        command += law / stiffness
    if simulated is not None:
        model, data = simulated, mujoco.MjData(simulated)
        model.opt.gravity[:] = gravity
    command = _late(along.time, command + offset, plant.delay) - plant.offsets
    # a motion that begins in mid-course has its lag already
    begun = along.angles[0] - plant.delay * along.rates[0]
    data.qpos[at], data.qvel[dof] = begun - plant.offsets, along.rates[0]
    limited = model.actuator_forcelimited[servo] > 0
    limit = np.where(limited, model.actuator_forcerange[servo, 1], np.inf)
    count, wide = len(along.time), len(at)
    qpos = np.zeros((count, model.nq))
    rates, bends, torque, held = np.zeros((4, count, wide))
    contacts, stopped, ticks = np.zeros(count), "", count
    try:
        for k in range(count):
            speed = data.qvel[dof].copy()
            qpos[k], rates[k] = data.qpos, speed
            data.ctrl[servo] = command[k]
            data.qfrc_applied[dof] = -friction.torque(speed) if friction.present else 0.0
            mujoco.mj_step(model, data)
            gained = data.qvel[dof] - speed
            bends[k] = gained / model.opt.timestep
            given = data.actuator_force[servo]
            torque[k] = given - np.where(np.abs(given) < limit, damping * gained, 0.0)
            held[k] = data.qfrc_applied[dof] + data.qfrc_constraint[dof]
            contacts[k] = data.ncon
            if not np.abs(data.qvel).max() < _LOST:
                stopped, ticks = f"diverged at {along.time[k]:.3f} s", k + 1
                break
            if progress is not None and k % 200 == 0:
                progress(k, count)
    except KeyboardInterrupt:
        stopped, ticks = f"interrupted at {along.time[k]:.2f} s", max(k, 1)
    inverse = inverse_dynamics(world, along, gravity)
    return Moved(
        ticks, qpos[:ticks], rates[:ticks], bends[:ticks], torque[:ticks], held[:ticks],
        (command - qpos[:, at])[:ticks], inverse[:ticks], contacts[:ticks], stopped,
    )  # fmt: skip


def _late(time: Floats, command: Floats, delay: float) -> Floats:
    """Returns commands (T, k) as they arrive `delay` s later; the first one is there at the start.

    Before the delay is over they go on as they began, so that a motion in mid-course starts so.
    """
    if delay <= 0.0 or len(time) < 2:
        return command
    slope = (command[1] - command[0]) / (time[1] - time[0])
    then = time - delay
    columns = [np.interp(then, time, column) for column in command.T]
    before = np.minimum(then - time[0], 0.0)[:, None] * slope
    return np.asarray(np.transpose(columns) + before)
