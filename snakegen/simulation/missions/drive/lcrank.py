"""Drive an L-crank by follow-the-leader from a start off the path (HA Figs 9 and 13)."""

import math
from dataclasses import dataclass

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.errors import MissionError
from snakegen.robot.robot import Robot
from snakegen.screw_drive.geometry import yaw_joints
from snakegen.screw_drive.ground_paths import l_crank
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
    """Options of mission `lcrank`.

    Attributes:
        start: fig9, fig13 (HA's two starts) or path: on the path, at rest
        radius: m, of the corner
        duration: s
    """

    start: str = "fig9"
    radius: float = 0.6
    duration: float = 25.0


_STARTS = {"fig9": (0.1, 0.1, -1.1 * math.pi, 10), "fig13": (0.1, 0.04, -3.32, 9)}


BOUNDS = {"distance_excess_m": 0.009, "tilt_max_rad": 0.055, "slip_mean_m_s": 0.006}


def applies(robot: Robot) -> bool:
    """A floating base and two or more screw drums."""
    return can_drive(robot)


def first_state(name: str, joints: int, on_path: Floats) -> Floats:
    """Returns w(0) of HA's starts: joints at −π/10, −π/11 … (Fig 9) or −π/9, −π/10 … (Fig 13)."""
    if name == "path":
        return on_path
    if name not in _STARTS:
        raise MissionError(f"start '{name}': fig9, fig13 or path is needed.")
    x, y, heading, first = _STARTS[name]
    return np.array([x, y, heading, *(-math.pi / (first + i) for i in range(joints))])


def fly(robot: Robot, options: Options, settings: RunSettings) -> Recording:
    """Drives the mission and returns the judged recording."""
    path = l_crank(radius=options.radius)
    reference = following(robot, path, options.speed, options.acceleration)
    start = first_state(options.start, len(yaw_joints(robot)), reference.at(0.0)[0])
    end = "" if options.start == "path" else "_settled"
    bounds = BOUNDS | {f"distance_rmse{end}_m": 0.006, f"shape_rmse{end}_rad": 0.0085}
    plan = DrivePlan(
        reference,
        start,
        lasting(options, reference.duration + 2.0),
        options.gain,
        options.feedback,
        events=((0.0, f"start {options.start}"), (reference.duration, "end of the path")),
        thresholds=at_most(bounds, options),
    )
    return drive(robot, "lcrank", plan, plant=options.plant, settings=settings)
