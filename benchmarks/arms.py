"""Arms: the hardest posture between search and proof, and whole bodies led into holes.

Run: OPENBLAS_NUM_THREADS=1 python benchmarks/arms.py
"""

import time

import numpy as np

import snakegen
from snakegen.analysis import tunnel
from snakegen.simulation.flight.run import run
from snakegen.statics.worst import worst_posture
from snakegen.statics.worst_bound import use_bound


def hardest() -> None:
    """Prints the bracket of the hardest posture: found by search, proved from above."""
    print("\nhardest posture: use found, use that no posture exceeds, gap; time of each")
    for name, wrenches in (
        ("arm6", None),
        ("arm6", "link7=0,0,-5,0,0,0"),
        ("arm6", "link7=3,0,-5,0,0,0"),
        ("screw4", None),
    ):
        robot = snakegen.load(name)
        q = robot.configuration()
        use_bound(robot, q)
        start = time.perf_counter()
        bound = use_bound(robot, q, wrenches=wrenches)
        proved = time.perf_counter() - start
        found = worst_posture(robot, q, hold="base", wrenches=wrenches)["use"]
        spent = time.perf_counter() - start - 2 * proved  # the search proves it once more
        print(
            f"  {name:7s} {wrenches or 'gravity alone':20s} {found:.4f} {bound:.4f} "
            f"{100 * (bound / found - 1):5.2f} %  search {spent:.2f} s, proof {proved:.2f} s"
        )


def holes() -> None:
    """Prints how deep the whole body of `arm6` follows its tip, and by its servos."""
    robot = snakegen.load("arm6")
    q, s = robot.configuration(), np.linspace(0, 0.8, 80)
    bent = np.stack([0.45 * np.sin(s / 0.45), 0.45 * (1 - np.cos(s / 0.45)), 0.1 * s**2], axis=1)
    print("\nwhole body into a hole: depth reached, body off the centreline, tip error [mm]")
    for what, given in (
        ("straight, base held", {"mouth": (1.25, 0.08, 0.08)}),
        ("straight, 0.5 m, base held", {"mouth": (1.25, 0.08, 0.08), "depth": 0.5}),
        (
            "in space, radius 0.45 m, base fed",
            {"path": np.array([1.602, 0, 0]) + bent, "feed": 1.0},
        ),
    ):
        found = tunnel.analyze(robot, q, room=0.02, **given)
        e = found.entry
        print(
            f"  {what:34s} {1e3 * e.depth[-1]:4.0f} of {1e3 * e.whole:4.0f}  "
            f"{1e3 * e.off.max():7.3f}  {1e3 * e.tip_error.max():.4f}  {e.why}"
        )
    m = run(robot, "tunnel").metrics
    print(
        f"  by servos under gravity, 300 mm: body {1e3 * m['body_off_max_m']:.3f}, "
        f"tip {1e3 * m['position_max_m']:.4f}"
    )


if __name__ == "__main__":
    hardest()
    holes()
