"""The <snakegen> element of a URDF, checked as strictly as a spec before anything reads it.

Every element, attribute, number and count is checked; a mistake is one line with the element, the
attribute and the line of the file.
"""

import xml.etree.ElementTree as ET
from typing import Any
from xml.parsers import expat

from snakegen.errors import DescriptionError, near
from snakegen.spec import attribute_values as accept

_SERVO = dict.fromkeys(("stiffness", "damping", "armature", "friction"), accept.not_negative)
_ROTOR = dict.fromkeys(("lag", "diameter", "inertia", "speed"), accept.not_negative)
_FIELDS: dict[str, dict[str, accept.Check]] = {
    "link": {"name": accept.name, "length": accept.positive},
    "servo": {"joint": accept.name, **_SERVO},
    "vectoring_apparatus": {
        "link": accept.name,
        "roll": accept.name,
        "pitch": accept.name,
        "position": accept.share,
    },
    "rotor": {
        "link": accept.name,
        "thrust_min": accept.real,
        "thrust_max": accept.positive,
        "drag_ratio": accept.real,
        "axis": accept.axis,
        "spin": accept.spin,
        "position": accept.point,
        "name": accept.name,
        **_ROTOR,
    },
    "screw_drive": {
        "joint": accept.name,
        "link": accept.name,
        "alpha": accept.real,
        "radius": accept.positive,
        "blades": accept.count,
        "wheels_per_blade": accept.count,
        "wheel_radius": accept.positive,
        "rollers": accept.rollers,
        "friction": accept.not_negative,
        "torque": accept.positive,
        "gain": accept.positive,
        "armature": accept.not_negative,
    },
    "caster": {"link": accept.name, "track": accept.not_negative, "radius": accept.positive},
    "cables": {
        "count": accept.count,
        "radius": accept.positive,
        "phase": accept.real,
        "standoff": accept.positive,
        "sheathed": accept.switch,
        "minimum": accept.not_negative,
        "maximum": accept.limit,
        "stiffness": accept.positive,
        "elasticity": accept.limit,
        "friction": accept.not_negative,
    },
    "mount": {"pose": accept.pose, "height": accept.not_negative},
}
_NEEDED = {
    "link": ("name", "length"),
    "servo": ("joint",),
    "rotor": ("link", "thrust_min", "thrust_max", "drag_ratio"),
    "screw_drive": ("joint", "link", "alpha", "radius"),
    "caster": ("link",),
    "mount": ("pose", "height"),
    "gains": ("name",),
}
_WITHIN = {
    "snakegen": (
        "link", "servo", "vectoring_apparatus", "screw_drive", "caster", "mount", "cables",
        "control", "plant",
    ),
    "vectoring_apparatus": ("rotor",),
    "control": ("gains",),
    "plant": ("uncertainty", "losses"),
}  # fmt: skip
_MOST = {  # elements of a kind in all
    "link": 1000, "servo": 10_000, "vectoring_apparatus": 1000, "rotor": 2000,
    "screw_drive": 1000, "caster": 1000, "mount": 1, "cables": 1, "control": 1, "plant": 1,
    "gains": 100, "uncertainty": 1, "losses": 1,
}  # fmt: skip
_UNIQUE = {  # what two elements must not share
    "link": ("name",), "servo": ("joint",), "rotor": ("link",), "screw_drive": ("joint",),
    "vectoring_apparatus": ("roll", "pitch"), "gains": ("name",),
}  # fmt: skip


def find_element(text: str) -> ET.Element | None:
    """Returns the checked <snakegen> element of URDF text, None where it has none.

    Raises:
        DescriptionError: text that is not XML, or a mistake in the element: its line, the
            element, the attribute, and what is needed.
    """
    found, lines = _parse(text)
    if not found:
        return None
    if len(found) > 1:
        raise _mistake(lines[found[1]], "a second <snakegen> element; one is allowed.")
    root = found[0]
    if root.get("version") != "1":
        version = root.get("version")
        raise _mistake(lines[root], f"version '{version}' is not known; this reads version 1.")
    if root.get("base", "fixed") not in ("floating", "fixed"):
        raise _mistake(lines[root], f"base='{root.get('base')}'; floating or fixed is needed.")
    _check_counts(root, lines)
    for parent in root.iter():
        for child in parent:
            known = _WITHIN.get(parent.tag, ())
            if child.tag not in known:
                raise _mistake(
                    lines[child],
                    f"<{child.tag}> is not known in <{parent.tag}>.{near(child.tag, known)}",
                )
            _check_attributes(child, lines[child])
    _check_unique(root, lines)
    _check_models(root, lines)
    return root


