"""What a push bears over what the analysis predicts: ten postures, both modes, both allocators.

python benchmarks/push.py [--postures 10] [--seed 1] [--noise] [--only 0,2]

Beside the ratio to what was promised: that to what the commanded posture holds by the analysis,
and to what the body can hold as it gives way under the push.
"""

import argparse
from collections.abc import Iterator

import numpy as np

from snakegen.errors import SnakegenError
from snakegen.posture import angles_by_name
from snakegen.robot import Robot, load
from snakegen.spec_file import load_spec
from snakegen.verify.clearance import clearances
from snakegen.verify.postures import driven_joints, place
from snakegen.verify.run import run
from snakegen.verify.world import make_world

CASES = (
    ("dragon4", "virtual_single_rotor", "force", "link1"),
    ("dragon4", "virtual_single_rotor", "torque", "link1"),
    ("dragon4", "dual_rotor", "wrench", "link1"),
    ("dragon3", "dual_rotor", "wrench", "link1"),
    ("dragon4", "virtual_single_rotor", "force", "link4"),
)
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
    """Prints a line a posture: predicted wrench, ratio of each allocator, what stops it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--postures", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--noise", action="store_true", help="the usual noise and mismatch")
    parser.add_argument("--only", default="0,1,2,3,4", help="numbers of cases, by commas")
    given = parser.parse_args()
    for name, mode, kind, link in (CASES[int(i)] for i in given.only.split(",")):
        robot = load(load_spec(name, overrides=[f"control.mode={mode}"]))
        ratios: dict[str, list[float]] = {"constrained": [], "paper": []}
        print(f"{name} {mode} {kind} on {link}" + (", usual noise" if given.noise else ""))
        for i, posture in enumerate(postures(robot, given.postures, given.seed)):
            cells = []
            for allocator, kept in ratios.items():
                options = {"kind": kind, "posture": posture, "link": link}
                try:
                    recording = run(
                        robot, "push", seed=i, allocator=allocator, ideal=not given.noise,
                        options=options,
                    )  # fmt: skip
                except SnakegenError as error:
                    cells.append(f"{allocator}: {error}")
                    continue
                m, f = recording.metrics, recording.meta["facts"]["forecast"]
                wrench = np.array(m["predicted_wrench"])
                size = f"{np.linalg.norm(wrench[:3]):5.1f} N {np.linalg.norm(wrench[3:]):5.2f} N·m"
                kept.append(m["ratio"])
                mark = " " if m["tracking_lost"] else "+"
                at = m["limit_ratio"] or np.nan
                end = f"ratio {m['ratio']:5.3f}{mark}, first limit at {at:5.3f}"
                for key in ("held_at_posture", "held_loaded"):
                    whole = f[key] or np.nan
                    end += f", {m['ratio'] * f['held'] / whole:5.3f} of {key[5:]}"
                cells.append(f"{allocator} {size} {end} {f['stopped'][:2]}")
            print(f"  {i}: " + " | ".join(cells), flush=True)
        for allocator, kept in ratios.items():
            if kept:
                print(
                    f"  {allocator}: least {min(kept):.3f}, median {np.median(kept):.3f}, "
                    f"most {max(kept):.3f} of {len(kept)}"
                )


if __name__ == "__main__":
    main()
