"""Lose a rotor or an apparatus in flight: detected after a delay, flown without it from then on.

The verdict holds the flight to the analysis: where hover is in reach without the lost rotors it
must be held; where it is proved out of reach the body must leave it, as `left_hover` says.
"""

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
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.recording.signals import attitude_error, position_error

FAR, LEANS = 1.0, 0.2  # m, rad: a body that is farther off has left its hover
# rotors that stand still are at their lower limit
HOLDS: dict[str, dict[str, Any] | None] = {
    "position_max_m": {"at_most": FAR},
    "saturation_share": None,
}
FALLS: dict[str, dict[str, Any] | None] = HOLDS | dict.fromkeys(
    (
        "completed",
        "floor_contact_after_takeoff_s",
        "position_rmse_m",
        "position_max_m",
        "attitude_rmse_rad",
        "joint_torque_use",
        "gimbal_torque_limit_share",
    )
)
FALLS["left_hover"] = {"equals": True}


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
    left, above = margins_without(robot, start, rotors)
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
        facts={
            "lost": options.lost,
            "lost_part": part,
            "predicted_wrench_margin": left,
            "lost_at_s": options.at,
        },
        thresholds=FALLS if above < 0.0 else HOLDS,
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


def metrics(recording: Recording) -> dict[str, Any]:
    """Returns whether the body left its hover after the loss: by 1 m, .2 rad or onto the floor."""
    lost_at = recording.meta["facts"].get("lost_at_s")
    if lost_at is None:
        return {}
    worst = []
    for name, error in (("position", position_error), ("attitude", attitude_error)):
        after = recording.times(name) >= lost_at
        worst.append(np.abs(error(recording)[after]).max(initial=0.0))
    return {"left_hover": bool(worst[0] > FAR or worst[1] > LEANS)}


def margin_without(robot: Robot, q: Any, rotors: tuple[int, ...]) -> float:
    """Returns the lower bound of `margins_without`."""
    return margins_without(robot, q, rotors)[0]


def margins_without(robot: Robot, q: Any, rotors: tuple[int, ...]) -> tuple[float, float]:
    """Returns bounds of the mode's scaled wrench margin without `rotors`; negative: it falls.

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
        return float(found.attitude_altitude), float(found.attitude_altitude)
    left = robot.force_sets(q).without(robot.rotors.apparatus[list(rotors)])
    low, high = set_margins(left, a.hover_wrench, **scale).wrench_bounds
    return float(low), float(high)
