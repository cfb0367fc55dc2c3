"""One line for what is wrong in a spec: the field, what it needs, and what would have worked."""

import re
from collections.abc import Iterator
from difflib import get_close_matches
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from snakegen.errors import near
from snakegen.spec.robot_spec import RobotSpec


def fields_at(path: tuple[Any, ...]) -> list[str]:
    """Returns the field names of the section that a pydantic error path points into."""
    model: Any = RobotSpec
    for key in path:
        field = getattr(model, "model_fields", {}).get(key)
        if field is not None:
            model = next(sections_of(field.annotation), model)
    return list(model.model_fields)


def sections_of(annotation: Any) -> Iterator[type[BaseModel]]:
    """Yields the sections that an annotation names, however deep in lists and unions."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from sections_of(part)


def near_field(leaf: str, prefix: str, names: list[str]) -> str:
    """Returns the hint for a field that does not exist: the near ones, else all of its section."""
    close = get_close_matches(leaf, names, n=2, cutoff=0.6)
    if not close:
        return near(leaf, names)
    full = [f"'{prefix}.{name}'" if prefix else f"'{name}'" for name in close]
    return f" Did you mean {' or '.join(full)}?"


def _is_field(key: Any) -> bool:
    """Tells real path parts from pydantic's names for the branches of a union."""
    return isinstance(key, int) or (key.isidentifier() and key not in ("float", "int", "list"))


def explain(
    error: ValidationError, data: dict[str, Any], label: str, options: dict[str, str]
) -> str:
    """Returns one line for the most telling of pydantic's errors.

    Args:
        error: of a spec.
        data: the spec, its overrides applied.
        label: names the spec.
        options: that made a valid spec this one, by the field that they set: to blame instead.
    """
    errors = error.errors()
    unknown = [e for e in errors if e["type"] == "extra_forbidden"]
    first = unknown[0] if unknown else max(errors, key=lambda e: len(_real_path(e["loc"], data)))
    loc = _real_path(first["loc"], data)
    path = "".join(f"[{k + 1}]" if isinstance(k, int) else f".{k}" for k in loc).lstrip(".")
    if unknown:
        prefix = path.rpartition(".")[0]
        hint = near_field(str(loc[-1]), prefix, fields_at(loc[:-1]))
        return f"{label} has no field '{path}'.{hint}"
    text = _mistake(first, path, loc)
    place = re.match(r"'?([\w.\[\]]+)'?: ", text)
    field = re.sub(r"\[(\d+)\]", r".\1", place[1] if place else path)
    if field in options:  # which names the field already, or the text does
        named = options[field].startswith("--set")
        return (
            f"--set {text}."
            if named
            else f"{options[field]}: {text.removeprefix(place[0] if place else '')}."
        )
    inside = [o for f, o in options.items() if f"{field}.".startswith(f"{f}.")]
    around = [o for f, o in options.items() if f.startswith(f"{field}.")]
    return f"{', '.join(inside or around or options.values()) or label}: {text}."


def _mistake(first: Any, path: str, loc: tuple[Any, ...]) -> str:
    """Returns what is wrong at `path`, named first, in the words of one of pydantic's errors."""
    if first["type"] == "missing" and isinstance(first["loc"][-1], int):
        given, least = first["input"], first["loc"][-1] + 1
        return f"'{path}': {least} or more entries are needed (got {list(given)})"
    if first["type"] == "missing":
        return f"'{path}' is needed"
    message = first["msg"].removeprefix("Value error, ").removeprefix("Assertion failed, ")
    if first["type"] == "value_error":
        named = message.startswith(path.removesuffix(".mapping")) or not path
        return str(message) if named else f"'{path}': {message}"
    message = message[0].lower() + message[1:]
    if first["type"] in ("model_type", "model_attributes_type", "dict_type"):
        parts = [f"{path}.{name}" for name in fields_at((*loc, "")) or ["…"]]
        return f"'{path}' is a section; set {', '.join(parts[:3])} …"
    if first["type"] == "tuple_type":
        message = "three numbers in a list are needed"
    if first["type"] == "string_pattern_mismatch":
        message = "letters (a to z, A to Z), digits and _ are needed, a letter first"
    given = first["input"]
    return f"'{path}': {message}" + ("" if isinstance(given, dict) else f" (got {given!r})")


def _real_path(loc: tuple[Any, ...], data: Any) -> tuple[Any, ...]:
    """Keeps those parts of a pydantic path that index the data; drops union branch names."""
    out: list[Any] = []
    at = data
    for position, key in enumerate(loc):
        in_dict = isinstance(at, dict) and isinstance(key, str) and key in at
        if in_dict or (isinstance(at, list) and isinstance(key, int) and key < len(at)):
            at = at[key]
        elif position == len(loc) - 1 and isinstance(at, dict) and _is_field(key):
            at = None
        else:
            continue
        out.append(key)
    return tuple(out)
