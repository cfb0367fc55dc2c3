"""Every check of every mission's verdict at ten seeds: median, worst seed, bound; planted faults.

A bound should be at most three medians, and hold at every seed; each planted fault should fail at
every seed: a rotor's drag torque of the wrong sign in the MJCF, 15 % of thrust mismatch, an IMU
0.05 rad off (drawn and as a fixed tilt).

python benchmarks/mission_bounds.py [--seeds 10] [--only dragon4] [--mission hover] [--faults]
"""

import argparse
import copy
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from snakegen.errors import SnakegenError
from snakegen.robot.robot import load
from snakegen.simulation.flight.run import prepare, run
from snakegen.simulation.missions import mission as find
from snakegen.spec.loading import load_spec

LATE = ["plant.delay=0.02", "vectoring_apparatus.motor_lag=0.06"]
DUAL = ["control.mode=dual_rotor"]
FLOWN = ("hover", "transform", "switch", "ascend", "squeeze", "step", "gust", "ring", "fail")
CASES: tuple[tuple[str, list[str], tuple[str, ...]], ...] = (
    ("dragon4", [], FLOWN),
    ("dragon4", DUAL, ("hover", "transform", "ascend")),
    ("dragon3", [], FLOWN),
    ("dragon3", LATE, ("hover", "transform", "ascend")),
    ("hybrid4", [], ("hover", "transform", "ascend", "drive_fly")),
    ("dragon4", ["chain.links=6"], ("hover", "transform")),
    ("dragon4", ["chain.links=12"], ("hover", "transform")),
    ("screw4", [], ("follow", "lcrank", "square", "gap", "pipe", "rough", "ledge")),
    ("arm6", [], ("tip_path", "tunnel", "table3")),
)
FAULTS = ("gear", "mismatch", "bias", "tilt")


def recordings(
    name: str, overrides: list[str], mission: str, seeds: int, fault: str = ""
) -> Iterator[Any]:
    """Yields the judged recordings of seeds 0, 1, …"""
    more = {"mismatch": ["plant.thrust_mismatch=0.15"], "bias": ["plant.attitude_bias=0.05"]}
    robot = load(load_spec(name, overrides=[*overrides, *more.get(fault, [])]))
    if hasattr(find(mission, robot), "fly"):
        for seed in range(seeds):
            yield run(robot, mission, seed=seed)
        return
    ready = prepare(robot, mission)
    world = ready.world()
    if fault == "gear":
        model = copy.copy(world.model)
        model.actuator_gear[world.rotors[0], 5] *= -1.0
        world = replace(world, model=model)
    for seed in range(seeds):
        rng: Any = np.random.default_rng(seed)
        yield ready.flown(
            world, ready.imperfections, Tilted(rng) if fault == "tilt" else rng, seed, margins=False
        )


class Tilted:
    """A generator whose first three-number draw, the IMU's bias, is 0.05 rad about y."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng, self.told = rng, False

    def __getattr__(self, name: str) -> Any:
        return getattr(self.rng, name)

    def uniform(self, low: float = 0.0, high: float = 1.0, size: Any = None) -> Any:
        """Returns uniform numbers, but for the bias."""
        drawn = self.rng.uniform(low, high, size)
        if size == 3 and not self.told:
            from scipy.special import ndtr

            self.told = True
            return ndtr(np.array([0.0, 0.05 / 0.00698, 0.0]))
        return drawn


def table(name: str, overrides: list[str], mission: str, seeds: int) -> None:
    """Prints one mission's checks."""
    found: dict[str, list[Any]] = {}
    bounds: dict[str, Any] = {}
    failed: dict[str, list[int]] = {}
    for seed, recording in enumerate(recordings(name, overrides, mission, seeds)):
        for c in recording.verdict.checks:
            found.setdefault(c.metric, []).append(c.value)
            bounds[c.metric] = c
            if not c.passed:
                failed.setdefault(c.metric, []).append(seed)
    print(f"{name} {' '.join(overrides)} {mission}: {seeds} seeds")
    for metric, values in found.items():
        c = bounds[metric]
        if any(v is None for v in values) or isinstance(values[0], bool):
            print(f"  {metric:<28} {values[:3]} …  failed at {failed.get(metric, [])}")
            continue
        rows = np.array(values, float).reshape(seeds, -1)
        worst = rows.max(axis=0) if c.kind == "at_most" else rows.min(axis=0)
        seed = int((rows / np.maximum(np.abs(np.atleast_1d(c.bound)), 1e-12)).max(axis=1).argmax())
        middle = np.median(rows, axis=0)
        share = np.max(np.atleast_1d(c.bound) / np.maximum(middle, 1e-12))
        print(
            f"  {metric:<28} median {_row(middle)}  worst {_row(worst)} (seed {seed})  bound "
            f"{_row(np.atleast_1d(c.bound))}  bound/median {share:.3g}"
            + (f"  FAILED at {failed[metric]}" if metric in failed else "")
        )
    print(flush=True)


def faults(name: str, overrides: list[str], mission: str, seeds: int) -> None:
    """Prints at how many seeds each planted fault fails, and by which checks."""
    for fault in FAULTS:
        lost, names = 0, set()
        for recording in recordings(name, overrides, mission, seeds, fault):
            lost += not recording.verdict.passed
            names |= {c.metric for c in recording.verdict.failed}
        print(f"{name} {mission}, {fault}: fails at {lost} of {seeds}: {', '.join(sorted(names))}")


def _row(values: Any) -> str:
    return " ".join(f"{v:.4g}" for v in values)


def main() -> None:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--only", default="")
    parser.add_argument("--mission", default="")
    parser.add_argument("--faults", action="store_true")
    given = parser.parse_args()
    for name, overrides, missions in CASES:
        for mission in missions:
            if given.only not in ("", name) or given.mission not in ("", mission):
                continue
            try:
                if not given.faults:
                    table(name, overrides, mission, given.seeds)
                elif mission in ("hover", "transform", "switch") and not overrides:
                    faults(name, overrides, mission, given.seeds)
            except SnakegenError as error:
                print(f"{name} {' '.join(overrides)} {mission}: {error}", flush=True)


if __name__ == "__main__":
    main()
