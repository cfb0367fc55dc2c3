"""Random scenes: which are solved, how fast, whether the certificate holds, and whether plans fly.

Ceilings, walls, pipes and rows of two walls with openings of random sizes and places, some with
posts beside them, for bodies of 4, 6 and 8 links. Each is planned with the demands of
`snakegen plan` and, where that fails, without margins. Accepted plans are checked by another code
path at 10 kHz (`plan_check`) and flown with noise.

Every scene has files of its own in FOLDER, so that runs may be cut short, continued and shared.

python benchmarks/plans.py FOLDER [--first 0] [--scenes 100] [--seed 0] [--only search|fly|bare]
"""

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
from plan_check import below_bounds

from snakegen.base import yaml_file
from snakegen.errors import PlanError
from snakegen.planning.motion_search import search
from snakegen.planning.plan_file import read_plan
from snakegen.robot.robot import Robot, load
from snakegen.scene.schema import read_scene
from snakegen.simulation.flight.run import prepare
from snakegen.simulation.trial_flight import search_and_fly
from snakegen.spec.loading import load_spec

LINKS = (4, 6, 8)
KINDS = ("ceiling", "wall", "pipe", "two walls")
BATTERY = 213.0 / 4.0  # Wh of a link
MINUTES = 1.0  # of CPU time at most


def scene(rng: np.random.Generator, number: int) -> dict[str, Any]:
    """Returns a random scene."""
    kind = KINDS[number % len(KINDS)]
    size = float(rng.uniform(0.45, 0.85))
    obstacles: list[dict[str, Any]] = []
    if kind == "ceiling":
        high = float(rng.uniform(1.3, 1.7))
        obstacles.append(plate("gate", [0.0, 0.0, high], 2, size, size, rng))
    elif kind == "wall":
        obstacles.append(plate("gate", [0.0, 0.0, 1.2], 0, size, 1.3 * size, rng))
    elif kind == "pipe":
        radius, long = float(rng.uniform(0.28, 0.45)), float(rng.uniform(0.1, 0.5))
        up = bool(rng.integers(2))
        start = np.array([0.0, 0.0, 1.3])
        end = start + long * (np.array([0.0, 0.0, 1.0]) if up else np.array([1.0, 0.0, 0.0]))
        line = [start.tolist(), end.tolist()]
        obstacles.append({"name": "gate", "kind": "pipe", "points": line, "radius": radius})
        hole = 2.0 * radius + 0.04
        middle = (0.5 * (start + end)).tolist()
        obstacles.append(plate("around", middle, 2 if up else 0, hole, hole, None))
    else:
        away = float(rng.uniform(1.0, 1.6))
        obstacles.append(plate("gate", [0.0, 0.0, 1.2], 0, size, size, rng))
        obstacles.append(plate("exit", [away, 0.0, 1.2], 0, size, size, rng))
    for k in range(int(rng.integers(0, 3))):
        x, y = rng.uniform(-1.8, 1.8, 2)
        if abs(x) > 0.6:
            line = [[float(x), float(y), 0.0], [float(x), float(y), 1.1]]
            post = {"kind": "cylinder", "from": line[0], "to": line[1], "radius": 0.05}
            obstacles.append({"name": f"post{k + 1}"} | post)
    last = "exit" if kind == "two walls" else "gate"
    return {"obstacles": obstacles, "start": {"below": "gate"}, "goal": {"above": last}}


def plate(
    name: str, centre: list[float], thin: int, wide: float, high: float, rng: Any
) -> dict[str, Any]:
    """Returns a plate of 5 m across axis `thin` with an opening, somewhere near its middle."""
    size = [5.0, 5.0, 5.0]
    size[thin] = 0.04
    if thin == 0:
        size[2] = 2.0 * centre[2]
    at = [0.0, 0.0] if rng is None else [float(x) for x in rng.uniform(-0.15, 0.15, 2)]
    opening = {"centre": at, "size": [wide, high]}
    return {"name": name, "centre": centre, "size": size, "openings": [opening]}


def searched(
    robot: Robot, data: dict[str, Any], folder: Path, seed: int, *, fly: bool
) -> dict[str, Any]:
    """Returns whether a scene is solved; writes it, and the plan where it has one.

    With `fly` as `snakegen plan` does it: a motion that falls in its trial flight is none.
    """
    path = folder / "scene.yaml"
    path.write_text(yaml_file.dump(data), encoding="utf-8")
    place = read_scene(path)
    start = time.process_time()
    motion, unmet = None, ["no way"]
    try:
        options: dict[str, Any] = {"minutes": MINUTES, "seed": seed, "clock": time.process_time}
        if fly:
            motion, trial = search_and_fly(robot, place, **options)
        else:
            motion, trial = search(robot, place, **options), None
        unmet = motion.unmet(place.demands)
        if trial is not None and not trial.passed:
            unmet = [f"its trial flight fails {', '.join(trial.failed)}"]
        why = "; ".join(unmet)
    except PlanError as error:
        why = str(error)
    row = {"solved": not unmet, "cpu": time.process_time() - start, "why": why}
    if motion is not None and not unmet:
        motion.file(place).write(folder / "plan.yaml")
        row |= {"sigmas": motion.tracking.sigmas, "seconds": float(motion.path.times[-1])}
        row |= {k: float(b.lower) for k, b in motion.certificate.bounds().items()}
    return row


