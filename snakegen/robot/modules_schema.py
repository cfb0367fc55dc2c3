"""The JSON Schema of a modules file, for editors."""

import json
from dataclasses import MISSING, fields
from typing import Any

from snakegen.robot.modules import Rotor, Servo
from snakegen.robot.modules_file import FIELDS
from snakegen.spec.control import Control
from snakegen.spec.plant import Plant

_NUMBER, _NAME = {"type": "number"}, {"type": "string"}
_VECTOR = {"type": "array", "items": _NUMBER, "minItems": 3, "maxItems": 3}
MEANINGS = {
    "floating_root": "name of the URDF's root link: the base is free; left out, it is fixed",
    "link_length": "m, lever of the torque scale",
    "apparatuses": "rotors behind up to two gimbal joints, one entry each",
    "servos": "position servos on joints, in place of the defaults",
    "control": "controller, as in a spec",
    "plant": "simulated plant, as in a spec",
    "roll": "joint of the outer gimbal, or the only one where it turns about x",
    "pitch": "joint of the inner gimbal, or the only one where it turns about y",
    "rotors": "rotors that the gimbals turn together",
    "link": "link at whose origin, or `position`, the thrust acts",
    "thrust_min": "N; negative: a reversible rotor",
    "thrust_max": "N",
    "drag_ratio": "m, signed: torque on the body about the thrust axis per newton; negative for a "
    "rotor that turns counter-clockwise about its thrust",
    "axis": "direction of thrust in the link's axes",
    "lag": "s, time constant of the motor",
    "diameter": "m",
    "inertia": "kg·m², of the spinning part about its axis",
    "speed": "rad/s at thrust_max",
    "spin": "+1 counter-clockwise about the axis, -1, or 0: as the drag ratio says",
    "position": "m, where the thrust acts, in the link's axes",
    "name": "of a rotor that shares its link with others",
    "stream_efficiency": "share of its still-air thrust that it keeps in the streams of the other "
    "rotors of its body; 0: by momentum theory",
    "joint": "joint that the servo holds",
    "stiffness": "N·m/rad",
    "damping": "N·m·s/rad",
    "armature": "kg·m²",
    "friction": "N·m",
}


def schema() -> dict[str, Any]:
    """Returns the JSON Schema of a modules file."""
    apparatus = _object(
        {
            "roll": _NAME,
            "pitch": _NAME,
            "link": _NAME | {"description": "link that carries the apparatus"},
            "rotors": {"type": "array", "items": _of(Rotor, "link", "thrust_max"), "minItems": 1},
        },
        "rotors",
    )
    top: dict[str, Any] = {
        "floating_root": _NAME,
        "link_length": {"type": "number", "exclusiveMinimum": 0},
        "apparatuses": {"type": "array", "items": apparatus},
        "servos": {"type": "array", "items": _of(Servo, "joint")},
        "control": {"$ref": "#/$defs/Control"},
        "plant": {"$ref": "#/$defs/Plant"},
    }
    definitions: dict[str, Any] = {}
    for model in (Control, Plant):
        made = model.model_json_schema(ref_template="#/$defs/{model}")
        definitions |= made.pop("$defs", {})
        definitions[model.__name__] = made
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "snakegen modules file",
        **_object({key: top[key] for key in FIELDS}),
        "$defs": definitions,
    }


def schema_text() -> str:
    """Returns the JSON Schema of a modules file as text."""
    return json.dumps(schema(), indent=2, ensure_ascii=False)


def _object(properties: dict[str, Any], *required: str) -> dict[str, Any]:
    described = {
        key: value if "description" in value else value | {"description": MEANINGS[key]}
        for key, value in properties.items()
    }
    needed = {"required": list(required)} if required else {}
    return {
        "type": "object",
        "properties": described,
        "additionalProperties": False,
        **needed,
    }


def _of(kind: Any, *required: str) -> dict[str, Any]:
    """Returns the schema of a dataclass whose fields are names, numbers and triples."""
    properties = {}
    for f in fields(kind):
        triple, text = str(f.type).startswith("tuple"), f.type in (str, "str")
        value = dict(_VECTOR if triple else _NAME if text else _NUMBER)
        if f.default is not MISSING and f.default != "":
            value["default"] = list(f.default) if triple else f.default
        properties[f.name] = value
    properties.get("thrust_min", {}).setdefault("default", 0.0)
    properties.get("drag_ratio", {}).setdefault("default", 0.0)
    return _object(properties, *required)
