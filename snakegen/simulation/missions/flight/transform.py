"""Change shape in the air while ascending: large joint motion, as in ZN23 Tables 4 and 6."""

from dataclasses import dataclass

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.errors import MissionError
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.plan import Plan, knots_for, level, through
from snakegen.simulation.flight.postures import bent, driven_joints, place, resting_height
from snakegen.simulation.flight.trim import TrimOption


@dataclass(frozen=True)
class Options(TrimOption):
    """Options of mission `transform`.

    Attributes:
        duration: s; as long as the motion needs by default
        rise: m, that the CoG ascends during the motion
        rate_limit: rad/s, fastest joint (ZN23 5.2.2: 0.31)
        floor: start at rest on the floor, not in the air
    """

    duration: float | None = None
    rise: float = 1.0
    rate_limit: float = 0.31
    floor: bool = False


_SETTLE = 2.0  # s, of hover before and after


def applies(robot: Robot) -> bool:
    """A floating base, rotors and driven joints."""
    return robot.floating and bool(robot.modules.apparatuses) and bool(driven_joints(robot))


def waypoints(robot: Robot) -> Floats:
    """Returns joint waypoints (m, k) [rad], each within limits.

    In dual-rotor mode: straight to yaws of 0.6 and 1.2, alternating (Table 4's motion). Else a
    squeeze like ZN23 Fig 11: from a planar arc the links turn up one after the other and lie down
    again; joints span −1.0 … 1.6 rad.
    """
    names = driven_joints(robot)
    low, high, _ = robot.limits(names)
    if robot.modules.control.get("mode") == "dual_rotor":
        yaws = [i for i, n in enumerate(names) if n.endswith("_yaw")]
        goal = np.zeros(len(names))
        for k, i in enumerate(yaws):
            goal[i] = (0.6, 1.2)[k % 2]
        return np.clip(np.array([np.zeros(len(names)), goal]), low, high)
    start = bent(robot)
    up, over, down = np.array(start), np.array(start), np.array(start)
    pitches = [i for i, n in enumerate(names) if n.endswith("_pitch")]
    yaws = [i for i, n in enumerate(names) if n.endswith("_yaw")]
    for k, i in enumerate(pitches):
        up[i] = (-1.0, 1.0)[k % 2] if k < 2 else 0.0
        over[i] = (0.0, -1.0, 1.0)[k % 3]
    for k, i in enumerate(yaws):
        over[i] = start[i] * (1.6, 0.6)[k % 2]
        down[i] = start[i] * (0.8, 1.6)[k % 2]
    return np.clip(np.array([start, up, over, down, start]), low, high)


def plan(robot: Robot, rate: float, options: Options) -> Plan:
    """Returns the plan: joints through the waypoints, CoG rising with them, CoG frame level."""
    goals = waypoints(robot)
    if not options.rate_limit > 0:
        raise MissionError(f"rate_limit {options.rate_limit:g} rad/s: more than 0 is needed.")
    lift = 3.0 if options.floor else 0.0
    knots = knots_for(goals, options.rate_limit, start=_SETTLE + lift)
    end = float(knots[-1]) + _SETTLE
    if options.duration is not None:
        if options.duration < end:
            raise MissionError(
                f"duration {options.duration:g} s is too short: the motion needs {end:.1f} s at "
                f"{options.rate_limit:g} rad/s."
            )
        end = options.duration
    time = np.arange(round(end * rate)) / rate
    joints, _, _ = through(time, knots, goals)
    start = place(robot, goals[0], np.array([0.0, 0.0, 1.2]))
    heights = [(0.0, 1.2), (float(knots[0]), 1.2), (float(knots[-1]), 1.2 + options.rise)]
    if options.floor:
        low = resting_height(robot, start)
        heights = [(0.0, low), (0.5, low), *heights[1:]]
        start[2] += low - 1.2
    path = np.array([[0.0, 0.0, h] for _, h in heights])
    position, velocity, acceleration = through(time, [t for t, _ in heights], path)
    rotation, angular = level(len(time))
    events = [(float(t), f"waypoint {k + 1} of {len(knots)}") for k, t in enumerate(knots)]
    return Plan(
        time,
        position,
        velocity,
        acceleration,
        rotation,
        angular,
        joints,
        start,
        on_floor=options.floor,
        window=(2.0, end) if options.floor else None,
        events=tuple(events),
    )
