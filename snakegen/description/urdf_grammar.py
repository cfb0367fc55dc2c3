"""What may stand where in a URDF: the tags, attributes and numbers of the ROS format.

Parsers skip what they do not know without a word, so a mistyped ``<limit lowr=…>`` becomes a joint
without a lower limit. The table says what is known; `grammar_faults` holds a file against it.
"""

from collections.abc import Iterator
from collections.abc import Set as AbstractSet
from dataclasses import dataclass

from snakegen.description.finding import Finding, error, label, word_fault
from snakegen.description.xmltree import Node
from snakegen.errors import near

EXTENSIONS = frozenset(
    {
        "snakegen",
        "mujoco",
        "gazebo",
        "transmission",
        "ros2_control",
        "sensor",
        # tags of the public aerial-robot descriptions of the same platforms
        "m_f_rate",
        "baselink",
        "thrust_link",
    }
)
"""Elements of other programs, allowed under ``<robot>`` and not looked into."""

JOINT_AXES = {
    "revolute": True,
    "continuous": True,
    "prismatic": True,
    "planar": True,
    "fixed": False,
    "floating": False,
}
"""Joint types, and whether each uses its axis."""


@dataclass(frozen=True)
class Tag:
    """One element: children that come once and many times; text and number attributes.

    `numbers` gives the count of components of each numeric attribute; `required` names the
    attributes, and `needs` the children, that have to be there.
    """

    once: tuple[str, ...] = ()
    many: tuple[str, ...] = ()
    texts: tuple[str, ...] = ()
    numbers: tuple[tuple[str, int], ...] = ()
    required: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()


def _scalars(*names: str) -> tuple[tuple[str, int], ...]:
    return tuple((name, 1) for name in names)


_INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
SHAPES = ("box", "cylinder", "sphere", "capsule", "mesh")

GRAMMAR: dict[str, Tag] = {
    "robot": Tag(many=("link", "joint", "material"), texts=("name", "version"), required=("name",)),
    "link": Tag(
        once=("inertial",),
        many=("visual", "collision"),
        texts=("name", "type"),
        required=("name",),
    ),
    "inertial": Tag(once=("origin", "mass", "inertia"), needs=("mass", "inertia")),
    "mass": Tag(numbers=_scalars("value"), required=("value",)),
    "inertia": Tag(numbers=_scalars(*_INERTIA), required=_INERTIA),
    "origin": Tag(numbers=(("xyz", 3), ("rpy", 3), ("quat_xyzw", 4))),
    "visual": Tag(
        once=("origin", "geometry", "material"), texts=("name", "concave"), needs=("geometry",)
    ),
    "collision": Tag(once=("origin", "geometry"), texts=("name", "concave"), needs=("geometry",)),
    "geometry": Tag(once=SHAPES),
    "box": Tag(numbers=(("size", 3),), required=("size",)),
    "cylinder": Tag(numbers=_scalars("radius", "length"), required=("radius", "length")),
    "capsule": Tag(numbers=_scalars("radius", "length"), required=("radius", "length")),
    "sphere": Tag(numbers=_scalars("radius"), required=("radius",)),
    "mesh": Tag(texts=("filename",), numbers=(("scale", 3),), required=("filename",)),
    "material": Tag(once=("color", "texture"), texts=("name",)),
    "color": Tag(numbers=(("rgba", 4),), required=("rgba",)),
    "texture": Tag(texts=("filename",), required=("filename",)),
    "joint": Tag(
        once=(
            "origin",
            "parent",
            "child",
            "axis",
            "limit",
            "dynamics",
            "mimic",
            "safety_controller",
            "calibration",
        ),
        texts=("name", "type"),
        required=("name", "type"),
        needs=("parent", "child"),
    ),
    "parent": Tag(texts=("link",), required=("link",)),
    "child": Tag(texts=("link",), required=("link",)),
    "axis": Tag(numbers=(("xyz", 3),), required=("xyz",)),
    "limit": Tag(
        numbers=_scalars(
            "lower", "upper", "effort", "velocity", "acceleration", "deceleration", "jerk"
        )
    ),
    "dynamics": Tag(numbers=_scalars("damping", "friction")),
    "mimic": Tag(texts=("joint",), numbers=_scalars("multiplier", "offset"), required=("joint",)),
    "safety_controller": Tag(
        numbers=_scalars("soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity"),
        required=("k_velocity",),
    ),
    "calibration": Tag(numbers=_scalars("rising", "falling", "reference_position")),
}


