"""Plans of drives: a reference on the ground, the law that follows it, what lies in the way."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.errors import MissionError
from snakegen.robot.configuration import Configuration
from snakegen.robot.robot import Robot
from snakegen.screw_drive.geometry import drive_geometry, yaw_joints
from snakegen.screw_drive.ground_paths import (
    CrabReference,
    FollowReference,
    Path,
    Reference,
    TimeLaw,
    path_length,
)
from snakegen.screw_drive.kinematics import path_demand
from snakegen.simulation.drive.load import GroundLoad
from snakegen.simulation.flight.plan import Box

GAIN = 0.5  # 1/s, HA's K


@dataclass(frozen=True)
class DriveLaw:
    """Options of every drive that follows a reference.

    Attributes:
        speed: m/s
        acceleration: m/s²; 0: at once, as printed
        gain: 1/s, K of HA eq 7
        feedback: false: feedforward alone
    """

    speed: float = 0.125
    acceleration: float = 0.4
    gain: float = GAIN
    feedback: bool = True


@dataclass(frozen=True)
class DriveOptions(DriveLaw):
    """Options of a mission that is one drive.

    Attributes:
        plant: contact (MuJoCo, wheels that roll) or kinematic (wheels cannot slip)
        duration: s; the mission's own by default
    """

    plant: str = "contact"
    duration: float | None = None


@dataclass(frozen=True, eq=False)
class DrivePlan:
    """What a drive is asked to do.

    Attributes:
        reference: w_d and ẇ_d over time.
        start: w(0) (m + 2,).
        duration: s.
        gain: K [1/s], one or (m + 2,).
        feedback: whether the state is fed back.
        integral: 1/s, of the integral of the head's error, added to the error: the rate servos of
            screws slip back under load; a drive that holds its place corrects that.
        lift: over time [s], pitch joint angles and what is added to yaw joints [rad];
            None: all at 0.
        compliance: pitch servos are softer by this factor, so that every drum finds the ground.
        load: gravity and a pull over time; the run ends when the drive lets go.
        obstacles: boxes on, over and beside the ground.
        thresholds: of the verdict, over the defaults; None takes a check out.
        events: (time, text).
        facts: what the mission wants in the log, as JSON.
    """

    reference: Reference
    start: Floats
    duration: float
    gain: float | tuple[float, ...] = GAIN
    feedback: bool = True
    integral: float = 0.0
    lift: Callable[[float], tuple[Floats, Floats]] | None = None
    compliance: float = 1.0
    load: GroundLoad | None = None
    obstacles: tuple[Box, ...] = ()
    thresholds: dict[str, dict[str, Any] | None] = field(default_factory=dict)
    events: tuple[tuple[float, str], ...] = ()
    facts: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Raises MissionError for numbers that no drive can have."""
        gain = np.asarray(self.gain, float)
        if not (np.isfinite(self.duration) and self.duration > 0):
            raise MissionError(f"duration {self.duration:g} s: more than 0 is needed.")
        if not (np.all(np.isfinite(gain)) and np.all(gain >= 0)):
            raise MissionError(f"gain {gain.min():g} 1/s: 0 or more is needed, or it runs away.")
        if not isinstance(self.feedback, bool):
            raise MissionError(f"feedback {self.feedback!r}: true or false is needed.")
        if not (np.isfinite(self.compliance) and self.compliance > 0):
            raise MissionError(f"compliance {self.compliance:g}: more than 0 is needed.")


def lasting(options: DriveOptions, own: float) -> float:
    """Returns the duration asked for [s], else the mission's own."""
    return own if options.duration is None else options.duration


def at_most(
    bounds: dict[str, float], options: DriveOptions, usual: float = 0.125
) -> dict[str, dict[str, Any] | None]:
    """Returns checks of these bounds, measured at the usual speed [m/s] and gain.

    A law of gain K leaves an error of what slips in 1/K: distances and slip grow with the speed,
    distances with 1/K too. None grows less than measured.
    """
    quick = options.speed / usual
    slow = GAIN / options.gain if options.gain > 0 else 1.0
    out: dict[str, dict[str, Any] | None] = {}
    for name, bound in bounds.items():
        grows = quick * slow if name.startswith("distance") else quick
        known = name.startswith(("distance", "slip"))
        out[name] = {"at_most": bound * max(1.0, grows) if known else bound}
        if name == "tilt_max_rad":  # contact alone has it
            out[name] = {"at_most": bound, "channel": "wheel_load"}
    return out


def can_drive(robot: Robot) -> bool:
    """Tells whether a robot is a drive: a floating base and two or more drums."""
    return robot.floating and len(robot.modules.screws) >= 2


def rates(robot: Robot) -> tuple[float, float]:
    """Returns the largest screw rate and yaw joint rate [rad/s] by the URDF."""
    model = robot.model

    def least(names: list[str]) -> float:
        limits = [model.upperVelocityLimit[model.joints[model.getJointId(n)].idx_v] for n in names]
        return float(min(limits, default=math.inf))

    return least([s.joint for s in robot.modules.screws]), least(list(yaw_joints(robot)))


