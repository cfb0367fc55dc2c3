"""The rules of the lint that look past the grammar: the tree, its bodies and its joints.

Each function takes the ``<robot>`` element and yields findings. Numbers that the grammar has
already refused are passed over here, so one mistake gives one finding.
"""

import math
from collections.abc import Iterator

import numpy as np

from snakegen.description.finding import Finding, error, label, number, numbers, shapes, warning
from snakegen.description.urdf_grammar import JOINT_AXES
from snakegen.description.xmltree import Node
from snakegen.errors import near

DEFINITE_TOLERANCE = 1e-12
"""Smallest principal moment of inertia, relative to the largest."""

TRIANGLE_TOLERANCE = 1e-6
"""How far I1 + I2 may fall short of I3, relative to I3: a flat plate printed with six digits."""

AXIS_TOLERANCE = (1e-6, 1e-3)
"""Deviation of an axis' length from 1 that is a warning (printed digits), and an error."""


def _end(joint: Node, side: str) -> str | None:
    node = joint.find(side)
    return None if node is None else node.attrib.get("link")


def tree_faults(robot: Node) -> Iterator[Finding]:
    """Yields duplicate names, dangling ends, second parents, loops, and missing or extra roots."""
    for tag in ("link", "joint", "material"):
        first: dict[str, int] = {}
        for node in robot.findall(tag):
            name = node.attrib.get("name", "")
            if name in first:
                message = f"the name is already taken on line {first[name]}"
                yield error(f"duplicate_{tag}", label(node), node.line, message)
            first.setdefault(name, node.line)
    links = {node.attrib.get("name", ""): node for node in robot.findall("link")}
    parent_of: dict[str, str] = {}
    via: dict[str, Node] = {}
    for joint in robot.findall("joint"):
        ends = {side: _end(joint, side) for side in ("parent", "child")}
        for side, end in ends.items():
            if end is not None and end not in links:
                message = f"its {side} link {end!r} does not exist.{near(end, links)}"
                line = getattr(joint.find(side), "line", joint.line)
                yield error(f"dangling_{side}", label(joint), line, message)
        parent, child = ends["parent"], ends["child"]
        if parent not in links or child not in links or parent is None or child is None:
            continue
        if child in via:
            message = f"link {child!r} already hangs on {label(via[child])}, so the tree has a loop"
            yield error("two_parents", label(joint), joint.line, message)
        else:
            parent_of[child], via[child] = parent, joint
    yield from _root_faults(robot, links, parent_of)
    yield from _loop_faults(parent_of, via)


def _root_faults(
    robot: Node, links: dict[str, Node], parent_of: dict[str, str]
) -> Iterator[Finding]:
    # links that a dangling joint was meant to hold are reported with that joint, not as roots
    children = {_end(joint, "child") for joint in robot.findall("joint")}
    if not children <= {None, *links}:
        return
    roots = [name for name in links if name not in parent_of and name not in children]
    if not roots:
        reason = "every link is some joint's child" if links else "there is no link"
        yield error("no_root", label(robot), robot.line, f"the tree has no root: {reason}")
    for name in roots[1:]:
        message = f"a second root beside link {roots[0]!r}; join the two with a joint"
        yield error("two_roots", label(links[name]), links[name].line, message)


def _loop_faults(parent_of: dict[str, str], via: dict[str, Node]) -> Iterator[Finding]:
    done: set[str] = set()
    for start in parent_of:
        path: list[str] = []
        name: str | None = start
        while name is not None and name not in done:
            done.add(name)
            path.append(name)
            name = parent_of.get(name)
        if name in path:
            loop = path[path.index(name) :]
            message = f"the links {' < '.join([*loop, loop[0]])} form a closed loop"
            yield error("loop", label(via[loop[0]]), via[loop[0]].line, message)


def body_faults(robot: Node) -> Iterator[Finding]:
    """Yields impossible masses and inertias, moving bodies without mass, and impossible sizes."""
    heavy: set[str] = set()
    for link in robot.findall("link"):
        inertial = link.find("inertial")
        if inertial is not None:
            yield from _mass_faults(link, inertial)
            yield from _inertia_faults(link, inertial)
            heavy.add(link.attrib.get("name", ""))
        for shape in shapes(link):
            yield from _size_faults(link, shape)
    yield from _massless_faults(robot, heavy)


def _mass_faults(link: Node, inertial: Node) -> Iterator[Finding]:
    node = inertial.find("mass")
    mass = number(node, "value")
    if node is not None and mass is not None and mass <= 0:
        what = "negative" if mass < 0 else "zero; a mere frame has no <inertial>"
        yield error("bad_mass", label(link), node.line, f"its mass {mass:g} kg is {what}")


