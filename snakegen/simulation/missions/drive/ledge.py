"""Climb and leave a ledge: pitch joints lift and lower the body, screws drive (beyond HA).

HA drives in the plane. Here every drum is lifted just before an edge and set down behind it, one
at a time, while the others drive; before each lift the body bends so that the drums that stay down
carry it. The heights of the chain's nodes come from a small quadratic program: drums and casters
as low as the ground under them allows, the body as little bent as that leaves room for.
"""

import math
from dataclasses import dataclass

from snakegen.errors import MissionError
from snakegen.robot.robot import Robot
from snakegen.screw_drive.geometry import drive_geometry, yaw_joints
from snakegen.simulation.drive.gait import Pace, crossing
from snakegen.simulation.drive.plan import DriveOptions, DrivePlan, at_most, can_drive, lasting
from snakegen.simulation.drive.record import PASSAGE, drive
from snakegen.simulation.drive.run import pitch_joints
from snakegen.simulation.obstacles import ledge
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.run_settings import RunSettings


@dataclass(frozen=True)
class Options(DriveOptions):
    """Options of mission `ledge`.

    Attributes:
        height: m, of the ledge
        length: m, of the ledge
        lift: false: pitch joints stay at 0
        compliance: 1; pitch servos are softer by this factor
        speed: m/s
    """

    height: float = 0.03
    length: float = 1.2
    lift: bool = True
    compliance: float = 1.0
    speed: float = 0.1


BOUNDS = {
    "distance_excess_m": 0.4,
    "distance_rmse_m": 0.1,
    "distance_end_m": 0.0056,
    "shape_rmse_rad": 0.0105,
    "tilt_max_rad": 0.5,
    "slip_mean_m_s": 0.0024,
}
"""1.4 to 3 medians of ten seeds of `screw4`."""
_AHEAD = 0.4  # m, from the foremost drum to the edge


def applies(robot: Robot) -> bool:
    """A floating base, four or more screw drums, and a pitch joint between links."""
    if not can_drive(robot) or len(robot.modules.screws) < 4:
        return False
    return len(pitch_joints(robot)) == len(drive_geometry(robot).lengths) - 1


def fly(robot: Robot, options: Options, settings: RunSettings) -> Recording:
    """Drives over the ledge and returns the judged recording."""
    if not (options.height > 0 and options.length > 0 and options.speed > 0):
        raise MissionError("ledge needs height, length and speed above 0.")
    lengths = drive_geometry(robot).lengths
    if options.length < sum(lengths):
        raise MissionError(
            f"a ledge {options.length:g} m long is shorter than the body, {sum(lengths):.3f} m: "
            "two drums would be lifted at a time."
        )
    edges = (_AHEAD, _AHEAD + options.length)
    pace = Pace(options.speed, options.acceleration)
    gait = crossing(robot, edges, options.height, pace, _AHEAD)
    pitch, yaw = gait.steepest
    for kind, names, most in (
        ("pitch", pitch_joints(robot), pitch),
        ("yaw", yaw_joints(robot), yaw),
    ):
        low, high, _ = robot.limits(names)
        limit = min(float(-low.max()), float(high.min()))
        if most > limit:
            raise MissionError(
                f"a ledge of {options.height:g} m bends the {kind} joints to "
                f"{math.degrees(most):.1f}°; they turn {math.degrees(limit):.1f}°."
            )
    plan = DrivePlan(
        gait,
        gait.at(0.0)[0],
        lasting(options, gait.duration + 1.0),
        options.gain,
        options.feedback,
        lift=gait.lift if options.lift else None,
        compliance=options.compliance,
        obstacles=ledge(edges, 1.0, options.height),
        events=((0.0, f"a ledge of {1e3 * options.height:.0f} mm, {_AHEAD:g} m ahead"),),
        facts={"ledge_m": options.height, "pitch_max_rad": pitch},
        thresholds=PASSAGE | at_most(BOUNDS, options, Options.speed),
    )
    return drive(robot, "ledge", plan, plant=options.plant, settings=settings)
