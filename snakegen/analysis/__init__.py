"""Analyses, found by folder: every module here is one.

An analysis has ``COMMAND`` (its name on the command line), ``ORDER`` (its place in a report),
perhaps ``REPORT = False`` (not part of a report) and ``EXAMPLE`` (what follows its name in its
help), ``applies(robot) -> bool`` and ``analyze(robot, q, **options) -> Result``. Options of the
command are the arguments under ``Options:`` of `analyze`'s docstring: name, type and default are
those of the signature, the meaning is the docstring's. A Result is a frozen dataclass with
``to_json()`` and ``rows()``, (label, text) pairs for people. `catalogue` reads names without
importing anything.
"""

import ast
import re
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple


class Option(NamedTuple):
    """An option of an analysis, as its signature and docstring declare it."""

    default: Any  # text where the command line writes numbers with commas between them
    kind: type
    meaning: str


@dataclass(frozen=True)
class Entry:
    """An analysis as its source file describes it."""

    command: str
    module: str
    order: int
    help: str
    options: dict[str, "Option"]
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
            if name in ("COMMAND", "ORDER", "REPORT", "EXAMPLE"):
                constants[name] = ast.literal_eval(node.value)
    if "COMMAND" not in constants:
        return None
    summary = (ast.get_docstring(tree) or "").strip().splitlines()
    options = read_options(tree, path.name)
    return Entry(
        constants["COMMAND"],
        f"snakegen.analysis.{path.stem}",
        constants.get("ORDER", 100),
        summary[0] if summary else "",
        options,
        constants.get("REPORT", True),
        constants.get("EXAMPLE", "dragon4 --json"),
    )


def read_options(tree: ast.Module, file: str) -> dict[str, Option]:
    """Returns the options of the function `analyze` in `tree`, in the docstring's order."""
    function = next(n for n in tree.body if isinstance(n, ast.FunctionDef) and n.name == "analyze")
    text = ast.get_docstring(function) or ""
    _, _, listed = text.partition("\nOptions:\n")
    listed = re.split(r"\n(?=\w+:\n)", listed)[0]
    signature = _signature(function.args)
    out = {}
    for entry in re.split(r"\n(?= {4}\w+:)", "\n" + listed):
        name, colon, meaning = entry.strip().partition(":")
        if not colon:
            continue
        if name not in signature:
            raise ValueError(f"{file}: analyze has no argument '{name}' that its docstring names")
        kinds, default = signature[name]
        out[name] = Option(default, _kind(kinds, default), " ".join(meaning.split()))
    return out


def _signature(args: ast.arguments) -> dict[str, tuple[list[str], Any]]:
    """Returns the types and the default of every argument that has a default."""
    last = args.args[len(args.args) - len(args.defaults) :]
    pairs = [*zip(last, args.defaults, strict=True)]
    pairs += [(a, d) for a, d in zip(args.kwonlyargs, args.kw_defaults, strict=True) if d]
    out = {}
    for argument, node in pairs:
        kinds = ast.unparse(argument.annotation).split(" | ") if argument.annotation else []
        value = ast.literal_eval(node)
        if isinstance(value, tuple):
            value = ",".join(f"{x:g}" for x in value) or None
        out[argument.arg] = kinds, value
    return out


def _kind(kinds: list[str], default: Any) -> type:
    """Returns the type in which the command line reads an option: text, if not a plain number."""
    plain: dict[str, type] = {"bool": bool, "int": int, "float": float}
    named = [kind for kind in kinds if kind != "None"]
    return plain.get(named[0], str) if len(named) == 1 else str
