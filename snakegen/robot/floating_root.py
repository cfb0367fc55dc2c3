"""A URDF whose free base is a joint of its own: the joint is taken off, the base stays free."""

import xml.etree.ElementTree as ET


def without_floating_root(text: str) -> tuple[str, str | None]:
    """Returns the URDF without a floating joint that holds its root, and the link above it.

    The joint of type ``floating`` between a root link without mass, often called ``world``, and
    the robot says that the robot is free: what a free root link says too. Its pose is where the
    robot starts and is dropped.

    Args:
        text: sound URDF text.

    Returns:
        The text as it was and None where there is no such joint.
    """
    if "floating" not in text:
        return text, None
    robot = ET.fromstring(text)
    joints = robot.findall("joint")
    children = {e.get("link") for j in joints for e in j.findall("child")}
    root = next(link for link in robot.findall("link") if link.get("name") not in children)
    here = [j for j in joints for e in j.findall("parent") if e.get("link") == root.get("name")]
    if len(here) != 1 or here[0].get("type") != "floating" or root.find("inertial") is not None:
        return text, None
    robot.remove(root)
    robot.remove(here[0])
    return ET.tostring(robot, encoding="unicode"), root.get("name")
