"""Tracking of both platforms at ten seeds beside the paper's tables (ZN23 Tables 4 and 6).

python benchmarks/flights.py [--seeds 10] [--mismatch 0.03]
"""

import argparse

import numpy as np

from snakegen.robot import load
from snakegen.spec_file import load_spec
from snakegen.verify.run import run

PAPER = {
    "dragon4": ("Table 6", [0.036, 0.038, 0.017], [0.026, 0.033, 0.033]),
    "dragon3": ("Table 4", [0.076, 0.180, 0.060], [0.033, 0.063, 0.062]),
}


def errors(name: str, seeds: int, mismatch: float) -> np.ndarray:
    """Returns (seeds, 6): position RMSE [m], attitude RMSE [rad]; NaN where a flight failed."""
    robot = load(load_spec(name, overrides=[f"plant.thrust_mismatch={mismatch}"]))
    rows = []
    for seed in range(seeds):
        recording = run(robot, "transform", seed=seed)
        m = recording.metrics
        done = recording.meta["stopped"] == "" and m["floor_contact_after_takeoff_s"] == 0.0
        rows.append(
            [*m["position_rmse_m"], *m["attitude_rmse_rad"]] if done else [np.nan] * 6
        )
    return np.array(rows)


def main() -> None:
    """Prints median and worst of each axis beside the paper's figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--mismatch", type=float, default=0.03)
    given = parser.parse_args()
    for name, (table, position, attitude) in PAPER.items():
        found = errors(name, given.seeds, given.mismatch)
        print(f"{name} transform, {given.seeds} seeds, mismatch {given.mismatch}: x y z, roll …")
        for label, row in (
            ("median", np.median(found, axis=0)),
            ("worst", found.max(axis=0)),
            (f"paper {table}", np.array([*position, *attitude])),
        ):
            print(f"  {label:<14}" + " ".join(f"{v:7.4f}" for v in row))


if __name__ == "__main__":
    main()
