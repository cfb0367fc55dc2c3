"""What flies from 2 to 32 links, by where the apparatuses are, and why the rest does not.

One gain set (Table 5's), one servo stiffness, links of dragon4; hover for ten seconds in a planar
wave with the usual noise.

python benchmarks/many_links.py [--links 2 3 4 8 16 32] [--stiffness 400] [--thrust 32]
"""

import argparse

import numpy as np

from snakegen.errors import SnakegenError
from snakegen.robot import load
from snakegen.spec_file import load_spec
from snakegen.verify.run import run

PLACES = {
    "every link": lambda n: ",".join(str(k) for k in range(1, n + 1)),
    "every other": lambda n: ",".join(str(k) for k in range(1, n + 1, 2)),
    "uneven": lambda n: ",".join(f"{k}@{(0.3, 0.7, 0.5)[k % 3]}" for k in range(1, n + 1)),
}


def line(
    links: int, places: str, stiffness: float, effort: float, thrust: float, duration: float
) -> str:
    """Returns what came of one robot: flown with its numbers, or why not."""
    overrides = [
        f"joint.servo={{stiffness: {stiffness}, damping: {stiffness / 20}, armature: 0.005}}",
        f"joint.effort={effort}",
        f"vectoring_apparatus.thrust_max={thrust}",
    ]
    try:
        spec = load_spec("dragon4", links=links, apparatus=places, overrides=overrides)
        robot = load(spec)
        options = {"duration": duration, "height": 3.0}
        recording = run(robot, "hover", options=options)
    except SnakegenError as error:
        return f"refused: {error}"
    m = recording.metrics
    own = m.get("min_self_distance_m")
    own_text = "  –  " if own is None else f"{own:.2f} m"
    numbers = (
        f"position {np.linalg.norm(m['position_rmse_m']):.3f} m, "
        f"attitude {np.linalg.norm(m['attitude_rmse_rad']):.3f} rad, "
        f"joint torque {100 * (m.get('joint_torque_use') or 0):3.0f} %, "
        f"apart {own_text}, σ_min {m['sigma_min'] or 0:.3f}"
    )
    verdict = recording.verdict
    if verdict is not None and verdict.passed:
        return f"flies: {numbers}"
    why = recording.meta["stopped"] or (verdict.summary() if verdict else "no verdict")
    return f"does not: {why} ({numbers})"


def main() -> None:
    """Prints a row a robot."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--links", type=int, nargs="+", default=[2, 3, 4, 6, 8, 12, 16, 24, 32])
    parser.add_argument("--stiffness", type=float, default=400.0, help="N m/rad, joint servos")
    parser.add_argument("--effort", type=float, default=7.0, help="N m, joint servos")
    parser.add_argument("--thrust", type=float, default=16.0, help="N, a rotor")
    parser.add_argument("--duration", type=float, default=6.0)
    given = parser.parse_args()
    servo = f"joint servos {given.stiffness:g} N m/rad, {given.effort:g} N m"
    print(f"gains of Table 5, {servo}, {given.thrust:g} N a rotor")
    for name, places in PLACES.items():
        for n in given.links:
            found = line(n, places(n), given.stiffness, given.effort, given.thrust, given.duration)
            print(f"{name:<12}{n:>3}  {found}", flush=True)


if __name__ == "__main__":
    main()
