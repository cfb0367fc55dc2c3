"""What an environment asks: a mission's references, what is seen, what is rewarded.

Everything takes and gives rows, one an environment, so that one and many share it.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from snakegen.base.geometry import Floats, quaternions_xyzw
from snakegen.errors import MissionError
from snakegen.robot.robot import load
from snakegen.simulation.flight.plan import is_constant
from snakegen.simulation.flight.prepared_run import PreparedRun
from snakegen.simulation.flight.run import prepare
from snakegen.simulation.flight.world import World, make_world

ACTIONS = ("actuators", "wrench")
SENSORS = ("cog_position", "cog_velocity", "imu_quaternion", "imu_gyro")
STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS

FORCE_SHARE = 0.5  # of the weight: force of a wrench action of 1
TORQUE_SHARE = 0.25  # of weight times mean link length: its torque
_FAR, _TURNED = 1.0, 1.5  # m and rad of error at which an episode ends
_START = (0.05, 0.05, 0.1)  # m, rad, m/s and rad/s: standard deviations of the start
# q* ⊗ d as a matrix of d's entries, wxyz, by which q is multiplied
_ORDER = np.array([[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]])
_SIGN = np.array([[1.0, 1, 1, 1], [1, -1, -1, 1], [1, 1, -1, -1], [1, -1, 1, -1]])
_EFFORT = 0.01  # reward lost by an action of length 1


class Task:
    """A mission as a task.

    Attributes:
        ready: the mission, planned and checked.
        world: the plant, with the sensors that observations need.
        substeps: physics steps an action is held for.
        seconds: one action's time.
        first, last: ticks of the plan that an episode runs over.
        observations: length of an observation.
        actions: length of an action.
    """

    def __init__(
        self,
        robot: Any = "dragon4",
        mission: str = "hover",
        action: str = "actuators",
        modules: str | None = None,
        options: dict[str, Any] | None = None,
    ) -> None:
        """Plans the mission.

        Args:
            robot: what `snakegen.load` takes, or a Robot.
            mission: a flight mission or a file of waypoints.
            action: ``actuators``: thrust of each rotor and angle of each gimbal between their
                limits; ``wrench``: force and torque that the robot's own allocation turns into
                these.
            modules: modules file of a foreign URDF.
            options: of the mission.

        Raises:
            SnakegenError: no such robot or mission, or a mission that does not suit the robot.
        """
        if action not in ACTIONS:
            raise MissionError(f"action '{action}' is not known; 'actuators' or 'wrench'.")
        machine = robot if hasattr(robot, "urdf") else load(robot, modules=modules)
        self.ready: PreparedRun = prepare(machine, mission, options=options)
        self.action = action
        self.robot, self.plan = machine, self.ready.plan
        plan = self.plan
        self.world: World = make_world(
            machine, obstacles=plan.obstacles, sensors=SENSORS,
            motor_lag=bool(self.ready.imperfections.motor_lag),
        )  # fmt: skip
        model = self.world.model
        self.seconds = float(plan.time[1] - plan.time[0])
        self.substeps = max(1, round(self.seconds / model.opt.timestep))
        self.first, self.last = plan.trim, len(plan.time) - 1
        still = is_constant(plan.rotation)
        turns = quaternions_xyzw(plan.rotation[:1] if still else plan.rotation)
        self._wanted = np.broadcast_to(np.roll(turns, 1, axis=1), (len(plan.time), 4))  # wxyz
        self._joints = self.world.qpos[self.world.chain]
        self._rates = self.world.qvel[self.world.chain]
        present = self.world.gimbal_joints >= 0
        self._gimbals = self.world.qpos[self.world.gimbal_joints[present]]
        self._gimbal_servos = self.world.gimbals[present]
        self._driven = np.concatenate([self.world.rotors, self._gimbal_servos]).astype(int)
        low, high = model.actuator_ctrlrange[self._driven].T
        self._low, self._span = low, high - low
        self._sensor = {n: model.sensor(n).adr[0] for n in SENSORS}
        k = len(self._joints)
        self.observations = 12 + 2 * k + len(self._gimbals) + len(self.world.rotors)
        self.actions = len(self._driven) if action == "actuators" else 6

    def start(self, data: mujoco.MjData, rng: np.random.Generator, spread: float) -> Floats:
        """Puts `data` near the start of the plan, in hover; returns the command held there."""
        world, plan, model = self.world, self.plan, self.world.model
        mujoco.mj_resetData(model, data)
        world.set_state(data, plan.start)
        if not plan.on_floor and spread > 0:
            data.qpos[:3] += spread * _START[0] * rng.standard_normal(3)
            turn = spread * _START[1] * rng.standard_normal(3)
            mujoco.mju_quatIntegrate(data.qpos[3:7], turn, 1.0)
            data.qvel[:6] += spread * _START[2] * rng.standard_normal(6)
        control = self.hovering(data)
        data.ctrl[:] = control
        self._settle_motors(data, control)
        mujoco.mj_forward(model, data)
        return control

    def hovering(self, data: mujoco.MjData) -> Floats:
        """Returns the control that holds the plan's start: gimbals and joints as they stand."""
        control = np.zeros(self.world.model.nu)
        control[self._gimbal_servos] = data.qpos[self._gimbals]
        control[self.world.servos] = self.plan.joints[self.first]
        if not self.plan.on_floor:
            control[self.world.rotors] = self._hover_thrust(data)
        return control

    def _hover_thrust(self, data: mujoco.MjData) -> Floats:
        """Returns the thrusts of least norm that carry the weight, clipped to their ranges."""
        model = self.world.model
        mujoco.mj_forward(model, data)
        sites = [model.actuator_trnid[r, 0] for r in self.world.rotors]
        axes = data.site_xmat[sites].reshape(-1, 3, 3)
        gear = model.actuator_gear[self.world.rotors]
        force = np.einsum("nij,nj->ni", axes, gear[:, :3])
        arm = data.site_xpos[sites] - data.subtree_com[1]
        torque = np.einsum("nij,nj->ni", axes, gear[:, 3:]) + np.cross(arm, force)
        wrench = np.array([0.0, 0.0, self.robot.force_scale, 0.0, 0.0, 0.0])
        thrust = np.linalg.pinv(np.hstack([force, torque]).T, rcond=1e-9) @ wrench
        low, high = model.actuator_ctrlrange[self.world.rotors].T
        return np.asarray(np.clip(thrust, low, high))

    def _settle_motors(self, data: mujoco.MjData, control: Floats) -> None:
        at = self.world.activation
        data.act[at[at >= 0]] = control[self.world.rotors[at >= 0]]

    def control(self, action: Floats, tick: int, control: Floats) -> None:
        """Writes an action of actuators, each in −1 … 1, into a row of controls."""
        control[self._driven] = self._low + 0.5 * (action + 1.0) * self._span
        control[self.world.servos] = self.plan.joints[tick]

    def errors(self, sensed: Floats, tick: Any) -> tuple[Floats, Floats, Floats, Floats]:
        """Returns (n, 3) errors of position, velocity, attitude [rad] and angular rate.

        The attitude error is half the skew part of ``Rᵀ R_d``, in the root link's axes: ``2 w v``
        of the quaternion ``q* q_d`` = [w, v].

        Args:
            sensed: (n, ·) sensors.
            tick: of the plan, one or (n,).
        """
        plan, at = self.plan, self._sensor
        cog, velocity = at["cog_position"], at["cog_velocity"]
        gyro, quaternion = at["imu_gyro"], at["imu_quaternion"]
        position = plan.position[tick] - sensed[:, cog : cog + 3]
        linear = plan.velocity[tick] - sensed[:, velocity : velocity + 3]
        turn = (
            self._wanted[tick][..., _ORDER] * _SIGN @ sensed[:, quaternion : quaternion + 4, None]
        )
        attitude = 2.0 * turn[:, 0] * turn[:, 1:, 0]
        rate = plan.angular[tick] - sensed[:, gyro : gyro + 3]
        return position, linear, attitude, rate

    def observe(
        self, qpos: Floats, qvel: Floats, act: Floats, errors: tuple[Floats, ...], tick: Any
    ) -> Floats:
        """Returns (n, observations): errors, joints against their plan, rates, gimbals, thrusts."""
        joints = self.plan.joints[tick] - qpos[:, self._joints]
        at = self.world.activation
        most = self._low[: len(at)] + self._span[: len(at)]
        thrust = act[:, at] / most if len(at) and at.min() >= 0 else np.zeros((len(qpos), len(at)))
        parts = (*errors, joints, qvel[:, self._rates], qpos[:, self._gimbals], thrust)
        return np.concatenate(parts, axis=1)

    def reward(self, errors: tuple[Floats, ...], action: Floats) -> tuple[Floats, Any]:
        """Returns (n,) rewards, at most 1 an action, and which episodes end in failure.

        ``1 − |e_p|²/(0.5 m)² − |e_R|²/(0.5 rad)² − 0.01 |a|²``, −1 for a failure: 1 m or 1.5 rad
        away, or no longer finite.
        """
        far = np.einsum("ni,ni->n", errors[0], errors[0])
        turned = np.einsum("ni,ni->n", errors[2], errors[2])
        effort = np.einsum("ni,ni->n", action, action)
        reward = 1.0 - 4.0 * far - 4.0 * turned - _EFFORT * effort
        failed = ~(far < _FAR**2) | ~(turned < np.sin(_TURNED) ** 2) | ~np.isfinite(reward)
        return np.where(failed, -1.0, np.maximum(reward, -1.0)), failed
