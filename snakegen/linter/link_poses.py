"""Poses of a URDF's links with all joint coordinates at 0."""

import numpy as np

from snakegen.linter.composites import Floats, placement
from snakegen.linter.tree_rules import end_of
from snakegen.linter.xml_tree import Node


def link_poses(root: Node) -> dict[str, Floats]:
    """Returns the (4, 4) pose of each link with all joint coordinates at 0, the root's at 1."""
    below: dict[str, list[Node]] = {}
    children = set()
    for joint in root.findall("joint"):
        below.setdefault(end_of(joint, "parent") or "", []).append(joint)
        children.add(end_of(joint, "child"))
    names = [link.attrib.get("name", "") for link in root.findall("link")]
    waiting = [(name, np.eye(4)) for name in names if name not in children]
    poses: dict[str, Floats] = {}
    while waiting:
        name, pose = waiting.pop()
        poses[name] = pose
        for joint in below.get(name, []):
            step = np.eye(4)
            step[:3, :3], step[:3, 3] = placement(joint.find("origin"))
            waiting.append((end_of(joint, "child") or "", pose @ step))
    return {name: poses[name] for name in names}
