"""Vibration suppression by redundant thrust, on and off: mission `ring`, energy of the modes.

python benchmarks/vibration.py [--gains 0 5 10 20]
"""

import argparse

from snakegen.errors import MissionError
from snakegen.robot import load
from snakegen.spec_file import load_spec
from snakegen.verify.run import run

STIFF = "joint.servo.stiffness=1000"
CASES = (
    ("dragon4", "its own tubes", ["plant.link_stiffness=1300"]),
    ("dragon4", "soft tubes", ["plant.link_stiffness=100"]),
    ("dragon4", "soft tubes, stiff servos", ["plant.link_stiffness=300", STIFF]),
    ("dragon4", "8 links", ["chain.links=8", "plant.link_stiffness=1300"]),
    ("dragon4", "8 links, stiff servos", ["chain.links=8", "plant.link_stiffness=1300", STIFF]),
    ("dragon3", "its own tubes", ["plant.link_stiffness=1300"]),
)


def main() -> None:
    """Prints, per robot, way of the pluck and gain, what swings and how long."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gains", type=float, nargs="+", default=[0.0, 5.0, 10.0, 20.0])
    given = parser.parse_args()
    print("gain [N s/m]; J s after the pluck, all modes and the lowest; s to a tenth of the energy")
    for name, title, overrides in CASES:
        for way in ("y", "z"):
            print(f"{name}, {title}, plucked along {way}")
            for gain in given.gains:
                more = [*overrides, f"control.vibration_damping={gain}"]
                robot = load(load_spec(name, overrides=more))
                try:
                    flown = run(robot, "ring", options={"direction": way})
                except MissionError as error:
                    print(f"  {gain:5.1f}  {error}", flush=True)
                    continue
                m = flown.metrics
                if m["position_max_m"] > 0.5:
                    print(f"  {gain:5.1f}  lost: {m['position_max_m']:.2f} m off", flush=True)
                    continue
                label = flown.channel("modal_energy").labels[0]
                times = [m["decay_s"], m["modal_decay_s"][0]]
                told = " ".join("   –  " if t is None else f"{t:6.2f}" for t in times)
                print(
                    f"  {gain:5.1f}  {m['swing_j_s']:9.2e} {m['modal_swing_j_s'][0]:9.2e}  {told}  "
                    f"({label})",
                    flush=True,
                )


if __name__ == "__main__":
    main()
