"""The rules of the linter about masses and inertias, and whether any body has them."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from snakegen.linter.composites import ENTRIES, composites
from snakegen.linter.finding import Finding, finding, label, number, numbers, shapes
from snakegen.linter.tree_rules import end_of
from snakegen.linter.xml_tree import Node

DEFINITE_TOLERANCE = 1e-12
"""Smallest principal moment of inertia, relative to the largest."""

POINT = 1e-6
"""m; a radius of gyration below this is no body's (MuJoCo refuses moments below 1e-15 kg·m²)."""

FAR = 50.0  # m
LEAST_BALL = 0.1  # of the radius of gyration of a ball of the densest metal
THIN, DENSE = 1.0, 3e4  # kg/m³, of any part


@dataclass(frozen=True)
class Extent:
    """What a link's primitive shapes span: reach from the link's origin, size, volume."""

    reach: float  # m
    size: float  # m, of the largest shape
    volume: float  # m³, of the collision shapes, else of the visual ones


def body_faults(robot: Node) -> Iterator[Finding]:
    """Yields impossible or implausible masses, inertias and sizes, and moving massless bodies."""
    links = robot.findall("link")
    heavy: set[str] = set()
    sound = {
        name
        for body in composites(robot)
        if body.mass > 0 and tensor_fault(body.mass, body.moments, 0.0) is None
        for name in body.links
        if len(body.links) > 1
    }
    steps = (numbers(j.find("origin"), "xyz", 3) for j in robot.findall("joint"))
    reach = 10.0 * sum(math.hypot(*step) for step in steps if step)
    widest = min(FAR, reach) if reach > 0.0 else FAR
    for link in links:
        inertial = link.find("inertial")
        if inertial is not None:
            mass = number(inertial.find("mass"), "value")
            if mass != 0.0:  # an unreadable one is the grammar's finding
                heavy.add(link.attrib.get("name", ""))
            welded = link.attrib.get("name", "") in sound
            yield from _inertial_faults(link, inertial, mass, welded, widest)
        for shape in shapes(link):
            yield from _size_faults(link, shape)
        for node in [link.find("inertial"), *link.findall("visual"), *link.findall("collision")]:
            if node is not None:
                yield from _far_faults(link, node)
    for joint in robot.findall("joint"):
        yield from _far_faults(joint, joint)
    if links and not heavy:
        yield finding("no_mass", label(robot), robot.line, "no link has a mass")
    else:
        yield from _massless_faults(robot, heavy)


def _inertial_faults(
    link: Node, inertial: Node, mass: float | None, welded: bool, widest: float
) -> Iterator[Finding]:
    """Yields findings of one <inertial>.

    Args:
        link, inertial, mass: the link, its element and mass [kg].
        welded: the body that it is part of is sound.
        widest: m, ten times what the joints reach: no link without shapes is larger.
    """
    node, where = inertial.find("inertia"), label(link)
    entries = [number(node, name) for name in ENTRIES]
    moments = None
    if node is not None and None not in entries:
        moments = principal_moments([e for e in entries if e is not None])
    if mass is not None and mass < 0:
        line = getattr(inertial.find("mass"), "line", inertial.line)
        yield finding("negative_mass", where, line, f"its mass {mass:g} kg is negative")
        return
    if mass == 0:
        still = moments is None or max(map(abs, moments)) == 0
        code = "massless_frame" if still else "inertia_without_mass"
        message = "zero mass and inertia: a frame" if still else "an inertia, but a mass of 0"
        yield finding(code, where, getattr(inertial.find("mass"), "line", 1), message)
        return
    if node is None or moments is None or mass is None:
        return
    fault = tensor_fault(mass, moments, printed_step(node))
    if fault is not None:
        code, message = fault
        if welded:
            message += "; the link that it is fixed to makes up for it"
        yield finding(code, where, node.line, message, "note" if welded else None)
    else:
        found = _plausibility(link, inertial, node, mass, moments, widest)
        for one in found:
            mild = welded and one.code == "gyration_small"
            yield replace(one, severity="note") if mild else one


