"""The flat arrays of a robot, from its Pinocchio model and modules (kernels/core/types.py)."""

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from snakegen.base.geometry import Floats, quaternion_xyzw, rotation_from_rpy
from snakegen.errors import DescriptionError, PostureError, near
from snakegen.kernels.core.types import Gimbals, Rotors, Tree
from snakegen.robot.configuration import Configuration
from snakegen.robot.frames import ModelFrames
from snakegen.robot.modules import Rotor
from snakegen.robot.rotor_shafts import rotor_shafts


def _settled(
    robot: ModelFrames, spinners: frozenset[int], rotor: Rotor
) -> tuple[int, Floats, Floats]:
    """Returns body, position and direction of a rotor, its spin joint counted as fixed."""
    body, rotation, origin = robot.body_of_link(rotor.link)
    direction = rotation @ np.asarray(rotor.axis, float)
    position = origin + rotation @ np.asarray(rotor.position, float)
    while body in spinners:
        if abs(abs(direction @ robot.tree.axis[body]) - 1.0) > 1e-6:
            raise DescriptionError(
                f"rotor '{rotor.label}': its joint '{robot.joint_names[body - 1]}' does not turn "
                "about its thrust axis; name the joint as roll or pitch, or fix the axis."
            )
        if np.linalg.norm(np.cross(rotor.position, rotor.axis)) > 1e-6:
            raise DescriptionError(
                f"rotor '{rotor.label}': its position lies off the axis of its own joint "
                f"'{robot.joint_names[body - 1]}'; name the link that carries that joint."
            )
        mount = robot.tree.rotation[body]
        position = robot.tree.translation[body] + mount @ position
        direction = mount @ direction
        body = int(robot.tree.parent[body])
    return body, position, direction


def rotors_of(robot: ModelFrames, spinners: frozenset[int]) -> Rotors:
    """Returns the rotors of `robot`, apparatus by apparatus, on the bodies that carry them."""
    rows = [(j, r) for j, a in enumerate(robot.modules.apparatuses) for r in a.rotors]
    placed = [_settled(robot, spinners, r) for _, r in rows]
    return Rotors(
        np.array([p[0] for p in placed], np.int64),
        np.array([p[1] for p in placed], float).reshape(-1, 3),
        np.array([p[2] for p in placed], float).reshape(-1, 3),
        np.array([r.drag_ratio for _, r in rows], float),
        np.array([r.thrust_min for _, r in rows], float),
        np.array([r.thrust_max for _, r in rows], float),
        np.array([j for j, _ in rows], np.int64),
    )


def gimbals_of(robot: ModelFrames, rotors: Rotors) -> Gimbals:
    """Returns the apparatuses of `robot`: joints, thrust points and limits."""
    n = len(robot.modules.apparatuses)
    link_body, thrust_body = np.zeros(n, np.int64), np.zeros(n, np.int64)
    roll_body, pitch_body = np.full(n, -1, np.int64), np.full(n, -1, np.int64)
    frames, points, axes = np.zeros((n, 3, 3)), np.zeros((n, 3)), np.zeros((n, 3))
    limit = np.zeros(n)
    for j, a in enumerate(robot.modules.apparatuses):
        mine = np.flatnonzero(rotors.apparatus == j)
        bodies = {int(b) for b in rotors.body[mine]}
        if len(bodies) != 1:
            raise DescriptionError(
                f"{robot.apparatus_names[j]}: its rotors {a.rotor_labels} stand on different "
                "moving bodies; make them apparatuses of their own."
            )
        thrust_body[j] = bodies.pop()
        points[j] = rotors.position[mine].mean(axis=0)
        mean = rotors.axis[mine].mean(axis=0)
        if np.linalg.norm(mean) < 1e-9:
            raise DescriptionError(
                f"{robot.apparatus_names[j]}: its rotors push against each other."
            )
        axes[j] = mean / np.linalg.norm(mean)
        limit[j] = len(mine) * rotors.thrust_max[mine].min()  # they share a thrust equally
        roll_body[j] = robot.body_of_joint(a.roll) if a.roll else -1
        pitch_body[j] = robot.body_of_joint(a.pitch) if a.pitch else -1
        above = [b for b in (roll_body[j], pitch_body[j]) if b >= 0]
        for joint, body in ((a.roll, roll_body[j]), (a.pitch, pitch_body[j])):
            if body >= 0 and not _carries(robot.tree, int(body), int(thrust_body[j])):
                raise DescriptionError(
                    f"{robot.apparatus_names[j]}: joint '{joint}' does not turn its rotors "
                    f"{a.rotor_labels}."
                )
        base = int(robot.tree.parent[min(above)]) if above else int(thrust_body[j])
        link_body[j], frames[j] = base, np.eye(3)
        if a.link is not None:
            body, turned, _ = robot.body_of_link(a.link)
            if body == base:
                frames[j] = turned
    return Gimbals(link_body, frames, roll_body, pitch_body, thrust_body, points, axes, limit)


def _carries(tree: Tree, body: int, other: int) -> bool:
    """Tells whether `other` is `body` or hangs on it."""
    while other > body:
        other = int(tree.parent[other])
    return other == body


def spinners_of(robot: ModelFrames) -> frozenset[int]:
    """Returns the bodies that turn on a rotor's own shaft."""
    shafts = rotor_shafts(robot.urdf, robot.modules)
    return frozenset(b + 1 for b, name in enumerate(robot.joint_names) if name in shafts)


