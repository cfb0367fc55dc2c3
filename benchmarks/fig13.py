"""HA's Fig 13, an L-crank from a start off the path, with losses on one at a time and together.

HA's text: every state converges; the experiment leaves a steady-state error of each joint angle
which the simulation does not have, by friction with the ground, side slip of the wheels and the
load of the communication cables. Errors here are of t > 10 s: mean and RMS over seeds.

python benchmarks/fig13.py [--seeds 3]
"""

import argparse

import numpy as np

from snakegen.robot.robot import load
from snakegen.simulation.flight.run import run
from snakegen.spec.loading import load_spec

OFF = {"rolling": 0.0, "bearing": 0.0, "play": 0.0, "cable_mass": 0.0}
CASES: tuple[tuple[str, dict[str, float], float], ...] = (
    ("no losses", OFF, 0.8),
    ("rolling and bearing friction", OFF | {"rolling": 2e-4, "bearing": 1e-4}, 0.8),
    ("play of 20'", OFF | {"play": 0.0058}, 0.8),
    ("cable of 50 g/m", OFF | {"cable_mass": 0.05}, 0.8),
    ("all", {"cable_mass": 0.05}, 0.8),
    ("all, μ = 0.2", {"cable_mass": 0.05}, 0.2),
    ("all, μ = 0.1", {"cable_mass": 0.05}, 0.1),
    ("all, μ = 0.05", {"cable_mass": 0.05}, 0.05),
)


def row(name: str, errors: list[np.ndarray], slip: list[float], passed: int) -> str:
    """Returns one row: RMS of distance and heading, mean of each joint, slip."""
    e = np.concatenate(errors)
    distance = 1e3 * np.sqrt((e[:, :2] ** 2).sum(axis=1).mean())
    heading = 1e3 * np.sqrt((e[:, 2] ** 2).mean())
    joints = ", ".join(f"{1e3 * x:+.1f}" for x in e[:, 3:].mean(axis=0))
    spread = 1e3 * np.sqrt((e[:, 3:] ** 2).mean())
    return (
        f"| {name} | {distance:.2f} | {heading:.1f} | {joints} | {spread:.1f} "
        f"| {1e3 * np.mean(slip):.1f} | {passed} of {len(errors)} |"
    )


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    seeds = parser.parse_args().seeds
    print("| plant | distance RMS [mm] | heading RMS [mrad] | mean error of φ₁, φ₂, φ₃ [mrad] "
          "| φ RMS [mrad] | mean slip [mm/s] | passes |")  # fmt: skip
    print("|---|---|---|---|---|---|---|")
    options = {"start": "fig13", "plant": "kinematic"}
    found = run(load("screw4"), "lcrank", options=options)
    late = found.times("state_error") > 10.0
    error = found.channel("state_error").values[late]
    print(row("kinematic (HA's simulation)", [error], [0.0], int(found.verdict.passed)))
    for name, losses, friction in CASES:
        given = [f"screw_drive.friction={friction}"]
        given += [f"plant.losses.{k}={v}" for k, v in losses.items()]
        robot, errors, slip, passed = load(load_spec("screw4", overrides=given)), [], [], 0
        for seed in range(seeds):
            found = run(robot, "lcrank", seed=seed, options={"start": "fig13"})
            late = found.times("state_error") > 10.0
            errors.append(found.channel("state_error").values[late])
            slip.append(found.metrics["slip_mean_m_s"])
            passed += found.verdict.passed
        print(row(name, errors, slip, passed), flush=True)


if __name__ == "__main__":
    main()
