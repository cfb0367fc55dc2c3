"""Drive any path by follow-the-leader: line, arc, scurve, lcrank, or rounded way points."""

from typing import Any

from snakegen.errors import MissionError, near
from snakegen.robot.robot import Robot
from snakegen.screw_drive.ground_paths import NAMED, Path, waypoints
from snakegen.simulation.drive.plan import COMMON, DrivePlan, can_drive, following, lasting
from snakegen.simulation.drive.record import drive
from snakegen.simulation.recording.recording import Recording

OPTIONS: dict[str, list[Any]] = COMMON | {
    "path": ["scurve", "line, arc, scurve or lcrank"],
    "points": [None, "way points in place of it, m: [[0, 0], [2, 0], [2, 2]]"],
    "radius": [0.6, "m, of the corners at way points"],
}


def applies(robot: Robot) -> bool:
    """A floating base and two or more screw drums."""
    return can_drive(robot)


def fly(
    robot: Robot, *, seed: int, ideal: bool, options: dict[str, Any], progress: Any
) -> Recording:
    """Drives the path from rest on it and returns the judged recording."""
    o = {k: v[0] for k, v in OPTIONS.items()} | options
    path, start = _path(o)
    reference = following(robot, path, o["speed"], o["acceleration"], start)
    plan = DrivePlan(
        reference,
        reference.at(0.0)[0],
        lasting(o, reference.duration + 2.0),
        o["gain"],
        o["feedback"],
        events=((reference.duration, "end of the path"),),
        thresholds={"distance_rmse_m": {"at_most": 0.005}},
    )
    how = {"plant": o["plant"], "seed": seed, "ideal": ideal, "progress": progress}
    return drive(robot, "follow", plan, **how)


def _path(o: dict[str, Any]) -> tuple[Path, tuple[float, float, float]]:
    """Returns the path asked for, and where it starts."""
    if o["points"] is not None:
        return waypoints(o["points"], o["radius"])
    if o["path"] not in NAMED:
        raise MissionError(f"there is no path '{o['path']}'.{near(str(o['path']), NAMED)}")
    return NAMED[o["path"]](), (0.0, 0.0, 0.0)
