"""The rules of the linter about joints: axes, limits, dynamics, mimics.

Numbers that the grammar has already refused are passed over here, so one mistake gives one
finding.
"""

import math
from collections.abc import Iterator

from snakegen.errors import near
from snakegen.linter.finding import Finding, finding, label, number, numbers
from snakegen.linter.grammar import JOINT_AXES
from snakegen.linter.rule import Severity
from snakegen.linter.xml_tree import Node

AXIS_TOLERANCE = (1e-6, 1e-3)
"""Deviation of an axis' length from 1 that is a note (printed digits), and a warning."""

WIDEST = 8.0 * math.pi
"""rad; four turns: limits beyond are degrees, or stand for a continuous joint."""

PLACEHOLDER = 1e5  # N·m


def joint_faults(robot: Node) -> Iterator[Finding]:
    """Yields unknown joint types, bad axes and limits, negative damping, and bad mimics."""
    joints = {joint.attrib.get("name", ""): joint for joint in robot.findall("joint")}
    for joint in robot.findall("joint"):
        kind = joint.attrib.get("type")
        if kind is None:
            continue
        if kind not in JOINT_AXES:
            message = f"unknown joint type {kind!r}.{near(kind, JOINT_AXES)}"
            yield finding("unknown_joint_type", label(joint), joint.line, message)
            continue
        if JOINT_AXES[kind]:
            yield from _axis_faults(joint)
        if kind == "planar":
            message = f"a {kind} joint"
            yield finding("multi_axis_joint", label(joint), joint.line, message)
        if kind in ("revolute", "prismatic", "continuous"):
            yield from _limit_faults(joint, needed=kind != "continuous")
            yield from _dynamics_faults(joint)
        yield from _angle_faults(joint)
        yield from _mimic_faults(joint, joints)


def _axis_faults(joint: Node) -> Iterator[Finding]:
    node = joint.find("axis")
    axis = numbers(node, "xyz", 3)
    if node is None or axis is None:
        return
    length = math.hypot(*axis)
    shown = f"its axis {node.attrib['xyz']!r}"
    if length == 0:
        yield finding("zero_axis", label(joint), node.line, f"{shown} has no direction")
    elif abs(length - 1) > AXIS_TOLERANCE[1]:
        message = f"{shown} has length {length:.6g}, not 1"
        yield finding("axis_not_unit", label(joint), node.line, message)
    elif abs(length - 1) > AXIS_TOLERANCE[0]:
        message = f"{shown} has length {length:.9g}, not 1"
        yield finding("axis_rounded", label(joint), node.line, message)


def _limit_faults(joint: Node, *, needed: bool) -> Iterator[Finding]:
    node = joint.find("limit")
    where = label(joint)
    if node is None:
        if needed:
            message = f"a {joint.attrib['type']} joint needs a <limit> with effort and velocity"
            yield finding("missing_limit", where, joint.line, message)
        return
    for name in ("effort", "velocity"):
        value = number(node, name)
        if needed and name not in node.attrib:
            yield finding("missing_limit", where, node.line, f"its <limit> has no {name}")
        elif value is not None and value < 0:
            message = f"its {name} limit {value:g} is negative"
            yield finding("negative_limit", where, node.line, message)
        elif value == 0:
            mild: Severity | None = None if needed else "note"  # a shaft, often of a rotor
            yield finding(f"no_{name}", where, node.line, f"its {name} limit is 0", mild)
    effort = number(node, "effort")
    if effort is not None and effort > PLACEHOLDER:
        message = f"its effort limit {effort:g} is no actuator's"
        yield finding("effort_placeholder", where, node.line, message)
    if needed:
        yield from _range_faults(joint, node)


def bounds(node: Node | None) -> tuple[float, float] | None:
    """Returns lower and upper of a <limit>, 0 where absent; None where a number is faulty."""
    if node is None:
        return None
    lower, upper = (number(node, s) if s in node.attrib else 0.0 for s in ("lower", "upper"))
    return None if lower is None or upper is None else (lower, upper)


