"""Wrench actions: the robot's own allocation turns them into thrusts and gimbal angles."""

from __future__ import annotations

import mujoco
import numpy as np

from snakegen.base.geometry import Floats
from snakegen.control.frame import cog_frame
from snakegen.environment.task import FORCE_SHARE, TORQUE_SHARE, Task
from snakegen.kernels.control.types import Measured, State, Target


class WrenchPilot:
    """Allocates the wrench of an action as the flight controller allocates its own.

    An action of 1 is a force of half the weight beside hover (world axes), or the torque
    ``I α`` (root link's axes) whose α would take a quarter of weight times mean link length at
    the plan's start, in the mean over its axes.
    """

    def __init__(self, task: Task) -> None:
        none, unit = np.zeros((3, 3)), np.zeros((3, 3))
        unit[2] = 1.0  # torque = I (rate wanted − rate) + ω × I ω: the rate carries the action
        self.task = task
        self._flat = np.empty(9)
        self._present = task.world.gimbals >= 0
        self._servos = task.world.gimbals[self._present]
        self.controller = task.ready.controller.with_law(
            force=none, torque=unit, attitude=np.zeros(2), vectoring=np.zeros_like(
                task.ready.controller.law.vectoring
            ), rate_filter=0.0, axes_body=0, axes_rotation=np.eye(3),
        )  # fmt: skip
        robot = task.robot
        frame = cog_frame(self.controller, robot.angles(task.plan.start))
        self.force = FORCE_SHARE * self.controller.law.gravity  # m/s²
        mean = float(np.trace(frame.inertia)) / 3.0
        self.torque = TORQUE_SHARE * robot.torque_scale / mean  # rad/s²

    def start(self, qpos: Floats) -> State:
        """Returns the memory at the start of an episode: gimbals as they stand."""
        world = self.task.world
        present = world.gimbal_joints >= 0
        gimbals = np.zeros(present.shape)
        gimbals[present] = qpos[world.qpos[world.gimbal_joints[present]]]
        return self.controller.start(gimbals)

    def control(
        self, action: Floats, qpos: Floats, qvel: Floats, memory: State, control: Floats
    ) -> State:
        """Writes thrusts and gimbal angles into a row of controls; returns the memory after it."""
        task, world = self.task, self.task.world
        mujoco.mju_quat2Mat(self._flat, qpos[3:7])
        rotation = self._flat.reshape(3, 3).copy()
        measured = Measured(
            rotation, qpos[:3].copy(), qvel[:3].copy(), rotation @ qvel[3:6], qpos[world.qpos],
            qvel[world.qvel],
        )  # fmt: skip
        target = Target(
            measured.position, np.zeros(3), self.force * action[:3], rotation,
            qvel[3:6] + self.torque * action[3:],
        )  # fmt: skip
        after, command = self.controller.tick(measured, target, memory, task.seconds)
        control[world.rotors] = command.thrust
        control[self._servos] = command.gimbals[self._present]
        return after
