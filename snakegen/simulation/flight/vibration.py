"""What bends in a run and how it is damped: hinges, their sensors, modes and their energy.

Hinges are the joints between links, by the compliance of their servos, and the springs of elastic
links. A real robot is assumed to have encoders in the joints and a rate gyro on every half link,
whose difference is the rate at which the link bends (with √2 of one gyro's noise).
"""

from dataclasses import dataclass
from math import sqrt
from typing import Any

import mujoco
import numpy as np

from snakegen.base.geometry import Floats
from snakegen.control.controller import Controller
from snakegen.errors import MissionError
from snakegen.kernels.control.types import VIRTUAL
from snakegen.kernels.flight.types import Damper
from snakegen.simulation.flight.elastic import bend_axes, elastic_modes, stiffnesses
from snakegen.simulation.flight.world import Ints, World


@dataclass(frozen=True)
class Damping:
    """How vibration is damped: gain [N s/m] of the internal forces, highest mode [Hz]."""

    gain: float = 0.0
    bandwidth: float = 5.0

    @staticmethod
    def of(control: dict[str, Any]) -> "Damping":
        """Returns that of a `<control>` element; off where it says nothing."""
        names = {"gain": "vibration_damping", "bandwidth": "vibration_bandwidth"}
        return Damping(**{k: float(control[n]) for k, n in names.items() if n in control})


OFF = Damping()


@dataclass(frozen=True, eq=False)
class Hinges:
    """Compliant hinges, from root to tip within each kind.

    Attributes:
        names: (e,) of the simulator's joints.
        body, anchor, axis: (e,), (e, 3) m, (e, 3): where each stands in the believed, rigid robot.
        dof, qpos: (e,) addresses of its rate and angle in the simulator.
        servo: (e,) its servo among those that shape the body, -1 for a spring.
    """

    names: tuple[str, ...]
    body: Ints
    anchor: Floats
    axis: Floats
    dof: Ints
    qpos: Ints
    servo: Ints

    @property
    def noise(self) -> list[float]:
        """What share of a gyro's noise is in each hinge's rate."""
        return [0.0 if s >= 0 else sqrt(2.0) for s in self.servo]


def hinges(world: World) -> Hinges:
    """Returns the hinges of a world: its driven joints, and its links' springs if they bend."""
    robot, model = world.robot, world.model
    rows: list[tuple[str, int, Floats, Floats, int]] = []
    for i, joint in enumerate(world.chain):
        axis = robot.tree.axis[joint + 1]
        rows.append((robot.joint_names[joint], int(joint) + 1, np.zeros(3), axis, i))
    for link, length in robot.modules.lengths.items():
        body, turn, origin = robot.body_of_link(link)
        for name, axis in bend_axes(link).items():
            if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) >= 0:
                middle = origin + turn @ [0.5 * length, 0.0, 0.0]
                rows.append((name, body, middle, turn @ axis, -1))
    joints = [model.joint(name).id for name, *_ in rows]
    return Hinges(
        tuple(name for name, *_ in rows),
        np.array([body for _, body, *_ in rows], np.int64),
        np.array([anchor for _, _, anchor, *_ in rows]).reshape(-1, 3),
        np.array([axis for *_, axis, _ in rows]).reshape(-1, 3),
        np.array(model.jnt_dofadr[joints], np.int64),
        np.array(model.jnt_qposadr[joints], np.int64),
        np.array([servo for *_, servo in rows], np.int64),
    )


def bends(world: World) -> bool:
    """Tells whether the links of a world bend."""
    return any(s < 0 for s in hinges(world).servo)


def damper(
    world: World, controller: Controller, damping: Damping, qpos: Floats, delay: float = 0.0
) -> tuple[Damper, int]:
    """Returns what the loop damps, and how many modes; nothing where it is off.

    `delay` [s] from sensing to command is made up for, with the actuators' lag.
    """
    if damping.gain == 0.0:
        none, rows = np.empty(0, np.int64), np.empty((0, 3))
        nothing = np.empty((0, controller.apparatuses), np.int64)
        empty = np.empty((0, 0))
        calm = (empty, empty, np.empty(0), np.empty((2, 0)), 0.0)
        return Damper(0.0, none, rows, rows, nothing, none, none, *calm), 0
    found, model = hinges(world), world.model
    pairs = [a.rotors for a in world.robot.modules.apparatuses]
    carriers = [int(model.site(rotors[0].label).bodyid[0]) for rotors in pairs]
    beyond = np.zeros((len(found.names), controller.apparatuses), np.int64)
    for e, dof in enumerate(found.dof):
        for j, carrier in enumerate(carriers):
            beyond[e, j] = _stands_on(model, carrier, int(model.dof_bodyid[dof]))
    modes = count_modes(world, damping, qpos)
    maps = modal_maps(world, qpos, modes)
    places = (found.body, found.anchor, found.axis, beyond)
    still, lead = np.zeros((2, modes)), delay + actuator_lag(world, controller)
    return Damper(damping.gain, *places, found.dof, found.servo, *maps, still, lead), modes


