"""Many flights at once, stepped by MuJoCo's threads."""

from __future__ import annotations

import os
from typing import Any

import gymnasium
import mujoco
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from mujoco import rollout

from snakegen.base.geometry import Floats
from snakegen.environment.task import STATE, Task
from snakegen.environment.wrench import WrenchPilot


class FlightVectorEnv(VectorEnv[Floats, Floats, Floats]):
    """`FlightEnv` many times over; an episode that ended starts again in the step after."""

    def __init__(
        self,
        num_envs: int = 1,
        robot: Any = "dragon4",
        mission: str = "hover",
        action: str = "actuators",
        modules: str | None = None,
        options: dict[str, Any] | None = None,
        spread: float = 1.0,
        threads: int | None = None,
        render_mode: str | None = None,
    ) -> None:
        """Makes the worlds.

        Args:
            num_envs: how many.
            robot, mission, action, modules, options: see `Task`.
            spread: see `FlightEnv`.
            threads: of MuJoCo; the machine's cores by default.
            render_mode: none.
        """
        self.task = Task(robot, mission, action, modules, options)
        self.num_envs, self.spread, self.render_mode = int(num_envs), float(spread), render_mode
        self.pilot = WrenchPilot(self.task) if action == "wrench" else None
        self.metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP, "render_modes": []}
        size = self.task.observations
        box = gymnasium.spaces.Box
        self.single_observation_space = box(-np.inf, np.inf, (size,), np.float64)
        self.single_action_space = box(-1.0, 1.0, (self.task.actions,), np.float64)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        model = self.task.world.model
        count = threads or os.cpu_count() or 1
        self._models = [model] * self.num_envs
        self._datas = [mujoco.MjData(model) for _ in range(min(count, self.num_envs))]
        self._scratch = mujoco.MjData(model)
        self._rollout = rollout.Rollout(nthread=len(self._datas) if len(self._datas) > 1 else 0)
        self._sizes = (model.nq, model.nv, model.na)
        self._state = np.zeros((self.num_envs, mujoco.mj_stateSize(model, STATE)))
        self._sensed = np.zeros((self.num_envs, model.nsensordata))
        self._control = np.zeros((self.num_envs, model.nu))
        self._tick = np.full(self.num_envs, self.task.first)
        self._memory: list[Any] = [None] * self.num_envs
        self._ended = np.zeros(self.num_envs, bool)
        self._random = [np.random.default_rng() for _ in range(self.num_envs)]

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Starts every episode; seeds count up from `seed`."""
        if isinstance(seed, int):
            seed = [seed + i for i in range(self.num_envs)]
        for i in range(self.num_envs):
            if seed is not None and seed[i] is not None:
                self._random[i] = gymnasium.utils.seeding.np_random(seed[i])[0]
            self._begin(i)
        self._ended[:] = False
        return self._observed(self._errors()), {}

    def step(self, actions: Floats) -> tuple[Floats, Floats, Any, Any, dict[str, Any]]:
        """Holds an action for one control period in every world."""
        task, actions = self.task, np.clip(np.asarray(actions, float), -1.0, 1.0)
        again = np.flatnonzero(self._ended)
        for i in range(self.num_envs):
            if self._ended[i]:
                continue
            tick, row = int(self._tick[i]), self._control[i]
            if self.pilot is None:
                task.control(actions[i], tick, row)
            else:
                qpos, qvel, _ = self._parts(self._state[i : i + 1])
                self._memory[i] = self.pilot.control(
                    actions[i], qpos[0], qvel[0], self._memory[i], row
                )
                row[task.world.servos] = task.plan.joints[tick]
        held = np.repeat(self._control[:, None], task.substeps, axis=1)
        state, sensed = self._rollout.rollout(
            self._models, self._datas, self._state, held, nstep=task.substeps, skip_checks=False
        )
        self._state[:], self._sensed[:] = state[:, -1], sensed[:, -1]
        self._tick += 1
        for k in again:
            self._begin(int(k))
        errors = self._errors()
        reward, failed = task.reward(errors, actions)
        truncated = (self._tick >= task.last) & ~failed
        reward[again], failed[again], truncated[again] = 0.0, False, False
        self._ended = failed | truncated
        observed = self._observed(errors)
        observed[failed] = np.nan_to_num(observed[failed])
        return observed, reward, failed, truncated, {}

    def close_extras(self, **kwargs: Any) -> None:
        """Ends the threads."""
        self._rollout.close()

    def _begin(self, i: int) -> None:
        data = self._scratch
        self._control[i] = self.task.start(data, self._random[i], self.spread)
        mujoco.mj_getState(self.task.world.model, data, self._state[i], STATE)
        self._sensed[i] = data.sensordata
        self._tick[i] = self.task.first
        if self.pilot is not None:
            self._memory[i] = self.pilot.start(data.qpos)

    def _parts(self, state: Floats) -> tuple[Floats, Floats, Floats]:
        """Returns qpos, qvel and act of rows of full states: time stands first."""
        nq, nv, na = self._sizes
        a, b = 1 + nq, 1 + nq + nv
        return state[:, 1:a], state[:, a:b], state[:, b : b + na]

    def _errors(self) -> tuple[Floats, ...]:
        return self.task.errors(self._sensed, np.minimum(self._tick, self.task.last))

    def _observed(self, errors: tuple[Floats, ...]) -> Floats:
        tick = np.minimum(self._tick, self.task.last)
        return self.task.observe(*self._parts(self._state), errors, tick)
