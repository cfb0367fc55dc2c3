"""The base of an arm turned in the world, in the URDF itself, so that every analysis follows."""

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from math import isfinite

from snakegen.errors import PostureError
from snakegen.robot.robot import Robot, from_urdf_text


def mounted(robot: Robot, rpy: Sequence[float | str]) -> Robot:
    """Returns a robot whose fixed base has attitude `rpy`, in place of the one that it had.

    The URDF gets a root ``world`` and a fixed joint ``base_mount`` to the former root; where it has
    them, the joint's attitude changes.

    Args:
        robot: on a fixed base.
        rpy: rad, roll, pitch and yaw of the base in the world.

    Raises:
        PostureError: a floating base, whose attitude belongs to the posture.
    """
    if robot.floating:
        raise PostureError(f"{robot.name} floats: its attitude is part of the posture.")
    try:
        numbers = [float(x) for x in rpy]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) != 3 or not all(isfinite(x) for x in numbers):
        raise PostureError(f"base_rpy: three angles in rad are needed, not {rpy!r}.")
    root = ET.fromstring(robot.urdf)
    angles = " ".join(repr(x) for x in numbers)
    joint = next((j for j in root.iterfind("joint") if _from_world(j)), None)
    if joint is None:
        root.insert(0, ET.Element("link", name="world"))
        joint = ET.SubElement(root, "joint", name="base_mount", type="fixed")
        ET.SubElement(joint, "parent", link="world")
        ET.SubElement(joint, "child", link=robot.root_link)
    origin = joint.find("origin")
    if origin is None:
        origin = ET.SubElement(joint, "origin", xyz="0 0 0")
    origin.set("rpy", angles)
    mount = root.find("snakegen/mount")
    if mount is not None:
        mount.set("pose", "any")
    text = ET.tostring(root, encoding="unicode")
    turned = from_urdf_text(text, robot.path, checked=True)
    turned.model.armature[:] = robot.model.armature  # modules of a file are no part of the text
    return Robot(turned.name, text, robot.path, robot.modules, turned.model)


def _from_world(joint: ET.Element) -> bool:
    parent = joint.find("parent")
    return joint.get("type") == "fixed" and parent is not None and parent.get("link") == "world"