def actuator_lag(world: World, controller: Controller) -> float:
    """Returns the lag [s] of what damps: gimbal servos (damping over stiffness), or motors."""
    robot = world.robot
    motors = [r.lag for a in robot.modules.apparatuses for r in a.rotors]
    gimbals = [s for s in robot.modules.servos if s.joint in robot.gimbal_names]
    turning = [s.damping / s.stiffness for s in gimbals if s.stiffness > 0.0]
    return max(turning if controller.mode == VIRTUAL and turning else motors, default=0.0)


def count_modes(world: World, damping: Damping, qpos: Floats) -> int:
    """Returns how many elastic modes are slow enough to be damped.

    Raises:
        MissionError: none is.
    """
    frequency, _ = elastic_modes(world.model, qpos, hinges(world).dof)
    count = int(np.sum(frequency <= damping.bandwidth))
    if count == 0:
        raise MissionError(
            f"{world.robot.name} has nothing to damp: its lowest elastic mode is at "
            f"{frequency.min(initial=np.inf):.1f} Hz, above control.vibration_bandwidth "
            f"{damping.bandwidth:g} Hz; set control.vibration_damping=0."
        )
    return count


def modal_maps(world: World, qpos: Floats, modes: int) -> tuple[Floats, Floats, Floats]:
    """Returns shapes (e, k) and pulls (k, e) of the lowest k modes at `qpos`, and ω (k,) [rad/s].

    ``η̇ = Σ_i φ_i ȧ_i``, ``ȧ_i = φ_iᵀ K η̇ / ω_i²``, of hinges on a free body. Faster modes are left
    out: there the lag of motors and the inertia of the gimbals turn damping into the opposite. The
    controller is assumed to know its modes.
    """
    dofs = hinges(world).dof
    frequency, shape = elastic_modes(world.model, qpos, dofs)
    low, tuned = np.ascontiguousarray(shape[:, :modes]), 2.0 * np.pi * frequency[:modes]
    pull = stiffnesses(world.model)[dofs, None] * low / tuned**2
    return low, np.ascontiguousarray(pull.T), tuned


def retuned(damper: Damper, world: World, qpos: Floats) -> Damper:
    """Returns the damper for the modes at `qpos`; what swings goes on in the new shapes."""
    shape, pull, tuned = modal_maps(world, qpos, len(damper.tuned))
    swing = np.ascontiguousarray(damper.swing @ (pull @ damper.shape).T)
    return damper._replace(shape=shape, pull=pull, tuned=tuned, swing=swing)


def check_redundancy(controller: Controller, name: str) -> None:
    """Refuses vibration damping where the mode has no internal forces.

    Raises:
        MissionError: as many thrusts and gimbals as rows of the wrench, or fewer.
    """
    if controller.mode == VIRTUAL:
        gimbals = controller.gimbals
        turns = np.sum(gimbals.roll_body >= 0) + np.sum(gimbals.pitch_body >= 0)
        columns, rows, kind = controller.apparatuses + int(turns), 6, "force components"
    else:
        columns, rows, kind = len(controller.rotors.body), 4, "rotors"
    if columns <= rows:
        mode = "virtual-single-rotor" if controller.mode == VIRTUAL else "dual-rotor"
        raise MissionError(
            f"control.vibration_damping needs redundant thrust: {name} has {columns} {kind} for "
            f"the {rows} rows of its wrench in {mode} mode; more apparatuses, or a damping of 0."
        )


def _stands_on(model: mujoco.MjModel, body: int, base: int) -> bool:
    """Tells whether `body` is `base` or hangs on it."""
    while body > 0 and body != base:
        body = int(model.body_parentid[body])
    return body == base
