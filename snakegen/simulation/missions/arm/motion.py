"""Any motion of an arm, from a CSV table or a YAML file, by its servos and by inverse dynamics."""

from collections.abc import Callable
from typing import Any

from snakegen.errors import MissionError
from snakegen.inverse_kinematics.motion_files import motion_of
from snakegen.robot.robot import Robot
from snakegen.simulation.arm.run import arm_metrics, movable, run_arm, with_defaults
from snakegen.simulation.recording.recording import Recording

OPTIONS = {
    "file": [None, "CSV (time,joint1_pitch,… in s and rad) or YAML (sines: or time:); needed"],
    "duration": [None, "s, instead of the file's own; sines alone"],
    "ends": ["rest", "of a table: rest, or free for one that is cut out of a motion"],
    "gravity": ["0,0,-9.81", "m/s², world"],
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
    """Runs the motion of a file.

    Raises:
        MissionError: no file.
        AnalysisError: a file that cannot be read, a motion outside the limits.
    """
    given = with_defaults(OPTIONS, options)
    if given["file"] is None:
        raise MissionError("mission 'motion' needs a file: --option file=motion.csv.")
    motion = motion_of(
        robot, str(given["file"]), duration=given["duration"], ends=str(given["ends"])
    )
    return run_arm(
        robot, motion, mission="motion", seed=seed, ideal=ideal, options=given, progress=progress
    )


def metrics(recording: Recording) -> dict[str, Any]:
    """Returns how far the three torques are apart."""
    return arm_metrics(recording)
