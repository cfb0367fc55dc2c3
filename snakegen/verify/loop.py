"""The one stepping loop: sense, decide, step MuJoCo, remember."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from snakegen.control.controller import Controller
from snakegen.geometry import Floats
from snakegen.kernels.control_types import REFUSED, Measured, Target
from snakegen.verify.plan import Plan
from snakegen.verify.plant import Draw, Imperfections
from snakegen.verify.world import World

_LOST = 50.0  # m/s or rad/s: a run this fast has diverged


@dataclass(frozen=True, eq=False)
class Flown:
    """What a run left behind, a row a tick, taken before the tick's command acts.

    Attributes:
        ticks: how many were flown.
        qpos, qvel, act, force: rows of MuJoCo's state and actuator forces.
        command: (T, nu) controls asked for.
        sigma_min, wanted, given: from the controller.
        contact: (T,) N, normal force of the floor.
        events: (time, level, text).
        stopped: "" or why the run ended early.
        frame: (3, 3) attitude of the CoG frame at the start.
        step_time: s of wall time the whole loop took.
    """

    ticks: int
    qpos: Floats
    qvel: Floats
    act: Floats
    force: Floats
    command: Floats
    sigma_min: Floats
    wanted: Floats
    given: Floats
    contact: Floats
    events: list[tuple[float, str, str]]
    stopped: str
    frame: Floats


def fly(
    world: World,
    plan: Plan,
    controller: Controller,
    noise: Draw,
    imperfections: Imperfections,
    *,
    position_rate: float = 40.0,
    progress: Callable[[int], Any] | None = None,
) -> Flown:
    """Runs `plan` in MuJoCo; an interruption keeps what was flown so far.

    Sensors are read once a tick; the position loop sees motion capture at `position_rate`, and
    what the controller knows is `imperfections.delay` old. Gimbal commands are held to the
    servos' speed.

    Args:
        world: where.
        plan: references.
        controller: the law.
        noise: drawn for this run.
        imperfections: for the delay.
        position_rate: Hz.
        progress: called with the tick, about 20 times a second of flight.
    """
    model, data = world.model, mujoco.MjData(world.model)
    ticks = len(plan.time)
    dt = float(plan.time[1] - plan.time[0]) if ticks > 1 else 0.005
    substeps = max(1, round(dt / model.opt.timestep))
    hold = max(1, round(1.0 / (position_rate * dt)))
    run = _Run(world, plan, controller, data)
    events: list[tuple[float, str, str]] = [(t, "INFO", text) for t, text in plan.events]
    waiting: deque[Measured] = deque(maxlen=1 + round(imperfections.delay / dt))
    stopped, flown, refused = "", ticks, False
    try:
        for k in range(ticks):
            run.remember(k)
            waiting.append(run.sense(k, noise, fresh=k % hold == 0))
            status = run.decide(k, waiting[0], dt, hold * dt if k % hold == 0 else 0.0)
            if status == REFUSED and not refused:
                events.append((float(plan.time[k]), "WARN", "σ_min below the threshold"))
            refused = status == REFUSED
            run.fail(float(plan.time[k]))
            run.act(k, noise.thrust_factor, dt)
            mujoco.mj_step(model, data, substeps)
            speed = float(np.abs(data.qvel).max())
            if not speed < _LOST:
                stopped = f"diverged at {plan.time[k]:.2f} s: {run.fastest()}"
                events.append((float(plan.time[k]), "ERROR", stopped))
                flown = k + 1
                break
            if run.astray(k) > plan.give_up:
                stopped = f"gave up at {plan.time[k]:.2f} s: {plan.give_up:g} m off target"
                events.append((float(plan.time[k]), "WARN", stopped))
                flown = k + 1
                break
            if progress is not None and k % 10 == 0:
                progress(k)
    except KeyboardInterrupt:
        flown, stopped = max(k, 1), f"interrupted at {plan.time[k]:.2f} s"
        events.append((float(plan.time[k]), "WARN", stopped))
    return run.result(flown, events, stopped)


class _Run:
    """Buffers and addresses of one run; all state of the loop lives here."""

    def __init__(
        self, world: World, plan: Plan, controller: Controller, data: mujoco.MjData
    ) -> None:
        model, ticks = world.model, len(plan.time)
        self.world, self.plan, self.controller, self.data = world, plan, controller, data
        world.set_state(data, plan.start)
        self.rows = {
            name: np.zeros((ticks, size))
            for name, size in (
                ("qpos", model.nq),
                ("qvel", model.nv),
                ("act", model.na),
                ("force", model.nu),
                ("command", model.nu),
                ("wanted", 6),
                ("given", 6),
            )
        }
        self.sigma, self.contact = np.full(ticks, np.nan), np.zeros(ticks)
        self.alive, self.told = np.ones(len(world.rotors)), 0
        link = plan.disturbance_link or world.robot.root_link
        self.pushed = int(model.body(link).id)
        self.floor = model.geom("floor").id if _has_floor(model) else -1
        angles = data.qpos[world.qpos]
        self.gimbal = np.where(world.gimbal_joints >= 0, angles[world.gimbal_joints], 0.0)
        self.state = controller.start(self.gimbal)
        self.speed = _gimbal_speed(world)
        data.ctrl[world.servos] = plan.joints[0]
        self._write_gimbals(self.gimbal)
        mujoco.mj_forward(model, data)
        self.frame = self._frame()
        if not plan.on_floor:
            self._start_rotors()
        self.seen = (np.array(data.qpos[:3]), np.array(data.qvel[:3]))

    def _frame(self) -> Floats:
        """Returns the attitude of the CoG frame now."""
        from snakegen.kernels.chain import forward

        law, world = self.controller.law, self.world
        base = self.data.xmat[self._root].reshape(3, 3)
        angles = np.array(self.data.qpos[world.qpos])
        rotation, _ = forward(world.robot.tree, base, np.array(self.data.qpos[:3]), angles)
        return np.asarray(rotation[law.axes_body] @ law.axes_rotation)

    @property
    def _root(self) -> int:
        return int(self.world.model.body(self.world.robot.root_link).id)

    def _start_rotors(self) -> None:
        """Sets the motors to the thrust that the first tick asks for: a run starts in hover."""
        measured = self._true()
        _, command = self.controller.tick(measured, self._target(0), self.state, 1e-9)
        has = self.world.activation >= 0
        self.data.act[self.world.activation[has]] = command.thrust[has]
        self.data.ctrl[self.world.rotors] = command.thrust

    def _true(self) -> Measured:
        data, world = self.data, self.world
        rotation = data.xmat[self._root].reshape(3, 3).copy()
        return Measured(
            rotation,
            np.array(data.qpos[:3]),
            np.array(data.qvel[:3]),
            rotation @ data.qvel[3:6],
            np.array(data.qpos[world.qpos]),
            np.array(data.qvel[world.qvel]),
        )

    def remember(self, k: int) -> None:
        """Stores the state before tick k."""
        data, rows = self.data, self.rows
        rows["qpos"][k], rows["qvel"][k] = data.qpos, data.qvel
        rows["act"][k], rows["force"][k] = data.act, data.actuator_force
        if data.ncon and self.floor >= 0:
            self.contact[k] = _floor_force(self.world.model, data, self.floor)

    def sense(self, k: int, noise: Draw, *, fresh: bool) -> Measured:
        """Returns what the sensors say; motion capture is held between its samples."""
        data, world = self.data, self.world
        true = rotation_of(data.qpos[3:7])
        if fresh:
            self.seen = (data.qpos[:3] + noise.position[k], data.qvel[:3] + noise.velocity[k])
        rotation = true @ noise.attitude[k]
        return Measured(
            rotation,
            self.seen[0],
            self.seen[1],
            rotation @ (data.qvel[3:6] + noise.gyro[k]),
            data.qpos[world.qpos] + noise.angles[k],
            data.qvel[world.qvel],
        )

    def _target(self, k: int) -> Target:
        plan = self.plan
        return Target(
            plan.position[k],
            plan.velocity[k],
            plan.acceleration[k],
            self.frame @ plan.rotation[k],
            plan.angular[k],
        )

    def decide(self, k: int, measured: Measured, dt: float, force_dt: float) -> int:
        """Runs the controller; returns its status."""
        mode = None if self.plan.mode is None else int(self.plan.mode[k])
        self.state, command = self.controller.tick(
            measured, self._target(k), self.state, dt, mode=mode, force_dt=force_dt
        )
        self.sigma[k] = command.sigma_min
        self.rows["wanted"][k], self.rows["given"][k] = command.wanted, command.given
        self.command = command
        return int(command.status)

    def act(self, k: int, factor: Floats, dt: float) -> None:
        """Writes the controls of tick k: thrusts, gimbals within their speed, joints."""
        data, world = self.data, self.world
        step = self.speed * dt
        self.gimbal = self.gimbal + np.clip(self.command.gimbals - self.gimbal, -step, step)
        data.ctrl[world.rotors] = self.command.thrust * factor * self.alive
        self._write_gimbals(self.gimbal)
        data.ctrl[world.servos] = self.plan.joints[k]
        row = self.rows["command"][k]
        row[:] = data.ctrl
        row[world.rotors] = self.command.thrust
        if self.plan.disturbance is not None:
            self._push(self.plan.disturbance[k])

    def fail(self, now: float) -> None:
        """Stops rotors whose time has come, and tells the controller of those detected."""
        for failure in self.plan.failures:
            if now >= failure.time:
                self.alive[list(failure.rotors)] = 0.0
        known = [f for f in self.plan.failures if now >= f.detected]
        if len(known) > self.told:
            self.told = len(known)
            self.controller = self.controller.without(known[-1].rotors)

    def astray(self, k: int) -> float:
        """Returns the distance [m] of the CoG from its target."""
        gap = self.data.subtree_com[self._root] - self.plan.position[k]
        return float(np.sqrt(gap @ gap))

    def _push(self, wrench: Floats) -> None:
        """Applies a wrench; MuJoCo takes it about the body's centre of mass."""
        data, body = self.data, self.pushed
        at = data.subtree_com[self._root] if self.plan.disturbance_at_cog else data.xpos[body]
        data.xfrc_applied[body, :3] = wrench[:3]
        data.xfrc_applied[body, 3:] = wrench[3:] + np.cross(at - data.xipos[body], wrench[:3])

    def _write_gimbals(self, angles: Floats) -> None:
        present = self.world.gimbals >= 0
        self.data.ctrl[self.world.gimbals[present]] = angles[present]

    def fastest(self) -> str:
        """Returns the name of the fastest degree of freedom and its speed."""
        model = self.world.model
        dof = int(np.argmax(np.abs(np.nan_to_num(self.data.qvel, nan=np.inf))))
        name = model.joint(int(model.dof_jntid[dof])).name
        return f"{name} at {self.data.qvel[dof]:.3g} m/s or rad/s"

    def result(self, ticks: int, events: list[tuple[float, str, str]], stopped: str) -> Flown:
        """Returns the rows that were flown."""
        cut = {k: v[:ticks] for k, v in self.rows.items()}
        return Flown(
            ticks,
            cut["qpos"],
            cut["qvel"],
            cut["act"],
            cut["force"],
            cut["command"],
            self.sigma[:ticks],
            cut["wanted"],
            cut["given"],
            self.contact[:ticks],
            sorted(events),
            stopped,
            self.frame,
        )


