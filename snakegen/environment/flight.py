"""One robot on one flight mission, as a Gymnasium environment."""

from __future__ import annotations

from typing import Any

import gymnasium
import mujoco
import numpy as np

from snakegen.base.geometry import Floats
from snakegen.environment.task import Task
from snakegen.environment.wrench import WrenchPilot


class FlightEnv(gymnasium.Env[Floats, Floats]):
    """Fly a mission's references; see `Task` for what is seen and rewarded.

    Observation (float64): errors of CoG position [m], velocity [m/s], attitude [rad] and angular
    rate [rad/s]; joints against their plan [rad] and their rates; gimbal angles [rad]; thrusts
    over their limits. CoG and rates are one physics step (1 ms) old. Joints between links follow
    the mission's plan.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 50}  # noqa: RUF012  (Gymnasium's)

    def __init__(
        self,
        robot: Any = "dragon4",
        mission: str = "hover",
        action: str = "actuators",
        modules: str | None = None,
        options: dict[str, Any] | None = None,
        spread: float = 1.0,
        render_mode: str | None = None,
    ) -> None:
        """Makes the world of a mission; arguments as those of `Task`.

        Args:
            robot, mission, action, modules, options: see `Task`.
            spread: how far from its plan an episode starts: 1 for 5 cm, 0.05 rad and 0.1 m/s
                (standard deviations), 0 for exactly there.
            render_mode: ``rgb_array`` or none.
        """
        self.task = Task(robot, mission, action, modules, options)
        self.data = mujoco.MjData(self.task.world.model)
        self.spread, self.render_mode = float(spread), render_mode
        self.pilot = WrenchPilot(self.task) if action == "wrench" else None
        size = self.task.observations
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float64)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (self.task.actions,), np.float64)
        self._tick = self.task.first
        self._memory: Any = None
        self._renderer: mujoco.Renderer | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Starts an episode near the plan's start; the same seed gives the same episode."""
        super().reset(seed=seed)
        task = self.task
        self._control = task.start(self.data, self.np_random, self.spread)
        self._tick = task.first
        if self.pilot is not None:
            self._memory = self.pilot.start(self.data.qpos)
        return self._observed(self._errors()), {}

    def step(self, action: Floats) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """Holds an action for one control period."""
        task, data = self.task, self.data
        action = np.clip(np.asarray(action, float), -1.0, 1.0)
        if self.pilot is None:
            task.control(action, self._tick, self._control)
        else:
            self._memory = self.pilot.control(
                action, data.qpos, data.qvel, self._memory, self._control
            )
            self._control[task.world.servos] = task.plan.joints[self._tick]
        data.ctrl[:] = self._control
        mujoco.mj_step(task.world.model, data, task.substeps)
        self._tick += 1
        errors = self._errors()
        reward, failed = task.reward(errors, action[None])
        observed = self._observed(errors)
        over = bool(failed[0])
        if over:
            observed = np.nan_to_num(observed)
        return observed, float(reward[0]), over, self._tick >= task.last and not over, {}

    def render(self) -> Any:
        """Returns a picture (480, 640, 3) of the plant as it is simulated: bodies, no trimmings."""
        if self.render_mode != "rgb_array":
            return None
        if self._renderer is None:
            self._renderer = mujoco.Renderer(self.task.world.model, 480, 640)
        self._renderer.update_scene(self.data, "track")
        return self._renderer.render()

    def close(self) -> None:
        """Frees the renderer."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _errors(self) -> tuple[Floats, ...]:
        return self.task.errors(self.data.sensordata[None], self._tick)

    def _observed(self, errors: tuple[Floats, ...]) -> Floats:
        data = self.data
        rows = self.task.observe(
            data.qpos[None], data.qvel[None], data.act[None], errors, self._tick
        )
        return rows[0]