def grammar_faults(robot: Node, extensions: AbstractSet[str]) -> Iterator[Finding]:
    """Yields unknown, misplaced, repeated and missing elements and attributes, and bad numbers.

    Args:
        robot: the root element, known to be ``<robot>``.
        extensions: tags under ``<robot>`` that belong to other programs.
    """
    stack = [(robot, label(robot))]
    while stack:
        node, owner = stack.pop()
        rule = GRAMMAR[node.tag]
        where = owner if owner.startswith((node.tag, "<")) else f"<{node.tag}> of {owner}"
        yield from _attribute_faults(node, rule, where)
        for tag in rule.needs:
            if node.find(tag) is None:
                yield error("missing_element", where, node.line, f"needs a <{tag}>")
        seen: set[str] = set()
        for child in node.children:
            if child.tag in rule.once + rule.many:
                named = node.tag == "robot"
                stack.append((child, label(child) if named else owner))
                if child.tag in rule.once and child.tag in seen:
                    message = f"a second <{child.tag}>; parsers read the first only"
                    yield error("repeated_element", where, child.line, message)
                seen.add(child.tag)
            elif not (node.tag == "robot" and child.tag in extensions):
                yield _stranger(child, node, rule, where, extensions)
        if node.tag == "geometry" and len(seen) != 1:
            message = f"needs exactly one shape of {', '.join(SHAPES)}; it has {len(seen)}"
            yield error("missing_element", where, node.line, message)


def _stranger(
    child: Node, parent: Node, rule: Tag, where: str, extensions: AbstractSet[str]
) -> Finding:
    if child.tag.startswith("xacro:"):
        message = f"<{child.tag}> is not expanded yet; run the file through xacro first"
        return error("unknown_tag", where, child.line, message)
    homes = [home for home, other in GRAMMAR.items() if child.tag in other.once + other.many]
    if child.tag in extensions:
        homes.append("robot")
    if homes:
        message = f"<{child.tag}> does not belong in <{parent.tag}>; it goes into "
        message += " or ".join(f"<{home}>" for home in homes)
        return error("misplaced_tag", where, child.line, message)
    known = rule.once + rule.many + (tuple(extensions) if parent.tag == "robot" else ())
    message = f"unknown element <{child.tag}> in <{parent.tag}>.{near(child.tag, sorted(known))}"
    return error("unknown_tag", where, child.line, message)


def _attribute_faults(node: Node, rule: Tag, where: str) -> Iterator[Finding]:
    counts = dict(rule.numbers)
    known = (*rule.texts, *counts)
    for name, text in node.attrib.items():
        if name not in known and not name.startswith(("xmlns", "xml:")):
            message = f"<{node.tag}> has no attribute {name!r}.{near(name, known)}"
            yield error("unknown_attribute", where, node.line, message)
        elif name in counts:
            yield from _number_faults(node, name, text.split(), counts[name], where)
    for name in rule.required:
        value = node.attrib.get(name)
        if value is None:
            message = f"<{node.tag}> needs the attribute {name!r}"
            yield error("missing_attribute", where, node.line, message)
        elif not value.strip() and name not in counts:
            message = f"the attribute {name!r} is empty"
            yield error("missing_attribute", where, node.line, message)


def _number_faults(
    node: Node, name: str, words: list[str], count: int, where: str
) -> Iterator[Finding]:
    for word in words:
        code = word_fault(word)
        if code:
            what = "not finite" if code == "not_finite" else "not a number"
            message = f"{name}={node.attrib[name]!r}: {word!r} is {what}"
            yield error(code, where, node.line, message)
            return
    if len(words) != count:
        message = f"{name}={node.attrib[name]!r} has {len(words)} numbers, it needs {count}"
        yield error("component_count", where, node.line, message)
