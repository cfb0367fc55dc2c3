"""The JSON Schema that editors use: takes what the grammar takes, describes each field."""

import json
import re
from collections.abc import Iterator
from typing import Any

import pytest

from snakegen.base import yaml_file
from snakegen.spec.loading import load_spec, presets, schema, validate

SCHEMA = json.loads(schema())
KINDS = {
    "number": lambda v: isinstance(v, int | float) and not isinstance(v, bool),
    "integer": lambda v: isinstance(v, int) and not isinstance(v, bool),
    "string": lambda v: isinstance(v, str),
    "array": lambda v: isinstance(v, list),
    "object": lambda v: isinstance(v, dict),
    "boolean": lambda v: isinstance(v, bool),
    "null": lambda v: v is None,
}
KNOWN = {
    "$defs", "$ref", "$schema", "additionalProperties", "anyOf", "const", "default", "description",
    "enum", "exclusiveMaximum", "exclusiveMinimum", "items", "maxItems", "maxLength", "maximum",
    "minItems", "minimum", "pattern", "prefixItems", "properties", "required", "title", "type",
}  # fmt: skip


def faults(value: Any, rule: dict[str, Any], at: str = "") -> Iterator[str]:
    """Yields where `value` breaks JSON Schema `rule`: as much of the standard as ours uses."""
    if "$ref" in rule:
        yield from faults(value, SCHEMA["$defs"][rule["$ref"].rpartition("/")[2]], at)
    if "anyOf" in rule and all(any(True for _ in faults(value, r, at)) for r in rule["anyOf"]):
        yield f"{at}: {value!r} is none of the kinds"
    if "type" in rule and not KINDS[rule["type"]](value):
        yield f"{at}: {value!r} is no {rule['type']}"
        return
    if "const" in rule and value != rule["const"]:
        yield f"{at}: {value!r}"
    if "enum" in rule and value not in rule["enum"]:
        yield f"{at}: {value!r}"
    if "pattern" in rule and not re.search(rule["pattern"], value):
        yield f"{at}: {value!r} does not match"
    if len(value) > rule.get("maxLength", 10**9) if isinstance(value, str) else False:
        yield f"{at}: too long"
    if isinstance(value, int | float) and not isinstance(value, bool):
        if value < rule.get("minimum", value) or value > rule.get("maximum", value):
            yield f"{at}: {value} is out of range"
        if value <= rule.get("exclusiveMinimum", value - 1):
            yield f"{at}: {value} is too small"
        if value >= rule.get("exclusiveMaximum", value + 1):
            yield f"{at}: {value} is too large"
    if isinstance(value, list):
        if not rule.get("minItems", 0) <= len(value) <= rule.get("maxItems", 10**9):
            yield f"{at}: {len(value)} items"
        rules = rule.get("prefixItems") or [rule.get("items", {})] * len(value)
        for k, (item, r) in enumerate(zip(value, rules, strict=False)):
            yield from faults(item, r, f"{at}[{k}]")
    if isinstance(value, dict):
        fields = rule.get("properties", {})
        for name in rule.get("required", ()):
            if name not in value:
                yield f"{at}.{name} is missing"
        for name, item in value.items():
            if name in fields:
                yield from faults(item, fields[name], f"{at}.{name}")
            elif rule.get("additionalProperties") is False:
                yield f"{at}.{name} is unknown"
            elif isinstance(rule.get("additionalProperties"), dict):
                yield from faults(item, rule["additionalProperties"], f"{at}.{name}")


def rules(rule: Any, place: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Yields every sub-schema with its place."""
    yield place, rule
    for name, r in (rule.get("properties", {}) | rule.get("$defs", {})).items():
        yield from rules(r, f"{place}.{name}")
    for key in ("anyOf", "prefixItems"):
        for r in rule.get(key, ()):
            yield from rules(r, place)
    for key in ("items", "additionalProperties"):
        if isinstance(rule.get(key), dict):
            yield from rules(rule[key], place)


@pytest.mark.parametrize("name", sorted(presets()))
def test_presets_follow_the_schema(name: str) -> None:
    assert list(faults(yaml_file.read(presets()[name]), SCHEMA)) == []
    assert list(faults(load_spec(name).resolved(), SCHEMA)) == []


@pytest.mark.parametrize(
    "places", ["all", 1, "2@0.3", "1, 2@0.3,2@1", [1, "2@.5", {"link": 2, "position": 0.1}]]
)
def test_every_way_to_write_places(places: Any) -> None:
    data = {"name": "a", "chain": {"links": 2, "length": 1.0, "mass": 1.0}}
    data["vectoring_apparatus"] = {"at": places}
    assert list(faults(data, SCHEMA)) == []
    validate(data, "a")


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("chain.links", 0),
        ("chain.links", 2.5),
        ("chain.length", 0),
        ("chain.length", [0.1, -0.1]),
        ("chain.mass", "heavy"),
        ("chain.mass", True),
        ("chain.com", 1.5),
        ("chain.inertia", [1, 2]),
        ("chain.lnks", 3),
        ("joint.axes", ["twist"]),
        ("base", "loose"),
        ("name", "9lives"),
        ("vectoring_apparatus.rotors", 3),
        ("vectoring_apparatus.at", "2@@3"),
        ("vectoring_apparatus.at", [0]),
        ("control.mode", "both"),
        ("plant.delay", -1),
        ("plant.voltage_sag", 1),
    ],
)
def test_editor_and_program_refuse_the_same(path: str, value: Any) -> None:
    from snakegen.errors import SpecError

    data = {"name": "a", "chain": {"links": 2, "length": 1.0, "mass": 1.0}}
    at: Any = data
    *sections, field = path.split(".")
    for section in sections:
        at = at.setdefault(section, {})
    at[field] = value
    assert list(faults(data, SCHEMA)) != []
    with pytest.raises(SpecError):
        validate(data, "a")


def test_the_schema_uses_words_of_the_standard() -> None:
    """A keyword that is none, as `gt`, is passed over by every editor."""
    assert SCHEMA["$schema"].endswith("2020-12/schema")
    strangers = {(place, k) for place, r in rules(SCHEMA) for k in r if k not in KNOWN}
    assert strangers == set()


def test_every_field_is_described() -> None:
    silent = [
        f"{place}.{name}"
        for place, rule in rules(SCHEMA)
        for name, r in rule.get("properties", {}).items()
        if not r.get("description")
    ]
    assert silent == []
