"""Vibration suppression by redundant thrust, on and off: mission `ring`, energy of the modes.

The body is plucked at rest and while it changes shape; `transform` itself, in which nothing but
noise makes it swing, shows what the damping costs there.

python benchmarks/vibration.py [--gains 0 5 10 20]
"""

import argparse
from typing import Any

from snakegen.errors import MissionError
from snakegen.robot.robot import load
from snakegen.simulation.flight.run import run
from snakegen.simulation.recording.recording import Recording
from snakegen.spec.loading import load_spec

STIFF = ["joint.servo.stiffness=1000", "control.rate_filter=5"]  # these ring at 11 Hz with 10 Hz
PLUCK = {"dragon4": 20.0, "dragon3": 5.0}  # N; dragon3 is lost beyond, rigid as well
CASES = (
    ("dragon4", "its own tubes", ["plant.link_stiffness=1300"]),
    ("dragon4", "soft tubes", ["plant.link_stiffness=100", "control.rate_filter=4"]),
    ("dragon4", "soft tubes, stiff servos", ["plant.link_stiffness=300", *STIFF]),
    ("dragon4", "8 links", ["chain.links=8", "plant.link_stiffness=1300"]),
    ("dragon4", "8 links, stiff servos", ["chain.links=8", "plant.link_stiffness=1300", *STIFF]),
    ("dragon3", "its own tubes", ["plant.link_stiffness=1300"]),
)
FLOWN: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("plucked along y", "ring", {"direction": "y"}),
    ("plucked along z", "ring", {"direction": "z"}),
    ("plucked along y while changing shape", "ring", {"direction": "y", "moving": True}),
    ("transform", "transform", {}),
)


def said(gain: float, flown: Recording) -> str:
    """Returns one flight's numbers."""
    m = flown.metrics
    if m["position_max_m"] > 0.5:
        return f"  {gain:5.1f}  lost: {m['position_max_m']:.2f} m off"
    passed = flown.verdict is not None and flown.verdict.passed
    mean = (
        f"{1e6 * m['modal_energy_mean_j']:8.1f} µJ on average, {'passed' if passed else 'FAILED'}"
    )
    if "swing_j_s" not in m:
        return f"  {gain:5.1f}  {mean}"
    label = flown.channel("modal_energy").labels[0]
    times = [m["decay_s"], m["modal_decay_s"][0]]
    told = " ".join("   –  " if t is None else f"{t:6.2f}" for t in times)
    swing = f"{m['swing_j_s']:9.2e} {m['modal_swing_j_s'][0]:9.2e}  {told}"
    return f"  {gain:5.1f}  {swing}  {mean} ({label})"


def main() -> None:
    """Prints, per robot, flight and gain, what swings and how long."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gains", type=float, nargs="+", default=[0.0, 5.0, 10.0, 20.0])
    given = parser.parse_args()
    print("gain [N s/m]; J s after the pluck, all modes and the lowest; s to a tenth of the energy")
    for name, title, overrides in CASES:
        for way, mission, options in FLOWN:
            print(f"{name}, {title}: {way}")
            for gain in given.gains if name != "dragon3" else (0.0, given.gains[-1]):
                more = [*overrides, f"control.vibration_damping={gain}"]
                robot = load(load_spec(name, overrides=more))
                try:
                    pluck = {"force": PLUCK[name]} if mission == "ring" else {}
                    flown = run(robot, mission, options=options | pluck)
                except MissionError as error:
                    print(f"  {gain:5.1f}  {error}", flush=True)
                    continue
                print(said(gain, flown), flush=True)


if __name__ == "__main__":
    main()
