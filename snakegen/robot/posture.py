"""Postures: read from files, and completed with the gimbal angles of a hover."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base import yaml_file
from snakegen.base.geometry import Floats, rpy_from_rotation
from snakegen.errors import PostureError
from snakegen.robot.arrays import resting
from snakegen.robot.bodies import RobotBodies
from snakegen.robot.configuration import Configuration
from snakegen.robot.gimbal_geometry import mounts, point_thrust, thrust_line
from snakegen.robot.kinematics import centre_of_gravity, forward

SHOWN = 5e-4  # rad: what three digits show
BEND = 1.0  # rad, of the yaw joints of a body at rest in the air


def read_posture(path: Path) -> dict[str, Any]:
    """Reads a posture file: YAML, joint names with angles in rad, ``base_rpy`` too."""
    data = yaml_file.read(path)
    if data is None:
        return {}
    if not isinstance(data, dict):
        raise PostureError(f"{path.name}: a posture is a mapping, as in {{joint1_yaw: 0.5}}.")
    return data


def parse_joints(items: Iterable[str]) -> dict[str, float]:
    """Returns the angles of ``name=value`` items."""
    out: dict[str, float] = {}
    for item in items:
        name, equals, value = item.partition("=")
        try:
            out[name.strip()] = float(value)
        except ValueError:
            equals = ""
        if not equals:
            raise PostureError(f"--joint '{item}': write name=value, as in joint1_yaw=0.5.")
    return out


def hover_gimbals(robot: RobotBodies, q: ArrayLike, up: Floats | None = None) -> Configuration:
    """Returns q with gimbal angles that point every apparatus' thrust up.

    An apparatus whose gimbals cannot reach the vertical gets the nearest direction they can.

    Args:
        robot: the robot.
        q: (nq,) configuration; its gimbal angles are where the search starts.
        up: (3,) unit, world; the vertical if absent.
    """
    vertical = np.array([0.0, 0.0, 1.0]) if up is None else np.asarray(up, float)
    aimed, _ = aim_gimbals(robot, q, np.tile(vertical, (robot.gimbals.link_body.size, 1)))
    return robot.validate_configuration(aimed)


def aim_gimbals(
    robot: RobotBodies, q: ArrayLike, directions: Floats, *, limited: bool = True
) -> tuple[Floats, Floats]:
    """Returns q with each apparatus' thrust turned to its direction, and the angles that remain.

    Args:
        robot: the robot.
        q: (nq,) configuration; its gimbal angles are where the search starts.
        directions: (Ñ, 3) unit, world.
        limited: within the joints' limits; otherwise as if they turned all the way round.

    Returns:
        q (nq,), and (Ñ,) rad between thrust and direction: 0 where gimbals and limits allow it;
        of an apparatus without gimbals, the angle of its fixed axis.
    """
    gimbals, rotors, tree = robot.gimbals, robot.rotors, robot.tree
    count = gimbals.link_body.size
    out, remaining = np.array(q, float), np.zeros(count)
    if count == 0:
        return out, remaining
    base, origin = robot.base_pose(q)
    angles = robot.angles(q)
    rotation, position = forward(tree, base, origin, angles)
    _, cog = centre_of_gravity(tree, rotation, position)
    frames, _ = mounts(tree, rotors, gimbals, rotation, position, cog, base)
    wanted = np.ascontiguousarray(directions @ base)
    low, high, _ = robot.limits(robot.joint_names)
    axis, point = np.empty(3), np.empty(3)
    for j in range(count):
        bodies = sorted(b for b in (gimbals.roll_body[j], gimbals.pitch_body[j]) if b >= 0)
        last, lower, upper, found = np.zeros(2), np.full(2, -np.pi), np.full(2, np.pi), np.zeros(2)
        turned = list(enumerate(bodies, 2 - len(bodies)))  # a single axis is the second of two
        for k, body in turned:
            last[k] = angles[body - 1]
            if limited:
                lower[k], upper[k] = low[body - 1], high[body - 1]
        point_thrust(frames, j, wanted[j], last, lower, upper, found)
        for k, body in turned:
            set_angle(robot, out, robot.joint_names[body - 1], found[k])
        thrust_line(frames, j, found, axis, point)
        remaining[j] = 2.0 * np.arcsin(min(0.5 * float(np.linalg.norm(axis - wanted[j])), 1.0))
    return out, remaining


def set_angle(robot: RobotBodies, q: Floats, name: str, angle: float) -> None:
    """Writes the angle [rad] of joint `name` into q."""
    joint = robot.model.joints[robot.model.getJointId(name)]
    if joint.nq == 2:
        q[joint.idx_q : joint.idx_q + 2] = np.cos(angle), np.sin(angle)
    else:
        q[joint.idx_q] = angle


def angles_by_name(robot: RobotBodies, q: ArrayLike) -> dict[str, float]:
    """Returns the joint angles [rad] of q by name."""
    return {n: float(a) for n, a in zip(robot.joint_names, robot.angles(q), strict=True)}


def configuration_labels(robot: RobotBodies) -> list[str]:
    """Returns the name of each number of q: x y z qx qy qz qw of a free base, then the joints.

    A joint without limits has two, ``name:cos`` and ``name:sin``.
    """
    out = ["x", "y", "z", "qx", "qy", "qz", "qw"] if robot.floating else []
    for name in robot.joint_names:
        two = robot.model.joints[robot.model.getJointId(name)].nq == 2
        out += [f"{name}:cos", f"{name}:sin"] if two else [name]
    return out


def posture_text(angles: Mapping[str, float], base_rpy: Iterable[float] = ()) -> str:
    """Returns a posture in one line: joint angles and base attitude that are not 0, rad.

    Args:
        angles: rad (m where a joint slides), by joint name.
        base_rpy: roll, pitch and yaw of the base.
    """
    parts = [f"{name} {angle:+.3f}" for name, angle in angles.items() if abs(angle) > SHOWN]
    if any(abs(x) > SHOWN for x in base_rpy):
        parts.append("base_rpy " + " ".join(f"{x:+.3f}" for x in base_rpy))
    return ", ".join(parts) or "all joints at 0"


def posture_line(robot: RobotBodies, q: ArrayLike) -> str:
    """Returns the posture of q in one line, gimbals included."""
    at = robot.validate_configuration(q)
    angles = angles_by_name(robot, at)
    text = posture_text(angles, rpy_from_rotation(at.base_rotation).tolist())
    low, high, _ = robot.limits(robot.joint_names)
    kept = [
        name
        for name, a, b in zip(robot.joint_names, low, high, strict=True)
        if not a <= 0.0 <= b and angles[name] == (a if a > 0.0 else b)
    ]
    return f"{text} (0 is outside the limits of {', '.join(kept)})" if kept else text


def neutral(robot: RobotBodies) -> Floats:
    """Returns the configuration with every joint at 0, or at its nearest angle within limits."""
    return resting(robot)


def driven_joints(robot: RobotBodies) -> list[str]:
    """Returns the joints that shape the body and have a servo, in the tree's order."""
    servos = {s.joint for s in robot.modules.servos}
    return [n for n in robot.chain_joints if n in servos]


def turning_rates(robot: RobotBodies, names: Sequence[str]) -> Floats:
    """Returns the URDF's velocity limits [rad/s] of the joints `names`; inf where it has none."""
    at = [robot.model.joints[robot.model.getJointId(n)].idx_v for n in names]
    limit = np.array(robot.model.upperVelocityLimit[at], float)
    return np.where(limit > 0.0, limit, np.inf)


def bent(robot: RobotBodies, bend: float = BEND) -> Floats:
    """Returns joint angles (k,) of a planar body: every yaw (else pitch) bent, within limits.

    Up to four links bend one way. Longer bodies change side every two joints: headings run
    0, b, 2b, b, 0 …, a wave that goes on along b and so neither closes on itself nor becomes
    straight, however long.
    """
    names = driven_joints(robot)
    low, high, _ = robot.limits(names)
    kind = "_yaw" if any(n.endswith("_yaw") for n in names) else "_pitch"
    out, turns = np.zeros(len(names)), 0
    for i, name in enumerate(names):
        if name.endswith(kind):
            side = 1.0 if (turns // 2) % 2 == 0 or len(robot.modules.lengths) <= 4 else -1.0
            out[i] = np.clip(side * bend, low[i], high[i])
            turns += 1
    return out
