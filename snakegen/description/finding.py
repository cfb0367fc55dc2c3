"""What every rule of the lint returns, and how it reads numbers and names elements."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from snakegen.description.xmltree import Node

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity)", re.ASCII | re.IGNORECASE)


@dataclass(frozen=True)
class Finding:
    """One fault of a URDF.

    Attributes:
        severity: ``error`` (the model is wrong) or ``warning`` (it will not travel well).
        code: short stable name of the rule, e.g. ``limits_swapped``.
        element: the element at fault, e.g. ``joint 'joint1_yaw'``.
        line: its line in the text, from 1.
        message: what is wrong and what would be right.
    """

    severity: Literal["error", "warning"]
    code: str
    element: str
    line: int
    message: str

    def __str__(self) -> str:
        where = f"line {self.line}, {self.element}" if self.element else f"line {self.line}"
        return f"{where}: {self.message} [{self.code}]"


def error(code: str, element: str, line: int, message: str) -> Finding:
    """Returns a finding that makes the model unusable."""
    return Finding("error", code, element, line, message)


def warning(code: str, element: str, line: int, message: str) -> Finding:
    """Returns a finding that another program, machine or reader may stumble over."""
    return Finding("warning", code, element, line, message)


def label(node: Node) -> str:
    """Names an element for a person: ``joint 'joint1_yaw'``, or ``<geometry>`` without a name."""
    name = node.attrib.get("name")
    return f"<{node.tag}>" if name is None else f"{node.tag} {name!r}"


def word_fault(word: str) -> str | None:
    """Returns the code of what keeps a word from being a finite number, or None."""
    if _NOT_FINITE.fullmatch(word):
        return "not_finite"
    if not _NUMBER.fullmatch(word):
        return "not_numeric"
    return None if math.isfinite(float(word)) else "not_finite"


def numbers(node: Node | None, attribute: str, count: int = 1) -> tuple[float, ...] | None:
    """Returns the `count` finite numbers of an attribute; None where it is absent or faulty.

    The grammar reports faulty numbers; the rules behind it only look at sound ones.
    """
    words = [] if node is None else node.attrib.get(attribute, "").split()
    if len(words) != count or any(word_fault(word) for word in words):
        return None
    return tuple(float(word) for word in words)


def number(node: Node | None, attribute: str) -> float | None:
    """Returns one finite number of an attribute, or None where it is absent or faulty."""
    found = numbers(node, attribute)
    return found[0] if found else None


def shapes(link: Node) -> Iterator[Node]:
    """Yields the shape elements (``<box>``, ``<mesh>``, …) of a link's visuals and collisions."""
    for part in link.children:
        geometry = part.find("geometry") if part.tag in ("visual", "collision") else None
        if geometry is not None:
            yield from geometry.children
