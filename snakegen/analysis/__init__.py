"""Analyses, found by folder: every module here is one.

An analysis has ``COMMAND`` (its name on the command line), ``ORDER`` (its place in a report),
``OPTIONS`` (literal: name → [default, help]), perhaps ``REPORT = False`` (not part of a report)
and ``EXAMPLE`` (what follows its name in its help),
``applies(robot) -> bool`` and
``analyze(robot, q, **options) -> Result``. A Result is a frozen dataclass with ``to_json()`` and
``rows()``, (label, text) pairs for people. `catalogue` reads names without importing anything.
"""

import ast
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Entry:
    """An analysis as its source file describes it."""

    command: str
    module: str
    order: int
    help: str
    options: dict[str, tuple[Any, str]]
    report: bool = True  # whether a report runs it unasked
    example: str = "dragon4 --json"  # what follows its name in its help

    def load(self) -> Any:
        """Imports and returns the module."""
        return import_module(self.module)


@cache
def catalogue() -> dict[str, Entry]:
    """Returns the analyses by command, in report order, without importing them."""
    found = []
    for path in sorted(Path(__file__).parent.glob("*.py")):
        if path.stem != "__init__":
            entry = _read(path)
            if entry is not None:
                found.append(entry)
    return {e.command: e for e in sorted(found, key=lambda e: (e.order, e.command))}


def _read(path: Path) -> Entry | None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    constants: dict[str, Any] = {}
    for node in tree.body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            name = node.targets[0].id
            if name in ("COMMAND", "ORDER", "OPTIONS", "REPORT", "EXAMPLE"):
                constants[name] = ast.literal_eval(node.value)
    if "COMMAND" not in constants:
        return None
    summary = (ast.get_docstring(tree) or "").strip().splitlines()
    options = {k: (v[0], v[1]) for k, v in constants.get("OPTIONS", {}).items()}
    return Entry(
        constants["COMMAND"],
        f"snakegen.analysis.{path.stem}",
        constants.get("ORDER", 100),
        summary[0] if summary else "",
        options,
        constants.get("REPORT", True),
        constants.get("EXAMPLE", "dragon4 --json"),
    )
