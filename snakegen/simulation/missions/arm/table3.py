"""The paper's motion of an arm (ZS24 Table 3): servos, inverse dynamics and the law compared."""

from dataclasses import dataclass
from typing import Any

from snakegen.inverse_kinematics.zs24_table3 import table3
from snakegen.robot.robot import Robot
from snakegen.simulation.arm.metrics import arm_metrics
from snakegen.simulation.arm.run import ArmOptions, movable, run_arm
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.run_settings import RunSettings


@dataclass(frozen=True)
class Options(ArmOptions):
    """Options of mission `table3`.

    Attributes:
        duration: s
        amplitude: rad
        period: s
        gravity: m/s², world; the paper's run is weightless
    """

    duration: float = 6.0
    amplitude: float = 0.2
    period: float = 2.0
    gravity: str = "0,0,0"


def applies(robot: Robot) -> bool:
    """An arm: a fixed base, and a servo on every joint of the chain."""
    return movable(robot)


def fly(robot: Robot, options: Options, settings: RunSettings) -> Recording:
    """Runs 0.2 sin πt, signs + - + - …, on every joint."""
    motion = table3(
        robot, amplitude=options.amplitude, period=options.period, duration=options.duration
    )
    return run_arm(robot, motion, mission="table3", options=options, settings=settings)


def metrics(recording: Recording) -> dict[str, Any]:
    """Returns how far the three torques are apart."""
    return arm_metrics(recording)
