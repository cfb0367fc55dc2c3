"""A screw drive in contact: commands u of HA eq 7 into MuJoCo, the state w back out of it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.description.mjcf.rolling_contact import HEAD
from snakegen.errors import MissionError
from snakegen.screw_drive.ground_paths import Reference
from snakegen.simulation.drive.kinematic_plant import DriveRun, Law
from snakegen.simulation.drive.losses import motor_side, through_play

Floats = NDArray[np.float64]


def _ids(model: mujoco.MjModel, kind: mujoco.mjtObj, names: Sequence[str]) -> NDArray[np.int64]:
    """Returns the ids of the named elements; raises with the first name that is missing."""
    found = [mujoco.mj_name2id(model, kind, name) for name in names]
    if min(found, default=0) < 0:
        raise MissionError(f"the model has no '{names[found.index(-1)]}' ({kind.name}).")
    return np.array(found, dtype=np.int64)


@dataclass
class ContactDrive:
    """The plant: holds MjData; screws take rates, yaw joints take the integral of theirs.

    Yaw targets are positions because rate servos drift under load (THEORY B); pitch joints hold.
    """

    model: mujoco.MjModel
    units: int
    yaws: tuple[str, ...] | None = None  # names of the yaw joints; joint1_yaw … if absent
    pitches: tuple[str, ...] = ()  # names of joints that `hold` sets
    play: float = 0.0  # rad, of all these joints, from stop to stop

    def __post_init__(self) -> None:
        """Looks up screws, joints and the head; raises MissionError where one is missing."""
        yaws = [f"joint{i}_yaw" for i in range(1, self.units)] if self.yaws is None else self.yaws
        screws = [f"screw{i}" for i in range(1, self.units + 1)]
        self.screw_servo = _ids(self.model, mujoco.mjtObj.mjOBJ_ACTUATOR, screws)
        self.yaw_servo = _ids(self.model, mujoco.mjtObj.mjOBJ_ACTUATOR, yaws)
        self.pitch_servo = _ids(self.model, mujoco.mjtObj.mjOBJ_ACTUATOR, self.pitches)
        joints = _ids(self.model, mujoco.mjtObj.mjOBJ_JOINT, yaws)
        pitched = _ids(self.model, mujoco.mjtObj.mjOBJ_JOINT, self.pitches)
        gain, bias = self.model.actuator_gainprm, self.model.actuator_biasprm
        self.lead = -bias[self.yaw_servo, 2] / gain[self.yaw_servo, 0]
        self.yaw_q = self.model.jnt_qposadr[joints]
        self.pitch_q = self.model.jnt_qposadr[pitched]
        self.held = np.zeros(self.pitch_q.size)
        self.head = int(_ids(self.model, mujoco.mjtObj.mjOBJ_SITE, [HEAD])[0])
        self.data = mujoco.MjData(self.model)
        self.unit_of = self._units()
        self.rolling = self._rolling()
        self.reset(np.zeros(self.yaw_q.size + 3))

    def _units(self) -> NDArray[np.int64]:
        """Returns for each body the index of the drum it belongs to, -1 for all others."""
        unit = np.full(self.model.nbody, -1)
        for i in range(self.units):
            drum = _ids(self.model, mujoco.mjtObj.mjOBJ_BODY, [f"screw{i + 1}"])[0]
            unit[drum] = i
            unit[self.model.body_parentid == drum] = i
        return unit

    def _rolling(self) -> NDArray[np.bool_]:
        """Returns the degrees of freedom that roll: of wheels, or of balls in place of drums."""
        model = self.model
        free = np.isin(model.jnt_type, [mujoco.mjtJoint.mjJNT_BALL, mujoco.mjtJoint.mjJNT_HINGE])
        drums = _ids(model, mujoco.mjtObj.mjOBJ_BODY, [f"screw{i + 1}" for i in range(self.units)])
        wheel = np.isin(model.body_parentid, drums) & (self.unit_of >= 0)
        ball = model.jnt_type == mujoco.mjtJoint.mjJNT_BALL
        rolls = free & (wheel[model.jnt_bodyid] | ball)
        return np.asarray(rolls[model.dof_jntid])

    def press_wheels(self, arm: float, wheel_radius: float) -> None:
        """Sets the dry friction of wheels [N·m]: `arm` [m] times the load that each carries now.

        A ball in place of a drum rubs as much more as its radius is larger.
        """
        model, force = self.model, np.zeros(6)
        model.dof_frictionloss[self.rolling] = 0.0
        for index in range(self.data.ncon):
            contact = self.data.contact[index]
            if contact.efc_address < 0:
                continue
            geoms = contact.geom
            touching = int(np.argmax(self.unit_of[model.geom_bodyid[geoms]]))
            body = model.geom_bodyid[geoms[touching]]
            if self.unit_of[body] < 0:
                continue
            mujoco.mj_contactForce(model, self.data, index, force)
            first, count = model.body_dofadr[body], model.body_dofnum[body]
            rubs = arm * max(force[0], 0.0) * model.geom_size[geoms[touching], 0] / wheel_radius
            model.dof_frictionloss[first : first + count] += rubs

    def reset(self, w: ArrayLike) -> None:
        """Puts the drive at rest in state w (m + 2,), the drums touching the ground z = 0."""
        w = np.asarray(w, float)
        mujoco.mj_resetData(self.model, self.data)
        c, s = math.cos(w[2]), math.sin(w[2])
        offset = self.model.site_pos[self.head]
        self.data.qpos[:2] = w[:2] - np.array([[c, -s], [s, c]]) @ offset[:2]
        self.data.qpos[3:7] = [math.cos(w[2] / 2), 0.0, 0.0, math.sin(w[2] / 2)]
        self.data.qpos[self.yaw_q] = w[3:]
        self.targets, self.beside = w[3:].copy(), np.zeros(len(w) - 3)
        self.data.ctrl[self.yaw_servo] = self.targets
        self.held[:] = 0.0
        mujoco.mj_forward(self.model, self.data)
        self.heading = float(w[2])

    def state(self) -> Floats:
        """Returns w (m + 2,), ψ_p unwrapped since `reset`."""
        R = self.data.site_xmat[self.head]
        heading = math.atan2(R[3], R[0])
        self.heading += math.remainder(heading - self.heading, 2 * math.pi)
        x, y, _ = self.data.site_xpos[self.head]
        return np.concatenate([[x, y, self.heading], self.data.qpos[self.yaw_q] - self.beside])

    def read(self) -> Floats:
        """Returns w (m + 2,) as encoders on the motors' side of the play read its joints."""
        w, angle = self.state(), self.data.qpos[self.yaw_q]
        w[3:] = motor_side(self.targets + self.beside, angle, self.play) - self.beside
        return w

    def hold(self, pitches: ArrayLike, beside: ArrayLike = 0.0) -> None:
        """Sets the targets of the joints `pitches` [rad]; they hold at 0 otherwise.

        Where links are pitched, headings differ by other angles than the yaw joints': these turn
        `beside` [rad] what the law asks for, and `state` leaves that out.
        """
        self.held[:] = pitches
        self.beside[:] = beside

    def soften(self, factor: float) -> None:
        """Makes the servos of the joints `pitches` softer by `factor`; their damping stays."""
        self.model.actuator_gainprm[self.pitch_servo, 0] /= factor
        self.model.actuator_biasprm[self.pitch_servo, 1] /= factor

    def release(self) -> None:
        """Takes all pulls away."""
        self.data.qfrc_applied[:] = 0.0

    def place(self, link: str, point: ArrayLike) -> Floats:
        """Returns a point (3,) of a link in the world [m]."""
        body = self.model.body(link).id
        turn = self.data.xmat[body].reshape(3, 3)
        return np.asarray(self.data.xpos[body] + turn @ np.asarray(point, float))

    def pull(self, force: ArrayLike, link: str, point: ArrayLike) -> None:
        """Adds a force (3,) [N], world axes, at a point of a link."""
        if link and np.any(force):
            body, where = self.model.body(link).id, self.place(link, point)
            pull, nothing = np.asarray(force, float), np.zeros(3)
            mujoco.mj_applyFT(
                self.model, self.data, pull, nothing, where, body, self.data.qfrc_applied
            )

    def step(self, u: ArrayLike, steps: int = 1) -> None:
        """Holds the input u (n + m - 1,) for a number of time steps."""
        u = np.asarray(u, float)
        self.data.ctrl[self.screw_servo] = u[: self.units]
        # A servo damped against rest trails its target by damping/stiffness · rate.
        ahead = self.lead * u[self.units :]
        for _ in range(steps):
            self.targets = self.targets + u[self.units :] * self.model.opt.timestep
            qpos, aim = self.data.qpos, self.targets + self.beside
            self.data.ctrl[self.yaw_servo] = through_play(aim, qpos[self.yaw_q], self.play) + ahead
            self.data.ctrl[self.pitch_servo] = through_play(
                self.held, qpos[self.pitch_q], self.play
            )
            mujoco.mj_step(self.model, self.data)
        mujoco.mj_kinematics(self.model, self.data)