def _inertia_faults(link: Node, inertial: Node) -> Iterator[Finding]:
    node = inertial.find("inertia")
    entries = [number(node, name) for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")]
    if node is None or any(entry is None for entry in entries):
        return
    xx, xy, xz, yy, yz, zz = (float(entry) for entry in entries if entry is not None)
    low, mid, high = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    moments = f"principal moments {low:.4g}, {mid:.4g}, {high:.4g} kg m²"
    if low <= DEFINITE_TOLERANCE * abs(high):
        message = f"its inertia is not positive definite: {moments}"
        yield error("bad_inertia", label(link), node.line, message)
    elif low + mid < high * (1 - TRIANGLE_TOLERANCE):
        message = f"no body has this inertia, the largest moment exceeds the sum: {moments}"
        yield error("inertia_triangle", label(link), node.line, message)


def _size_faults(link: Node, shape: Node) -> Iterator[Finding]:
    sizes = {"box": ("size", 3), "mesh": ("scale", 3)}
    asked = [sizes[shape.tag]] if shape.tag in sizes else [("radius", 1), ("length", 1)]
    for name, count in asked:
        values = numbers(shape, name, count) or ()
        # a negative scale mirrors a mesh, which is legal
        if any(v == 0 if name == "scale" else v <= 0 for v in values):
            message = f"{name}={shape.attrib[name]!r} of a <{shape.tag}> must be positive"
            yield error("bad_size", label(link), shape.line, message)


def _massless_faults(robot: Node, heavy: set[str]) -> Iterator[Finding]:
    """Moving bodies are sets of links welded by fixed joints; each needs a mass somewhere."""
    joints = robot.findall("joint")
    welded: dict[str, list[str]] = {}
    for joint in joints:
        if joint.attrib.get("type") == "fixed":
            welded.setdefault(_end(joint, "parent") or "", []).append(_end(joint, "child") or "")
    links = {link.attrib.get("name", ""): link for link in robot.findall("link")}
    for joint in joints:
        name = _end(joint, "child")
        if joint.attrib.get("type") == "fixed" or name not in links or name is None:
            continue
        body, queue = {name}, [name]
        while queue:
            fresh = [child for child in welded.get(queue.pop(), []) if child not in body]
            body.update(fresh)
            queue.extend(fresh)
        if not body & heavy:
            message = f"moves by {label(joint)} but has no <inertial>, nor has any link fixed to it"
            yield error("massless", label(links[name]), links[name].line, message)


def joint_faults(robot: Node) -> Iterator[Finding]:
    """Yields unknown joint types, bad axes and limits, negative damping, and bad mimics."""
    joints = {joint.attrib.get("name", ""): joint for joint in robot.findall("joint")}
    for joint in robot.findall("joint"):
        kind = joint.attrib.get("type")
        if kind is None:
            continue
        if kind not in JOINT_AXES:
            message = f"unknown joint type {kind!r}.{near(kind, JOINT_AXES)}"
            yield error("unknown_joint_type", label(joint), joint.line, message)
            continue
        if JOINT_AXES[kind]:
            yield from _axis_faults(joint)
        yield from _limit_faults(joint, needed=kind in ("revolute", "prismatic"))
        yield from _dynamics_faults(joint)
        yield from _mimic_faults(joint, joints)


def _axis_faults(joint: Node) -> Iterator[Finding]:
    node = joint.find("axis")
    axis = numbers(node, "xyz", 3)
    if node is None or axis is None:
        return
    length = math.hypot(*axis)
    shown = f"its axis {node.attrib['xyz']!r}"
    if length == 0:
        yield error("zero_axis", label(joint), node.line, f"{shown} has no direction")
    elif abs(length - 1) > AXIS_TOLERANCE[1]:
        message = f"{shown} has length {length:.6g}, not 1"
        yield error("axis_not_unit", label(joint), node.line, message)
    elif abs(length - 1) > AXIS_TOLERANCE[0]:
        message = f"{shown} has length {length:.9g}, not 1; print more digits"
        yield warning("axis_rounded", label(joint), node.line, message)


def _limit_faults(joint: Node, *, needed: bool) -> Iterator[Finding]:
    node = joint.find("limit")
    if node is None:
        if needed:
            message = f"a {joint.attrib['type']} joint needs a <limit> with effort and velocity"
            yield error("missing_limit", label(joint), joint.line, message)
        return
    for name in ("effort", "velocity"):
        value = number(node, name)
        if needed and name not in node.attrib:
            message = f"its <limit> has no {name}"
            yield error("missing_limit", label(joint), node.line, message)
        elif value is not None and value < 0:
            message = f"its {name} limit {value:g} is negative"
            yield error("negative_limit", label(joint), node.line, message)
    # absent bounds are 0 in the format
    lower, upper = (number(node, s) if s in node.attrib else 0.0 for s in ("lower", "upper"))
    if lower is None or upper is None:
        return
    if lower > upper:
        message = f"its lower limit {lower:g} exceeds its upper limit {upper:g}"
        yield error("limits_swapped", label(joint), node.line, message)
    elif needed and lower == upper:
        message = f"cannot move: lower and upper limit are both {lower:g}"
        yield warning("locked_joint", label(joint), node.line, message)


def _dynamics_faults(joint: Node) -> Iterator[Finding]:
    node = joint.find("dynamics")
    for name in ("damping", "friction"):
        value = number(node, name)
        if node is not None and value is not None and value < 0:
            message = f"its {name} {value:g} is negative and would feed energy in"
            yield error("negative_dynamics", label(joint), node.line, message)


def _mimic_faults(joint: Node, joints: dict[str, Node]) -> Iterator[Finding]:
    name = joint.attrib.get("name", "")
    node = joint.find("mimic")
    seen = [name]
    while node is not None and "joint" in node.attrib:
        leader = node.attrib["joint"]
        if leader not in joints:
            if len(seen) == 1:
                others = [other for other in joints if other != name]
                message = f"mimics {leader!r}, which does not exist.{near(leader, others)}"
                yield error("dangling_mimic", label(joint), node.line, message)
            return
        if leader in seen:
            if leader == name:
                message = f"mimics itself: {' → '.join([*seen, leader])}"
                yield error("mimic_loop", label(joint), node.line, message)
            return
        seen.append(leader)
        node = joints[leader].find("mimic")
