"""The one stepping loop: sense, decide, step MuJoCo, remember.

A stretch of ticks is flown in compiled code (`kernels.flight`); between stretches Python looks at
interruptions, failures that become known, and progress. References come and rows go as the run goes
(`reference_window`), so that memory does not grow with its length where `watch` takes the rows.
"""

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from snakegen.base.geometry import Floats
from snakegen.base.sample_store import release_all
from snakegen.control.controller import Controller
from snakegen.kernels.control.types import REFUSED, Measured, State, Target
from snakegen.kernels.flight import types as kernel
from snakegen.kernels.flight.flight import ASTRAY, DIVERGED, LOST, fly_ticks, thrusts_into
from snakegen.kernels.flight.sensing import read_imu
from snakegen.kernels.kinematics.chain import forward
from snakegen.simulation.flight import mujoco_arrays
from snakegen.simulation.flight.falling import fall
from snakegen.simulation.flight.flown import Flown
from snakegen.simulation.flight.interrupt import noted
from snakegen.simulation.flight.plan import Plan
from snakegen.simulation.flight.plant import Imperfections, Noise
from snakegen.simulation.flight.reference_window import ReferenceWindow, RowWindow
from snakegen.simulation.flight.trim import SETTLING, integral_rates, integrator_state, trim_events
from snakegen.simulation.flight.vibration import OFF, Damping, damper, retuned
from snakegen.simulation.flight.world import World

STRETCH = 1.0  # s of flight between two looks at the rest of the world
REFRESH = 0.25  # s between two looks at the modes that are damped


def fly(
    world: World,
    plan: Plan,
    controller: Controller,
    noise: Noise,
    imperfections: Imperfections,
    *,
    position_rate: float = 40.0,
    damping: Damping = OFF,
    progress: Callable[[int], Any] | None = None,
    watch: Callable[[int, Callable[[int, int], Flown]], int] | None = None,
) -> Flown:
    """Runs `plan` in MuJoCo; an interruption keeps what was flown so far.

    Motion capture is sampled at `position_rate` and held, attitude at the IMU's rate; what the
    controller knows is `imperfections.delay` old. Servo commands are held to the servos' speed.

    Args:
        world: where.
        plan: references.
        controller: the law.
        noise: drawn for this run.
        imperfections: of the plant.
        position_rate: Hz.
        damping: of vibration by internal forces; `noise` has the noise of its sensors.
        progress: called with the tick, at least once a second of flight.
        watch: as `progress`, and with a function that returns ticks a … b − 1 as flown; returns the
            tick before which rows are no longer needed: they are missing from what is returned.
    """
    ticks = len(plan.time)
    dt = float(plan.time[1] - plan.time[0]) if ticks > 1 else 0.005
    run = _Run(world, plan, controller, noise, imperfections, dt, position_rate, damping)
    events: list[tuple[float, str, str]] = [(t, "INFO", text) for t, text in plan.events]
    stopped, k, taken = "", 0, 0
    try:
        with noted() as keys:
            step = max(1, round((REFRESH if run.modes else STRETCH) / dt))
            while k < ticks and not stopped:
                k, stopped, level = run.stretch(k, min(k + step, ticks))
                fell = None if stopped else run.fell(k)
                if fell is not None:
                    stopped, level = f"fell to the floor at {plan.time[fell]:.2f} s", "ERROR"
                if stopped:
                    events.append((float(plan.time[k - 1]), level, stopped))
                if progress is not None:
                    progress(k)
                if watch is not None:
                    taken = watch(k, lambda first, last: _flown(run, slice(first, last), [], ""))
                run.drop(k, taken)
                keys.check()
    except KeyboardInterrupt:
        k = max(k, 1)
        stopped = f"interrupted at {plan.time[k - 1]:.2f} s"
        events.append((float(plan.time[k - 1]), "WARN", stopped))
    refused = run.rows.status[:k] == REFUSED
    begun = np.flatnonzero(refused & ~np.append(False, refused[:-1]))
    events += [(float(plan.time[i]), "WARN", "σ_min below the threshold") for i in begun]
    empty = np.flatnonzero(run.rows.used[:k] >= 1.0)[:1]
    events += [(float(plan.time[i]), "WARN", "battery empty: the rotors stop") for i in empty]
    events += trim_events(plan, controller.law, run.trimmed)
    return _flown(run, slice(taken, k), events, stopped)


