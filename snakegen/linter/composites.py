"""Inertia of the bodies that move: links welded by fixed joints, summed as parsers do.

A sensor frame with an impossible inertia is harmless on a sound link: only the sum moves. So the
linter calls an inertia an error where the sum that it belongs to is one too.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from snakegen.linter.finding import number, numbers
from snakegen.linter.tree_rules import end_of
from snakegen.linter.xml_tree import Node

Floats = NDArray[np.float64]
ENTRIES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


@dataclass(frozen=True)
class Composite:
    """A moving body: the links welded to `carrier`.

    Attributes:
        carrier: the link that moves.
        links: it and all that is welded to it.
        mass: kg, of all.
        centre: (3,) m, centre of mass in the carrier's frame.
        tensor: (3, 3) kg·m², inertia about that centre, in the carrier's axes.
        moments: its principal moments, ascending.
    """

    carrier: str
    links: frozenset[str]
    mass: float
    centre: Floats
    tensor: Floats
    moments: tuple[float, float, float]


def composites(robot: Node) -> Iterator[Composite]:
    """Yields the moving bodies of a robot; those with unreadable numbers are left out."""
    links = {node.attrib.get("name", ""): node for node in robot.findall("link")}
    welded: dict[str, list[Node]] = {}
    moved, held = [], set()
    for joint in robot.findall("joint"):
        child = end_of(joint, "child") or ""
        held.add(child)
        if joint.attrib.get("type") == "fixed":
            welded.setdefault(end_of(joint, "parent") or "", []).append(joint)
        else:
            moved.append(child)
    roots = [name for name in links if name not in held]
    for name in [*roots, *moved]:
        if name in links:
            yield _composite(name, links, welded)


def _composite(name: str, links: dict[str, Node], welded: dict[str, list[Node]]) -> Composite:
    parts: list[tuple[float, Floats, Floats]] = []
    seen: set[str] = set()
    waiting: list[tuple[str, Floats, Floats]] = [(name, np.eye(3), np.zeros(3))]
    while waiting:
        link, rotation, position = waiting.pop()
        if link in seen or link not in links:
            continue
        seen.add(link)
        body = rigid_body(links[link])
        if body is not None:
            mass, com, tensor = body
            parts.append((mass, position + rotation @ com, rotation @ tensor @ rotation.T))
        for joint in welded.get(link, []):
            turn, shift = placement(joint.find("origin"))
            there = end_of(joint, "child") or ""
            waiting.append((there, rotation @ turn, position + rotation @ shift))
    total = sum(mass for mass, _, _ in parts)
    tensor, centre = np.zeros((3, 3)), np.zeros(3)
    if total > 0.0:
        centre = np.asarray(sum(mass * com for mass, com, _ in parts)) / total
        for mass, com, own in parts:
            arm = com - centre
            tensor += own + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    low, mid, high = np.linalg.eigvalsh(tensor)
    moments = (float(low), float(mid), float(high))
    return Composite(name, frozenset(seen), total, centre, tensor, moments)


def inertial_of(link: Node) -> tuple[float, tuple[float, float, float]] | None:
    """Returns mass and principal moments of a link's <inertial>; None where there is none."""
    body = rigid_body(link)
    if body is None:
        return None
    low, mid, high = np.linalg.eigvalsh(body[2])
    return body[0], (float(low), float(mid), float(high))


def rigid_body(link: Node) -> tuple[float, Floats, Floats] | None:
    inertial = link.find("inertial")
    if inertial is None:
        return None
    mass = number(inertial.find("mass"), "value")
    entries = [number(inertial.find("inertia"), name) for name in ENTRIES]
    if mass is None or any(entry is None for entry in entries):
        return None
    xx, xy, xz, yy, yz, zz = (float(entry or 0.0) for entry in entries)
    turn, com = placement(inertial.find("origin"))
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return mass, com, turn @ tensor @ turn.T


def placement(origin: Node | None) -> tuple[Floats, Floats]:
    """Returns rotation and translation of an <origin>; rpy turns about fixed x, y, z in turn."""
    roll, pitch, yaw = numbers(origin, "rpy", 3) or (0.0, 0.0, 0.0)
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(a), math.cos(a)) for a in (roll, pitch, yaw))
    rotation = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    return rotation, np.array(numbers(origin, "xyz", 3) or (0.0, 0.0, 0.0))