@dataclass(frozen=True)
class UnitContacts:
    """How each drum stands on the ground at one instant; n units, 0 where one is in the air."""

    normal: Floats  # (n,) N
    cone_use: Floats  # (n,) largest tangential force over friction · normal force, 1: it slides
    slip: Floats  # (n,) m/s, load-weighted mean speed of the touching material over the ground
    point: Floats  # (n, 3) m, load-weighted mean of the contacts, world; nan in the air
    force: Floats  # (n, 3) N, of the ground on the drum, world


def unit_contacts(drive: ContactDrive) -> UnitContacts:
    """Returns the forces, friction use and slip of each drum, as of the last step's start."""
    model, data = drive.model, drive.data
    normal, use, slip = (np.zeros(drive.units) for _ in range(3))
    point, total = np.zeros((drive.units, 3)), np.zeros((drive.units, 3))
    force = np.zeros(6)
    for index in range(data.ncon):
        contact = data.contact[index]
        body = max(model.geom_bodyid[contact.geom[0]], model.geom_bodyid[contact.geom[1]])
        unit = drive.unit_of[body]
        if unit < 0 or contact.efc_address < 0:
            continue
        mujoco.mj_contactForce(model, data, index, force)
        if force[0] <= 0.0:
            continue
        spin, velocity = data.cvel[body, :3], data.cvel[body, 3:]
        arm = contact.pos - data.subtree_com[model.body_rootid[body]]
        frame = contact.frame.reshape(3, 3)
        # a contact's frame points from its first geom to its second, which receives the force
        on_second = model.geom_bodyid[contact.geom[1]] == body
        total[unit] += (1.0 if on_second else -1.0) * (force[:3] @ frame)
        point[unit] += force[0] * contact.pos
        across = frame[1:] @ (velocity + np.cross(spin, arm))
        normal[unit] += force[0]
        slip[unit] += force[0] * math.hypot(*across)
        shared = math.hypot(force[1], force[2]) / (contact.friction[0] * force[0])
        use[unit] = max(use[unit], shared)
    with np.errstate(invalid="ignore"):
        point = point / np.where(normal > 0, normal, np.nan)[:, None]
    return UnitContacts(
        normal, use, np.divide(slip, normal, out=slip, where=normal > 0), point, total
    )


