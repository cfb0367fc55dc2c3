"""Screw drive: rank and singular shapes, slip, rates that a path needs, directions and radii.

HA eqs 1-7 as THEORY part B reads them; the algebra is in `screw_law`.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from snakegen.analysis.screw_drive_result import DriveResult
from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError, near
from snakegen.robot.robot import Robot
from snakegen.screw_drive.constraints import constraint_matrices, follow_the_leader, wheel_rates
from snakegen.screw_drive.geometry import drive_geometry, yaw_joints
from snakegen.screw_drive.ground_paths import NAMED, Path
from snakegen.screw_drive.held_shape import direction_cone, fixed_shape_radii
from snakegen.screw_drive.kinematics import (
    ScrewGeometry,
    following_radii,
    path_demand,
    worst_slip_sensitivity,
)
from snakegen.screw_drive.singularity import drive_hold, search_hold

__all__ = [
    "DriveResult",
    "analyze",
    "applies",
    "constraint_matrices",
    "examine",
    "follow_the_leader",
    "wheel_rates",
]

COMMAND = "drive"
EXAMPLE = "screw4 --path arc --speed 0.1"
ORDER = 60


def examine(
    geometry: ScrewGeometry,
    shape: ArrayLike,
    lower: ArrayLike,
    upper: ArrayLike,
    path: Path,
    speed: float = 0.125,
    screw_rate: float = 6.0,
    joint_rate: float = math.inf,
    pitch: float = 0.0,
    names: Sequence[str] = (),
) -> DriveResult:
    """Returns all that the model says of a drive.

    Args:
        geometry: the drive.
        shape: yaw angles (m - 1,) [rad] at which rank, cone and radius are taken.
        lower, upper: yaw limits (m - 1,) [rad].
        path: what is to be followed.
        speed: along it [m/s].
        screw_rate, joint_rate: motor limits [rad/s].
        pitch: largest angle out of the plane [rad], reported.
        names: of the yaw joints, for messages.

    Raises:
        AnalysisError: sizes or limits that do not fit the drive, a speed that is not positive.
    """
    if not speed > 0:
        raise AnalysisError(f"speed {speed:g} m/s: more than 0 is needed, the head leads.")
    bent, low, high = (np.asarray(value, float) for value in (shape, lower, upper))
    dead = tuple(int(i) + 1 for i in np.flatnonzero(np.abs(np.sin(geometry.alpha)) < 1e-9))
    demand, refusal = None, ""
    try:
        demand = path_demand(geometry, path, speed, screw_rate, joint_rate, (low, high), names)
    except AnalysisError as error:
        refusal = str(error)
    turn = np.clip(_arc_shape(geometry, 3 * geometry.scale), 0.0, high)
    shapes = [bent, turn, np.clip(-turn, low, 0.0)]
    return DriveResult(
        geometry,
        drive_hold(geometry, bent),
        search_hold(geometry, low, high),
        dead,
        {}
        if dead
        else worst_slip_sensitivity(geometry, shapes, [-speed, 0.0, speed / (3 * geometry.scale)]),
        demand,
        refusal,
        None if dead else direction_cone(geometry, bent, screw_rate),
        following_radii(geometry.lengths, low, high),
        (math.inf, math.inf) if dead else fixed_shape_radii(geometry, bent, speed, screw_rate),
        speed,
        pitch,
    )


def applies(robot: Robot) -> bool:
    """A floating base and screw units: what is fixed to the world does not drive."""
    return robot.floating and bool(robot.modules.screws)


def analyze(
    robot: Robot,
    q: Floats,
    path: str = "lcrank",
    speed: float = 0.125,
    screw_rate: float = 0.0,
) -> DriveResult:
    """Returns all that the model says of the robot's drive at q (HA eqs 1-7).

    Options:
        path: path whose rates are computed: line, arc, lcrank, scurve
        speed: m/s along that path
        screw_rate: rad/s that a screw motor reaches; 0: the URDF's limit

    Raises:
        AnalysisError: no such path, or drums that the planar model cannot hold.
    """
    if path not in NAMED:
        raise AnalysisError(f"there is no path '{path}'.{near(path, NAMED)}")
    yaws, angle = yaw_joints(robot), dict(zip(robot.joint_names, robot.angles(q), strict=True))
    others = [abs(angle[name]) for name in robot.chain_joints if name not in yaws]
    drums = tuple(screw.joint for screw in robot.modules.screws)
    low, high, _ = robot.limits(yaws)
    return examine(
        drive_geometry(robot),
        [angle[name] for name in yaws],
        low,
        high,
        NAMED[path](),
        speed,
        screw_rate if screw_rate > 0 else _rate_limit(robot, drums),
        _rate_limit(robot, yaws),
        max(others, default=0.0),
        yaws,
    )


def _rate_limit(robot: Robot, joints: tuple[str, ...]) -> float:
    """Returns the smallest velocity limit [rad/s] of the joints."""
    model = robot.model
    limits = [model.upperVelocityLimit[model.joints[model.getJointId(j)].idx_v] for j in joints]
    return float(min(limits, default=math.inf))


def _arc_shape(geometry: ScrewGeometry, radius: float) -> Floats:
    """Returns the joint angles (m - 1,) [rad] of a chain whose nodes lie on a circle."""
    half = np.arcsin(np.minimum(np.array(geometry.lengths) / (2 * radius), 1.0))
    return np.asarray(half[:-1] + half[1:])
