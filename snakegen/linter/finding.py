"""What every rule of the linter returns, and how it reads numbers and names elements."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from snakegen.linter.catalogue import RULES
from snakegen.linter.rule import Severity, Tier
from snakegen.linter.xml_tree import Node

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity)", re.ASCII | re.IGNORECASE)


@dataclass(frozen=True)
class Finding:
    """One observation about a description file.

    Attributes:
        severity: ``error`` (the model is wrong or unloadable), ``warning`` (probably not meant,
            or refused by some program) or ``note`` (harmless, worth knowing).
        tier: ``schema``, ``topology``, ``physics``, ``assets`` or ``portability``.
        code: short stable name of the rule, e.g. ``limits_swapped``; an entry of docs/lint.md.
        element: the element concerned, e.g. ``joint 'joint1_yaw'``.
        line: its line in the text, from 1.
        message: what is wrong.
        remedy: what mends it.
    """

    severity: Severity
    tier: Tier
    code: str
    element: str
    line: int
    message: str
    remedy: str

    def __str__(self) -> str:
        where = f"line {self.line}, {self.element}" if self.element else f"line {self.line}"
        return f"{where}: {self.message} [{self.code}]"

    def to_json(self) -> dict[str, Any]:
        """Returns plain data."""
        return {
            "severity": self.severity,
            "tier": self.tier,
            "code": self.code,
            "element": self.element,
            "line": self.line,
            "message": self.message,
            "remedy": self.remedy,
        }


def finding(
    code: str, element: str, line: int, message: str, severity: Severity | None = None
) -> Finding:
    """Returns a finding of rule `code`, of the rule's severity unless another is given."""
    rule = RULES[code]
    return Finding(severity or rule.severity, rule.tier, code, element, line, message, rule.remedy)


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

    The grammar reports faulty numbers; the other rules look at sound ones only.
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
