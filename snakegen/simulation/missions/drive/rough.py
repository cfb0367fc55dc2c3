"""Drive over rough ground: tiles of random heights, drawn from the seed."""

from typing import Any

import numpy as np

from snakegen.errors import MissionError
from snakegen.robot.robot import Robot
from snakegen.simulation.drive.plan import COMMON, DrivePlan, can_drive, curled, lasting
from snakegen.simulation.drive.record import PASSAGE, drive
from snakegen.simulation.obstacles import tiles
from snakegen.simulation.recording.recording import Recording

OPTIONS: dict[str, list[Any]] = COMMON | {
    "height": [0.006, "m, of the highest tile; half of a wheel's radius: two of ten stick at 8 mm"],
    "size": [0.1, "m, of a tile"],
    "length": [1.2, "m, of the rough stretch"],
    "compliance": [10.0, "1; pitch servos are softer by this factor"],
    "bend": [0.5, "rad, of every yaw joint: a curled body stands firmer"],
}
_AHEAD = 0.2  # m, from the head to the first tile
_WIDE = 0.6  # m, of the rough stretch
_CATCH_UP = 6.0  # s after the reference has ended: three time constants of the default gain


def applies(robot: Robot) -> bool:
    """A floating base and two or more screw drums."""
    return can_drive(robot)


def fly(
    robot: Robot, *, seed: int, ideal: bool, options: dict[str, Any], progress: Any
) -> Recording:
    """Drives a line over the tiles and returns the judged recording."""
    o = {k: v[0] for k, v in OPTIONS.items()} | options
    if not (o["height"] > 0 and o["size"] > 0 and o["length"] >= o["size"]):
        raise MissionError("rough needs height, size and length above 0, length at least a tile.")
    way = _AHEAD + o["length"]
    reference = curled(robot, way, o["speed"], o["acceleration"], o["bend"])
    ground = tiles(
        (_AHEAD, _AHEAD + o["length"]), _WIDE, o["size"], o["height"], np.random.default_rng(seed)
    )
    plan = DrivePlan(
        reference,
        reference.at(0.0)[0],
        lasting(o, reference.duration + _CATCH_UP),
        o["gain"],
        o["feedback"],
        compliance=o["compliance"],
        obstacles=ground,
        events=((0.0, f"{len(ground)} tiles up to {1e3 * o['height']:.0f} mm ahead"),),
        facts={"tile_height_m": o["height"], "tile_size_m": o["size"]},
        thresholds=PASSAGE
        | {
            "distance_rmse_m": {"at_most": 0.12},
            "distance_excess_m": {"at_most": 0.35},
            "distance_end_m": {"at_most": 0.03},
            "slip_mean_m_s": {"at_most": 0.05},
        },
    )
    how = {"plant": o["plant"], "seed": seed, "ideal": ideal, "progress": progress}
    return drive(robot, "rough", plan, **how)
