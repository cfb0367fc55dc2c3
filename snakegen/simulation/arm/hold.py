"""An arm on a fixed base held by servos and thrust together, in MuJoCo.

Apparatuses push as `analyze relief` says, for the model; masses, thrusts, encoders and servos are
those of the run. Servos stay at the posture, led by the torque that the model leaves to them.
"""

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from snakegen.base.geometry import Floats
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.world import World
from snakegen.statics.thrust_relief import ThrustMap

LOGGED = 5  # steps between rows of the log
_LOST = 100.0  # rad/s: a run this fast has diverged


@dataclass(frozen=True, eq=False)
class Hold:
    """What is asked of an arm that holds a posture.

    Attributes:
        q: posture (nq,), gimbals aimed along their thrusts.
        thrust: (r,) N of each rotor.
        torque: (k,) N·m that the model leaves to the servos.
        link, point: where `force` acts, (3,) m in the link's axes.
        force: (3,) N, world axes.
        gravity: (3,) m/s².
        duration: s.
    """

    q: Floats
    thrust: Floats
    torque: Floats
    link: str
    point: Floats
    force: Floats
    gravity: Floats
    duration: float


@dataclass(frozen=True, eq=False)
class HoldPlant:
    """The hardware of one run: a model, thrusts over those asked for, encoder offsets."""

    model: mujoco.MjModel
    factor: Floats  # (r,)
    offset: Floats  # (k,) rad


@dataclass(frozen=True, eq=False)
class Holding:
    """What a run left: rows (T, ·).

    Time [s], qpos, servo torque [N·m], rate [rad/s] and deflection [rad], thrust [N].
    """

    time: Floats
    qpos: Floats
    torque: Floats
    rate: Floats
    deflection: Floats
    thrust: Floats
    stopped: str


def rotor_thrusts(robot: Robot, forces: Floats) -> Floats:
    """Returns the thrust (r,) [N] of each rotor of apparatuses that push with forces (m, 3) [N]."""
    share = [np.linalg.norm(f) / len(a.rotors) for f, a in _pairs(robot, forces)]
    counts = [len(a.rotors) for a in robot.modules.apparatuses]
    return np.repeat(np.array(share), counts)


def _pairs(robot: Robot, forces: Floats) -> Any:
    return zip(forces, robot.modules.apparatuses, strict=True)


def servo_share(thrust: ThrustMap, forces: Floats, load: Floats) -> Floats:
    """Returns the torque (k,) [N·m] that forces (m, 3) leave to the servos."""
    return np.asarray(load - thrust.relief @ forces.ravel())


def hold_still(world: World, hold: Hold, plant: HoldPlant, progress: Any = None) -> Holding:
    """Holds a posture for `duration` s, thrust and servos on from the start.

    An interruption keeps what was held so far.
    """
    model, robot = plant.model, world.robot
    data = mujoco.MjData(model)
    model.opt.gravity[:] = hold.gravity
    world.set_state(data, hold.q)
    angles = robot.angles(hold.q)
    data.qpos[world.qpos[world.chain]] -= plant.offset
    present = world.gimbals >= 0
    given = hold.thrust * plant.factor
    stiffness = model.actuator_gainprm[world.servos, 0]
    data.ctrl[world.servos] = angles[world.chain] + hold.torque / stiffness - plant.offset
    data.ctrl[world.gimbals[present]] = angles[world.gimbal_joints[present]]
    data.ctrl[world.rotors] = given
    has = world.activation >= 0
    data.act[world.activation[has]] = given[has]
    body = model.body(hold.link).id
    steps = round(hold.duration / model.opt.timestep)
    rows: list[tuple[Floats, ...]] = []
    stopped, k = "", 0
    try:
        for k in range(steps + 1):
            if k % LOGGED == 0:
                mujoco.mj_forward(model, data)
                bent = data.ctrl - data.actuator_length
                servos = (
                    signal[world.servos].copy()
                    for signal in (data.actuator_force, data.actuator_velocity, bent)
                )
                pushed = data.actuator_force[world.rotors].copy()
                now = np.array([k * model.opt.timestep]), data.qpos.copy()
                rows.append((*now, *servos, pushed))
                if progress is not None:
                    progress(k, steps)
            _push(model, data, body, hold)
            mujoco.mj_step(model, data)
            if not np.abs(data.qvel).max() < _LOST:
                stopped = f"diverged at {k * model.opt.timestep:.3f} s"
                break
    except KeyboardInterrupt:
        stopped = f"interrupted at {k * model.opt.timestep:.2f} s"
    time, qpos, servo, rate, deflection, pushed = (
        np.array(column) for column in zip(*rows, strict=True)
    )
    return Holding(time[:, 0], qpos, servo, rate, deflection, pushed, stopped)


def _push(model: mujoco.MjModel, data: mujoco.MjData, body: int, hold: Hold) -> None:
    """Applies the force at the tip."""
    data.qfrc_applied[:] = 0.0
    if hold.force.any():
        point = data.xpos[body] + data.xmat[body].reshape(3, 3) @ hold.point
        mujoco.mj_applyFT(model, data, hold.force, np.zeros(3), point, body, data.qfrc_applied)
