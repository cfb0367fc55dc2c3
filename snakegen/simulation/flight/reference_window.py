"""References and rows of a flight at the index of their tick, in memory only around the present."""

import mujoco
import numpy as np

from snakegen.base.geometry import Floats
from snakegen.base.window_array import WindowArray
from snakegen.kernels.flight.types import References, Rows
from snakegen.simulation.flight.plan import Plan
from snakegen.simulation.flight.plant import Noise


class ReferenceWindow:
    """What is asked for and what the world does, filled as the run goes.

    Attributes:
        arrays: as the loop takes them; rows that are not filled are 0, dropped ones undefined.
    """

    def __init__(self, plan: Plan, noise: Noise, axes: Floats, mode: int) -> None:
        self.plan, self.noise, self.axes = plan, noise, axes
        self.filled = 0
        ticks, rotors = len(plan.time), len(noise.thrust_factor)
        pushed = 0 if plan.disturbance is None else ticks
        shapes = {
            "position": (ticks, 3),
            "velocity": (ticks, 3),
            "acceleration": (ticks, 3),
            "rotation": (ticks, 3, 3),
            "angular": (ticks, 3),
            "joints": (ticks, plan.joints.shape[1]),
            "strength": (ticks, rotors),
            "disturbance": (pushed, 6),
            "wind": (ticks, 3),
            "attitude_noise": (ticks, 3, 3),
            "position_noise": (ticks, 3),
            "velocity_noise": (ticks, 3),
            "gyro_noise": (ticks, 3),
        }
        self._windows = {name: WindowArray(shape) for name, shape in shapes.items()}
        self._modes = np.full(ticks, mode) if plan.mode is None else np.asarray(plan.mode)
        first = self._take(min(ticks, 1))
        self._windows["hinge_noise"] = WindowArray((ticks, first["hinge_noise"].shape[1]))
        self._put(0, first)
        self.arrays = References(
            **{name: w.values for name, w in self._windows.items()},
            mode=self._modes.astype(np.int64),
            angle_noise=noise.angles,
            torque_noise=noise.torques,
        )

    def fill(self, last: int) -> None:
        """Fills the rows before `last`."""
        first = self.filled
        if last > first:
            self._put(first, self._take(last))

    def drop(self, before: int) -> None:
        """Gives back rows before `before`."""
        for window in self._windows.values():
            window.drop(before)

    def _take(self, last: int) -> dict[str, Floats]:
        """Returns the rows from `filled` to `last`, which are then filled."""
        plan, rows = self.plan, slice(self.filled, last)
        noise = self.noise.rows(rows.start, last)
        time = plan.time[rows]
        strength = np.repeat(noise.thrust_factor[None], len(time), axis=0)
        for failure in plan.failures:
            strength[np.ix_(time >= failure.time - 1e-9, np.array(failure.rotors, int))] = 0.0
        self.filled = last
        return {
            "position": plan.position[rows],
            "velocity": plan.velocity[rows],
            "acceleration": plan.acceleration[rows],
            "rotation": plan.rotation[rows] @ self.axes,
            "angular": plan.angular[rows] @ self.axes,
            "joints": plan.joints[rows],
            "strength": strength,
            "disturbance": np.zeros((0, 6)) if plan.disturbance is None else plan.disturbance[rows],
            "wind": noise.wind if plan.wind is None else noise.wind + plan.wind[rows],
            "attitude_noise": noise.attitude,
            "position_noise": noise.position,
            "velocity_noise": noise.velocity,
            "gyro_noise": noise.gyro,
            "hinge_noise": noise.hinges,
        }

    def _put(self, first: int, found: dict[str, Floats]) -> None:
        for name, values in found.items():
            if len(values):
                self._windows[name].values[first : first + len(values)] = values


class RowWindow:
    """The rows that a flight of `ticks` writes: `arrays`, whose states and commands can be dropped.

    What is looked at as a whole stays: contact, battery and status.
    """

    def __init__(self, model: mujoco.MjModel, ticks: int) -> None:
        widths = {"qpos": model.nq, "qvel": model.nv, "act": model.na, "force": model.nu}
        widths |= {"command": model.nu, "wanted": 6, "given": 6}
        self._windows = {name: WindowArray((ticks, width)) for name, width in widths.items()}
        self._windows["sigma"] = WindowArray((ticks,))
        self.arrays = Rows(
            **{name: w.values for name, w in self._windows.items()},
            contact=np.zeros(ticks),
            used=np.zeros(ticks),
            status=np.zeros(ticks, np.int64),
        )

    def drop(self, before: int) -> None:
        """Gives back rows before `before`."""
        for window in self._windows.values():
            window.drop(before)
