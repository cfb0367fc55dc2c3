"""Take off from the floor and ascend: contact, spool-up and climb, as in ZN23 section 5.2.1."""

from typing import Any

import numpy as np

from snakegen.errors import MissionError
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.plan import Plan, holding, through, ticks
from snakegen.simulation.flight.postures import place, resting_height, resting_joints

OPTIONS = {
    "height": [3.0, "m, of the CoG at the end"],
    "climb": [8.0, "s, from the floor to there"],
    "duration": [None, "s; climb and five seconds of hover by default"],
    "posture": [None, "posture file; a bent body by default"],
}
_IDLE = 0.5  # s on the floor before the climb
_HOVER = 5.0  # s at the top


def applies(robot: Robot) -> bool:
    """A floating base and rotors."""
    return robot.floating and bool(robot.modules.apparatuses)


def plan(
    robot: Robot,
    rate: float,
    *,
    height: float = 3.0,
    climb: float = 8.0,
    duration: float | None = None,
    posture: dict[str, Any] | None = None,
) -> Plan:
    """Returns the plan: rest on the floor, climb along a quintic, hold."""
    if not climb > 0:
        raise MissionError(f"climb {climb:g} s: more than 0 is needed.")
    joints = resting_joints(robot, posture)
    start = place(robot, joints, np.array([0.0, 0.0, 1.0]))
    low = resting_height(robot, start)
    if height <= low:
        raise MissionError(f"height {height:g} m is no ascent: at rest the CoG is {low:.2f} m up.")
    start[2] += low - 1.0
    time = ticks(duration or _IDLE + climb + _HOVER, rate)
    path = np.array([[0.0, 0.0, low], [0.0, 0.0, low], [0.0, 0.0, height]])
    position, velocity, acceleration = through(time, [0.0, _IDLE, _IDLE + climb], path)
    return holding(
        time,
        joints,
        start,
        path[0],
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        on_floor=True,
        events=((_IDLE, "climb"), (_IDLE + climb, f"at {height:g} m")),
    )