def _parse(text: str) -> tuple[list[ET.Element], dict[ET.Element, int]]:
    """Returns the <snakegen> elements below the root, and the line of each element in them."""
    parser = expat.ParserCreate(encoding="utf-8")
    stack: list[ET.Element] = []
    found: list[ET.Element] = []
    lines: dict[ET.Element, int] = {}
    depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if stack or (depth == 2 and tag == "snakegen"):
            element = (
                ET.SubElement(stack[-1], tag, attributes) if stack else ET.Element(tag, attributes)
            )
            lines[element] = parser.CurrentLineNumber
            stack.append(element)

    def end(_tag: str) -> None:
        nonlocal depth
        depth -= 1
        if stack:
            element = stack.pop()
            if not stack:
                found.append(element)

    parser.StartElementHandler, parser.EndElementHandler = start, end
    try:
        parser.Parse(text.removeprefix("\ufeff").encode(), True)
    except (expat.ExpatError, UnicodeEncodeError) as error:
        raise DescriptionError(f"the URDF is not well-formed XML ({error}).") from None
    return found, lines


def _mistake(line: int, text: str) -> DescriptionError:
    return DescriptionError(f"<snakegen>, line {line}: {text}")


def _check_counts(root: ET.Element, lines: dict[ET.Element, int]) -> None:
    counts: dict[str, int] = {}
    for element in root.iter():
        counts[element.tag] = counts.get(element.tag, 0) + 1
        most = _MOST.get(element.tag)
        if most is not None and counts[element.tag] > most:
            total = sum(1 for _ in root.iter(element.tag))
            raise _mistake(lines[element], f"{total} <{element.tag}> elements; at most {most}.")


def _check_attributes(element: ET.Element, line: int) -> None:
    for name in _NEEDED.get(element.tag, ()):
        if name not in element.attrib:
            raise _mistake(line, f"<{element.tag}> needs '{name}'.")
    known = _FIELDS.get(element.tag)
    if known is None:  # a model of the spec knows its fields
        return
    for name, text in element.attrib.items():
        if name not in known:
            raise _mistake(line, f"<{element.tag}> has no attribute '{name}'.{near(name, known)}")
        try:
            known[name](text)
        except ValueError as error:
            raise _mistake(line, f"<{element.tag} {name}='{_short(text)}'>: {error}.") from None
    if element.tag == "rotor":
        low, high = float(element.attrib["thrust_min"]), float(element.attrib["thrust_max"])
        if not low < high:
            raise _mistake(
                line, f"<rotor thrust_min='{low:g}' thrust_max='{high:g}'>: min must be below max."
            )
    if element.tag == "vectoring_apparatus" and element.find("rotor") is None:
        raise _mistake(line, "<vectoring_apparatus> needs a <rotor>.")


def _check_unique(root: ET.Element, lines: dict[ET.Element, int]) -> None:
    for tag, names in _UNIQUE.items():
        seen: dict[str, int] = {}
        for element in root.iter(tag):
            for name in names:
                value = element.get(name)
                if value in seen:
                    raise _mistake(
                        lines[element],
                        f"<{tag} {name}='{value}'>: line {seen[value]} has that name too.",
                    )
                if value is not None:
                    seen[value] = lines[element]


def _check_models(root: ET.Element, lines: dict[ET.Element, int]) -> None:
    """Checks <control>, <gains>, <plant> and its parts by the models of a spec."""
    if root.find("control") is None and root.find("plant") is None:
        return
    from snakegen.spec.control import Control, GainSet
    from snakegen.spec.plant import Losses, Plant, Uncertainty

    for element in root.iter("gains"):
        values = {k: v.split() for k, v in element.attrib.items() if k != "name"}
        lists = {k: v if len(v) != 1 else v[0] for k, v in values.items()}
        _check_model(GainSet, lists, element, lines)
    control, plant = root.find("control"), root.find("plant")
    if control is not None:
        names: dict[str, Any] = {str(e.get("name")): {} for e in control.findall("gains")}
        given: dict[str, Any] = dict(control.attrib)
        if names:
            given["gain_sets"] = names
        else:
            given.pop("gains", None)
        _check_model(Control, given, control, lines)
    if plant is not None:
        _check_model(Plant, dict(plant.attrib), plant, lines)
        for name, model in (("uncertainty", Uncertainty), ("losses", Losses)):
            for element in plant.findall(name):
                _check_model(model, dict(element.attrib), element, lines)


def _check_model(
    model: Any, values: dict[str, Any], element: ET.Element, lines: dict[ET.Element, int]
) -> None:
    from pydantic import ValidationError

    try:
        model.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        where = str(first["loc"][0]) if first["loc"] else ""
        if first["type"] == "extra_forbidden":
            raise _mistake(
                lines[element],
                f"<{element.tag}> has no attribute '{where}'.{near(where, model.model_fields)}",
            ) from None
        what = first["msg"].removeprefix("Value error, ")
        shown = f" {where}='{_short(element.get(where, ''))}'" if where in element.attrib else ""
        raise _mistake(
            lines[element], f"<{element.tag}{shown}>: {what[0].lower()}{what[1:]}."
        ) from None


def _short(text: str) -> str:
    return text if len(text) <= 40 else text[:40] + "…"
