"""Drive through a duct no wider than the body, its ceiling touching, and compare with open ground.

A snake that undulates needs room beside it; drums do not. Wheels that touch walls and ceiling roll
there too: straight ahead, their no-slip conditions are those of the ground.
"""

from dataclasses import dataclass, replace

from snakegen.robot.robot import Robot
from snakegen.simulation.drive.plan import (
    DriveOptions,
    DrivePlan,
    at_most,
    can_drive,
    following,
    lasting,
)
from snakegen.simulation.drive.record import PASSAGE, beside_open_ground, drive
from snakegen.simulation.obstacles import duct
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.run_settings import RunSettings


@dataclass(frozen=True)
class Options(DriveOptions):
    """Options of mission `gap`.

    Attributes:
        side: m, room on each side of the drums
        above: m, room over the drums; less than 0: the ceiling presses on them
        entry: m ahead of the head, where the duct begins
        length: m, of the duct
    """

    side: float = 0.0
    above: float = -0.0005
    entry: float = 0.25
    length: float = 1.2


BOUNDS = {
    "distance_excess_m": 0.034,
    "distance_rmse_m": 0.023,
    "distance_end_m": 0.0065,
    "shape_rmse_rad": 0.009,
    "tilt_max_rad": 0.047,
    "slip_mean_m_s": 0.006,
}
"""2.5 to 3 medians of ten seeds of `screw4`."""


def applies(robot: Robot) -> bool:
    """A floating base and two or more screw drums."""
    return can_drive(robot)


def fly(robot: Robot, options: Options, settings: RunSettings) -> Recording:
    """Drives open ground first, then the duct, and returns the judged recording of the latter."""
    body = sum(robot.modules.lengths.values())
    path = [("line", options.entry + options.length + body + 0.1)]
    reference = following(robot, path, options.speed, options.acceleration)
    width = 2.0 * (robot.modules.screws[0].radius + options.side)
    height = 2.0 * robot.modules.screws[0].radius + options.above
    span = (options.entry, options.entry + options.length)
    plan = DrivePlan(
        reference,
        reference.at(0.0)[0],
        lasting(options, reference.duration + 1.0),
        options.gain,
        options.feedback,
        obstacles=duct(span, width, height),
        events=((0.0, f"a duct {width:.3f} m wide and {height:.3f} m high lies ahead"),),
        facts={"width_m": width, "height_m": height},
        thresholds=PASSAGE | at_most(BOUNDS, options),
    )
    open_plan = DrivePlan(reference, plan.start, plan.duration, plan.gain, plan.feedback)
    quiet = replace(settings, progress=None)
    free = drive(robot, "gap", open_plan, plant=options.plant, settings=quiet).metrics
    return drive(
        robot, "gap", plan, plant=options.plant, settings=settings, more=beside_open_ground(free)
    )
