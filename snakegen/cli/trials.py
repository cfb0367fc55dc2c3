"""`snakegen analyze flight … --trials N`: many flights, their survival, and a log of the worst."""

from pathlib import Path
from typing import Any

import click

from snakegen.cli.meshes import MeshFolder
from snakegen.cli.options import print_json

_SHOWN = (
    "position_rmse_m_norm",
    "position_max_m",
    "attitude_rmse_rad_norm",
    "thrust_headroom",
    "saturation_share",
    "joint_error_max_rad",
    "joint_torque_use",
    "gimbal_torque_use",
    "roll_moment_use",
    "battery_used",
    "energy_j",
    "min_obstacle_distance_m",
    "ratio",
    "recovery_s",
    "settling_s",
)


def fly_trials(
    machine: Any, mission: str, path: Path, count: int, workers: int | None, as_json: bool,
    *, seed: int, progress: Any, meshes: MeshFolder, **how: Any,
) -> int:  # fmt: skip
    """Flies trials, logs the worst to `path`, prints the outcome; returns the exit code."""
    from snakegen.errors import MissionError
    from snakegen.log import write
    from snakegen.simulation.flight.run import prepare
    from snakegen.simulation.monte_carlo import fly_again, monte_carlo

    own = _loop_of(machine, mission)
    if own is not None:
        if how["ideal"]:
            raise MissionError("trials draw a plant that is not ideal; leave ideal out.")
        with progress as step:
            found, worst = own(
                machine, mission, count, seed=seed, options=how["options"], progress=step
            )
    else:
        ready = prepare(machine, mission, **how)
        with progress as step:
            found = monte_carlo(ready, count, seed=seed, workers=workers, progress=step)
        worst = fly_again(ready, found.worst, seed=seed)
    path.parent.mkdir(parents=True, exist_ok=True)
    write(worst, path, mesh_folder=meshes.path())
    out = {"robot": machine.name, "mission": mission, "seed": seed} | found.to_json()
    # what was interrupted has not shown what was asked for
    passed = found.survival == 1.0 and len(found.trials) == count
    if as_json:
        print_json(out | {"log": str(path), "passed": passed})
    else:
        for line in outcome_lines(out, path):
            click.echo(line)
    if len(found.trials) < count:
        return 130  # by Ctrl-C; the log and the outcome are of the trials that were finished
    return 0 if passed else 3


def _loop_of(machine: Any, mission: str) -> Any:
    """Returns the trials of an arm's or a drive's mission, None of a flight's."""
    from snakegen.simulation.arm.run import movable
    from snakegen.simulation.arm.trials import arm_trials
    from snakegen.simulation.drive.trials import drive_trials
    from snakegen.simulation.missions import mission as find

    if movable(machine):
        return arm_trials
    module = find(mission, machine)
    return drive_trials if module.__name__.split(".")[-2] == "drive" else None


def outcome_lines(out: dict[str, Any], path: Path) -> list[str]:
    """Returns what a person reads of `MonteCarlo.to_json`."""
    low, high = out["survival_interval_95"]
    flown = "thrust" in out["uncertainty"]
    runs = "flights" if flown else "runs"
    lines = [
        f"{out['survived']} of {out['trials']} {runs} survived: {100 * out['survival']:.1f} % "
        f"(95 % interval {100 * low:.1f} … {100 * high:.1f} %); "
        f"{out['passed_all_checks']} passed every check",
        "drawn over " + ", ".join(_range(*item) for item in out["uncertainty"].items()),
    ]
    if out["trials"] < out["trials_asked"]:
        kept = f"kept: the {out['trials']} that were finished, and the log of their worst"
        lines.append(f"interrupted; {out['trials_asked']} were asked for; {kept}")
    if out["failed_checks"]:
        counts = ", ".join(f"{name} {count}" for name, count in out["failed_checks"].items())
        lines.append(f"failed checks: {counts}")
    if out["percentiles"]:
        head = "".join(f"{f'{p}th':>12}" for p in out["percentiles_of"])
        lines.append(f"  {'of the survivors':<26}{head}")
    for key in _SHOWN:
        if key in out["percentiles"]:
            numbers = "".join(f"{v:12.4g}" for v in out["percentiles"][key])
            lines.append(f"  {key:<26}{numbers}")
    worst = out["worst"]
    drawn = ", ".join(f"{k} {v:.3g}" for k, v in worst["drawn"].items())
    end = f", {worst['stopped']}" if worst["stopped"] else ""
    return [*lines, f"worst: trial {worst['number']} ({drawn}){end}", f"log of the worst: {path}"]


def _range(name: str, half: float) -> str:
    """Returns one of the ranges of `plant.uncertainty` in words."""
    if name == "delay":
        return f"{name} 0 … {1e3 * half:g} ms"
    if name == "friction":
        return f"{name} 0 … {100 * half:g} % of a servo's torque"
    if name == "offset_rad":
        return f"joint offset {1e3 * half:.3g} mrad (standard deviation)"
    if name == "drums":
        return f"drums' turn {100 * half:g} % (standard deviation)"
    return f"{name} ±{100 * half:g} %"
