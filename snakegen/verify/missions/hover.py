"""Hover in place: the robot starts in the air and holds its CoG and attitude."""

from typing import Any

import numpy as np

from snakegen.errors import MissionError
from snakegen.robot import Robot
from snakegen.verify.plan import Plan, level
from snakegen.verify.postures import bent, driven_joints, place

OPTIONS = {
    "duration": [10.0, "s"],
    "height": [1.5, "m, of the CoG"],
    "posture": [None, "posture file; a bent body by default"],
}


def applies(robot: Robot) -> bool:
    """A floating base and rotors."""
    return robot.floating and bool(robot.modules.apparatuses)


def plan(
    robot: Robot,
    rate: float,
    *,
    duration: float = 10.0,
    height: float = 1.5,
    posture: dict[str, Any] | None = None,
) -> Plan:
    """Returns the plan: constant CoG, level CoG frame, constant joints."""
    joints = bent(robot)
    if posture:
        q = robot.configuration({k: v for k, v in posture.items() if k != "base_rpy"})
        angles = dict(zip(robot.joint_names, robot.angles(q), strict=True))
        joints = np.array([angles[n] for n in driven_joints(robot)])
    if not duration > 0:
        raise MissionError(f"duration {duration:g} s: more than 0 is needed.")
    time = np.arange(round(duration * rate)) / rate
    cog = np.array([0.0, 0.0, height])
    still = np.zeros((len(time), 3))
    rotation, angular = level(len(time))
    return Plan(
        time,
        np.repeat(cog[None], len(time), axis=0),
        still,
        still,
        rotation,
        angular,
        np.repeat(joints[None], len(time), axis=0),
        place(robot, joints, cog),
    )