def base_link(robot: ModelFrames) -> str:
    """Returns the first link that is a body: the root, or what is fixed to a root named world."""
    if robot.root_link != "world":
        return robot.root_link
    for joint in ET.fromstring(robot.urdf).iterfind("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is not None and child is not None and parent.get("link") == "world":
            return str(child.get("link"))
    return robot.root_link


def configuration_of(
    robot: ModelFrames, posture: Mapping[str, Any], base_rpy: Any, base_position: Any
) -> Configuration:
    """Returns q of a posture by joint names; see `Robot.configuration`."""
    if not isinstance(posture, Mapping):
        raise PostureError(
            f"{robot.name}: a posture is a mapping, as in {{'joint1_yaw': 0.5}}, "
            f"not of type {type(posture).__name__}."
        )
    given = dict(posture)
    rpy = given.pop("base_rpy", base_rpy)
    position = given.pop("base_position", base_position)
    q = resting(robot)
    if robot.floating:
        q[:3] = _vector(position, "base_position")
        q[3:7] = quaternion_xyzw(rotation_from_rpy(_vector(rpy, "base_rpy")))
    elif np.any(_vector(rpy, "base_rpy")) or np.any(_vector(position, "base_position")):
        raise PostureError(f"{robot.name} has a fixed base; mount it by base.pose of its spec.")
    for name, value in given.items():
        if name not in robot.joint_names:
            known = (*robot.joint_names, "base_rpy", "base_position")
            raise PostureError(f"{robot.name} has no joint '{name}'.{near(str(name), known)}")
        angle = _finite(value, name)
        low, high = _range(robot, name)
        if not low - 1e-9 <= angle <= high + 1e-9:
            raise PostureError(
                f"{robot.name}: {name} = {angle:g} is outside its limits {low:g} … {high:g}."
            )
        _set(robot, q, name, angle)
    _follow(robot, q, given)
    return Configuration(robot, q)


def resting(robot: ModelFrames) -> Floats:
    """Returns q (nq,) with every joint at 0, or at the angle of its range that is nearest to 0.

    A leader's range is narrowed to where its followers are within theirs.
    """
    q = pin.neutral(robot.model)
    ranges = {name: _range(robot, name) for name in robot.joint_names}
    for name, (leader, ratio, offset) in robot.followers.items():
        if ratio != 0.0:
            ends = sorted((end - offset) / ratio for end in ranges[name])
            low, high = ranges[leader]
            narrowed = max(low, ends[0]), min(high, ends[1])
            ranges[leader] = narrowed if narrowed[0] <= narrowed[1] else (low, high)
    for name, (low, high) in ranges.items():
        if name not in robot.followers and not low <= 0.0 <= high:
            _set(robot, q, name, low if low > 0.0 else high)
    _follow(robot, q, ())
    return np.asarray(q)


def _range(robot: ModelFrames, name: str) -> tuple[float, float]:
    """Returns the range of a joint [rad or m], infinite for a continuous one."""
    joint = robot.model.joints[robot.model.getJointId(name)]
    if joint.nq == 2:
        return -np.inf, np.inf
    model = robot.model
    low, high = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
    return float(low), float(high)


def _set(robot: ModelFrames, q: Floats, name: str, angle: float) -> None:
    joint = robot.model.joints[robot.model.getJointId(name)]
    turn = (np.cos(angle), np.sin(angle))
    q[joint.idx_q : joint.idx_q + joint.nq] = turn if joint.nq == 2 else angle


def _angle(robot: ModelFrames, q: Floats, name: str) -> float:
    joint = robot.model.joints[robot.model.getJointId(name)]
    if joint.nq == 2:
        return float(np.arctan2(q[joint.idx_q + 1], q[joint.idx_q]))
    return float(q[joint.idx_q])


def _follow(robot: ModelFrames, q: Floats, given: Any) -> None:
    """Brings followers in q to where their leaders have them.

    Raises:
        PostureError: a follower is `given` elsewhere, or its leader takes it out of its range.
    """
    for name, (leader, ratio, offset) in robot.followers.items():
        angle = ratio * _angle(robot, q, leader) + offset
        if name in given and abs(_angle(robot, q, name) - angle) > 1e-9:
            raise PostureError(
                f"{robot.name}: {name} follows {leader} (mimic) and is {angle:g} here; "
                f"give {leader} alone."
            )
        low, high = _range(robot, name)
        if leader in given and not low - 1e-9 <= angle <= high + 1e-9:
            raise PostureError(
                f"{robot.name}: {leader} = {_angle(robot, q, leader):g} takes {name}, which "
                f"follows it, to {angle:g}, outside its limits {low:g} … {high:g}."
            )
        _set(robot, q, name, angle)


def _vector(value: Any, name: str) -> Floats:
    out = np.asarray(value, dtype=object)
    if out.shape != (3,):
        raise PostureError(f"{name}: three numbers are needed, not {value!r}.")
    return np.array([_finite(v, name) for v in out])


def _finite(value: Any, name: str) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise PostureError(f"{name}: {value!r} is not a number.") from None
    if isinstance(value, bool) or not np.isfinite(number):
        raise PostureError(f"{name}: {value!r} is not a finite number.")
    return number
