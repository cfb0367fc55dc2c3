"""Options of missions: fields of a dataclass, read for the command line and checked for a run.

A mission's ``Options`` is a frozen dataclass: a field's name, type and default are the option's,
and the text beside its name under ``Attributes:`` in the docstring is its meaning. A field with
``metadata={"set_by": …}`` is set by the run, not by the person who flies it.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Mapping
from dataclasses import MISSING, fields
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import Any, NamedTuple, Union, get_args, get_origin, get_type_hints

from snakegen.errors import MissionError, near


class MissionOption(NamedTuple):
    """An option as its field declares it."""

    default: Any
    kinds: tuple[Any, ...]  # types of its values; None is among them where it may be absent
    meaning: str
    set_by: str = ""


def options_of(kind: type) -> dict[str, MissionOption]:
    """Returns the options of the dataclass `kind` by name, those of its bases first."""
    hints, meanings = get_type_hints(kind), _meanings(kind)
    out = {}
    for one in fields(kind):
        default = None if one.default is MISSING else one.default
        set_by = str(one.metadata.get("set_by", ""))
        kinds = _kinds(hints[one.name])
        out[one.name] = MissionOption(default, kinds, meanings.get(one.name, ""), set_by)
    return out


def checked_options(mission: str, kind: type, given: Mapping[str, Any]) -> Any:
    """Returns an instance of `kind` with the values `given`.

    Args:
        mission: its name, for the error.
        kind: the mission's ``Options``.
        given: by name; whole numbers do for real ones, lists of numbers for text like ``0,0,1``.

    Raises:
        MissionError: an option that the mission does not have, or a value of another type.
    """
    known = options_of(kind)
    values = {}
    for name, value in given.items():
        if name not in known:
            raise MissionError(f"mission '{mission}' has no option '{name}'.{near(name, known)}")
        if known[name].set_by:
            raise MissionError(f"{name} of '{mission}' is set by {known[name].set_by}.")
        values[name] = _checked(name, value, known[name].kinds)
    return kind(**values)


def _checked(name: str, value: Any, kinds: tuple[Any, ...]) -> Any:
    """Returns `value` as one of `kinds`."""
    if value is None and NoneType in kinds:
        return None
    if bool in kinds:
        if isinstance(value, bool):
            return value
        raise MissionError(f"option {name}: {value!r}; true or false is needed.")
    if str in kinds:  # a name may look like a number
        if isinstance(value, list | tuple):
            return ",".join(str(x) for x in value)
        return str(value)
    if Mapping in kinds:
        if isinstance(value, Mapping):
            return dict(value)
        raise MissionError(f"option {name}: {value!r} is not a mapping of joint names to angles.")
    if list in kinds:
        if isinstance(value, list | tuple):
            return list(value)
        raise MissionError(f"option {name}: {value!r} is not a list.")
    if int in kinds and isinstance(value, Integral) and not isinstance(value, bool):
        return int(value)
    number = isinstance(value, Real) and not isinstance(value, bool)
    if float in kinds and number and not math.isnan(value):
        return float(value)
    whole = "a whole number" if int in kinds else "a number"
    raise MissionError(f"option {name}: {value!r} is not {whole}.")


def _kinds(hint: Any) -> tuple[Any, ...]:
    """Returns the plain types of an annotation."""
    parts = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
    return tuple(get_origin(part) or part for part in parts)


def _meanings(kind: type) -> dict[str, str]:
    """Returns the text beside each attribute in the docstrings of `kind` and its bases."""
    out: dict[str, str] = {}
    for one in reversed(kind.__mro__):
        text = inspect.cleandoc(one.__dict__.get("__doc__") or "")
        _, _, listed = text.partition("Attributes:\n")
        for entry in re.split(r"\n(?= {4}\w+:)", "\n" + listed):
            name, colon, meaning = entry.strip().partition(":")
            if colon:
                out[name] = " ".join(meaning.split())
    return out
