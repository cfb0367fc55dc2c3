"""Measured over predicted limit of a push: ten postures, both modes, both allocators.

Bodies whose gimbals are limited hover in few postures: they are pushed in one, every yaw at 1 rad.

python benchmarks/push.py [--postures 10] [--seed 1] [--noise] [--only 0,2]

`ratio` is over the prediction that `analyze margin` names; `loaded` over that of the deflected
body; `informed` over that which knows the thrust factors drawn; `first limit` as `limit_ratio`.
"""

import argparse
from collections.abc import Iterator

import numpy as np

from snakegen.errors import SnakegenError
from snakegen.robot.posture import angles_by_name
from snakegen.robot.robot import Robot, load
from snakegen.simulation.flight.postures import driven_joints, place
from snakegen.simulation.flight.run import prepare
from snakegen.simulation.flight.world import make_world
from snakegen.simulation.recording.clearance import clearances
from snakegen.simulation.recording.recording import Recording
from snakegen.spec.loading import load_spec

NARROW = tuple(f"vectoring_apparatus.{axis}_limit" for axis in ("roll", "pitch"))
CASES = (
    ("dragon4", "virtual_single_rotor", "force", "link1", ()),
    ("dragon4", "virtual_single_rotor", "torque", "link1", ()),
    ("dragon4", "virtual_single_rotor", "force", "link4", ()),
    ("dragon4", "virtual_single_rotor", "torque", "link4", ()),
    ("dragon4", "virtual_single_rotor", "force", "link1", (0.05, 0.05)),
    ("dragon4", "virtual_single_rotor", "torque", "link1", (0.05, 0.05)),
    ("dragon4", "virtual_single_rotor", "force", "link1", (0.6, 0.6)),
    ("dragon4", "virtual_single_rotor", "torque", "link1", (0.6, 0.6)),
    ("dragon4", "virtual_single_rotor", "force", "link1", (1.0, 0.25)),
    ("dragon4", "virtual_single_rotor", "torque", "link1", (1.0, 0.25)),
    ("dragon4", "dual_rotor", "wrench", "link1", ()),
    ("dragon3", "dual_rotor", "wrench", "link1", ()),
)  # preset, mode, kind, link, largest |φ| and |θ| of the gimbals, rad
YAWS = {f"joint{i}_yaw": 1.0 for i in (1, 2, 3)} | {f"joint{i}_pitch": 0.0 for i in (1, 2, 3)}
RAMP = {"until": 1.12, "slow": 80.0}  # at the mission's own pace, ended sooner
APART = 0.05  # m, between parts of a body that is pushed


def postures(robot: Robot, count: int, seed: int) -> Iterator[dict[str, float]]:
    """Yields postures: pitches to ±0.5 rad, yaws of 0.4 to 1.2 rad, clear of themselves."""
    rng, world = np.random.default_rng(seed), make_world(robot, floor=False)
    names, found = driven_joints(robot), 0
    while found < count:
        joints = np.array(
            [
                rng.uniform(-0.5, 0.5)
                if n.endswith("_pitch")
                else rng.choice([-1, 1]) * rng.uniform(0.4, 1.2)
                for n in names
            ]
        )
        q = place(robot, joints, np.zeros(3))
        row = np.concatenate([q[:3], q[[6, 3, 4, 5]], robot.angles(q)])
        if clearances(world, row[None])[1][0] > APART:
            found += 1
            named = angles_by_name(robot, q)
            yield {n: named[n] for n in names}


def main() -> None:
    """Prints a line a posture, then least, median and most of every ratio."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--postures", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--noise", action="store_true", help="the usual noise and mismatch")
    parser.add_argument("--only", default="", help="numbers of cases, by commas")
    given = parser.parse_args()
    chosen = [int(i) for i in given.only.split(",")] if given.only else range(len(CASES))
    for name, mode, kind, link, limits in (CASES[i] for i in chosen):
        changes = [f"{n}={x}" for n, x in zip(NARROW, limits, strict=False)]
        robot = load(load_spec(name, overrides=[f"control.mode={mode}", *changes]))
        about = f", gimbals within {limits} rad" if limits else ""
        about += ", usual noise" if given.noise else ""
        print(f"{name} {mode} {kind} on {link}{about}", flush=True)
        rows: dict[str, list[dict[str, float]]] = {"paper": [], "constrained": []}
        shapes = [YAWS] if limits else postures(robot, given.postures, given.seed)
        for i, posture in enumerate(shapes):
            options = {"kind": kind, "posture": posture, "link": link} | RAMP
            cells = []
            for allocator, kept in rows.items():
                try:
                    ready = prepare(
                        robot, "push", allocator=allocator, ideal=not given.noise, options=options
                    )
                    rng = np.random.default_rng(i)
                    recording = ready.flown(
                        ready.world(), ready.imperfections, rng, i, margins=False
                    )
                except SnakegenError as error:
                    cells.append(f"{allocator}: {error}")
                    continue
                kept.append(recording.metrics)
                cells.append(f"{allocator} {_cell(recording)}")
            print(f"  {i}: " + " | ".join(cells), flush=True)
        for allocator, kept in rows.items():
            for key in RATIOS:
                values = [m[key] for m in kept if m[key] is not None]
                if values:
                    least, middle, most = min(values), np.median(values), max(values)
                    print(
                        f"  {allocator} {key}: {least:.3f} / {middle:.3f} / {most:.3f} "
                        f"of {len(values)}",
                        flush=True,
                    )


RATIOS = ("ratio", "informed_ratio", "loaded_ratio", "limit_ratio")


def _cell(recording: Recording) -> str:
    """Returns prediction, ratios and what limits one flight."""
    m, found = recording.metrics, recording.meta["facts"]["forecast"]
    wrench = np.array(m["predicted_wrench"])
    size = f"{np.linalg.norm(wrench[:3]):5.1f} N {np.linalg.norm(wrench[3:]):5.2f} N·m"
    ratios = " ".join(f"{m[key] or np.nan:6.3f}" for key in RATIOS)
    return f"{size} {ratios}{' ' if m['tracking_lost'] else '+'} {' '.join(found['stopped'][:2])}"


if __name__ == "__main__":
    main()