def rotation_of(wxyz: Floats) -> Floats:
    """Returns the (3, 3) rotation of a unit quaternion in MuJoCo's order."""
    out = np.empty(9)
    mujoco.mju_quat2Mat(out, wxyz)
    return out.reshape(3, 3)


def _has_floor(model: mujoco.MjModel) -> bool:
    return mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, "floor") >= 0


def _floor_force(model: mujoco.MjModel, data: mujoco.MjData, floor: int) -> float:
    """Returns the sum of normal forces [N] of contacts with the floor."""
    total, force = 0.0, np.zeros(6)
    for i in range(data.ncon):
        if floor in data.contact.geom[i]:
            mujoco.mj_contactForce(model, data, i, force)
            total += force[0]
    return total


def _gimbal_speed(world: World) -> Floats:
    """Returns the gimbal servos' speed (Ñ, 2) [rad/s] from the URDF's velocity limits."""
    limit = world.robot.model.upperVelocityLimit
    out = np.full(world.gimbal_joints.shape, np.inf)
    for (j, k), joint in np.ndenumerate(world.gimbal_joints):
        if joint >= 0:
            name = world.robot.joint_names[joint]
            pin_joint = world.robot.model.joints[world.robot.model.getJointId(name)]
            out[j, k] = limit[pin_joint.idx_v]
    return out
