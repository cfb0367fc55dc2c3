"""What may stand where in a URDF: the tags, attributes and numbers of the ROS format.

Parsers skip what they do not know without a word, so a mistyped ``<limit lowr=…>`` becomes a joint
without a lower limit. The table says what is known; `grammar_faults` holds a file against it.
"""

from collections.abc import Iterator
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from difflib import get_close_matches

from snakegen.errors import near
from snakegen.linter.finding import Finding, finding, label, word_fault
from snakegen.linter.rule import Severity
from snakegen.linter.xml_tree import Node

EXTENSIONS = frozenset(
    {
        "snakegen",
        "mujoco",
        "gazebo",
        "transmission",
        "ros2_control",
        "sensor",
        "drake:collision_filter_group",
        # tags of the public aerial-robot descriptions of the same platforms
        "m_f_rate",
        "baselink",
        "thrust_link",
    }
)
"""Elements of other programs, allowed under ``<robot>`` and not looked into."""

_SEEN = ("material", "color", "texture")  # what changes no number of the model

ASSUMED = {"origin": "0", "limit": "0", "inertia": "0", "mimic": None, "axis": None}
"""What parsers take for an absent numeric attribute, where it is one number; None: it matters."""

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
                yield finding("missing_element", where, node.line, f"needs a <{tag}>")
        seen: set[str] = set()
        for child in node.children:
            if child.tag in rule.once + rule.many:
                named = node.tag == "robot"
                stack.append((child, label(child) if named else owner))
                if child.tag in rule.once and child.tag in seen:
                    message = f"a second <{child.tag}>; parsers read the first only"
                    yield finding("repeated_element", where, child.line, message)
                seen.add(child.tag)
            elif not (node.tag == "robot" and child.tag in extensions):
                yield from _stranger(child, node, rule, where, extensions)
        if node.tag == "geometry" and len(seen) != 1:
            message = f"needs exactly one shape of {', '.join(SHAPES)}; it has {len(seen)}"
            yield finding("shapeless_geometry", where, node.line, message)


def _stranger(
    child: Node, parent: Node, rule: Tag, where: str, extensions: AbstractSet[str]
) -> Iterator[Finding]:
    """Yields what is to be said of a child that the grammar does not know at its place."""
    if child.tag.startswith("xacro:"):
        message = f"<{child.tag}> is not expanded yet"
        yield finding("xacro_left", where, child.line, message)
        return
    homes = [home for home, other in GRAMMAR.items() if child.tag in other.once + other.many]
    if child.tag in extensions:
        homes.append("robot")
    if homes:
        message = f"<{child.tag}> does not belong in <{parent.tag}>; it goes into "
        message += " or ".join(f"<{home}>" for home in homes)
        exported = parent.tag == "collision" and child.tag == "material"  # nobody reads it
        severity: Severity | None = "note" if exported else None
        yield finding("misplaced_tag", where, child.line, message, severity)
        return
    known = [*rule.once, *rule.many]
    close = get_close_matches(child.tag, known, n=1, cutoff=0.75)
    lost = (close and parent.find(close[0]) is None) or (close and close[0] in rule.many)
    code = "misspelt_tag" if lost else "unknown_tag"
    mild: Severity | None = "warning" if close and close[0] in _SEEN and lost else None
    if lost:
        message = f"unknown element <{child.tag}> in <{parent.tag}>. Did you mean {close[0]!r}?"
    else:
        hint = near(child.tag, sorted(extensions)) if parent.tag == "robot" else ""
        message = f"unknown element <{child.tag}> in <{parent.tag}>.{hint}"
    yield finding(code, where, child.line, message, mild)


def _attribute_faults(node: Node, rule: Tag, where: str) -> Iterator[Finding]:
    counts = dict(rule.numbers)
    known = (*rule.texts, *counts)
    meant = set()
    for name, text in node.attrib.items():
        if name not in known and not name.startswith(("xmlns", "xml:")) and ":" not in name:
            yield _unknown_attribute(node, name, text, rule, where)
            meant.add(_meant(name, known))
        elif name in counts:
            yield from _number_faults(node, name, text.split(), counts[name], where)
    for name in set(rule.required) - meant if meant else rule.required:
        value = node.attrib.get(name)
        severity: Severity | None = "note" if node.tag == "texture" else None
        if value is None:
            message = f"<{node.tag}> needs the attribute {name!r}"
            yield finding("missing_attribute", where, node.line, message, severity)
        elif not value.strip() and name not in counts:
            message = f"the attribute {name!r} is empty"
            severity = "warning" if node.tag == "robot" else severity  # a name is made up
            yield finding("missing_attribute", where, node.line, message, severity)
    yield from _habits(node, where)


def _unknown_attribute(node: Node, name: str, text: str, rule: Tag, where: str) -> Finding:
    """Returns the finding of an unknown attribute: an error where a number is lost by it."""
    known = (*rule.texts, *(number for number, _ in rule.numbers))
    meant, swapped = _meant(name, known), any(sorted(k) == sorted(name) for k in known)
    message = f"<{node.tag}> has no attribute {name!r}."
    if meant is None:
        return finding("unknown_attribute", where, node.line, message.rstrip("."))
    message += f" Did you mean {meant!r}?"
    if meant in node.attrib:
        same = swapped and _value(node.attrib[meant]) != _value(text)
        code = "misspelt_attribute" if same and node.tag == "inertia" else "unknown_attribute"
        return finding(code, where, node.line, message, None if same or not swapped else "warning")
    assumed = ASSUMED.get(node.tag)
    lost = (
        assumed is None
        or meant in rule.required
        or any(_value(word) != 0.0 for word in text.split())
    )
    code = "misspelt_attribute" if lost else "unknown_attribute"
    return finding(code, where, node.line, message, None if lost else "warning")


def _meant(name: str, known: tuple[str, ...]) -> str | None:
    """Returns the known attribute that an unknown name resembles: an anagram of it, or close."""
    swapped = next((k for k in known if sorted(k) == sorted(name)), None)
    close = get_close_matches(name, known, n=1, cutoff=0.6)
    return swapped or (close[0] if close else None)


def _value(word: str) -> float | None:
    return None if word_fault(word) else float(word)


def _habits(node: Node, where: str) -> Iterator[Finding]:
    """Yields notes on what not every program reads: names, capsules, quaternions."""
    name = node.attrib.get("name", "")
    if node.tag in ("link", "joint") and (not name.isascii() or set(name) & set(" /\\\t")):
        yield finding("odd_name", where, node.line, f"the name {name!r} is not portable")
    if node.tag == "capsule":
        yield finding("capsule_shape", where, node.line, "a <capsule>")
    if "quat_xyzw" in node.attrib:
        yield finding("quaternion_origin", where, node.line, "an attribute quat_xyzw")


def _number_faults(
    node: Node, name: str, words: list[str], count: int, where: str
) -> Iterator[Finding]:
    for word in words:
        code = word_fault(word)
        if code:
            what = "not finite" if code == "not_finite" else "not a number"
            message = f"{name}={node.attrib[name]!r}: {word!r} is {what}"
            yield finding(code, where, node.line, message)
            return
    if len(words) != count:
        message = f"{name}={node.attrib[name]!r} has {len(words)} numbers, it needs {count}"
        harmless = node.tag in (*SHAPES, "color") and len(words) > count
        yield finding("component_count", where, node.line, message, "warning" if harmless else None)
