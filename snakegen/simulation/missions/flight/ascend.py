"""Take off from the floor and ascend: contact, spool-up and climb, as in ZN23 section 5.2.1."""

from dataclasses import dataclass

import numpy as np

from snakegen.errors import MissionError
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.plan import Plan, holding, through, ticks
from snakegen.simulation.flight.postures import (
    PostureOption,
    place,
    resting_attitude,
    resting_height,
    resting_joints,
)


@dataclass(frozen=True)
class Options(PostureOption):
    """Options of mission `ascend`.

    Attributes:
        height: m, of the CoG at the end
        climb: s, from the floor to there
        duration: s; climb and five seconds of hover by default
    """

    height: float = 3.0
    climb: float = 8.0
    duration: float | None = None


_IDLE = 0.5  # s on the floor before the climb
_HOVER = 5.0  # s at the top


def applies(robot: Robot) -> bool:
    """A floating base and rotors."""
    return robot.floating and bool(robot.modules.apparatuses)


def plan(robot: Robot, rate: float, options: Options) -> Plan:
    """Returns the plan: rest on the floor, climb along a quintic, hold."""
    if not options.climb > 0:
        raise MissionError(f"climb {options.climb:g} s: more than 0 is needed.")
    joints = resting_joints(robot, options.posture)
    resting_attitude(robot, options.posture, "ascend", level=True)
    start = place(robot, joints, np.array([0.0, 0.0, 1.0]))
    low = resting_height(robot, start)
    if options.height <= low:
        raise MissionError(
            f"height {options.height:g} m is no ascent: at rest the CoG is {low:.2f} m up."
        )
    start[2] += low - 1.0
    time = ticks(options.duration or _IDLE + options.climb + _HOVER, rate)
    path = np.array([[0.0, 0.0, low], [0.0, 0.0, low], [0.0, 0.0, options.height]])
    position, velocity, acceleration = through(time, [0.0, _IDLE, _IDLE + options.climb], path)
    return holding(
        time,
        joints,
        start,
        path[0],
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        on_floor=True,
        events=((_IDLE, "climb"), (_IDLE + options.climb, f"at {options.height:g} m")),
    )
