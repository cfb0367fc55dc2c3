"""Drive round a square with heading and shape held, sideways too (HA section V, Fig 11)."""

from dataclasses import dataclass

from snakegen.robot.robot import Robot
from snakegen.screw_drive.geometry import yaw_joints
from snakegen.screw_drive.ground_paths import square
from snakegen.simulation.drive.plan import (
    DriveOptions,
    DrivePlan,
    at_most,
    can_drive,
    lasting,
    time_law,
)
from snakegen.simulation.drive.record import drive
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.run_settings import RunSettings


@dataclass(frozen=True)
class Options(DriveOptions):
    """Options of mission `square`.

    Attributes:
        side: m
        speed: m/s
    """

    side: float = 1.2
    speed: float = 0.2


BOUNDS = {
    "distance_excess_m": 0.017,
    "distance_rmse_m": 0.0095,
    "shape_rmse_rad": 0.0095,
    "tilt_max_rad": 0.0145,
    "slip_mean_m_s": 0.018,
}
"""2.5 to 3 medians of ten seeds of `screw4`."""


def applies(robot: Robot) -> bool:
    """A floating base and two or more screw drums."""
    return can_drive(robot)


def fly(robot: Robot, options: Options, settings: RunSettings) -> Recording:
    """Drives the mission and returns the judged recording; position is fed back, shape is not."""
    law = time_law(options.side, options.speed, options.acceleration)
    joints = len(yaw_joints(robot))
    reference = square(options.side, law.speed, law.acceleration, joints)
    k = float(options.gain)
    plan = DrivePlan(
        reference,
        reference.at(0.0)[0],
        lasting(options, reference.duration + 1.0),
        (k, k, k, *[0.0] * joints),
        options.feedback,
        events=tuple((i * law.duration, f"corner {i}") for i in range(1, 5)),
        thresholds=at_most(BOUNDS, options, 0.2),
    )
    return drive(robot, "square", plan, plant=options.plant, settings=settings)
