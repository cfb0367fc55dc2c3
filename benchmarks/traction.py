"""Slope and pull of screw drives: measured in contact over what `analyze traction` predicts.

Usage: python benchmarks/traction.py [slope|tow] [friction …]
Prints a row a case and the share of cases within 0.9 … 1.1.
"""

import sys
from collections.abc import Iterator

import numpy as np

from snakegen.robot.robot import load
from snakegen.simulation.flight.run import run
from snakegen.spec.loading import load_spec

STRAIGHT: dict[str, float] = {}
ARC = {"joint1_yaw": 0.5, "joint2_yaw": 0.5, "joint3_yaw": 0.5}
ZIGZAG = {"joint1_yaw": 0.6, "joint2_yaw": -0.6, "joint3_yaw": 0.6}
CASES = (
    ("straight", {}, STRAIGHT, 0),
    ("straight", {}, STRAIGHT, 1),
    ("straight", {}, STRAIGHT, 2),
    ("straight", {}, STRAIGHT, 3),
    ("arc", {}, ARC, 0),
    ("arc", {}, ARC, 2),
    ("zigzag", {}, ZIGZAG, 0),
    ("zigzag", {}, ZIGZAG, 2),
    ("six links", {"links": 6}, STRAIGHT, 0),
    ("helix 30°", {"overrides": ["screw_drive.helix_angle=0.5236"]}, STRAIGHT, 0),
)
SIDES = {
    "slope": ("side", ("nose_up", "nose_down", "left_down", "right_down")),
    "tow": ("towards", ("back", "ahead", "left", "right")),
}


def rows(mission: str, friction: float) -> Iterator[tuple[str, str, float, float, float]]:
    """Yields case, side, prediction, ratio and bound ratio (slopes in degrees, pulls in N)."""
    option, sides = SIDES[mission]
    for name, change, posture, side in CASES:
        more = [f"screw_drive.friction={friction}", *change.get("overrides", [])]
        spec = load_spec("screw4", links=change.get("links"), overrides=more)
        found = run(load(spec), mission, options={option: sides[side], "posture": posture})
        predicted = found.meta["facts"]["predicted"]
        shown = np.degrees(predicted) if mission == "slope" else predicted
        ratios = found.metrics["ratio"], found.metrics["bound_ratio"]
        yield name, sides[side], shown, *ratios


def main() -> None:
    """Prints the table."""
    words = sys.argv[1:]
    missions = [w for w in words if w in SIDES] or list(SIDES)
    frictions = [float(w) for w in words if w not in SIDES] or [0.2, 0.5, 0.8]
    for mission in missions:
        for friction in frictions:
            print(f"\n{mission}, friction {friction:g}")
            ratios = []
            for name, side, predicted, ratio, bound in rows(mission, friction):
                ratios.append(ratio)
                print(
                    f"  {name:10} {side:11} {predicted:7.2f} {ratio:6.3f} {bound:6.3f}", flush=True
                )
            r = np.array(ratios)
            good = int(((r >= 0.9) & (r <= 1.1)).sum())
            print(f"  {good} of {len(r)} within 0.9 … 1.1; least {r.min():.3f}, most {r.max():.3f}")


if __name__ == "__main__":
    main()
