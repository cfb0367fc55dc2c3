"""The house keeps its shape: imports go down the floors of docs/architecture.md."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "snakegen"
FILES = sorted(PACKAGE.rglob("*.py"))


def floors() -> list[tuple[int, str]]:
    """Returns (floor, module) in the order of the table: each may import those before it."""
    rows = re.findall(
        r"^\| (\d) \| (.+) \|$", (ROOT / "docs/architecture.md").read_text(encoding="utf-8"), re.M
    )
    return [
        (int(n), name.rstrip("/")) for n, cells in rows for name in re.findall(r"`(.+?)`", cells)
    ]


def imports(source: str) -> Iterator[tuple[int, str]]:
    """Yields (line, dotted name) of all that a file imports, in functions too, but for types."""
    tree = ast.parse(source)
    for_types = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        for inner in ast.walk(node)
    }
    for node in ast.walk(tree):
        if id(node) in for_types:
            continue
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = "." * node.level + (node.module or "")
            yield from ((node.lineno, f"{base}.{alias.name}") for alias in node.names)


def unit_of(dotted: str) -> str | None:
    """Returns the top-level module of snakegen that a dotted name lies in, None if outside."""
    parts = dotted.split(".")
    if parts[0] != "snakegen" or len(parts) < 2:
        return None
    here = PACKAGE / parts[1]
    return parts[1] if here.is_dir() or here.with_suffix(".py").is_file() else None


def breaches(source: str, unit: str, order: list[tuple[int, str]]) -> list[str]:
    """Returns the imports of a file of `unit` that do not go down."""
    place = {name: (floor, i) for i, (floor, name) in enumerate(order)}
    out = []
    for line, dotted in imports(source):
        other = unit_of(dotted)
        if other is None or other == unit:
            continue
        if other not in place:
            out.append(f"line {line}: '{other}' has no floor in docs/architecture.md")
        elif place[other] >= place[unit]:
            up, here = place[other][0], place[unit][0]
            out.append(f"line {line}: '{unit}' (floor {here}) imports '{other}' (floor {up})")
    return out


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_go_down(path: Path) -> None:
    """Every import goes to a lower floor, or to the left on the same floor."""
    unit = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    if unit == "__init__":
        return  # the lazy public surface names every floor
    order = floors()
    assert unit in {name for _, name in order}, f"give '{unit}' a floor in docs/architecture.md"
    assert breaches(path.read_text(encoding="utf-8"), unit, order) == []


def test_a_planted_breach_is_seen() -> None:
    """The walk finds an import upward, at the top and in a function, and leaves types alone."""
    order = floors()
    assert breaches("from snakegen.cli import main", "geometry", order)
    assert breaches("def f():\n    import snakegen.robot", "kernels", order)
    assert breaches("from snakegen import report", "analysis", order)
    assert breaches("from snakegen.nowhere import x\nimport snakegen.errors", "robot", order) == []
    typed = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import snakegen.robot"
    assert breaches(typed, "kernels", order) == []


def test_the_table_is_the_folder() -> None:
    """The table names every module that there is, once, and none that there is not."""
    named = [name for _, name in floors()]
    there = {p.stem for p in PACKAGE.iterdir() if p.suffix == ".py" or (p / "__init__.py").exists()}
    assert len(named) == len(set(named))
    assert set(named) == there - {"__init__"}


def test_nothing_imports_relatively_or_everything() -> None:
    """Imports are absolute, and never a star."""
    found = [
        f"{path.name}:{line}"
        for path in FILES
        for line, name in imports(path.read_text(encoding="utf-8"))
        if name.startswith(".") or name.endswith(".*")
    ]
    assert found == []


def test_oracles_stay_apart() -> None:
    """Pinocchio and MuJoCo meet in the gate and in verify/ alone, else neither checks the other."""
    both = set()
    for path in FILES:
        roots = {name.split(".")[0] for _, name in imports(path.read_text(encoding="utf-8"))}
        if {"mujoco", "pinocchio"} <= roots:
            both.add(str(path.relative_to(PACKAGE)))
    assert {b for b in both if not b.startswith("verify/")} == {"equivalence.py"}


def test_kernels_know_arrays_only() -> None:
    """Kernels import numpy, numba and one another: no file of snakegen above them."""
    for path in sorted((PACKAGE / "kernels").glob("*.py")):
        for line, name in imports(path.read_text(encoding="utf-8")):
            inside = name.startswith("snakegen.")
            assert not inside or name.startswith("snakegen.kernels."), f"{path.name}:{line}: {name}"
