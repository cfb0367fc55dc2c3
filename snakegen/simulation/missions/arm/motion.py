"""Any motion of an arm, from a table or a YAML file, by its servos and by inverse dynamics."""

from dataclasses import dataclass
from typing import Any

from snakegen.errors import MissionError
from snakegen.inverse_kinematics.motion_files import motion_of
from snakegen.robot.robot import Robot
from snakegen.simulation.arm.metrics import arm_metrics
from snakegen.simulation.arm.run import ArmOptions, movable, run_arm
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.run_settings import RunSettings


@dataclass(frozen=True)
class Options(ArmOptions):
    """Options of mission `motion`.

    Attributes:
        file: table (CSV, Parquet, YAML; header time,joint1_pitch,… in s and rad) or YAML of sines
        duration: s, instead of the file's own; sines alone
        ends: of a table: rest, or free for one that is cut out of a motion
    """

    file: str | None = None
    duration: float | None = None
    ends: str = "rest"


def applies(robot: Robot) -> bool:
    """An arm: a fixed base, and a servo on every joint of the chain."""
    return movable(robot)


def fly(robot: Robot, options: Options, settings: RunSettings) -> Recording:
    """Runs the motion of a file.

    Raises:
        MissionError: no file.
        AnalysisError: a file that cannot be read, a motion outside the limits.
    """
    if options.file is None:
        raise MissionError("mission 'motion' needs a file: --option file=motion.csv.")
    motion = motion_of(robot, options.file, duration=options.duration, ends=options.ends)
    return run_arm(robot, motion, mission="motion", options=options, settings=settings)


def metrics(recording: Recording) -> dict[str, Any]:
    """Returns how far the three torques are apart."""
    return arm_metrics(recording)
