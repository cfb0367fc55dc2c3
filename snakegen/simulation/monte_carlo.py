"""Many flights of one mission over what is not known well: survival, percentiles, the worst.

Trials run in threads: the flight loop holds no lock of Python's. Each draws from a generator of
its own, made from seed and number, so that results do not depend on how many threads there are.
"""

import copy
import os
from collections import Counter
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, fields, replace
from math import sqrt
from threading import Event
from typing import Any

import mujoco
import numpy as np

from snakegen.errors import MissionError, SpecError, near
from snakegen.simulation.flight.plant import Imperfections
from snakegen.simulation.flight.prepared_run import PreparedRun
from snakegen.simulation.flight.world import World
from snakegen.simulation.recording.flight_report import flight_report
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.recording.verdict import FLIGHT_THRESHOLDS

SURVIVED = (
    "completed",
    "finite",
    "took_off",
    "floor_contact_after_takeoff_s",
)  # checks of the verdict that a trial must pass to count as flown; others judge how well
PERCENTILES = (5, 50, 95)
_Z = 1.959963984540054  # 97.5 % point of the normal distribution
_NOISES = (
    "position_noise",
    "attitude_bias",
    "attitude_noise",
    "gyro_noise",
    "velocity_noise",
    "torque_noise",
)


@dataclass(frozen=True)
class Spread:
    """Half ranges of uniform draws, relative unless a unit is given: `plant.uncertainty`."""

    mass: float = 0.05  # each body's, its inertia with it
    inertia: float = 0.10  # each body's, in addition to its mass
    thrust: float = 0.05  # all rotors' together, in addition to the plant's mismatch of each
    lag: float = 0.30  # all motors'
    delay: float = 0.010  # s, added: 0 … this
    noise: float = 0.50  # all sensors'
    friction: float = 0.005  # of an arm's joints: share of the servo's limit, 0 … this
    ground: float = 0.25  # friction of a drive's wheels on the ground
    losses: float = 0.50  # a drive's rolling and bearing friction, play, its cable's weight

    @staticmethod
    def of(values: dict[str, Any]) -> "Spread":
        """Returns that of an `<uncertainty>` element; absent ones are default."""
        known = [f.name for f in fields(Spread)]
        for name in values:
            if name not in known:
                raise SpecError(f"plant.uncertainty has no field '{name}'.{near(name, known)}")
        return Spread(**{k: float(v) for k, v in values.items()})


@dataclass(frozen=True)
class Trial:
    """One flight: its number, what was drawn, its metrics, whether it was flown, what it failed."""

    number: int
    drawn: dict[str, float]
    metrics: dict[str, Any]
    survived: bool
    passed: bool
    stopped: str
    failed: tuple[str, ...]  # checks of the verdict


@dataclass(frozen=True)
class MonteCarlo:
    """The outcome of all trials that were flown.

    Attributes:
        asked: how many were to be flown; fewer were if it was interrupted.
        spread: what was drawn, and how widely.
        trials: by number.
        survival: share that was flown to the end off the floor and on its path.
        interval: 95 % confidence interval of that share (Wilson).
        percentiles: 5th, 50th, 95th of each metric, over the survivors.
        worst: number of the worst trial: the first to end early, else the farthest off its path.
    """

    asked: int
    spread: Any  # a dataclass of ranges
    trials: tuple[Trial, ...]
    survival: float
    interval: tuple[float, float]
    percentiles: dict[str, tuple[float, ...]]
    worst: int

    def to_json(self) -> dict[str, Any]:
        """Returns plain data for a program."""
        return {
            "trials": len(self.trials),
            "trials_asked": self.asked,
            "uncertainty": ranges(self.spread),
            "survived": sum(t.survived for t in self.trials),
            "passed_all_checks": sum(t.passed for t in self.trials),
            "failed_checks": dict(Counter(c for t in self.trials for c in t.failed).most_common()),
            "survival": self.survival,
            "survival_interval_95": list(self.interval),
            "percentiles": {k: list(v) for k, v in self.percentiles.items()},
            "percentiles_of": list(PERCENTILES),
            "worst": vars(next(t for t in self.trials if t.number == self.worst)),
            "lost": [vars(t) for t in self.trials if not t.survived],
        }


def ranges(spread: Any) -> dict[str, float]:
    """Returns the ranges that trials draw from, by name; flights draw none of drives and arms."""
    unused = {"friction", "ground", "losses"} if isinstance(spread, Spread) else set()
    return {k: v for k, v in vars(spread).items() if k not in unused}


class _Stop(Exception):
    """Ends a flight in its thread once the whole is interrupted."""


def monte_carlo(
    ready: PreparedRun,
    count: int,
    *,
    seed: int = 0,
    spread: Spread | None = None,
    workers: int | None = None,
    progress: Callable[[int, int], Any] | None = None,
) -> MonteCarlo:
    """Flies `count` trials; an interruption keeps those that are finished.

    Args:
        ready: a mission from `run.prepare`.
        count: of trials.
        seed: the same seed gives the same trials with any number of workers, bit for bit on one
            machine.
        spread: what is drawn, and how widely; the robot's own plant.uncertainty if not given.
        workers: threads; one a core if not given.
        progress: called with trials flown and trials in all.

    Raises:
        MissionError: no trial asked for.
        KeyboardInterrupt: interrupted before the first was finished.
    """
    if count < 1:
        raise MissionError(f"{count} trials: at least 1 is needed.")
    world = ready.world()
    spread, stop = spread or Spread.of(ready.robot.modules.uncertainty), Event()
    done: list[Trial] = []
    with ThreadPoolExecutor(workers or os.cpu_count() or 1) as pool:
        waiting: set[Future[Trial]] = {
            pool.submit(_trial, ready, world, spread, seed, i, stop) for i in range(count)
        }
        try:
            while waiting:
                finished, waiting = wait(waiting, timeout=0.5, return_when=FIRST_COMPLETED)
                done += [f.result() for f in finished]
                if progress is not None and finished:
                    progress(len(done), count)
        except BaseException as error:
            stop.set()
            pool.shutdown(cancel_futures=True)
            if not isinstance(error, KeyboardInterrupt):
                raise
    if not done:
        raise KeyboardInterrupt  # before the first trial was finished: nothing is kept
    return summary(count, spread, sorted(done, key=lambda t: t.number))