def principal_moments(entries: list[float]) -> tuple[float, float, float]:
    """Returns the eigenvalues of the symmetric matrix (xx, xy, xz, yy, yz, zz), ascending."""
    xx, xy, xz, yy, yz, zz = entries
    low, mid, high = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return float(low), float(mid), float(high)


def printed_step(node: Node) -> float:
    """Returns one unit in the last printed digit of an <inertia>'s diagonal, the largest one.

    A printed 0 is exact.
    """
    steps = [0.0]
    for name in ("ixx", "iyy", "izz"):
        digits, _, exponent = node.attrib[name].lower().partition("e")
        if float(digits) != 0.0:
            steps.append(10.0 ** (int(exponent or 0) - len(digits.partition(".")[2])))
    return max(steps)


def tensor_fault(
    mass: float, moments: tuple[float, float, float], step: float
) -> tuple[str, str] | None:
    """Returns (code, message) of what no body's inertia has; None where it is sound.

    Args:
        mass: kg, positive.
        moments: principal moments, ascending, kg·m².
        step: one unit in the last printed digit, kg·m²: two of them are forgiven, up to 2 %.
    """
    low, mid, high = moments
    shown = f"principal moments {low:.4g}, {mid:.4g}, {high:.4g} kg·m²"
    slack = min(2.0 * step, 0.02 * abs(high)) + 1e-12 * abs(high)
    if 0 <= high < mass * POINT**2:
        message = f"{mass:g} kg of radius of gyration {math.sqrt(high / mass):.1e} m"
        return "point_inertia", f"{message}: no body has it"
    if low < -slack or (low <= DEFINITE_TOLERANCE * abs(high) and high > slack):
        return "bad_inertia", f"not positive definite: {shown}"
    if low + mid < high * (1 - 1e-6) - slack:
        return "inertia_triangle", f"the largest moment exceeds the sum of the others: {shown}"
    return None


def _plausibility(
    link: Node,
    inertial: Node,
    node: Node,
    mass: float,
    moments: tuple[float, float, float],
    widest: float,
) -> Iterator[Finding]:
    where, line = label(link), node.line
    if mass == 1.0 and moments == (1.0, 1.0, 1.0):
        yield finding("identity_inertia", where, line, "mass 1 and inertia 1 1 1: placeholders")
        return
    if not 1e-7 <= mass <= 1e4:
        yield finding("mass_range", where, inertial.line, f"its mass is {mass:g} kg")
    extent = _extent(link)
    gyration = math.sqrt(max(moments[2], 0.0) / mass)
    size = extent.size if extent else widest
    if gyration > (1.2 * size if extent else size):
        message = f"radius of gyration {gyration:.3g} m, the body spans {size:.3g} m"
        yield finding("gyration_large", where, line, message)
    elif extent is None and gyration < LEAST_BALL * _densest_ball(mass):
        message = f"{mass:g} kg with a radius of gyration of {1e3 * gyration:.2g} mm"
        yield finding("gyration_small", where, line, f"{message} are denser than any metal")
    elif extent and gyration < 1e-3 * size:
        message = f"radius of gyration {gyration:.3g} m, the body spans {size:.3g} m"
        yield finding("gyration_small", where, line, message)
    if extent is None:
        return
    com = numbers(inertial.find("origin"), "xyz", 3) or (0.0, 0.0, 0.0)
    if math.hypot(*com) > extent.reach + extent.size:
        message = f"its centre of mass is {math.hypot(*com):.3g} m away, its shapes reach "
        yield finding("com_outside", where, inertial.line, f"{message}{extent.reach:.3g} m")
    density = mass / extent.volume if extent.volume > 0 else 0.0
    if extent.volume > 0 and not THIN <= density <= DENSE:
        message = f"{mass:g} kg in {extent.volume:.3g} m³ is {density:.3g} kg/m³"
        yield finding("density", where, inertial.line, message)


def _densest_ball(mass: float) -> float:
    """Returns the radius of gyration [m] of a ball of osmium, 22.6 t/m³: no body has a smaller."""
    return float(0.632 * (3.0 * mass / (4.0 * math.pi * 22600.0)) ** (1.0 / 3.0))