def mean_twist(before: Floats, after: Floats, duration: float) -> Floats:
    """Returns the constant body twist [vx, vy, ω] that leads from w `before` to w `after`.

    The SE(2) logarithm in P's axes; the heading must be unwrapped.
    """
    turn = after[2] - before[2]
    c, s = math.cos(before[2]), math.sin(before[2])
    move = np.array([[c, s], [-s, c]]) @ (after[:2] - before[:2])
    half = turn / 2
    cot = half / math.tan(half) if abs(half) > 1e-9 else 1.0
    return np.append(np.array([[cot, half], [-half, cot]]) @ move, turn) / duration


def measured_twist(
    drive: ContactDrive, shape: ArrayLike, rates: ArrayLike, settle: float, duration: float
) -> Floats:
    """Returns the mean body twist of a drive of held shape whose screws turn at `rates`.

    The screws are brought up over half of `settle` [s]; the mean is taken over the `duration` [s]
    that follows.
    """
    shape, rates = np.asarray(shape, float), np.asarray(rates, float)
    drive.reset(np.concatenate([np.zeros(3), shape]))
    dt = drive.model.opt.timestep
    hold = np.zeros(shape.size)
    for k in range(round(settle / dt)):
        drive.step(np.append(rates * min(1.0, 2 * k * dt / settle), hold))
    before = drive.state()
    for _ in range(round(duration / dt) // 50):
        drive.step(np.append(rates, hold), 50)
        drive.state()
    return mean_twist(before, drive.state(), (round(duration / dt) // 50) * 50 * dt)


def drive_contact(
    law: Law,
    reference: Reference,
    drive: ContactDrive,
    start: ArrayLike,
    duration: float,
    period: float = 0.01,
) -> DriveRun:
    """Drives the contact plant along `reference` from rest in w(0) = `start`.

    The law is asked every `period` [s] with the state as it is; slip is that of `unit_contacts`.
    """
    drive.reset(start)
    steps = max(1, round(period / drive.model.opt.timestep))
    rows = []
    for k in range(round(duration / period) + 1):
        t, w = k * period, drive.state()
        desired, desired_rate = reference.at(t)
        u = law(w, desired, desired_rate)
        rows.append((t, w, desired, u, unit_contacts(drive).slip))
        drive.step(u, steps)
    return DriveRun(*(np.array(column) for column in zip(*rows, strict=True)))
