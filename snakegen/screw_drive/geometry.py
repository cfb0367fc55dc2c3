"""A robot's screw drive as numbers: which units stand where on the chain, read from its URDF."""

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError
from snakegen.kernels.kinematics.chain import forward
from snakegen.robot.robot import Robot
from snakegen.screw_drive.kinematics import ScrewGeometry


def yaw_joints(robot: Robot) -> tuple[str, ...]:
    """Returns the names of the chain joints whose axis is vertical in the neutral posture."""
    rotation, _ = _neutral(robot)
    names = []
    for name in robot.chain_joints:
        body = robot.body_of_joint(name)
        axis = rotation[body] @ robot.tree.axis[body]
        if axis[2] > 1 - 1e-9 and not robot.tree.prismatic[body]:
            names.append(name)
    return tuple(names)


def drive_geometry(robot: Robot) -> ScrewGeometry:
    """Returns the planar drive of a robot: P at the root link's origin, the chain along its x.

    Raises:
        AnalysisError: a drum that stands off the chain's line, or does not turn about it.
    """
    rotation, place = _neutral(robot)
    joints = yaw_joints(robot)
    bodies = [robot.body_of_joint(name) for name in joints]
    pivots = np.array([place[body, 0] for body in bodies])
    starts = np.concatenate([[0.0], pivots])
    alpha, link, offset, radius = [], [], [], []
    for screw in robot.modules.screws:
        body = robot.body_of_joint(screw.joint)
        axis = rotation[body] @ robot.tree.axis[body]
        aside = float(np.hypot(place[body, 1], place[body, 2]))
        if aside > 1e-6 or axis[0] < 1 - 1e-9:
            raise AnalysisError(
                f"{screw.joint} stands {aside:.4g} m off the chain's line or does not turn about "
                "it; the drive model needs drums that turn about +x of their links."
            )
        index = sum(ahead in bodies for ahead in _ancestors(robot, body))
        alpha.append(screw.alpha)
        link.append(index)
        offset.append(float(place[body, 0] - starts[index]))
        radius.append(screw.radius)
    if np.ptp(radius) > 1e-9:
        raise AnalysisError(
            f"drums of {min(radius):g} to {max(radius):g} m: the planar model needs one radius."
        )
    ends = np.append(starts[1:], _end(robot, place))
    return ScrewGeometry(
        tuple(alpha), radius[0], tuple(link), tuple(offset), tuple(float(d) for d in ends - starts)
    )


def _neutral(robot: Robot) -> tuple[Floats, Floats]:
    """Returns rotation and origin of every body with all joints at 0 and the base at the origin."""
    return forward(robot.tree, np.eye(3), np.zeros(3), np.zeros(robot.tree.parent.size - 1))


def _ancestors(robot: Robot, body: int) -> list[int]:
    """Returns the bodies from `body`'s parent to the base."""
    out = []
    while robot.tree.parent[body] >= 0:
        body = int(robot.tree.parent[body])
        out.append(body)
    return out


def _end(robot: Robot, place: Floats) -> float:
    """Returns how far the chain's last link reaches along x [m]."""
    reach = []
    for name, length in robot.modules.lengths.items():
        body, _, shift = robot.body_of_link(name)
        reach.append(float(place[body, 0] + shift[0] + length))
    return max(reach, default=float(place[:, 0].max()))