def _extent(link: Node) -> Extent | None:
    """Returns what the primitive shapes of a link span; None without one, or with a mesh."""
    reach = size = 0.0
    volumes = {"visual": 0.0, "collision": 0.0}
    for part in (p for p in link.children if p.tag in volumes):
        geometry = part.find("geometry")
        if geometry is not None and len(geometry.children) != 1:
            return None
        for shape in geometry.children if geometry else ():
            measured = _measure(shape)
            if measured is None:
                return None
            span, volume = measured
            place = numbers(part.find("origin"), "xyz", 3) or (0.0, 0.0, 0.0)
            size = max(size, span)
            reach = max(reach, math.hypot(*place) + 0.5 * span)
            volumes[part.tag] += volume
    if size <= 0.0:
        return None
    return Extent(reach, size, volumes["collision"] or volumes["visual"])


def _measure(shape: Node) -> tuple[float, float] | None:
    """Returns the diagonal [m] and the volume [m³] of a primitive shape; None for others."""
    radius, length = number(shape, "radius"), number(shape, "length")
    if shape.tag == "box":
        box = numbers(shape, "size", 3)
        return None if box is None else (math.hypot(*box), math.prod(box))
    if shape.tag == "sphere" and radius is not None:
        return 2.0 * radius, 4.0 / 3.0 * math.pi * radius**3
    if shape.tag in ("cylinder", "capsule") and radius is not None and length is not None:
        return math.hypot(2.0 * radius, length), math.pi * radius**2 * length
    return None


def _size_faults(link: Node, shape: Node) -> Iterator[Finding]:
    sizes = {"box": ("size", 3), "mesh": ("scale", 3)}
    asked = [sizes[shape.tag]] if shape.tag in sizes else [("radius", 1), ("length", 1)]
    for name, count in asked:
        values = numbers(shape, name, count) or ()
        shown = f"{name}={shape.attrib.get(name)!r} of a <{shape.tag}>"
        if any(v == 0 if name == "scale" else v <= 0 for v in values):
            yield finding("bad_size", label(link), shape.line, f"{shown} must be positive")
        elif name == "scale" and math.prod(values or (1.0,)) < 0:
            yield finding("mirrored_mesh", label(link), shape.line, f"{shown} mirrors it")
        elif name != "scale" and any(v > FAR for v in values):
            yield finding("size_range", label(link), shape.line, f"{shown} exceeds {FAR:g} m")


def _far_faults(owner: Node, node: Node) -> Iterator[Finding]:
    origin = node.find("origin")
    place = numbers(origin, "xyz", 3)
    if origin is not None and place is not None and math.hypot(*place) > FAR:
        message = f"an origin {math.hypot(*place):.4g} m away"
        yield finding("size_range", label(owner), origin.line, message)


def _massless_faults(robot: Node, heavy: set[str]) -> Iterator[Finding]:
    """Yields bodies (links welded by fixed joints) that move and have no mass, or nothing outward.

    Args:
        robot: the root element.
        heavy: links with a mass.
    """
    joints = [
        (j, end_of(j, "parent") or "", end_of(j, "child") or "") for j in robot.findall("joint")
    ]
    above = [(child, parent) for _, parent, child in joints]
    welded = [(c, p) for j, p, c in joints if j.attrib.get("type") == "fixed"]
    carry, weigh = _upward(heavy, above), _upward(heavy, welded)
    links = {link.attrib.get("name", ""): link for link in robot.findall("link")}
    for joint, _, child in joints:
        if joint.attrib.get("type") == "fixed" or child not in links:
            continue
        where, line = label(links[child]), links[child].line
        if child not in carry:
            message = f"nothing that {label(joint)} moves has a mass"
            yield finding("massless_tip", where, line, message)
        elif child not in weigh:
            message = f"moves by {label(joint)} but has no mass, nor has any link fixed to it"
            yield finding("massless", where, line, message)


def _upward(start: set[str], above: list[tuple[str, str]]) -> set[str]:
    """Returns the links of `start` and all that lie above them by way of (child, parent) pairs."""
    parents: dict[str, list[str]] = {}
    for child, parent in above:
        parents.setdefault(child, []).append(parent)
    found, queue = set(start), list(start)
    while queue:
        fresh = [parent for parent in parents.get(queue.pop(), []) if parent not in found]
        found.update(fresh)
        queue.extend(fresh)
    return found
