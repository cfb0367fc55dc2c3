"""Lose a rotor or an apparatus in flight: detected after a delay, flown without it from then on."""

from typing import Any

import numpy as np

from snakegen.errors import MissionError, near
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.plan import Failure, Plan, holding, ticks
from snakegen.simulation.flight.postures import place, resting_joints
from snakegen.simulation.flight.trim import OPTION as TRIM

OPTIONS = {
    "lost": ["apparatus2", "rotor by its link's name, or apparatus by its number"],
    "at": [3.0, "s, when it stops"],
    "delay": [0.1, "s, until the controller knows"],
    "duration": [10.0, "s"],
    "height": [2.0, "m, of the CoG"],
    "posture": [None, "posture file; a bent body by default"],
    "trim": TRIM,
}


def applies(robot: Robot) -> bool:
    """A floating base and more than one rotor."""
    return robot.floating and len(robot.rotors.body) > 1


def plan(
    robot: Robot,
    rate: float,
    *,
    lost: str = "apparatus2",
    at: float = 3.0,
    delay: float = 0.1,
    duration: float = 10.0,
    height: float = 2.0,
    posture: dict[str, Any] | None = None,
) -> Plan:
    """Returns the plan: hover through the failure. Its facts hold the margin that is left."""
    rotors = rotors_named(robot, lost)
    if delay < 0:
        raise MissionError(f"delay {delay:g} s: a failure cannot be known before it happens.")
    if not at >= 0.0:
        raise MissionError(f"at {at:g} s: the flight begins at 0.")
    if not at + delay < duration:
        raise MissionError(
            f"duration {duration:g} s: more than {at + delay:g} is needed, when the loss is known."
        )
    joints = resting_joints(robot, posture)
    cog = np.array([0.0, 0.0, height])
    start = place(robot, joints, cog)
    left = margin_without(robot, start, rotors)
    word = "can still hover level" if left >= 0 else "cannot hover level"
    return holding(
        ticks(duration, rate),
        joints,
        start,
        cog,
        failures=(Failure(at, at + delay, rotors),),
        events=((at, f"{lost} lost"), (at + delay, f"the controller knows; the robot {word}")),
        facts={"lost": lost, "predicted_wrench_margin": left},
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
    links = [r.link for a in robot.modules.apparatuses for r in a.rotors]
    known: dict[str, tuple[int, ...]] = {name: (i,) for i, name in enumerate(links)}
    for j in range(len(robot.modules.apparatuses)):
        known[f"apparatus{j + 1}"] = tuple(np.flatnonzero(robot.rotors.apparatus == j).tolist())
    if str(lost) not in known:
        raise MissionError(f"{robot.name} has no rotor '{lost}' to fail.{near(str(lost), known)}")
    return known[str(lost)]


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
