"""Lose a rotor or an apparatus in flight: detected after a delay, flown without it from then on."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.errors import MissionError, near
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.plan import Failure, Plan, holding, ticks
from snakegen.simulation.flight.postures import (
    PostureOption,
    place,
    resting_attitude,
    resting_joints,
)
from snakegen.simulation.flight.trim import TrimOption


@dataclass(frozen=True)
class Options(PostureOption, TrimOption):
    """Options of mission `fail`.

    Attributes:
        lost: rotor by its link's name, or apparatus by its number
        at: s, when it stops
        delay: s, until the controller knows
        duration: s
        height: m, of the CoG
    """

    lost: str = "apparatus2"
    at: float = 3.0
    delay: float = 0.1
    duration: float = 10.0
    height: float = 2.0


def applies(robot: Robot) -> bool:
    """A floating base and more than one rotor."""
    return robot.floating and len(robot.rotors.body) > 1


def plan(robot: Robot, rate: float, options: Options) -> Plan:
    """Returns the plan: hover through the failure. Its facts hold the margin that is left."""
    rotors = rotors_named(robot, options.lost)
    if options.delay < 0:
        raise MissionError(
            f"delay {options.delay:g} s: a failure cannot be known before it happens."
        )
    if not options.at >= 0.0:
        raise MissionError(f"at {options.at:g} s: the flight begins at 0.")
    if not options.at + options.delay < options.duration:
        raise MissionError(
            f"duration {options.duration:g} s: more than {options.at + options.delay:g} is needed, "
            "when the loss is known."
        )
    joints = resting_joints(robot, options.posture)
    attitude = resting_attitude(robot, options.posture, "fail")
    cog = np.array([0.0, 0.0, options.height])
    start = place(robot, joints, cog, attitude)
    left = margin_without(robot, start, rotors)
    part = lost_name(robot, options.lost)
    word = "can still hover level" if left >= 0 else "cannot hover level"
    return holding(
        ticks(options.duration, rate),
        joints,
        start,
        cog,
        failures=(Failure(options.at, options.at + options.delay, rotors),),
        events=(
            (options.at, f"{part} lost"),
            (options.at + options.delay, f"the controller knows; the robot {word}"),
        ),
        facts={"lost": options.lost, "lost_part": part, "predicted_wrench_margin": left},
        thresholds={
            "position_max_m": {"at_most": 1.0},
            # rotors that stand still are at their lower limit
            "saturation_share": None,
        },
        tracked=False,
    )


def rotors_named(robot: Robot, lost: str) -> tuple[int, ...]:
    """Returns the indices of the rotors that `lost` names.

    Raises:
        MissionError: no such rotor or apparatus; the near names are given.
    """
    links = [r.label for a in robot.modules.apparatuses for r in a.rotors]
    known: dict[str, tuple[int, ...]] = {name: (i,) for i, name in enumerate(links)}
    for j in range(len(robot.modules.apparatuses)):
        known[f"apparatus{j + 1}"] = tuple(np.flatnonzero(robot.rotors.apparatus == j).tolist())
    if str(lost) not in known:
        raise MissionError(f"{robot.name} has no rotor '{lost}' to fail.{near(str(lost), known)}")
    return known[str(lost)]


def lost_name(robot: Robot, lost: str) -> str:
    """Returns what is lost as people call it: an apparatus with its link."""
    number = lost.removeprefix("apparatus")
    return robot.apparatus_names[int(number) - 1] if number.isdigit() else lost


def margin_without(robot: Robot, q: Any, rotors: tuple[int, ...]) -> float:
    """Returns the scaled wrench margin of the robot's mode without `rotors`; negative: it falls.

    Dual-rotor mode: the exact margin of [f_z; τ]. Virtual single rotor: the certain margin without
    the whole apparatus, within gimbal limits and least thrusts.
    """
    from snakegen.analysis.allocation import allocation
    from snakegen.wrench_margins.thrust import thrust_margins
    from snakegen.wrench_margins.vectored import set_margins

    a = allocation(robot, q)
    scale: dict[str, Any] = {"force_scale": robot.force_scale, "torque_scale": robot.torque_scale}
    if robot.modules.control.get("mode") == "dual_rotor":
        most = np.array(robot.rotors.thrust_max)
        most[list(rotors)] = 0.0
        least = np.minimum(robot.rotors.thrust_min, most)
        found = thrust_margins(a.dual, least, most, a.hover_wrench, **scale)
        return float(found.attitude_altitude)
    left = robot.force_sets(q).without(robot.rotors.apparatus[list(rotors)])
    return float(set_margins(left, a.hover_wrench, **scale).wrench)
