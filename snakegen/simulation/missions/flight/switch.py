"""Change mode in the air: dual-rotor to virtual-single-rotor and back, where rank allows it."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.control.controller import flight_controller
from snakegen.control.switch import require_mode
from snakegen.errors import MissionError
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.plan import Plan, holding, ticks
from snakegen.simulation.flight.postures import (
    PostureOption,
    place,
    resting_attitude,
    resting_joints,
)
from snakegen.simulation.flight.trim import TrimOption
from snakegen.simulation.recording.recording import Recording


@dataclass(frozen=True)
class Options(PostureOption, TrimOption):
    """Options of mission `switch`.

    Attributes:
        at: s, of the first change
        stay: s in the other mode
        duration: s
        height: m, of the CoG
        force: change even where the rank test refuses
    """

    at: float = 3.0
    stay: float = 5.0
    duration: float = 12.0
    height: float = 1.5
    force: bool = False


_NAMES = ("dual-rotor mode", "virtual-single-rotor mode")


def applies(robot: Robot) -> bool:
    """A floating base, and apparatuses that all have two rotors and gimbals."""
    pairs = all(len(a.rotors) == 2 for a in robot.modules.apparatuses)
    return robot.floating and pairs and bool(robot.gimbal_names)


def plan(robot: Robot, rate: float, options: Options) -> Plan:
    """Returns the plan: hover, the other mode for a while, the first one again.

    Raises:
        ControlRefused: the other mode cannot hold the posture.
        MissionError: a flight that ends before the change.
    """
    if not (options.at >= 0.0 and options.stay > 0.0):
        raise MissionError(
            f"at {options.at:g} s, stay {options.stay:g} s: 0 or more, and more than 0, are needed."
        )
    if not options.at < options.duration:
        raise MissionError(
            f"duration {options.duration:g} s: more than {options.at:g} is needed, when it changes."
        )
    joints = resting_joints(robot, options.posture)
    attitude = resting_attitude(robot, options.posture, "switch")
    cog = np.array([0.0, 0.0, options.height])
    start = place(robot, joints, cog, attitude)
    controller = flight_controller(robot)
    own, other = controller.mode, 1 - controller.mode
    if not options.force:
        require_mode(controller, other, robot.angles(start), robot.base_pose(start)[0])
    time = ticks(options.duration, rate)
    mode = np.where(
        (time >= options.at) & (time < options.at + options.stay), float(other), float(own)
    )
    events = [(options.at, f"to {_NAMES[other]}")]
    if options.at + options.stay < options.duration:
        events.append((options.at + options.stay, f"back to {_NAMES[own]}"))
    return holding(
        time,
        joints,
        start,
        cog,
        mode=mode,
        events=tuple(events),
        facts={"switches_s": [t for t, _ in events]},
    )


def metrics(recording: Recording) -> dict[str, Any]:
    """Returns what the changes cost: thrust jump [N a tick] and the CoG's way off [m]."""
    time = recording.times("thrust_command")
    jump = np.abs(np.diff(recording.channel("thrust_command").values, axis=0)).max(axis=1)
    p = recording.channel("position").values
    jumps, strays = [], []
    for at in recording.meta["facts"]["switches_s"]:
        if at >= time[-1]:
            continue
        near = (time[1:] >= at - 1e-9) & (time[1:] < at + 1.5)
        before, after = (time >= at - 1.0) & (time < at), (time >= at) & (time < at + 2.0)
        jumps.append(float(jump[near].max()))
        strays.append(float(np.linalg.norm(p[after] - p[before].mean(axis=0), axis=1).max()))
    return {"switch_thrust_step_n": jumps, "switch_stray_m": strays}
