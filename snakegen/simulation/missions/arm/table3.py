"""The paper's motion of an arm (ZS24 Table 3): servos, inverse dynamics and the law compared."""

from collections.abc import Callable
from typing import Any

from snakegen.inverse_kinematics.zs24_table3 import table3
from snakegen.robot.robot import Robot
from snakegen.simulation.arm.run import arm_metrics, movable, run_arm, with_defaults
from snakegen.simulation.recording.recording import Recording

OPTIONS = {
    "duration": [6.0, "s"],
    "amplitude": [0.2, "rad"],
    "period": [2.0, "s"],
    "gravity": ["0,0,0", "m/s², world; the paper's run is weightless"],
    "lead": ["law", "what servos get beside the angle: none, speed, or law (speed and torque)"],
    "friction": [
        None,
        "static,sliding of every joint in N m, as in 0.1,0.06; else the servos' own",
    ],
}


def applies(robot: Robot) -> bool:
    """An arm: a fixed base, and a servo on every joint of the chain."""
    return movable(robot)


def fly(
    robot: Robot,
    *,
    seed: int = 0,
    ideal: bool = False,
    options: dict[str, Any] | None = None,
    progress: Callable[[int, int], Any] | None = None,
) -> Recording:
    """Runs 0.2 sin πt, signs + - + - …, on every joint."""
    given = with_defaults(OPTIONS, options)
    sizes = {k: float(given[k]) for k in ("amplitude", "period", "duration")}
    motion = table3(robot, **sizes)
    return run_arm(
        robot, motion, mission="table3", seed=seed, ideal=ideal, options=given, progress=progress
    )


def metrics(recording: Recording) -> dict[str, Any]:
    """Returns how far the three torques are apart."""
    return arm_metrics(recording)
