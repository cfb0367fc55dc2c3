"""A drafted modules file as YAML: a comment on each value, guesses marked."""

import json
import re
from dataclasses import dataclass
from typing import Any

_PLAIN = re.compile(r"[A-Za-z_][\w/.-]*", re.ASCII)
_SHOWN = 20  # names in a list
_WORDS = frozenset(("yes", "no", "true", "false", "null", "on", "off", "y", "n"))


@dataclass(frozen=True)
class Drafted:
    """A value with the reason for it; a guess has no evidence in the URDF."""

    value: Any
    why: str
    guess: bool = False

    @property
    def rest(self) -> tuple[str, bool]:
        """Reason and mark."""
        return self.why, self.guess


def to_yaml(made: dict[str, Any], name: str, left: list[str]) -> tuple[str, tuple[str, ...]]:
    """Returns YAML of a drafted modules file, and its guesses as sentences.

    Args:
        made: mappings and lists whose leaves are `Drafted`.
        name: of the URDF.
        left: frames at an end that were not taken for rotors.
    """
    lines = [
        f"# Modules of {_comment(name)}, drafted by snakegen adopt.",
        "# Lines with 'guess' rest on no statement of the URDF: check them. docs/modules.md",
        "# explains every field.",
    ]
    guesses: list[str] = []
    if left:
        more = ", …" if len(left) > _SHOWN else ""
        text = f"frames not taken for rotors: {', '.join(left[:_SHOWN])}{more}"
        lines.append(f"# {_comment(text)}")
        guesses.append(_comment(text))
    _mapping(made, "", "", lines, guesses)
    return "\n".join(lines) + "\n", tuple(guesses)


def _mapping(
    made: dict[str, Any], indent: str, place: str, lines: list[str], guesses: list[str]
) -> None:
    for key, value in made.items():
        here = f"{place}{key}"
        if isinstance(value, list):
            lines.append(f"{indent}{key}:")
            for k, entry in enumerate(value):
                at = len(lines)
                _mapping(entry, f"{indent}    ", f"{here}[{k + 1}].", lines, guesses)
                lines[at] = f"{indent}  - {lines[at].lstrip()}"
            continue
        if isinstance(value, dict):
            lines.append(f"{indent}{key}:")
            _mapping(value, f"{indent}  ", f"{here}.", lines, guesses)
            continue
        mark = "guess: " if value.guess else ""
        lines.append(f"{indent}{key}: {_scalar(value.value)}  # {mark}{_comment(value.why)}")
        if value.guess:
            guesses.append(f"{here} = {_scalar(value.value)}: {_comment(value.why)}")


def _scalar(value: Any) -> str:
    if isinstance(value, str):
        plain = _PLAIN.fullmatch(value) and value.lower() not in _WORDS
        return value if plain else json.dumps(value)
    if isinstance(value, list):
        return f"[{', '.join(_scalar(x) for x in value)}]"
    number = repr(float(value))
    if "e" in number and "." not in number:  # YAML 1.1 reads 1e-05 as text
        number = number.replace("e", ".0e")
    return number.removesuffix(".0")


def _comment(text: str) -> str:
    """Returns text that stays on its line."""
    return "".join(c if c.isprintable() else " " for c in text)
