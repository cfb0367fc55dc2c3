"""Hover in place: the robot starts in the air and holds its CoG and attitude."""

from typing import Any

import numpy as np

from snakegen.robot.robot import Robot
from snakegen.simulation.flight.plan import Plan, holding, ticks
from snakegen.simulation.flight.postures import place, resting_joints
from snakegen.simulation.flight.trim import OPTION as TRIM

OPTIONS = {
    "duration": [10.0, "s"],
    "height": [1.5, "m, of the CoG"],
    "posture": [None, "posture file; a bent body by default"],
    "trim": [0.0, TRIM[1]],
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
    joints = resting_joints(robot, posture)
    cog = np.array([0.0, 0.0, height])
    return holding(ticks(duration, rate), joints, place(robot, joints, cog), cog)
