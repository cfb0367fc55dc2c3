"""Hover in place: the robot starts in the air and holds its CoG and attitude."""

from dataclasses import dataclass

import numpy as np

from snakegen.robot.robot import Robot
from snakegen.simulation.flight.plan import Plan, holding, ticks
from snakegen.simulation.flight.postures import (
    PostureOption,
    place,
    resting_attitude,
    resting_joints,
)
from snakegen.simulation.flight.trim import TrimOption

UNTRIMMED = True  # shows the start itself, where it stays within the bounds


@dataclass(frozen=True)
class Options(PostureOption, TrimOption):
    """Options of mission `hover`.

    Attributes:
        duration: s
        height: m, of the CoG
        trim: s of hover before t = 0, in which the integrals run faster; if absent none, or 20
            where unequal rotors would carry the body off at the start
    """

    duration: float = 10.0
    height: float = 1.5


def applies(robot: Robot) -> bool:
    """A floating base and rotors."""
    return robot.floating and bool(robot.modules.apparatuses)


def plan(robot: Robot, rate: float, options: Options) -> Plan:
    """Returns the plan: constant CoG, level CoG frame, constant joints."""
    joints = resting_joints(robot, options.posture)
    attitude = resting_attitude(robot, options.posture, "hover")
    cog = np.array([0.0, 0.0, options.height])
    return holding(ticks(options.duration, rate), joints, place(robot, joints, cog, attitude), cog)
