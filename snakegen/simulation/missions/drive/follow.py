"""Drive any path by follow-the-leader: line, arc, scurve, lcrank, or rounded waypoints."""

from dataclasses import dataclass
from typing import Any

from snakegen.errors import MissionError, near
from snakegen.robot.robot import Robot
from snakegen.screw_drive.ground_paths import NAMED, Path, waypoints
from snakegen.simulation.drive.plan import (
    DriveOptions,
    DrivePlan,
    at_most,
    can_drive,
    following,
    lasting,
)
from snakegen.simulation.drive.record import drive
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.run_settings import RunSettings


@dataclass(frozen=True)
class Options(DriveOptions):
    """Options of mission `follow`.

    Attributes:
        path: line, arc, scurve or lcrank
        points: waypoints in place of it, m: [[0, 0], [2, 0], [2, 2]]
        radius: m, of the corners at waypoints
    """

    path: str = "scurve"
    points: list[Any] | None = None
    radius: float = 0.6


BOUNDS = {
    "distance_excess_m": 0.0095,
    "distance_rmse_m": 0.005,
    "shape_rmse_rad": 0.009,
    "tilt_max_rad": 0.008,
    "slip_mean_m_s": 0.006,
}
"""2.5 to 3 medians of ten seeds of `screw4`."""


def applies(robot: Robot) -> bool:
    """A floating base and two or more screw drums."""
    return can_drive(robot)


def fly(robot: Robot, options: Options, settings: RunSettings) -> Recording:
    """Drives the path from rest on it and returns the judged recording."""
    path, start = _path(options)
    reference = following(robot, path, options.speed, options.acceleration, start)
    plan = DrivePlan(
        reference,
        reference.at(0.0)[0],
        lasting(options, reference.duration + 2.0),
        options.gain,
        options.feedback,
        events=((reference.duration, "end of the path"),),
        thresholds=at_most(BOUNDS, options),
    )
    return drive(robot, "follow", plan, plant=options.plant, settings=settings)


def _path(options: Options) -> tuple[Path, tuple[float, float, float]]:
    """Returns the path asked for, and where it starts."""
    if options.points is not None:
        return waypoints(options.points, options.radius)
    if options.path not in NAMED:
        raise MissionError(f"there is no path '{options.path}'.{near(str(options.path), NAMED)}")
    return NAMED[options.path](), (0.0, 0.0, 0.0)
