"""Drive over rough ground: tiles of random heights, drawn from the seed."""

from dataclasses import dataclass

import numpy as np

from snakegen.errors import MissionError
from snakegen.robot.robot import Robot
from snakegen.simulation.drive.plan import (
    DriveOptions,
    DrivePlan,
    at_most,
    can_drive,
    curled,
    lasting,
)
from snakegen.simulation.drive.record import PASSAGE, drive
from snakegen.simulation.obstacles import tiles
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.run_settings import RunSettings


@dataclass(frozen=True)
class Options(DriveOptions):
    """Options of mission `rough`.

    Attributes:
        height: m, of the highest tile; a quarter of a wheel's radius: one of ten sticks at 5 mm
        size: m, of a tile
        length: m, of the rough stretch
        compliance: 1; pitch servos are softer by this factor
        bend: rad, of every yaw joint: a curled body stands firmer
    """

    height: float = 0.003
    size: float = 0.1
    length: float = 1.2
    compliance: float = 10.0
    bend: float = 0.5


_AHEAD = 0.2  # m, from the head to the first tile
_WIDE = 0.6  # m, of the rough stretch
_CATCH_UP = 12.0  # s after the reference has ended: six time constants of the default gain
BOUNDS: dict[str, float] = {
    "distance_end_m": 0.0018,
    "shape_rmse_rad": 0.009,
    "tilt_max_rad": 0.07,
    "slip_mean_m_s": 0.0042,
}
"""Three medians of ten seeds of `screw4`."""
_LATE = dict.fromkeys(("distance_rmse_m", "distance_excess_m"))
"""Not judged: how long drums wait at an edge is the ground's own; that they arrive is judged."""


def applies(robot: Robot) -> bool:
    """A floating base and two or more screw drums."""
    return can_drive(robot)


def fly(robot: Robot, options: Options, settings: RunSettings) -> Recording:
    """Drives a line over the tiles and returns the judged recording."""
    if not (options.height > 0 and options.size > 0 and options.length >= options.size):
        raise MissionError("rough needs height, size and length above 0, length at least a tile.")
    way = _AHEAD + options.length
    reference = curled(robot, way, options.speed, options.acceleration, options.bend)
    ground = tiles(
        (_AHEAD, _AHEAD + options.length),
        _WIDE,
        options.size,
        options.height,
        np.random.default_rng(settings.seed),
    )
    plan = DrivePlan(
        reference,
        reference.at(0.0)[0],
        lasting(options, reference.duration + _CATCH_UP),
        options.gain,
        options.feedback,
        compliance=options.compliance,
        obstacles=ground,
        events=((0.0, f"{len(ground)} tiles up to {1e3 * options.height:.0f} mm ahead"),),
        facts={"tile_height_m": options.height, "tile_size_m": options.size},
        thresholds=PASSAGE | at_most(BOUNDS, options) | _LATE,
    )
    return drive(robot, "rough", plan, plant=options.plant, settings=settings)
