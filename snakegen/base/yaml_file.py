"""Plain YAML only: no tags, no anchors, no repeated keys, no text that xacro would run.

A word is read as YAML 1.2's core schema reads it (https://yaml.org/spec/1.2.2, section 10.3.2):
1:30 is no 90, 010 no 8, `yes` no true, 1e3 a number. What is none of its numbers stays text, so
that whoever needed a number says so.
"""

import re
from pathlib import Path
from typing import Any, ClassVar

import yaml

from snakegen.base.bounded_text import read_bounded
from snakegen.errors import SpecError

_EXECUTABLE = ("${", "$(")
MAX_BYTES = 16_000_000
MAX_VALUES = 500_000  # some 15 s; a spec of 1000 links has fewer


_WORDS = {  # tag: (what it looks like, the letters it may start with)
    "null": (r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    "bool": (r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    "int": (r"[-+]?[0-9]+", list("-+0123456789")),
    "float": (
        r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?"
        r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)",
        list("-+.0123456789"),
    ),
}


class _PlainLoader(yaml.SafeLoader):
    """YAML of the plain types; everything that could surprise is refused with its line."""

    yaml_implicit_resolvers: ClassVar[dict[str, Any]] = {}  # its own, none of YAML 1.1

    def compose_node(self, parent: Any, index: Any) -> Any:
        event = self.peek_event()
        tag, anchor = getattr(event, "tag", None), getattr(event, "anchor", None)
        line = event.start_mark.line + 1
        if isinstance(event, yaml.AliasEvent) or anchor is not None:
            raise SpecError(f"line {line}: anchors and aliases (& and *) are not allowed here.")
        if tag is not None:
            raise SpecError(f"line {line}: the YAML tag '{tag}' is not allowed; use plain values.")
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        seen: set[Any] = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if not isinstance(key, str):
                raise SpecError(f"line {key_node.start_mark.line + 1}: key {key!r} is not a name.")
            if key in seen:
                raise SpecError(f"line {key_node.start_mark.line + 1}: '{key}' stands twice.")
            seen.add(key)
        return super().construct_mapping(node, deep)

    def decimal(self, node: Any) -> Any:
        """Returns a whole number; one of more digits than Python converts stays text."""
        try:
            return int(node.value)
        except ValueError:
            return node.value


_PlainLoader.add_constructor("tag:yaml.org,2002:int", _PlainLoader.decimal)
for _tag, (_form, _first) in _WORDS.items():
    _PlainLoader.add_implicit_resolver(
        f"tag:yaml.org,2002:{_tag}", re.compile(f"^(?:{_form})$"), _first
    )


class _PlainDumper(yaml.SafeDumper):
    """Writes what `_PlainLoader` and YAML 1.1 (xacro's) both read: no aliases."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


_PlainDumper.add_implicit_resolver(  # quotes the text '1e3', which YAML 1.1 would not
    "tag:yaml.org,2002:float", re.compile(f"^(?:{_WORDS['float'][0]})$"), _WORDS["float"][1]
)


def refuse_executable(value: Any, place: str = "") -> None:
    """Raises SpecError where any string in `value` holds text that xacro would evaluate."""
    if isinstance(value, str):
        for mark in _EXECUTABLE:
            if mark in value:
                where = f" in '{place}'" if place else ""
                raise SpecError(f"'{mark}'{where} is not allowed: a spec is data, not code.")
    elif isinstance(value, dict):
        for key, item in value.items():
            refuse_executable(key, place)
            refuse_executable(item, f"{place}.{key}" if place else str(key))
    elif isinstance(value, list):
        for i, item in enumerate(value):
            refuse_executable(item, f"{place}[{i}]")


def parse(text: str, source: str) -> Any:
    """Returns the plain value of YAML `text`; `source` names it in errors.

    Raises:
        SpecError: not YAML, or a tag, anchor, repeated key, or text that xacro would evaluate.
    """
    values = text.count(",") + text.count(":") + text.count("- ")  # each goes before one
    if values > MAX_VALUES:
        raise SpecError(f"{source}: some {values} values; up to {MAX_VALUES} are read.")
    try:
        value = yaml.load(text, Loader=_PlainLoader)
        refuse_executable(value)
    except SpecError as error:
        raise SpecError(f"{source}: {error}") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f", line {mark.line + 1}" if mark else ""
        problem = getattr(error, "problem", None) or str(error).splitlines()[0]
        raise SpecError(f"{source}{where}: not YAML ({problem}).") from None
    except RecursionError:
        raise SpecError(f"{source}: nested too deeply.") from None
    return value


def read(path: Path) -> Any:
    """Returns the plain value of a YAML file; raises SpecError where it cannot be read.

    Files above `MAX_BYTES` or `MAX_VALUES` are refused before they are parsed.
    """
    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise SpecError(f"{path}: {size / 1e6:.4g} MB; up to {MAX_BYTES / 1e6:g} MB are read.")
        text = read_bounded(path, MAX_BYTES)
    except FileNotFoundError:
        raise SpecError(f"{path}: no such file.") from None
    except OSError as error:
        raise SpecError(f"{path}: cannot be read ({error.strerror or error}).") from None
    except UnicodeDecodeError as error:
        raise SpecError(f"{path}: cannot be read as UTF-8 text ({error}).") from None
    return parse(text, path.name)


def dump(value: Any) -> str:
    """Returns block YAML of plain values, lists of scalars on one line, keys in given order."""
    return yaml.dump(
        value,
        Dumper=_PlainDumper,
        sort_keys=False,
        default_flow_style=None,
        width=100,
        allow_unicode=True,
    )
