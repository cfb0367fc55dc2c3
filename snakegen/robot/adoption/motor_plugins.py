"""Motors that a URDF declares to a simulator: direction, thrust, drag and lag of rotors."""

from dataclasses import dataclass
from math import isfinite
from xml.parsers import expat

from snakegen.linter.xml_tree import Node


@dataclass(frozen=True)
class MotorPlugin:
    """A motor of Gazebo's multicopter plugins, by the names of its link and joint.

    Attributes:
        link, joint: names, empty where it has none.
        spin: +1 counter-clockwise about the joint's axis, −1, or 0.
        thrust_max: N, motorConstant times the square of maxRotVelocity; 0 where unknown.
        moment_constant: m, drag torque over thrust; 0 where unknown.
        lag: s, timeConstantUp; 0 where unknown.
    """

    link: str
    joint: str
    spin: float
    thrust_max: float
    moment_constant: float
    lag: float


def motor_plugins(root: Node, text: str) -> list[MotorPlugin]:
    """Returns the motors in the ``<gazebo>`` elements of a URDF.

    Args:
        root: the root element.
        text: that it was read from.
    """
    blocks = root.findall("gazebo")
    data = text.removeprefix("\ufeff").encode("utf-8") if blocks else b""
    found = [fields for node in blocks for fields in _plugins(data[node.start : node.end])]
    return [_plugin(fields) for fields in found if "motorConstant" in fields]


def _plugins(data: bytes) -> list[dict[str, str]]:
    """Returns the text of each element right under each plugin of a block."""
    found: list[dict[str, str]] = []
    stack: list[str] = []
    parser = expat.ParserCreate(encoding="utf-8")
    parser.buffer_text = True

    def start(tag: str, _attributes: dict[str, str]) -> None:
        stack.append(tag)
        if tag == "plugin":
            found.append({})

    def end(_tag: str) -> None:
        stack.pop()

    def characters(data: str) -> None:
        if len(stack) >= 2 and stack[-2] == "plugin" and found:
            found[-1][stack[-1]] = found[-1].get(stack[-1], "") + data

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = characters
    try:
        parser.Parse(data, True)
    except expat.ExpatError:
        return []
    return found


def _plugin(fields: dict[str, str]) -> MotorPlugin:
    def number(name: str) -> float:
        try:
            value = float(fields.get(name, "0"))
        except ValueError:
            return 0.0
        return value if isfinite(value) and value > 0.0 else 0.0

    turning = fields.get("turningDirection", "").strip().lower()
    return MotorPlugin(
        fields.get("linkName", "").strip(),
        fields.get("jointName", "").strip(),
        {"ccw": 1.0, "cw": -1.0}.get(turning, 0.0),
        number("motorConstant") * number("maxRotVelocity") ** 2,
        number("momentConstant"),
        number("timeConstantUp"),
    )
