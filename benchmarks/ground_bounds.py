"""Every check of every mission of drives and arms at ten seeds, and planted faults that must fail.

A bound should be at most three medians and hold at every seed. Faults, one at a time: the second
drum of the wrong hand, servos of a screw, a yaw and a pitch joint at half strength. Lost cables are
planted in `tests/test_cable_stiffness.py`.

python benchmarks/ground_bounds.py [--seeds 10] [--only screw4] [--mission rough] [--faults]
"""

import argparse
import time
from typing import Any

import numpy as np

from snakegen.errors import SnakegenError
from snakegen.robot.robot import Robot, load
from snakegen.simulation.drive.hardware import DriveDraw
from snakegen.simulation.missions import mission as find
from snakegen.simulation.missions.options import checked_options
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.run_settings import RunSettings
from snakegen.spec.loading import load_spec

BENT = {"joint1_yaw": 0.4, "joint2_pitch": -0.5, "joint3_yaw": 0.6}
ON_GROUND = ("follow", "lcrank", "square", "rough", "pipe", "gap", "ledge", "slope", "tow")
CASES: tuple[tuple[str, list[str], str, dict[str, Any]], ...] = (
    *(("screw4", [], name, {}) for name in ON_GROUND),
    ("hybrid4", [], "drive_fly", {}),
    *(("arm6", [], name, {}) for name in ("tip_path", "tunnel", "table3")),
    ("arm6", [], "table3", {"gravity": "0,0,-9.81"}),
    ("dragon4", ["base=fixed"], "hold", {"posture": BENT}),
)
WRONG_HAND = "screw_drive.hand=[right, right, right, left]"
WEAK = ("screw1", "joint2_yaw", "joint1_pitch")


def fly(
    robot: Robot, mission: str, options: dict[str, Any], seed: int, draw: Any = None
) -> Recording:
    """Returns the judged recording of a seed."""
    module = find(mission, robot)
    chosen = checked_options(mission, module.Options, options)
    out: Recording = module.fly(robot, chosen, RunSettings(seed, draw=draw))
    return out


def table(name: str, given: list[str], mission: str, options: dict[str, Any], seeds: int) -> None:
    """Prints one mission's checks: median, worst seed, bound, bound over median."""
    robot, began = load(load_spec(name, overrides=given)), time.time()
    rows: dict[str, list[Any]] = {}
    failed: dict[str, list[int]] = {}
    for seed in range(seeds):
        for check in fly(robot, mission, options, seed).verdict.checks:
            rows.setdefault(check.metric, []).append(check)
            if not check.passed:
                failed.setdefault(check.metric, []).append(seed)
    spent = time.time() - began
    print(f"{name} {' '.join(given)} {mission} {options or ''}: {seeds} seeds, {spent:.0f} s")
    for metric, checks in rows.items():
        bad = f"  FAILED at {failed[metric]}" if metric in failed else ""
        values, bound = [c.value for c in checks], checks[0].bound
        if isinstance(bound, bool) or None in values:
            print(f"  {metric:<24} {values[0]} …{bad}")
            continue
        size = np.array([np.max(np.abs(v)) for v in values])
        bounds = np.array([np.max(np.abs(c.bound)) for c in checks])
        worst = size.max() if checks[0].kind == "at_most" else size.min()
        middle = float(np.median(size))
        ratio = float(np.median(bounds)) / middle if middle > 0 else np.inf
        print(
            f"  {metric:<24} median {middle:.4g}  worst {worst:.4g}  {checks[0].kind} "
            f"{np.median(bounds):.4g}  bound/median {ratio:.3g}{bad}"
        )
    print(flush=True)


def faults(name: str, given: list[str], mission: str, options: dict[str, Any], seeds: int) -> None:
    """Prints at how many seeds each planted fault of a drive fails, and by which checks."""
    robot = load(load_spec(name, overrides=given))
    wrong = load(load_spec(name, overrides=[*given, WRONG_HAND]))
    planted = {"wrong hand": DriveDraw(body=wrong)}
    planted |= {f"half {joint}": DriveDraw(strength={joint: 0.5}) for joint in WEAK}
    for fault, draw in planted.items():
        lost, names = 0, set()
        for seed in range(seeds):
            verdict = fly(robot, mission, options, seed, draw).verdict
            lost += not verdict.passed
            names |= {c.metric for c in verdict.failed}
        print(f"{name} {mission}, {fault}: fails at {lost} of {seeds}: {', '.join(sorted(names))}",
              flush=True)  # fmt: skip


def main() -> None:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--only", default="")
    parser.add_argument("--mission", default="")
    parser.add_argument("--faults", action="store_true")
    given = parser.parse_args()
    missions = given.mission.split(",")
    for name, overrides, mission, options in CASES:
        if given.only not in ("", name) or (missions != [""] and mission not in missions):
            continue
        if given.faults and name != "screw4":
            continue
        try:
            (faults if given.faults else table)(name, overrides, mission, options, given.seeds)
        except SnakegenError as error:
            print(f"{name} {' '.join(overrides)} {mission}: {error}", flush=True)


if __name__ == "__main__":
    main()
