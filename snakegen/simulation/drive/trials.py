"""Many runs of a drive's mission over what is not known well: pass rate, its interval, the worst.

The commands stay those of the nominal robot. Each run draws, from a seed of its own, masses and
inertias, drums that turn too far, sensors (as every run does), and the friction of the ground, the
losses, the noise of all sensors and a delay; ground that is random is random for each run. A run
passes if it passes every check of its mission.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.errors import MissionError
from snakegen.robot.robot import Robot
from snakegen.simulation.drive.hardware import DriveDraw
from snakegen.simulation.flight.plant import Imperfections
from snakegen.simulation.missions import mission
from snakegen.simulation.missions.options import checked_options
from snakegen.simulation.monte_carlo import MonteCarlo, Spread, Trial
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.run_settings import RunSettings
from snakegen.simulation.trial_loop import run_trials


@dataclass(frozen=True)
class DriveSpread:
    """Half ranges of uniform draws, relative unless a unit is given."""

    mass: float = Spread.mass  # each body's, its inertia with it
    inertia: float = Spread.inertia  # each body's, in addition to its mass
    ground: float = Spread.ground  # of the friction of wheels on the ground
    losses: float = Spread.losses  # of rolling and bearing friction, play, the cable's weight
    noise: float = Spread.noise  # all sensors'
    delay: float = Spread.delay  # s, added: 0 … this
    drums: float = Imperfections.drive_mismatch  # standard deviation, of what each drum turns

    @staticmethod
    def of(robot: Robot) -> "DriveSpread":
        """Returns the ranges of a robot: plant.uncertainty and plant.drive_mismatch of its spec."""
        s = Spread.of(robot.modules.uncertainty)
        drums = Imperfections.of(robot.modules.plant).drive_mismatch
        return DriveSpread(s.mass, s.inertia, s.ground, s.losses, s.noise, s.delay, drums)

    def draw(self, rng: np.random.Generator) -> DriveDraw:
        """Draws what single runs do not; masses, inertias and drums are drawn by the run."""
        ground, losses, noise = (
            1.0 + half * rng.uniform(-1.0, 1.0) for half in (self.ground, self.losses, self.noise)
        )
        delay = self.delay * rng.uniform()
        return DriveDraw(ground, losses, noise, delay, self.mass, self.inertia, self.drums)


def drive_trials(
    robot: Robot,
    name: str,
    count: int,
    *,
    seed: int = 0,
    options: dict[str, Any] | None = None,
    spread: DriveSpread | None = None,
    progress: Callable[[int, int], Any] | None = None,
) -> tuple[MonteCarlo, Recording]:
    """Runs a mission of a drive `count` times; returns the outcome and the worst recording.

    Args:
        robot: a drive.
        name: of the mission.
        count: of runs.
        seed: of the draws; run k draws from [seed, k].
        options: of the mission.
        spread: what is drawn; the robot's own ranges if absent.
        progress: called with runs done and runs in all.

    Raises:
        MissionError: the kinematic plant, which draws nothing; fewer than one run.
        KeyboardInterrupt: interrupted before the first run was finished.
    """
    module = mission(name, robot)
    chosen = checked_options(name, module.Options, options or {})
    if getattr(chosen, "plant", "contact") == "kinematic":
        raise MissionError("the kinematic plant draws nothing; trials need plant=contact.")
    spread = DriveSpread.of(robot) if spread is None else spread

    def fly(rng: np.random.Generator) -> Recording:
        drawn = spread.draw(rng)
        own = RunSettings(int(rng.integers(2**31)), draw=drawn)
        out: Recording = module.fly(robot, chosen, own)
        return out

    return run_trials(fly, _judged, count, seed=seed, spread=spread, progress=progress)


def _judged(recording: Recording, number: int) -> Trial:
    """Returns the trial of a run; it counts as survived where every check passed."""
    checks = recording.verdict.checks if recording.verdict is not None else ()
    failed = tuple(c.metric for c in checks if not c.passed)
    good = bool(checks) and not failed
    far = {"position_max_m": _farthest(recording), "duration_s": float(recording.time[-1])}
    stopped, drawn = str(recording.meta["stopped"]), dict(recording.meta["drawn"])
    return Trial(number, drawn, recording.metrics | far, good, good, stopped, failed)


def _farthest(recording: Recording) -> float:
    """Returns the farthest the head was from its reference [m], without the start's own error."""
    error = recording.channel("state_error").values[:, :2]
    away = np.hypot(error[:, 0], error[:, 1])
    return float(max(0.0, away.max() - away[0]))
