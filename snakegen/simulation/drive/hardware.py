"""What a drive's hardware adds to its model: sensors, drums that are not alike, masses, losses.

Drawn once a run from one generator; the same plant fields and seeds as of a flight.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import mujoco
import numpy as np

from snakegen.base.geometry import Floats
from snakegen.robot.losses import NONE, Losses
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.plant import Imperfections, bounded_normal
from snakegen.simulation.monte_carlo import Spread
from snakegen.simulation.run_settings import RunSettings

_NOISES = ("position_noise", "attitude_bias", "attitude_noise", "joint_noise")


@dataclass(frozen=True)
class DriveDraw:
    """What a trial draws in addition to what every run draws: factors, s of delay, another body.

    `mass` and `inertia` (half ranges) and `drums` (standard deviation) are what the run draws
    within, in place of the robot's own; None: its own.
    """

    ground: float = 1.0  # of the friction of wheels and casters on the ground
    losses: float = 1.0  # of rolling and bearing friction, play, the cable's weight
    noise: float = 1.0  # of all sensors
    delay: float = 0.0
    mass: float | None = None
    inertia: float | None = None
    drums: float | None = None
    body: Robot | None = None  # that drives in place of the one that the law knows
    strength: Mapping[str, float] = field(default_factory=dict)  # of servos, by their joint

    def to_json(self) -> dict[str, float]:
        """Returns what was drawn, by name."""
        factors = {n: getattr(self, n) for n in ("ground", "losses", "noise")}
        return factors | {"delay_s": self.delay}

    def shaken(self, what: Imperfections) -> Imperfections:
        """Returns a plant with this noise and delay."""
        noises = {name: self.noise * getattr(what, name) for name in _NOISES}
        return replace(what, delay=what.delay + self.delay, **noises)

    def worn(self, losses: Losses) -> Losses:
        """Returns losses scaled."""
        changed = {n: self.losses * getattr(losses, n) for n in ("rolling", "bearing", "play")}
        return replace(losses, cable_mass=self.losses * losses.cable_mass, **changed)


class DriveHardware:
    """One draw of a drive's hardware; `measured` goes through a run's sensor noise in order."""

    def __init__(self, robot: Robot, settings: RunSettings, size: int) -> None:
        """Draws what is constant in a run.

        Args:
            robot: with n drums.
            settings: seed of everything that is drawn; ideal: perfect sensors, drums and masses,
                no losses; draw: a DriveDraw, what a trial draws besides.
            size: n + 2, of the state.
        """
        draw = DriveDraw() if settings.draw is None else settings.draw
        ideal = settings.ideal
        what = Imperfections.of(robot.modules.plant)
        self.what = what = what.ideal() if ideal else draw.shaken(what)
        self.losses = NONE if ideal else draw.worn(robot.modules.losses)
        self.strength = draw.strength
        self.robot = _rolling_on(draw.body or robot, self.losses, draw.ground)
        self.rng = np.random.default_rng(settings.seed)
        self.offset = np.zeros(size)
        self.offset[2] = what.attitude_bias * bounded_normal(self.rng, 3)[2]
        self.offset[3:] = what.joint_noise * self.rng.standard_normal(size - 3)
        drums = len(robot.modules.screws)
        mismatch = what.drive_mismatch if draw.drums is None or ideal else draw.drums
        self.factor = 1.0 + mismatch * self.rng.standard_normal(drums)
        spread = Spread.of(robot.modules.uncertainty)
        mass = spread.mass if draw.mass is None else draw.mass
        inertia = spread.inertia if draw.inertia is None else draw.inertia
        self.spread = (0.0, 0.0) if ideal else (mass, inertia)
        self.last: Floats | None = None

    def change(self, model: mujoco.MjModel) -> None:
        """Scales bodies within ``plant.uncertainty``, and servos by their strength, in place."""
        for name, factor in self.strength.items():
            weaken(model, name, factor)
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


def weaken(model: mujoco.MjModel, joint: str, factor: float) -> None:
    """Scales gains and torque limit of a joint's servo, in place."""
    servo = model.actuator(joint).id
    model.actuator_gainprm[servo] *= factor
    model.actuator_biasprm[servo] *= factor
    model.actuator_forcerange[servo] *= factor


def _rolling_on(robot: Robot, losses: Losses, ground: float) -> Robot:
    """Returns the robot as it meets the ground: with these losses, friction scaled by `ground`."""
    screws = tuple(replace(s, friction=ground * s.friction) for s in robot.modules.screws)
    return replace(robot, modules=replace(robot.modules, losses=losses, screws=screws))
