"""Drives run in the kinematic plant or in contact, and what is remembered of each tick."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np

from snakegen.base.geometry import Floats, xyzw_from_wxyz
from snakegen.base.sample_store import RowStore, in_pieces
from snakegen.description.mjcf.decorate import decorate
from snakegen.description.mjcf.rolling_contact import meet_rollers
from snakegen.errors import MissionError
from snakegen.robot.robot import Robot
from snakegen.screw_drive.geometry import drive_geometry, yaw_joints
from snakegen.screw_drive.kinematics import ScrewGeometry
from snakegen.screw_drive.tracking import ScrewLaw
from snakegen.simulation.drive.contact_plant import ContactDrive, unit_contacts
from snakegen.simulation.drive.hardware import DriveHardware
from snakegen.simulation.drive.kinematic_plant import drive_kinematic
from snakegen.simulation.drive.load import AWAY, ROLLED
from snakegen.simulation.drive.losses import CableDrag
from snakegen.simulation.drive.plan import DrivePlan, rates
from snakegen.simulation.flight.plan import Box
from snakegen.simulation.run_settings import NOMINAL, RunSettings

PERIOD = 0.01  # s, of the law in contact
STEP = 0.005  # s, of the kinematic plant
_LOST = 50.0  # m/s or rad/s: a body this fast has diverged

Progress = Callable[[int, int], Any] | None


@dataclass(eq=False)
class Driven:
    """What a drive left behind, a row a tick, taken before the tick's command acts.

    Attributes:
        robot, geometry: what drove.
        rows: by name, (T, ·): time, state, desired, command, base (xyz and quaternion xyzw),
            joints (all of the robot's, its order), rate (screws), slip, and in contact torque,
            joint_rate, asked and deflection (servos), screw_torque, load, cone_use, contact_point
            and contact_force.
        stopped: "" or why the run ended early.
        events: (time, level, text).
    """

    robot: Robot
    geometry: ScrewGeometry
    rows: dict[str, Floats] = field(default_factory=dict)
    stopped: str = ""
    events: list[tuple[float, str, str]] = field(default_factory=list)


def law_of(robot: Robot, geometry: ScrewGeometry, plan: DrivePlan) -> ScrewLaw:
    """Returns HA eq 7 with the plan's gain and the robot's motor limits."""
    screw, joint = rates(robot)
    return ScrewLaw(geometry, plan.gain, feedback=plan.feedback, screw_rate=screw, joint_rate=joint)


def run_kinematic(robot: Robot, plan: DrivePlan, progress: Progress = None) -> Driven:
    """Runs a plan with wheels that cannot slip, the law asked at every stage, sensors perfect.

    Raises:
        MissionError: ground that is not flat: this plant knows nothing of it.
    """
    if plan.obstacles or plan.lift is not None or plan.load is not None:
        raise MissionError("the kinematic plant knows flat ground alone; use plant=contact.")
    geometry = drive_geometry(robot)
    law = law_of(robot, geometry, plan)
    run = drive_kinematic(law.command, plan.reference, geometry, plan.start, plan.duration, STEP)
    out = Driven(robot, geometry)
    n, count = geometry.units, len(run.time)
    yaws, screws = yaw_joints(robot), [s.joint for s in robot.modules.screws]
    turned = np.zeros(n)  # of the drums, up to the rows made

    def poses(part: slice) -> tuple[Floats, Floats]:
        state = run.state[part]
        base, joints = np.zeros((len(state), 7)), np.zeros((len(state), len(robot.joint_names)))
        base[:, :2], base[:, 2] = state[:, :2], geometry.r
        base[:, 5], base[:, 6] = np.sin(state[:, 2] / 2), np.cos(state[:, 2] / 2)
        joints[:, _indices(robot, yaws)] = state[:, 3:]
        spun = turned + np.cumsum(run.command[part, :n], axis=0) * STEP
        joints[:, _indices(robot, screws)] = spun
        turned[:] = spun[-1]
        return base, joints

    base, joints = in_pieces(count, poses)
    out.rows = {
        "time": run.time,
        "state": run.state,
        "desired": run.desired,
        "command": run.command,
        "rate": run.command[:, :n],
        "slip": run.slip,
        "base": base,
        "joints": joints,
    }
    if progress is not None:
        progress(count, count)
    return out


def contact_model(
    robot: Robot, obstacles: Sequence[Box] = (), rollers: str | None = None
) -> mujoco.MjModel:
    """Returns the robot on the ground among `obstacles`, with wheels that roll."""
    spec = decorate(
        robot.urdf,
        robot.modules,
        {},
        visuals=False,
        rollers=rollers,
        folder=robot.folder,
    )
    plane, box = mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_BOX
    spec.worldbody.add_geom(name="floor", type=plane, size=[0.0, 0.0, 0.05])
    for one in obstacles:
        turn = [math.cos(one.roll / 2), math.sin(one.roll / 2), 0.0, 0.0]
        spec.worldbody.add_geom(name=one.name, type=box, pos=one.centre, size=one.half, quat=turn)
    meet_rollers(spec)
    return spec.compile()


def run_contact(
    robot: Robot,
    plan: DrivePlan,
    settings: RunSettings = NOMINAL,
    *,
    rollers: str | None = None,
) -> Driven:
    """Runs a plan in MuJoCo, the law asked every 10 ms with what the sensors say.

    An interruption keeps what was driven so far.
    """
    geometry, yaws = drive_geometry(robot), yaw_joints(robot)
    law = law_of(robot, geometry, plan)
    hardware = DriveHardware(robot, settings, len(plan.start))
    model = contact_model(hardware.robot, plan.obstacles, rollers)
    drive = ContactDrive(model, geometry.units, yaws, pitch_joints(robot))
    drive.play = hardware.losses.play
    drive.soften(plan.compliance)
    hardware.change(model)
    cable, tail = CableDrag(hardware.losses), tail_of(robot)
    drive.reset(plan.start)
    ticks = round(plan.duration / PERIOD) + 1
    out, record, rows = Driven(robot, geometry), _Recorder(robot, drive), RowStore(ticks)
    steps = max(1, round(PERIOD / model.opt.timestep))
    out.events = [(t, "INFO", text) for t, text in plan.events]
    t, drift = 0.0, np.zeros(len(plan.start))
    try:
        for k in range(ticks):
            t = k * PERIOD
            if plan.lift is not None:
                drive.hold(*plan.lift(t))
            drive.release()
            if plan.load is not None:
                gravity, pull = plan.load.at(t)
                drive.model.opt.gravity[:] = gravity
                drive.pull(pull, plan.load.link, plan.load.point)
            drive.pull(cable.force(drive.place(*tail), PERIOD), *tail)
            if hardware.losses.arm > 0.0 and k > 0:
                drive.press_wheels(hardware.losses.arm, robot.modules.screws[0].wheel_radius)
            w = drive.state()
            desired, rate = plan.reference.at(t)
            seen = hardware.measured(drive.read(), PERIOD)
            drift[:3] += plan.integral * PERIOD * (seen - desired)[:3]
            u = law.command(seen, desired - drift, rate)
            record.add(rows, t, w, desired, u)
            drive.step(hardware.given(u), steps)
            # the body's speed: a wheel of a few grams may well spin fast
            if not float(np.abs(drive.data.qvel[:6]).max()) < _LOST:
                out.stopped = f"diverged at {t:.2f} s"
                out.events.append((t, "ERROR", out.stopped))
                break
            if plan.load is not None and _let_go(drive, w, desired):
                out.events.append((t, "INFO", "it has let go"))
                break
            if settings.progress is not None and k % 20 == 0:
                settings.progress(k, ticks)
    except KeyboardInterrupt:
        out.stopped = f"interrupted at {t:.2f} s"
        out.events.append((t, "WARN", out.stopped))
    out.rows = rows.arrays()
    return out


def _let_go(drive: ContactDrive, w: Floats, desired: Floats) -> bool:
    """Tells whether a drive that holds its place has left it, or has rolled over."""
    upright = float(drive.data.site_xmat[drive.head][8])
    return bool(np.hypot(*(w - desired)[:2]) > AWAY or upright < math.cos(ROLLED))


def tail_of(robot: Robot) -> tuple[str, tuple[float, float, float]]:
    """Returns the last link and its end (3,) [m] in its axes: where a cable leaves the body."""
    lengths = robot.modules.lengths
    name = list(lengths)[-1] if lengths else robot.root_link
    return name, (lengths.get(name, 0.0), 0.0, 0.0)


def pitch_joints(robot: Robot) -> tuple[str, ...]:
    """Returns the joints that shape the body out of the plane and have a servo."""
    yaws, driven = yaw_joints(robot), {s.joint for s in robot.modules.servos}
    return tuple(n for n in robot.chain_joints if n in driven and n not in yaws)


def _indices(robot: Robot, names: Sequence[str]) -> list[int]:
    return [robot.joint_names.index(n) for n in names]


class _Recorder:
    """Reads a tick off the simulation; knows where each of the robot's joints stands in it."""

    def __init__(self, robot: Robot, drive: ContactDrive) -> None:
        self.drive, model = drive, drive.model
        hinge = int(mujoco.mjtJoint.mjJNT_HINGE)
        found = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, n) for n in robot.joint_names]
        # a ball in place of a drum has no angle, nor have the wheels that it replaces
        self.here = [i for i, j in enumerate(found) if j >= 0 and model.jnt_type[j] == hinge]
        self.address = model.jnt_qposadr[[found[i] for i in self.here]]
        self.count = len(robot.joint_names)
        names = [n for n in robot.chain_joints if n in {s.joint for s in robot.modules.servos}]
        self.servos = [model.actuator(n).id for n in names]

    def add(self, out: RowStore, t: float, w: Floats, desired: Floats, u: Floats) -> None:
        """Appends the tick at time t."""
        drive, data = self.drive, self.drive.data
        joints = np.zeros(self.count)
        joints[self.here] = data.qpos[self.address]
        found = unit_contacts(drive)
        out.add(
            time=t,
            state=w,
            desired=desired,
            command=u,
            base=np.concatenate([data.qpos[:3], xyzw_from_wxyz(data.qpos[3:7])]),
            joints=joints,
            rate=data.actuator_velocity[drive.screw_servo],
            slip=found.slip,
            torque=data.actuator_force[self.servos],
            joint_rate=data.actuator_velocity[self.servos],
            asked=data.ctrl[self.servos],
            deflection=data.ctrl[self.servos] - data.actuator_length[self.servos],
            screw_torque=data.actuator_force[drive.screw_servo],
            load=found.normal,
            cone_use=found.cone_use,
            contact_point=found.point.ravel(),
            contact_force=found.force.ravel(),
        )
