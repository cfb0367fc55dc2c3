"""Drive over the ground, take off where the drive ends, hover: a hybrid of drums and rotors."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats, quaternion_xyzw, rotation_about, rotation_from_xyzw
from snakegen.control.controller import flight_controller, gain_set
from snakegen.kernels.kinematics.chain import centre_of_gravity, forward
from snakegen.robot.posture import hover_gimbals
from snakegen.robot.robot import Robot
from snakegen.simulation.drive.plan import DriveLaw, DrivePlan, can_drive, curled
from snakegen.simulation.drive.record import DRIVE_THRESHOLDS, drive
from snakegen.simulation.flight.plan import Plan, holding, through, ticks
from snakegen.simulation.flight.plan import level as level_attitude
from snakegen.simulation.flight.plant import Imperfections
from snakegen.simulation.flight.postures import driven_joints
from snakegen.simulation.recording.join import join
from snakegen.simulation.recording.metrics import metrics as measure
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.recording.servo_strength import strength_checks
from snakegen.simulation.recording.verdict import FLIGHT_THRESHOLDS
from snakegen.simulation.recording.worst_place import judged_verdict
from snakegen.simulation.run_settings import RunSettings


@dataclass(frozen=True)
class Options(DriveLaw):
    """Options of mission `drive_fly`.

    Attributes:
        distance: m, driven
        bend: rad, of every yaw joint: a straight body could not fly
        height: m, that the CoG climbs
        climb: s, of the climb
        hover: s, at the top
    """

    distance: float = 0.6
    bend: float = 0.8
    height: float = 1.0
    climb: float = 5.0
    hover: float = 2.0


_IDLE = 0.5  # s on the ground before the climb


def applies(robot: Robot) -> bool:
    """A floating base, two or more screw drums, and rotors."""
    return can_drive(robot) and bool(robot.modules.apparatuses)


def fly(robot: Robot, options: Options, settings: RunSettings) -> Recording:
    """Drives, flies on from where the drive ended, and returns both as one judged recording."""
    from snakegen.simulation.flight.preflight import check_start
    from snakegen.simulation.flight.prepared_run import PreparedRun

    reference = curled(robot, options.distance, options.speed, options.acceleration, options.bend)
    plan = DrivePlan(
        reference,
        reference.at(0.0)[0],
        reference.duration + 1.0,
        options.gain,
        options.feedback,
        events=((0.0, "drive; position is the head's"),),
    )
    driven = drive(robot, "drive_fly", plan, settings=replace(settings, progress=None))
    imperfections = Imperfections.of(robot.modules.plant)
    imperfections = imperfections.ideal() if settings.ideal else imperfections
    control = robot.modules.control
    climb = _climb(robot, driven.channel("q").values[-1], options, control)
    controller = flight_controller(robot, gain_set(robot, None))
    check_start(robot, controller, climb)
    meta = {
        "mission": "drive_fly",
        "mode": "drive, then flight",
        "ideal": settings.ideal,
        "options": vars(options),
    }
    meta |= {"gains": str(control.get("gains", "")), "allocator": "paper"}
    rate = float(control.get("position_rate", 40.0))
    ready = PreparedRun(robot, climb, controller, imperfections, rate, meta)
    rng = np.random.default_rng(settings.seed)
    flown = ready.flown(
        ready.world(), imperfections, rng, settings.seed, settings.progress, margins=False
    )
    both = join(driven, flown)
    found = measure(both) | {"completed": not flown.meta["stopped"] and not driven.meta["stopped"]}
    bounds = FLIGHT_THRESHOLDS | DRIVE_THRESHOLDS | strength_checks(found) | _tight(options)
    return both.judged(found, judged_verdict(both, found, bounds))


def _tight(options: Options) -> dict[str, dict[str, Any]]:
    """Returns bounds of three medians of ten seeds of `hybrid4`; faster ones are off by more.

    Tilt is that of the drive: banking for a step aside is flight, not rolling over.
    """
    quick = max(1.0, options.speed / Options.speed)
    steep = max(1.0, options.height / options.climb * Options.climb / Options.height)
    flown = {"position_rmse_m": 0.069, "position_max_m": 0.155, "attitude_rmse_rad": 0.085}
    driven = {"tilt_max_rad": 0.01, "slip_mean_m_s": 0.007}
    factors = dict.fromkeys(flown, steep) | dict.fromkeys(driven, quick)
    return {name: {"at_most": factors[name] * x} for name, x in (flown | driven).items()}


def _climb(robot: Robot, q: Floats, options: Options, control: dict[str, Any]) -> Plan:
    """Returns the flight's plan: from rest in q straight up, then hover; gimbals point up first."""
    base = rotation_from_xyzw(q[3:7])
    level = q.copy()
    level[3:7] = quaternion_xyzw(rotation_about([0, 0, 1], np.arctan2(base[1, 0], base[0, 0])))
    start = hover_gimbals(robot, level)
    angles = robot.angles(start)
    pose = forward(robot.tree, *robot.base_pose(start), angles)
    _, cog = centre_of_gravity(robot.tree, *pose)
    joints = [angles[robot.joint_names.index(n)] for n in driven_joints(robot)]
    time = ticks(_IDLE + options.climb + options.hover, float(control.get("attitude_rate", 200.0)))
    path = np.array([cog, cog, cog + np.array([0.0, 0.0, options.height])])
    position, velocity, acceleration = through(time, [0.0, _IDLE, _IDLE + options.climb], path)
    return holding(
        time,
        joints,
        start,
        cog,
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        rotation=level_attitude(len(time))[0],
        on_floor=True,
        events=((0.0, "fly; position is the CoG's"), (_IDLE, "climb")),
    )
