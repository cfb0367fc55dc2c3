"""Parts of a robot read from a URDF of any tool, and from what its modules declare."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.linter.composites import rigid_body
from snakegen.linter.finding import numbers
from snakegen.linter.link_poses import link_poses
from snakegen.linter.lint import lint, refuse
from snakegen.linter.tree_rules import end_of
from snakegen.linter.xml_tree import Node, parse_xml
from snakegen.pipeline.robot_parts import BASE, ActuatorPart, BodyPart, JointPart, RobotParts, Sum
from snakegen.robot.modules import Screw, from_urdf
from snakegen.robot.robot import Robot, load
from snakegen.spec.urdf import read_urdf

_SINGLE = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic"}


def urdf_parts(path: Path, modules: Path | None = None) -> RobotParts:
    """Reads a URDF; its <snakegen> element or a modules file says what drives it.

    Raises:
        DescriptionError: no sound URDF, or a modules file of another robot.
    """
    text = read_urdf(path)
    refuse(lint(path, quick=True), str(path))
    root = parse_xml(text)
    frames = link_poses(root)
    joints, bodies = _joints(root, frames), _bodies(root, frames)
    floating: bool | None = None
    for name, joint in joints.items():
        if joint.kind == "floating" and joint.carrier == BASE and bodies[BASE].mass == 0.0:
            floating = True
            joints, bodies = _without_free_root(joints, bodies, name)
            break
    actuators = None
    if modules is not None or from_urdf(text) is not None:
        robot = load(path, modules=modules)
        floating = robot.floating
        joints = _driven(robot, joints)
        actuators = _actuators(robot, frames, joints)
    return RobotParts(str(path), "URDF", floating, frames, joints, bodies, actuators)


def _carriers(root: Node) -> dict[str, str]:
    """Returns the key of the moving body that each link belongs to."""
    own = {end_of(j, "child") or "": j for j in root.findall("joint")}
    keys: dict[str, str] = {}
    for link in root.findall("link"):
        chain, here, key = [], link.attrib.get("name", ""), None
        while key is None:
            if here in keys:
                key = keys[here]
                break
            chain.append(here)
            joint = own.get(here)
            if joint is None:
                key = BASE
            elif joint.attrib.get("type") != "fixed":
                key = joint.attrib.get("name", "")
            else:
                here = end_of(joint, "parent") or ""
        keys |= dict.fromkeys(chain, key)
    return keys


def _bodies(root: Node, frames: dict[str, Floats]) -> dict[str, BodyPart]:
    keys = _carriers(root)
    sums: dict[str, Sum] = {}
    for link in root.findall("link"):
        name = link.attrib.get("name", "")
        total = sums.setdefault(keys[name], Sum(name))
        part = rigid_body(link)
        if part is not None:
            mass, centre, inertia = part
            turn, origin = frames[name][:3, :3], frames[name][:3, 3]
            total.add(mass, origin + turn @ centre, turn @ inertia @ turn.T)
    own = {j.attrib.get("name", ""): end_of(j, "child") or "" for j in root.findall("joint")}
    for key, total in sums.items():
        total.link = own.get(key, total.link)
    return {key: total.body() for key, total in sums.items()}


def _joints(root: Node, frames: dict[str, Floats]) -> dict[str, JointPart]:
    keys, out = _carriers(root), {}
    for joint in root.findall("joint"):
        kind = joint.attrib.get("type", "")
        if kind == "fixed":
            continue
        child, parent = end_of(joint, "child") or "", end_of(joint, "parent") or ""
        turn, axis = frames[child][:3, :3], numbers(joint.find("axis"), "xyz", 3) or (1.0, 0.0, 0.0)
        limit, dynamics = joint.find("limit"), joint.find("dynamics")
        effort = _number(limit, "effort", math.nan)
        effort = math.inf if effort >= 1e30 else effort
        bounded = kind in ("revolute", "prismatic")
        low, high = _number(limit, "lower", 0.0), _number(limit, "upper", 0.0)
        mimic = joint.find("mimic")
        follows = None
        if mimic is not None:
            ratio = _number(mimic, "multiplier", 1.0), _number(mimic, "offset", 0.0)
            follows = (mimic.attrib.get("joint", ""), *ratio)
        damping, friction = _number(dynamics, "damping", 0.0), _number(dynamics, "friction", 0.0)
        out[joint.attrib.get("name", "")] = JointPart(
            _SINGLE.get(kind, kind),
            keys[parent],
            child,
            turn @ (np.array(axis) / np.linalg.norm(axis)) if kind in _SINGLE else np.zeros(3),
            frames[child][:3, 3],
            np.array([low, high]) if bounded else np.array([-np.inf, np.inf]),
            np.array([-effort, effort]),
            _number(limit, "velocity", math.nan),
            np.array([damping, friction, 0.0, 0.0]),
            follows,
        )
    return out


def _number(node: Node | None, name: str, default: float) -> float:
    found = numbers(node, name)
    return found[0] if found else default


def _without_free_root(
    joints: dict[str, JointPart], bodies: dict[str, BodyPart], free: str
) -> tuple[dict[str, JointPart], dict[str, BodyPart]]:
    """Returns joints and bodies of a robot whose free root is a joint of its URDF."""
    kept = {
        name: replace(joint, carrier=BASE if joint.carrier == free else joint.carrier)
        for name, joint in joints.items()
        if name != free
    }
    others = {key: body for key, body in bodies.items() if key not in (BASE, free)}
    return kept, {BASE: bodies[free], **others}


def _driven(robot: Robot, joints: dict[str, JointPart]) -> dict[str, JointPart]:
    """Returns joints with the armature and friction of what drives them."""
    out = dict(joints)
    for servo in robot.modules.servos:
        joint = out[servo.joint]
        passive = np.array([joint.passive[0], servo.friction, servo.armature, 0.0])
        out[servo.joint] = replace(joint, passive=passive)
    for screw in robot.modules.screws:
        joint = out[screw.joint]
        passive = np.array([*joint.passive[:2], screw.armature, 0.0])
        effort = np.array([-screw.torque, screw.torque])
        out[screw.joint] = replace(joint, passive=passive, effort=effort)
    return out


def _actuators(
    robot: Robot, frames: dict[str, Floats], joints: dict[str, JointPart]
) -> dict[str, ActuatorPart]:
    """Returns the actuators that modules declare, with the names that an MJCF gives them."""
    out = {}
    rotors = [r for a in robot.modules.apparatuses for r in a.rotors]
    free = np.array([-np.inf, np.inf])
    for k, rotor in enumerate(rotors):
        body = int(robot.rotors.body[k])
        key = robot.joint_names[body - 1] if body > 0 else BASE
        pose = frames[rotor.link]
        axis = pose[:3, :3] @ np.asarray(rotor.axis)
        point = pose[:3, 3] + pose[:3, :3] @ np.asarray(rotor.position)
        out[rotor.label] = ActuatorPart(
            f"body {key}",
            np.concatenate([axis, rotor.drag_ratio * axis]),
            point,
            1.0,
            np.zeros(3),
            np.array([rotor.thrust_min, rotor.thrust_max]),
            free,
            rotor.lag,
        )
    for servo in robot.modules.servos:
        joint = joints[servo.joint]
        known = bool(joint.effort[1] > 0)
        out[servo.joint] = ActuatorPart(
            f"joint {servo.joint}",
            np.eye(6)[0],
            np.zeros(3),
            servo.stiffness,
            np.array([0.0, -servo.stiffness, -servo.damping]),
            joint.limits,
            joint.effort if known else free,
            0.0,
        )
    for screw in robot.modules.screws:
        out[screw.joint] = _drum(screw)
    return out


def _drum(screw: Screw) -> ActuatorPart:
    gear = np.eye(6)[0]
    if screw.rollers == "ball":
        gear = np.array([1.0, -1.0 / math.tan(screw.alpha), 0.0, 0.0, 0.0, 0.0])
    return ActuatorPart(
        f"joint {screw.joint}",
        gear,
        np.zeros(3),
        screw.gain,
        np.array([0.0, 0.0, -screw.gain]),
        np.array([-np.inf, np.inf]),
        np.array([-screw.torque, screw.torque]),
        0.0,
    )