def _range_faults(joint: Node, node: Node) -> Iterator[Finding]:
    found, where = bounds(node), label(joint)
    if found is None:
        return
    lower, upper = found
    if lower > upper:
        message = f"its lower limit {lower:g} exceeds its upper limit {upper:g}"
        yield finding("limits_swapped", where, node.line, message)
        return
    if lower == upper:
        message = f"cannot move: lower and upper limit are both {lower:g}"
        yield finding("locked_joint", where, node.line, message)
    elif lower > 0 or upper < 0:
        message = f"its range {lower:g} … {upper:g} excludes 0"
        yield finding("neutral_outside", where, node.line, message)
    if joint.attrib["type"] == "revolute" and _degrees(max(abs(lower), abs(upper)), WIDEST):
        message = f"its range {lower:g} … {upper:g} rad is more than four turns"
        yield finding("degrees_for_radians", where, node.line, message)
    soft = joint.find("safety_controller")
    for name, sign, limit in (("soft_lower_limit", 1, lower), ("soft_upper_limit", -1, upper)):
        value = number(soft, name)
        if soft is not None and value is not None and sign * (value - limit) < 0:
            message = f"its {name} {value:g} is outside its limit {limit:g}"
            yield finding("soft_limits", where, soft.line, message)


def _degrees(angle: float, least: float) -> bool:
    """Tells whether an angle in a radian's place is one in degrees: large, and a whole number."""
    return least < angle <= 3600.0 and abs(angle - round(angle)) < 1e-6


def _angle_faults(joint: Node) -> Iterator[Finding]:
    node = joint.find("origin")
    rpy = numbers(node, "rpy", 3)
    if node is not None and rpy is not None and any(_degrees(abs(a), 2.1 * math.pi) for a in rpy):
        message = f"rpy={node.attrib['rpy']!r} looks like degrees"
        yield finding("degrees_for_radians", label(joint), node.line, message)


def _dynamics_faults(joint: Node) -> Iterator[Finding]:
    node = joint.find("dynamics")
    if node is None:
        return
    for name in ("damping", "friction"):
        value = number(node, name)
        if value is not None and value < 0:
            message = f"its {name} {value:g} is negative and would feed energy in"
            yield finding("negative_dynamics", label(joint), node.line, message)
    friction, effort = number(node, "friction"), number(joint.find("limit"), "effort")
    if friction is not None and effort is not None and 0 < effort <= friction:
        message = f"its friction {friction:g} is not below its effort limit {effort:g}"
        yield finding("friction_above_effort", label(joint), node.line, message)


def _mimic_faults(joint: Node, joints: dict[str, Node]) -> Iterator[Finding]:
    name, where = joint.attrib.get("name", ""), label(joint)
    node = first = joint.find("mimic")
    seen = [name]
    while node is not None and "joint" in node.attrib:
        leader = node.attrib["joint"]
        if leader not in joints:
            if len(seen) == 1:
                others = [other for other in joints if other != name]
                message = f"mimics {leader!r}, which does not exist.{near(leader, others)}"
                yield finding("dangling_mimic", where, node.line, message)
            return
        if leader in seen:
            if leader == name:
                message = f"mimics itself: {' → '.join([*seen, leader])}"
                yield finding("mimic_loop", where, node.line, message)
            return
        seen.append(leader)
        node = joints[leader].find("mimic")
    if first is not None and len(seen) > 1:
        yield from _ratio_faults(joint, first, joints[seen[1]])


def _ratio_faults(joint: Node, node: Node, leader: Node) -> Iterator[Finding]:
    where = label(joint)
    kinds = joint.attrib.get("type"), leader.attrib.get("type")
    if "fixed" in kinds:
        message = f"mimics {label(leader)}, and one of the two is fixed"
        yield finding("fixed_mimic", where, node.line, message)
        return
    ratio = number(node, "multiplier") if "multiplier" in node.attrib else 1.0
    offset = number(node, "offset") if "offset" in node.attrib else 0.0
    if ratio == 0.0:
        yield finding("mimic_zero", where, node.line, "its mimic multiplier is 0")
        return
    if ratio is None or offset is None or "continuous" in kinds:
        return
    mine, its = bounds(joint.find("limit")), bounds(leader.find("limit"))
    if mine is None or its is None:
        return
    reached = sorted(ratio * angle + offset for angle in its)
    slack = 1e-3 + 0.01 * (mine[1] - mine[0])
    if reached[0] < mine[0] - slack or reached[1] > mine[1] + slack:
        message = (
            f"follows {label(leader)} over {reached[0]:g} … {reached[1]:g}, "
            f"outside its own limits {mine[0]:g} … {mine[1]:g}"
        )
        yield finding("mimic_range", where, node.line, message)
