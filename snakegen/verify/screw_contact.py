"""A screw drive in contact: commands u of HA eq 7 into MuJoCo, the state w back out of it."""

import math
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.errors import MissionError
from snakegen.paths import Reference
from snakegen.verify.screw_plant import DriveRun, Law

Floats = NDArray[np.float64]


def _ids(model: mujoco.MjModel, kind: mujoco.mjtObj, names: list[str]) -> NDArray[np.int64]:
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

    def __post_init__(self) -> None:
        """Looks up screws, joints and the head; raises MissionError where one is missing."""
        yaws = [f"joint{i}_yaw" for i in range(1, self.units)]
        screws = [f"screw{i}" for i in range(1, self.units + 1)]
        self.screw_servo = _ids(self.model, mujoco.mjtObj.mjOBJ_ACTUATOR, screws)
        self.yaw_servo = _ids(self.model, mujoco.mjtObj.mjOBJ_ACTUATOR, yaws)
        joints = _ids(self.model, mujoco.mjtObj.mjOBJ_JOINT, yaws)
        self.yaw_q = self.model.jnt_qposadr[joints]
        self.head = int(_ids(self.model, mujoco.mjtObj.mjOBJ_SITE, ["control_point"])[0])
        self.data = mujoco.MjData(self.model)
        self.turns = 0.0
        self.reset(np.zeros(self.units + 2))

    def reset(self, w: ArrayLike) -> None:
        """Puts the drive at rest in state w (n + 2,), the drums touching the ground z = 0."""
        w = np.asarray(w, float)
        mujoco.mj_resetData(self.model, self.data)
        c, s = math.cos(w[2]), math.sin(w[2])
        offset = self.model.site_pos[self.head]
        self.data.qpos[:2] = w[:2] - np.array([[c, -s], [s, c]]) @ offset[:2]
        self.data.qpos[3:7] = [math.cos(w[2] / 2), 0.0, 0.0, math.sin(w[2] / 2)]
        self.data.qpos[self.yaw_q] = w[3:]
        self.targets = w[3:].copy()
        self.data.ctrl[self.yaw_servo] = self.targets
        mujoco.mj_forward(self.model, self.data)
        self.heading = float(w[2])

    def state(self) -> Floats:
        """Returns w (n + 2,), ψ_p unwrapped since `reset`."""
        R = self.data.site_xmat[self.head]
        heading = math.atan2(R[3], R[0])
        self.heading += math.remainder(heading - self.heading, 2 * math.pi)
        x, y, _ = self.data.site_xpos[self.head]
        return np.concatenate([[x, y, self.heading], self.data.qpos[self.yaw_q]])

    def step(self, u: ArrayLike, steps: int = 1) -> None:
        """Holds the input u (2n - 1,) for a number of time steps."""
        u = np.asarray(u, float)
        self.data.ctrl[self.screw_servo] = u[: self.units]
        for _ in range(steps):
            self.targets = self.targets + u[self.units :] * self.model.opt.timestep
            self.data.ctrl[self.yaw_servo] = self.targets
            mujoco.mj_step(self.model, self.data)
        mujoco.mj_kinematics(self.model, self.data)


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
    """Returns the mean body twist of a drive whose shape is held and whose screws turn at `rates`.

    The screws are brought up over half of `settle` [s]; the mean is taken over `duration` [s] after.
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

    The law is asked every `period` [s] with the state as it is; slip is the velocity of each drum's
    ground point along its axle direction that eq 3 says must be 0.
    """
    drive.reset(start)
    steps = max(1, round(period / drive.model.opt.timestep))
    rows = []
    for k in range(round(duration / period) + 1):
        t, w = k * period, drive.state()
        desired, desired_rate = reference.at(t)
        u = law(w, desired, desired_rate)
        rows.append((t, w, desired, u, np.full(drive.units, np.nan)))
        drive.step(u, steps)
    return DriveRun(*(np.array(column) for column in zip(*rows, strict=True)))
