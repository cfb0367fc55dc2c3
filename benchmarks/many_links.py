"""What flies from 2 to 32 links, by where the apparatuses are, and what the rest would need.

One gain set (Table 5's), one servo stiffness, links of dragon4; hover for six seconds in a planar
wave with the usual noise. What does not fly as asked is tried again, in turn, in dual-rotor mode,
with more thrust, and with stronger joints; the row then names the first that flies.

python benchmarks/many_links.py [--links 2 3 4 8 16 32] [--stiffness 400] [--thrust 16]
"""

import argparse
from collections.abc import Iterator
from typing import Any

import numpy as np

from snakegen.errors import SnakegenError
from snakegen.robot.robot import load
from snakegen.simulation.flight.run import run
from snakegen.simulation.recording.recording import Recording
from snakegen.spec.loading import load_spec

PLACES = {
    "every link": lambda n: ",".join(str(k) for k in range(1, n + 1)),
    "every other": lambda n: ",".join(str(k) for k in range(1, n + 1, 2)),
    "uneven": lambda n: ",".join(f"{k}@{(0.3, 0.7, 0.5)[k % 3]}" for k in range(1, n + 1)),
}
THRUSTS = (18.0, 20.0, 25.0, 32.0, 40.0)  # N a rotor, tried where less does not do
EFFORTS = (10.0, 14.0, 20.0)  # N·m, tried where joints are at their limit
DUAL = "control.mode=dual_rotor"


def flight(links: int, places: str, overrides: list[str], duration: float) -> Recording:
    """Returns the hover of one robot, judged."""
    robot = load(load_spec("dragon4", links=links, apparatus=places, overrides=overrides))
    return run(robot, "hover", options={"duration": duration, "height": 3.0})


def outcome(links: int, places: str, overrides: list[str], duration: float) -> tuple[bool, str]:
    """Returns whether one robot flies, and its numbers or why not."""
    try:
        recording = flight(links, places, overrides, duration)
    except SnakegenError as error:
        return False, f"refused: {error}"
    m, verdict = recording.metrics, recording.verdict
    own = m.get("min_self_distance_m")
    numbers = (
        f"position {np.linalg.norm(m['position_rmse_m']):.3f} m, "
        f"attitude {np.linalg.norm(m['attitude_rmse_rad']):.3f} rad, "
        f"joint torque {100 * (m.get('joint_torque_use') or 0):3.0f} %, "
        f"gimbals at limit {100 * (m.get('gimbal_torque_limit_share') or 0):.1f} %, "
        f"apart {'–' if own is None else f'{own:.2f} m'}, σ_min {m['sigma_min'] or 0:.3f}"
    )
    if verdict is not None and verdict.passed:
        return True, f"flies: {numbers}"
    why = recording.meta["stopped"] or (verdict.summary() if verdict else "no verdict")
    return False, f"does not: {why} ({numbers})"


def attempts(servo: str, effort: float, thrust: float) -> Iterator[tuple[str, list[str]]]:
    """Returns what is tried, in turn: its name and its overrides."""

    def with_(push: float, torque: float, *more: str) -> list[str]:
        turned = f"vectoring_apparatus.thrust_max={push}"
        return [servo, f"joint.effort={torque}", turned, *more]

    yield "", with_(thrust, effort)
    yield "in dual-rotor mode", with_(thrust, effort, DUAL)
    more = [t for t in THRUSTS if t > thrust]
    for push in more:
        yield f"with {push:g} N a rotor", with_(push, effort)
        yield f"in dual-rotor mode with {push:g} N a rotor", with_(push, effort, DUAL)
    for torque in (e for e in EFFORTS if e > effort):
        for push in [t for t in more if t <= 25.0]:
            name = f"with {push:g} N a rotor and joints of {torque:g} N·m"
            yield name, with_(push, torque)


def row(links: int, places: str, tries: Iterator[tuple[str, list[str]]], duration: float) -> str:
    """Returns what came of one robot as asked, and, if need be, what makes it fly."""
    _, first = next(tries)
    flies, text = outcome(links, places, first, duration)
    if flies:
        return text
    for name, overrides in tries:
        flies, found = outcome(links, places, overrides, duration)
        if flies:
            return f"{text}\n{'':17}{name} it {found}"
    return f"{text}\n{'':17}nothing that was tried makes it fly"


def main() -> None:
    """Prints a row a robot."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--links", type=int, nargs="+", default=[2, 3, 4, 6, 8, 12, 16, 24, 32])
    parser.add_argument("--stiffness", type=float, default=400.0, help="N·m/rad, joint servos")
    parser.add_argument("--effort", type=float, default=7.0, help="N·m, joint servos")
    parser.add_argument("--thrust", type=float, default=16.0, help="N, a rotor")
    parser.add_argument("--duration", type=float, default=6.0)
    parser.add_argument("--filter", type=float, help="Hz, low-pass on rates; the spec's by default")
    given: Any = parser.parse_args()
    servo = f"stiffness: {given.stiffness}, damping: {given.stiffness / 20}, armature: 0.005"
    servo = f"joint.servo={{{servo}}}"
    more = [] if given.filter is None else [f"control.rate_filter={given.filter}"]
    named = f"joint servos {given.stiffness:g} N·m/rad, {given.effort:g} N·m"
    print(f"gains of Table 5, {named}, {given.thrust:g} N a rotor")
    for name, places in PLACES.items():
        for n in given.links:
            tries = attempts(servo, given.effort, given.thrust)
            tries = ((what, [*overrides, *more]) for what, overrides in tries)
            print(f"{name:<12}{n:>3}  {row(n, places(n), tries, given.duration)}", flush=True)


if __name__ == "__main__":
    main()