class _Run:
    """One run's simulator and memory; all state of the loop lives here."""

    def __init__(
        self,
        world: World,
        plan: Plan,
        controller: Controller,
        noise: Noise,
        imperfections: Imperfections,
        dt: float,
        position_rate: float,
        damping: Damping,
    ) -> None:
        self.world, self.plan, self.controller = world, plan, controller
        self.data = data = mujoco.MjData(world.model)
        world.set_state(data, plan.start)
        angles = data.qpos[world.qpos]
        present = world.gimbal_joints >= 0
        gimbals = np.zeros(present.shape)
        gimbals[present] = angles[world.gimbal_joints[present]]
        data.ctrl[world.servos] = plan.joints[0]
        data.ctrl[world.gimbals[present]] = gimbals[present]
        mujoco.mj_forward(world.model, data)
        self.frame = _frame(world, controller, data)
        self.axes = plan.rotation[0].T @ self.frame
        self.state = controller.start(gimbals)
        self.trimmed: dict[str, Any] = {}
        settling = SETTLING if plan.trim else plan.settling
        self.controller = controller.with_law(
            integral_rate=integral_rates(controller.law, settling)
        )
        self.damper, self.modes = damper(world, controller, damping, data.qpos, imperfections.delay)
        self.plant = mujoco_arrays.plant(world, plan, imperfections, dt, position_rate)
        self.capacity = self.plant.capacity
        if plan.trim:  # the mission's battery is full at its t = 0
            self.plant = self.plant._replace(capacity=np.inf)
        self.wires = mujoco_arrays.wiring(world, plan)
        self.window = ReferenceWindow(plan, noise, self.axes, controller.mode)
        self.references = self.window.arrays
        self.memory = mujoco_arrays.memory(
            world, gimbals, plan.joints[0], self.plant.delay, len(self.damper.rate)
        )
        self.sim = mujoco_arrays.simulator(world, data)
        self.log = RowWindow(world.model, len(plan.time))
        self.rows = self.log.arrays
        if not plan.on_floor:
            self._start_rotors()
        read_imu(self.sim, self.memory)

    def _start_rotors(self) -> None:
        """Sets the motors to the thrust that the first tick asks for: a run starts in hover."""
        data, world, plan = self.data, self.world, self.references
        base = data.xmat[world.model.body(world.robot.root_link).id].reshape(3, 3).copy()
        measured = Measured(
            base,
            np.array(data.qpos[:3]),
            np.array(data.qvel[:3]),
            base @ data.qvel[3:6],
            np.array(data.qpos[world.qpos]),
            np.array(data.qvel[world.qvel]),
        )
        target = Target(
            plan.position[0],
            plan.velocity[0],
            plan.acceleration[0],
            self.frame,
            plan.angular[0],
        )
        _, command = self.controller.tick(measured, target, self.state, 1e-9)
        has = world.activation >= 0
        data.act[world.activation[has]] = command.thrust[has]
        data.ctrl[world.rotors] = command.thrust
        thrust = np.empty(len(world.rotors))
        thrusts_into(self.sim, self.wires, thrust)
        share = np.maximum(thrust, 0.0) / self.plant.thrust_max
        self.memory.momentum[:] = self.plant.spin_momentum * np.sqrt(share)

    def stretch(self, first: int, last: int) -> tuple[int, str, str]:
        """Flies ticks `first` … `last` − 1; returns the next tick, why it stopped, and a level."""
        time, trim = self.plan.time, self.plan.trim
        if 0 < trim == first:
            self.trimmed = integrator_state(self.controller.law, self.state)
            law = self.controller.law
            self.controller = self.controller.with_law(
                integral_rate=integral_rates(law, self.plan.settling)
            )
            self.plant = self.plant._replace(capacity=self.capacity)
        elif first < trim < last:
            last = trim
        for failure in self.plan.failures:
            known = int(np.searchsorted(time, failure.detected - 1e-9))
            if known == first:
                self.controller = self.controller.without(failure.rotors)
            elif first < known < last:
                last = known
        self.window.fill(last)
        if self.modes:  # they change with the posture
            self.damper = retuned(self.damper, self.world, self.data.qpos)
        c = self.controller
        outside = (self.sim, self.wires, self.references, self.plant, self.memory, self.rows)
        args = (c.mechanism, c.law, self.damper, kernel.World(*outside))
        end = DIVERGED
        while end == DIVERGED and first < last:
            state, k, end = fly_ticks(*args, self.state, first, last)
            self.state = State(*state)
            if end == DIVERGED and self._lost():
                return k, f"diverged at {time[k - 1]:.2f} s: {self._fastest()}", "ERROR"
            first = k  # a free wheel in the air may well spin that fast
        if end == ASTRAY:
            limit = self.plan.give_up
            return k, f"gave up at {time[k - 1]:.2f} s: {limit:g} m off target", "WARN"
        return k, "", ""

    def drop(self, ticks: int, taken: int) -> None:
        """Gives back rows before `taken`, and references that neither log nor delay ask for."""
        self.log.drop(taken)
        self.window.drop(min(taken, ticks - self.plant.delay - 2))
        release_all()  # what was read of the plan

    def fell(self, ticks: int) -> int | None:
        """Returns the tick at which the robot fell, of those flown; None while it flies."""
        dt, weight = self.plant.substeps * self.plant.timestep, self.world.robot.force_scale
        return fall(self.rows.contact[:ticks], dt, weight, on_floor=self.plan.on_floor)

    def _fastest(self) -> str:
        """Returns the name of the fastest degree of freedom and its speed, free wheels apart."""
        model = self.world.model
        speed = np.abs(np.nan_to_num(self.data.qvel, nan=np.inf))
        dof = int(np.argmax(np.where(self._held(), speed, -1.0)))
        joint = int(model.dof_jntid[dof])
        kind, first = model.jnt_type[joint], dof - int(model.jnt_dofadr[joint])
        slides = kind == mujoco.mjtJoint.mjJNT_SLIDE
        slides |= kind == mujoco.mjtJoint.mjJNT_FREE and first < 3  # its rotation comes after
        unit = "m/s" if slides else "rad/s"
        return f"{model.joint(joint).name} at {self.data.qvel[dof]:.3g} {unit}"

    def _lost(self) -> bool:
        """Tells whether anything but free wheels is too fast, or no number."""
        return not float(np.abs(self.data.qvel[self._held()]).max()) < LOST

    def _held(self) -> NDArray[np.bool_]:
        """Returns for each degree of freedom whether the base, a servo or a spring holds it."""
        model = self.world.model
        held = (model.jnt_stiffness > 0) | (model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
        on_joint = model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT
        held[model.actuator_trnid[on_joint, 0]] = True
        return np.asarray(held[model.dof_jntid])


def _frame(world: World, controller: Controller, data: mujoco.MjData) -> Floats:
    """Returns the attitude of the CoG frame now."""
    law = controller.law
    base = data.xmat[world.model.body(world.robot.root_link).id].reshape(3, 3).copy()
    rotation, _ = forward(
        world.robot.tree, base, np.array(data.qpos[:3]), np.array(data.qpos[world.qpos])
    )
    return np.asarray(rotation[law.axes_body] @ law.axes_rotation)


def _flown(run: _Run, part: slice, events: list[tuple[float, str, str]], stopped: str) -> Flown:
    """Returns the ticks `part` of a run."""
    r, wind = run.rows, run.references.wind
    states, asked = (r.qpos, r.qvel, r.act, r.force), (r.command, r.sigma, r.wanted, r.given)
    cut = [rows[part] for rows in (*states, *asked, r.contact, r.used, wind)]
    last = (sorted(events), stopped, run.axes, run.trimmed, part.start)
    return Flown(part.stop - part.start, *cut, *last)  # type: ignore[call-arg, arg-type]
