"""What a drive's hardware adds to its model: sensors, drums that are not alike, masses.

Drawn once a run from one generator; the same plant fields and seeds as of a flight.
"""

import mujoco
import numpy as np

from snakegen.base.geometry import Floats
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.plant import Imperfections, bounded_normal
from snakegen.simulation.monte_carlo import Spread


class DriveHardware:
    """One draw of a drive's hardware; `measured` goes through a run's sensor noise in order."""

    def __init__(self, robot: Robot, seed: int, size: int, *, ideal: bool) -> None:
        """Draws what is constant in a run.

        Args:
            robot: with n drums.
            seed: of everything that is drawn.
            size: n + 2, of the state.
            ideal: perfect sensors, drums and masses.
        """
        what = Imperfections.of(robot.modules.plant)
        self.what = what = what.ideal() if ideal else what
        self.rng = np.random.default_rng(seed)
        self.offset = np.zeros(size)
        self.offset[2] = what.attitude_bias * bounded_normal(self.rng, 3)[2]
        self.offset[3:] = what.joint_noise * self.rng.standard_normal(size - 3)
        drums = len(robot.modules.screws)
        self.factor = 1.0 + what.drive_mismatch * self.rng.standard_normal(drums)
        spread = Spread.of(robot.modules.uncertainty)
        self.spread = (0.0, 0.0) if ideal else (spread.mass, spread.inertia)
        self.last: Floats | None = None

    def change_bodies(self, model: mujoco.MjModel) -> None:
        """Scales mass and inertia of every body within ``plant.uncertainty``, in place."""
        mass, inertia = (1.0 + s * self.rng.uniform(-1.0, 1.0, model.nbody) for s in self.spread)
        model.body_mass *= mass
        model.body_inertia *= (mass * inertia)[:, None]
        mujoco.mj_setConst(model, mujoco.MjData(model))

    def measured(self, state: Floats, period: float) -> Floats:
        """Returns what the law learns of the state: offset, noisy, ``plant.delay`` old.

        Between two ticks, `period` s apart, the state is interpolated; older it is not.
        """
        last = state if self.last is None else self.last
        self.last = np.array(state)
        share = min(self.what.delay / period, 1.0)
        out = (1.0 - share) * state + share * last + self.offset
        out[:2] += self.what.position_noise * bounded_normal(self.rng, 2)
        out[2] += self.what.attitude_noise * bounded_normal(self.rng, 1)[0]
        return np.asarray(out)

    def given(self, command: Floats) -> Floats:
        """Returns the screw and joint rates that the motors give of those asked for."""
        out = np.array(command)
        out[: len(self.factor)] *= self.factor
        return out
