"""Drive an L-crank by follow-the-leader from a start off the path (HA Figs 9 and 13)."""

import math
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.errors import MissionError
from snakegen.robot.robot import Robot
from snakegen.screw_drive.geometry import yaw_joints
from snakegen.screw_drive.ground_paths import l_crank
from snakegen.simulation.drive.plan import COMMON, DrivePlan, can_drive, following, lasting
from snakegen.simulation.drive.record import drive
from snakegen.simulation.recording.recording import Recording

OPTIONS: dict[str, list[Any]] = COMMON | {
    "start": ["fig9", "fig9, fig13 (HA's two starts) or path: on the path, at rest"],
    "radius": [0.6, "m, of the corner"],
    "duration": [25.0, "s"],
}
_STARTS = {"fig9": (0.1, 0.1, -1.1 * math.pi, 10), "fig13": (0.1, 0.04, -3.32, 9)}


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


def fly(
    robot: Robot, *, seed: int, ideal: bool, options: dict[str, Any], progress: Any
) -> Recording:
    """Drives the mission and returns the judged recording."""
    o = {k: v[0] for k, v in OPTIONS.items()} | options
    path = l_crank(radius=o["radius"])
    reference = following(robot, path, o["speed"], o["acceleration"])
    start = first_state(o["start"], len(yaw_joints(robot)), reference.at(0.0)[0])
    tracking = "distance_rmse_m" if o["start"] == "path" else "distance_rmse_settled_m"
    plan = DrivePlan(
        reference,
        start,
        lasting(o, reference.duration + 2.0),
        o["gain"],
        o["feedback"],
        events=((0.0, f"start {o['start']}"), (reference.duration, "end of the path")),
        thresholds={tracking: {"at_most": 0.003}},
    )
    how = {"plant": o["plant"], "seed": seed, "ideal": ideal, "progress": progress}
    return drive(robot, "lcrank", plan, **how)