def fly_again(
    ready: PreparedRun, number: int, *, seed: int = 0, spread: Spread | None = None
) -> Recording:
    """Returns the full recording of one trial of `monte_carlo`; on one machine the same bits."""
    world = ready.world()
    rng = np.random.default_rng([seed, number])
    spread = spread or Spread.of(ready.robot.modules.uncertainty)
    changed, imperfections, drawn = perturbed(world, ready.imperfections, spread, rng)
    recording = ready.flown(changed, imperfections, rng, seed)
    labelled = replace(recording, meta=recording.meta | {"trial": number, "drawn": drawn})
    return replace(labelled, report=flight_report(labelled))


def _trial(
    ready: PreparedRun, world: World, spread: Spread, seed: int, number: int, stop: Event
) -> Trial:
    def look(_done: int, _total: int) -> None:
        if stop.is_set():
            raise _Stop

    rng = np.random.default_rng([seed, number])
    changed, imperfections, drawn = perturbed(world, ready.imperfections, spread, rng)
    flown = ready.flown(changed, imperfections, rng, seed, look, margins=False, located=False)
    checks = flown.verdict.checks if flown.verdict is not None else ()
    off, most = flown.metrics.get("position_max_m"), lost_beyond(ready)
    survived = all(c.passed for c in checks if c.metric in SURVIVED)
    survived = survived and off is not None and off <= most
    failed = tuple(c.metric for c in checks if not c.passed)
    stopped = str(flown.meta["stopped"])
    return Trial(number, drawn, flown.metrics, survived, not failed, stopped, failed)


def lost_beyond(ready: PreparedRun) -> float:
    """Returns the distance [m] from its target beyond which a trial counts as lost.

    0.5 m where a flight follows its references, however well it is to follow them; else what the
    mission allows.
    """
    own = None if ready.plan.tracked else ready.plan.thresholds.get("position_max_m")
    return float((own or FLIGHT_THRESHOLDS["position_max_m"])["at_most"])


def perturbed(
    world: World, imperfections: Imperfections, spread: Spread, rng: np.random.Generator
) -> tuple[World, Imperfections, dict[str, float]]:
    """Returns a world and a plant off their nominal values, and what was drawn.

    Inertias are scaled whole, so that they stay those of bodies; the controller keeps believing
    in the nominal robot.
    """
    model = copy.copy(world.model)

    def factors(half: float, size: int | None = None) -> Any:
        return 1.0 + half * rng.uniform(-1.0, 1.0, size)

    mass, inertia = factors(spread.mass, model.nbody), factors(spread.inertia, model.nbody)
    model.body_mass *= mass
    model.body_inertia *= (mass * inertia)[:, None]
    lag, thrust, noise = factors(spread.lag), factors(spread.thrust), factors(spread.noise)
    model.actuator_dynprm[world.rotors, 0] *= lag
    mujoco.mj_setConst(model, mujoco.MjData(model))
    delay = imperfections.delay + spread.delay * rng.uniform()
    changes = {n: getattr(imperfections, n) * noise for n in _NOISES}
    drawn = {
        "mass": float(model.body_mass.sum() / world.model.body_mass.sum()),
        "lag": float(lag),
        "thrust": float(thrust),
        "delay_s": float(delay),
        "noise": float(noise),
    }
    plant = replace(imperfections, delay=delay, thrust_scale=float(thrust), **changes)
    return replace(world, model=model), plant, drawn


def summary(asked: int, spread: Any, trials: list[Trial]) -> MonteCarlo:
    """Returns survival, percentiles and the worst of `trials`."""
    alive = [t for t in trials if t.survived]
    columns: dict[str, list[float]] = {}
    for t in alive:
        for key, value in t.metrics.items():
            if isinstance(value, list) and all(isinstance(v, float) for v in value):
                columns.setdefault(key + "_norm", []).append(float(np.linalg.norm(value)))
            elif isinstance(value, float):
                columns.setdefault(key, []).append(value)
    percentiles = {
        key: tuple(float(p) for p in np.percentile(values, PERCENTILES))
        for key, values in columns.items()
        if len(values) == len(alive)
    }
    return MonteCarlo(
        asked,
        spread,
        tuple(trials),
        len(alive) / len(trials),
        wilson(len(alive), len(trials)),
        percentiles,
        min(trials, key=badness).number,
    )


def badness(trial: Trial) -> tuple[bool, float, float]:
    """Returns a key by which the worst trial comes first: lost, ended early, farthest off."""
    off = trial.metrics.get("position_max_m")
    return (
        trial.survived,
        float(trial.metrics["duration_s"]) if trial.stopped else np.inf,
        -(np.inf if off is None else float(off)),
    )


def wilson(good: int, count: int) -> tuple[float, float]:
    """Returns the 95 % confidence interval of a share (Wilson's score interval, 1927)."""
    p, z2 = good / count, _Z * _Z
    middle = (p + z2 / (2 * count)) / (1 + z2 / count)
    half = _Z / (1 + z2 / count) * sqrt(p * (1 - p) / count + z2 / (4 * count * count))
    return max(0.0, middle - half), min(1.0, middle + half)
