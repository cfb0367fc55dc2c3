"""Random scenes: which are solved, how fast, whether the certificate holds, and whether plans fly.

Ceilings, walls, pipes and rows of two walls with openings of random sizes and places, some with
posts beside them, for bodies of 4, 6 and 8 links. Each is planned with the demands of
`snakegen plan` and, where that fails, without margins. Accepted plans are looked at at 10 kHz: a
sample below its bound would show an error in the proof. Then they are flown.

python benchmarks/plans.py [--scenes 100] [--seed 0] [--no-flights] [--stop SECONDS]
"""

import argparse
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from snakegen.base import yaml_file
from snakegen.errors import SnakegenError
from snakegen.planning.certificate import Certificate
from snakegen.planning.motion_search import Motion, search
from snakegen.planning.plan_file import PlanFile
from snakegen.robot.robot import Robot, load
from snakegen.scene.schema import Scene, read_scene
from snakegen.simulation.flight.run import run
from snakegen.spec.loading import load_spec

LINKS = (4, 6, 8)
KINDS = ("ceiling", "wall", "pipe", "two walls")
RATE = 10_000.0  # Hz, of the check
MINUTES = 5.0  # of wall time at most; the figures are CPU times


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


def below_bound(motion: Motion) -> dict[str, float]:
    """Returns how far samples at 10 kHz are below their bounds; 0 where none is.

    Distances are worked out at every sample that could be below, judged by its neighbours' motion:
    those of a coarser grid whose value is within reach of the bound.
    """
    body, path, proved = motion.body, motion.path, motion.certificate
    outer = body.shapes.outer
    out = dict.fromkeys(Certificate.__dataclass_fields__, 0.0)
    del out["intervals"]
    near: dict[str, list[float]] = {k: [] for k in out}
    step = 100.0 / RATE
    coarse = np.arange(0.0, path.times[-1], step)
    points = []
    for t in coarse:
        now = body.at_pose(path.at(t))
        found = body.distances(now.q)
        points.append(now.points)
        for name, part in (("clearance", found[:outer]), ("self_clearance", found[outer:])):
            value = part.min(initial=np.inf) - (now.slack if name == "clearance" else 0.0)
            out[name] = max(out[name], getattr(proved, name).lower - value)
            near[name].append(value)
    for name, values in zip(("force_margin", "torque_margin"), body.margins(np.array(points)),
                            strict=True):  # fmt: skip
        out[name] = max(0.0, getattr(proved, name).lower - float(values.min()))
    least = int(np.argmin(near["clearance"]))
    for t in np.arange(coarse[least] - step, coarse[least] + step, 1.0 / RATE):
        now = body.at_pose(path.at(t))
        value = body.distances(now.q)[:outer].min() - now.slack
        out["clearance"] = max(out["clearance"], proved.clearance.lower - float(value))
    return out


def flown(robot: Robot, motion: Motion, place: Scene, folder: Path) -> Any:
    """Returns the recording of the plan's flight."""
    file = PlanFile(
        robot.name, motion.body.names, motion.path, place.solids, motion.certificate.to_json(),
        vars(place.demands),
    )  # fmt: skip
    file.write(folder / "plan.yaml")
    return run(robot, str(folder / "plan.yaml"), seed=0)


def main() -> None:
    """Prints one line a scene, then the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--no-flights", action="store_true")
    parser.add_argument("--stop", type=float, default=float("inf"), help="s, after which to end")
    given = parser.parse_args()
    robots = {n: load(load_spec("dragon4", links=n)) for n in LINKS}
    rng = np.random.default_rng(given.seed)
    begun = time.monotonic()
    rows: list[dict[str, Any]] = []
    with TemporaryDirectory() as folder:
        for number in range(given.scenes):
            if time.monotonic() - begun > given.stop:
                break
            links = LINKS[number // len(KINDS) % len(LINKS)]
            data = scene(rng, number)
            row: dict[str, Any] = {"links": links, "kind": KINDS[number % len(KINDS)]}
            for demanded in (True, False):
                free = {"force_margin": 0.0, "torque_margin": 0.0}
                text = data if demanded else data | {"demands": free}
                path = Path(folder) / "scene.yaml"
                path.write_text(yaml_file.dump(text), encoding="utf-8")
                place = read_scene(path)
                start = time.process_time()
                try:
                    motion = search(robots[links], place, minutes=MINUTES, seed=given.seed)
                except SnakegenError as error:
                    row |= {"solved": False, "why": str(error)[:110]}
                    continue
                row["cpu"] = time.process_time() - start
                row["solved" if demanded else "bare"] = not motion.unmet(place.demands)
                row["why"] = "; ".join(motion.unmet(place.demands))
                if row.get("solved"):
                    break
            if row.get("solved"):
                row["below"] = max(below_bound(motion).values())
                row["clearance"] = motion.certificate.clearance.lower
                if not given.no_flights:
                    recording = flown(robots[links], motion, place, Path(folder))
                    m = recording.metrics
                    row["touch"] = not m["min_obstacle_distance_m"] > 0.0
                    row["least"] = m["min_obstacle_distance_m"]
                    row["lost"] = bool(recording.meta["stopped"])
                    row["passed"] = recording.verdict.passed
                    failed = [c.metric for c in recording.verdict.checks if not c.passed]
                    row["why"] = ", ".join(failed)
            rows.append(row)
            print(number, {k: round(v, 4) if isinstance(v, float) else v for k, v in row.items()},
                  flush=True)  # fmt: skip
    solved = [r for r in rows if r.get("solved")]
    bare = len(solved) + sum(bool(r.get("bare")) for r in rows)
    print(f"{len(rows)} scenes: {len(solved)} certified, {bare} with or without margins demanded")
    if solved:
        times = sorted(r["cpu"] for r in solved)
        print(
            f"search and certificate: median {np.median(times):.1f} s of CPU, most {times[-1]:.1f}"
        )
        print(f"samples below a bound: {sum(r['below'] > 0.0 for r in solved)} plans")
    if solved and not given.no_flights:
        print(
            f"flown: {sum(r['touch'] for r in solved)} touch, {sum(r['lost'] for r in solved)} "
            f"lost, {sum(r['passed'] for r in solved)} of {len(solved)} pass every check"
        )


if __name__ == "__main__":
    main()