def flown(robot: Robot, path: Path, seed: int) -> dict[str, Any]:
    """Returns what the check of a plan's certificate and its flight say."""
    plan = read_plan(yaml_file.read(path), path.name)
    row: dict[str, Any] = {"below": below_bounds(robot, plan.path, plan.solids, plan.certificate)}
    ready = prepare(robot, str(path))
    noise = np.random.default_rng(seed)
    recording = ready.flown(ready.world(), ready.imperfections, noise, seed, margins=False)
    m = recording.metrics
    names = ("position_rmse_m", "attitude_rmse_rad", "position_max_m", "saturation_share",
             "gimbal_torque_limit_share", "min_obstacle_distance_m")  # fmt: skip
    row |= {k: m.get(k) for k in names}
    row["touch"] = not m["min_obstacle_distance_m"] > 0.0
    row["lost"] = bool(recording.meta["stopped"])
    row["failed"] = [c.metric for c in recording.verdict.checks if not c.passed]
    return row


def totals(folder: Path) -> list[str]:
    """Returns the counts of a folder in words."""
    rows = [json.loads(p.read_text(encoding="utf-8")) for p in sorted(folder.glob("*/search.json"))]
    flights = [json.loads(p.read_text(encoding="utf-8")) for p in sorted(folder.glob("*/fly.json"))]
    solved = [r for r in rows if r["solved"]]
    bare = [json.loads(p.read_text(encoding="utf-8")) for p in folder.glob("*/bare.json")]
    out = [
        f"{len(rows)} scenes: {len(solved)} certified with margins; of {len(bare)} of the others "
        f"{sum(r['solved'] for r in bare)} without"
    ]
    for name in ("links", "kind"):
        for value in sorted({r[name] for r in rows}):
            mine = [r for r in rows if r[name] == value]
            out.append(f"  {name} {value}: {sum(r['solved'] for r in mine)} of {len(mine)}")
    if solved:
        times = [r["cpu"] for r in solved]
        out.append(f"search and certificate: median {np.median(times):.1f} s of CPU, most "
                   f"{max(times):.1f}; refused ones too: median "
                   f"{np.median([r['cpu'] for r in rows]):.1f} s")  # fmt: skip
    if flights:
        wrong = sum(any(v > 0.0 for v in r["below"].values()) for r in flights)
        passed = sum(not r["failed"] for r in flights)
        out.append(
            f"{len(flights)} checked and flown: {wrong} with a sample below a bound, "
            f"{sum(r['touch'] for r in flights)} touch, {sum(r['lost'] for r in flights)} lost, "
            f"{passed} pass every check"
        )
    return out


def main() -> None:
    """Prints one line a scene, then the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="of scenes, plans and results")
    parser.add_argument("--first", type=int, default=0, help="number of the first scene")
    parser.add_argument("--scenes", type=int, default=100, help="how many")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=("search", "fly", "bare"), help="one of the parts")
    given = parser.parse_args()
    robots: dict[int, Robot] = {}
    for number in range(given.first, given.first + given.scenes):
        links, kind = LINKS[number // len(KINDS) % len(LINKS)], KINDS[number % len(KINDS)]
        folder = given.folder / f"{number:03d}"
        folder.mkdir(parents=True, exist_ok=True)
        if links not in robots:  # links carry their batteries
            energy = f"plant.battery_energy={BATTERY * links:g}"
            robots[links] = load(load_spec("dragon4", links=links, overrides=[energy]))
        robot = robots[links]
        label = {"number": number, "links": links, "kind": kind}
        files = {k: folder / f"{k}.json" for k in ("search", "fly", "bare")}
        for part in [given.only] if given.only else files:
            if files[part].exists():
                continue
            if part == "fly":
                row = (
                    flown(robot, folder / "plan.yaml", given.seed + 1)
                    if (folder / "plan.yaml").exists()
                    else {}
                )
            elif part == "bare" and solved(files["search"]):
                row = {}
            else:
                data = scene(np.random.default_rng([given.seed, number]), number)
                free = {"demands": {"force_margin": 0.0, "torque_margin": 0.0}}
                where = folder if part == "search" else folder / "bare"
                where.mkdir(exist_ok=True)
                more = {} if part == "search" else free
                row = searched(robot, data | more, where, given.seed, fly=part == "search")
            if row:
                keep(files[part], label | row)
    print("\n".join(totals(given.folder)))


def solved(path: Path) -> bool:
    """Tells whether a scene whose result is at `path` was solved."""
    return path.exists() and bool(json.loads(path.read_text(encoding="utf-8"))["solved"])


def keep(path: Path, row: dict[str, Any]) -> None:
    """Writes a row and prints it."""
    path.write_text(json.dumps(row), encoding="utf-8")
    print(row, flush=True)


if __name__ == "__main__":
    main()
