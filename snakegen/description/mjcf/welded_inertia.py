"""Inertias of welded links that MuJoCo refuses, summed into the link that carries them.

MuJoCo keeps a body for every link and checks each inertia; Pinocchio sums what fixed joints weld.
Where a welded link has an inertia that no body has, the sum moves to the carrier: the same robot.
"""

import xml.etree.ElementTree as ET

from snakegen.linter.body_rules import tensor_fault
from snakegen.linter.composites import ENTRIES, Composite, composites, inertial_of
from snakegen.linter.xml_tree import parse_xml


def weld_inertias(robot: ET.Element) -> tuple[str, ...]:
    """Moves inertias in place; returns the links whose inertia was summed into their carrier's.

    Args:
        robot: the root element of a URDF.
    """
    node = parse_xml(ET.tostring(robot, encoding="unicode"))
    links = {str(link.get("name")): link for link in robot.iterfind("link")}
    own = {link.attrib.get("name", ""): inertial_of(link) for link in node.findall("link")}
    moved: list[str] = []
    for body in composites(node):
        members = [name for name in body.links if own.get(name) is not None]
        faulty = [name for name in members if _refused(own[name])]
        if not faulty or len(members) < 2 or tensor_fault(body.mass, body.moments, 0.0):
            continue
        for name in members:
            links[name].remove(_inertial(links[name]))
        links[body.carrier].append(_element(body))
        moved += members
    return tuple(moved)


def _refused(part: tuple[float, tuple[float, float, float]] | None) -> bool:
    """Tells whether MuJoCo refuses mass and principal moments of a link."""
    if part is None or part[0] <= 0.0:
        return part is not None and any(abs(m) > 0.0 for m in part[1])
    return tensor_fault(part[0], part[1], 0.0) is not None


def _inertial(link: ET.Element) -> ET.Element:
    found = link.find("inertial")
    if found is None:
        raise ValueError(f"link {link.get('name')} has no <inertial>")
    return found


def _element(body: Composite) -> ET.Element:
    """Returns the <inertial> of a whole body, in the axes of its carrier."""
    out = ET.Element("inertial")
    ET.SubElement(out, "origin", xyz=" ".join(f"{x:.17g}" for x in body.centre))
    ET.SubElement(out, "mass", value=f"{body.mass:.17g}")
    tensor = body.tensor
    upper = (tensor[0, 0], tensor[0, 1], tensor[0, 2], tensor[1, 1], tensor[1, 2], tensor[2, 2])
    values = {name: f"{x:.17g}" for name, x in zip(ENTRIES, upper, strict=True)}
    ET.SubElement(out, "inertia", values)
    return out
