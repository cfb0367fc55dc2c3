"""The rules of the linter about the rotors of a ``<snakegen>`` element: units and lift."""

from collections.abc import Iterator

from snakegen.linter.finding import Finding, finding, label, number
from snakegen.linter.xml_tree import Node

GRAVITY = 9.81  # m/s²
DRAG_RATIOS = (1e-5, 0.5)  # m


def rotor_faults(robot: Node) -> Iterator[Finding]:
    """Yields drag ratios in other units, and rotors that together do not lift the robot."""
    element = robot.find("snakegen")
    rotors = list(_all(element, "rotor")) if element is not None else []
    for rotor in rotors:
        ratio = number(rotor, "drag_ratio")
        if ratio and not DRAG_RATIOS[0] <= abs(ratio) <= DRAG_RATIOS[1]:
            message = f"a drag_ratio of {ratio:g} m"
            yield finding("drag_ratio", label(rotor), rotor.line, message)
    masses = [number(n, "value") for link in robot.findall("link") for n in _all(link, "mass")]
    weight = GRAVITY * sum(m for m in masses if m is not None)
    thrusts = [number(rotor, "thrust_max") for rotor in rotors]
    if element is not None and thrusts and None not in thrusts:
        thrust = sum(t for t in thrusts if t is not None)
        if thrust < weight:
            message = f"{thrust:.4g} N of thrust for {weight:.4g} N of weight"
            yield finding("thrust_to_weight", label(element), element.line, message)


def _all(node: Node | None, tag: str) -> Iterator[Node]:
    """Yields every descendant with a tag."""
    waiting = [] if node is None else list(node.children)
    while waiting:
        child = waiting.pop(0)
        if child.tag == tag:
            yield child
        waiting.extend(child.children)