def time_law(length: float, speed: float, acceleration: float) -> TimeLaw:
    """Returns a trapezoid of one stretch; an acceleration of 0 means at once."""
    if not speed > 0 or acceleration < 0:
        raise MissionError(
            f"speed {speed:g} m/s and acceleration {acceleration:g} m/s²: more than 0 is needed "
            "(0 acceleration: at once)."
        )
    if not length > 0:
        raise MissionError(f"a way of {length:g} m: more than 0 is needed.")
    return TimeLaw((length,), speed, acceleration or math.inf)


def following(
    robot: Robot,
    path: Path,
    speed: float,
    acceleration: float,
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> FollowReference:
    """Returns a robot's follow-the-leader reference along a path.

    Raises:
        AnalysisError: a path tighter than the joints allow, with the radius that can be followed.
        MissionError: more speed than the motors have.
    """
    geometry = drive_geometry(robot)
    names = yaw_joints(robot)
    low, high, _ = robot.limits(names)
    law = time_law(path_length(path), speed, acceleration)
    screw, joint = rates(robot)
    demand = path_demand(geometry, path, speed, screw, joint, (low, high), names, 0.02)
    if demand.fastest < speed:
        raise MissionError(
            f"{speed:g} m/s along this path takes screws of {demand.screw_rate:.2f} and joints of "
            f"{demand.joint_rate:.2f} rad/s; the motors of {robot.name} allow "
            f"{demand.fastest:.3f} m/s."
        )
    return FollowReference(tuple(path), geometry.lengths, law, start)


def curled(
    robot: Robot, distance: float, speed: float, acceleration: float, bend: float
) -> CrabReference:
    """Returns a line along x [m] travelled with every yaw joint at `bend` [rad], tail behind.

    A straight body stands on a line, and only its caster keeps it from rolling over; a curled one
    stands on a plane, whatever is lifted off the ground.
    """
    names = yaw_joints(robot)
    low, high, _ = robot.limits(names)
    if not (np.all(bend >= low) and np.all(bend <= high)):
        raise MissionError(
            f"bend {bend:g} rad is outside the yaw joints' limits {low.max():g} … {high.min():g}."
        )
    heading = math.pi - 0.5 * bend * len(names)
    law = time_law(distance, speed, acceleration)
    return CrabReference(((0.0, 0.0), (distance, 0.0)), (bend,) * len(names), law, heading)


@dataclass(frozen=True, eq=False)
class HoldReference:
    """A state that is held."""

    state: Floats
    duration: float

    def at(self, t: float) -> tuple[Floats, Floats]:
        """Returns w_d, and a rate of 0, at any time."""
        return self.state.copy(), np.zeros(len(self.state))


def held_plan(
    robot: Robot,
    q: Floats,
    load: GroundLoad,
    gain: float,
    thresholds: dict[str, dict[str, Any] | None],
    facts: dict[str, Any],
) -> DrivePlan:
    """Returns the plan of a drive that holds its place, in the posture of q, under a rising load.

    Raises:
        MissionError: joints bent out of the plane: drives start flat.
    """
    angle = dict(zip(robot.joint_names, robot.angles(q), strict=True))
    yaws = yaw_joints(robot)
    bent = [n for n in robot.chain_joints if n not in yaws and abs(angle[n]) > 1e-9]
    if bent:
        raise MissionError(f"{bent[0]} is bent out of the plane; drives hold flat postures.")
    state = np.array([0.0, 0.0, 0.0, *(angle[n] for n in yaws)])
    duration = load.time[-1]
    reference = HoldReference(state, duration)
    event = ((load.time[1], f"the {load.kind} begins"),)
    return DrivePlan(
        reference, state, duration, gain, integral=gain / 2, load=load, thresholds=thresholds,
        facts=facts, events=event,
    )  # fmt: skip


def held_posture(robot: Robot, posture: Mapping[str, Any] | None) -> Configuration:
    """Returns q of a posture by joint names; straight if there is none.

    Raises:
        MissionError: a base pose, which the ground decides.
    """
    for name in ("base_rpy", "base_position"):
        if posture and name in posture:
            raise MissionError(f"the ground decides how a drive stands; leave out {name}.")
    return robot.configuration(posture)


def check_figure(robot: Robot, figure: float, what: str) -> None:
    """Raises MissionError where there is no limit to confirm."""
    if not (np.isfinite(figure) and figure > 1e-3):
        raise MissionError(
            f"{robot.name} has no {what} to confirm in this posture: the analysis gives {figure:g}."
        )


def choice(value: Any, known: tuple[str, ...], name: str) -> str:
    """Returns one of the known values of an option, else raises MissionError."""
    if value not in known:
        raise MissionError(f"{name} '{value}': one of {', '.join(known)} is needed.")
    return str(value)
