"""The package keeps its shape: imports go to earlier layers of docs/architecture.md."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "snakegen"
FILES = sorted(PACKAGE.rglob("*.py"))


def layers() -> list[str]:
    """Returns the layers of docs/architecture.md in order: each may import those before it."""
    page = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    table = page[page.index("## Layers") : page.index("## Where things are found")]
    cells = re.findall(r"^\| (`.+?) \|", table, re.M)
    return [name.rstrip("/") for cell in cells for name in re.findall(r"`(.+?)`", cell)]


def imports(source: str) -> Iterator[tuple[int, str]]:
    """Yields (line, dotted name) of all that a file imports, in functions and for types too."""
    for node in ast.walk(ast.parse(source)):
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


def breaches(source: str, unit: str, order: list[str]) -> list[str]:
    """Returns the imports of a file of `unit` that do not go to an earlier layer."""
    out = []
    for line, dotted in imports(source):
        other = unit_of(dotted)
        if other is None or other == unit:
            continue
        if other not in order:
            out.append(f"line {line}: '{other}' is no layer of docs/architecture.md")
        elif order.index(other) >= order.index(unit):
            out.append(f"line {line}: '{unit}' imports '{other}', a later layer")
    return out


def import_graph() -> dict[str, set[str]]:
    """Returns the files that each file of the package imports, by dotted name."""
    names = {".".join(p.relative_to(ROOT).with_suffix("").parts): p for p in FILES}
    names = {n.removesuffix(".__init__"): p for n, p in names.items()}
    graph = {}
    for name, path in names.items():
        targets = set()
        for _, dotted in imports(path.read_text(encoding="utf-8")):
            nearest = dotted if dotted in names else dotted.rpartition(".")[0]
            if nearest in names and nearest != name:
                targets.add(nearest)
        graph[name] = targets
    del graph["snakegen"]  # the lazy public surface names every layer
    return graph


def cycles(graph: dict[str, set[str]]) -> list[set[str]]:
    """Returns the groups of files that import one another, directly or through others."""

    def reach(start: str) -> set[str]:
        found: set[str] = set()
        waiting = [start]
        while waiting:
            for other in graph.get(waiting.pop(), ()):
                if other not in found:
                    found.add(other)
                    waiting.append(other)
        return found

    reached = {name: reach(name) for name in graph}
    groups = {
        frozenset({name} | {o for o in reached[name] if name in reached.get(o, ())})
        for name in graph
        if name in reached[name]
    }
    return sorted(map(set, groups), key=sorted)


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_go_to_earlier_layers(path: Path) -> None:
    unit = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    if unit == "__init__":
        return  # the lazy public surface names every layer
    order = layers()
    assert unit in order, f"give '{unit}' a row in docs/architecture.md"
    assert breaches(path.read_text(encoding="utf-8"), unit, order) == []


def test_no_files_import_each_other() -> None:
    assert cycles(import_graph()) == []


def test_planted_breaches_are_seen() -> None:
    order = layers()
    assert breaches("from snakegen.cli import main", "base", order)
    assert breaches("def f():\n    import snakegen.robot", "kernels", order)
    assert breaches("from snakegen import report", "analysis", order)
    assert breaches("from snakegen.nowhere import x\nimport snakegen.errors", "robot", order) == []
    typed = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import snakegen.robot"
    assert breaches(typed, "kernels", order)
    assert cycles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) == [{"a", "b", "c"}]


def test_folders_stay_small() -> None:
    assert len(list(PACKAGE.glob("*.py"))) <= 8
    sizes = {str(d.relative_to(PACKAGE)): len(list(d.glob("*.py"))) for d in PACKAGE.rglob("*/")}
    assert {name: n for name, n in sizes.items() if n > 26} == {}


def test_the_table_is_the_folder() -> None:
    """The table names every module that there is, once, and none that there is not."""
    named = layers()
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
    """Pinocchio and MuJoCo meet in the equivalence check and in simulation/ alone."""
    both = set()
    for path in FILES:
        roots = {name.split(".")[0] for _, name in imports(path.read_text(encoding="utf-8"))}
        if {"mujoco", "pinocchio"} <= roots:
            both.add(str(path.relative_to(PACKAGE)))
    assert {b for b in both if not b.startswith("simulation/")} == {"pipeline/equivalence.py"}


def test_kernels_know_arrays_only() -> None:
    """Kernels import numpy, numba and one another: no file of snakegen above them."""
    for path in sorted((PACKAGE / "kernels").rglob("*.py")):
        for line, name in imports(path.read_text(encoding="utf-8")):
            inside = name.startswith("snakegen.")
            assert not inside or name.startswith("snakegen.kernels."), f"{path.name}:{line}: {name}"


MOST, ALLOWED = 10, 5  # arguments of a function, and functions that take more


def test_functions_take_few_arguments() -> None:
    """Outside the command line; those of an analysis, counted here, are options there."""
    long = []
    for path in FILES:
        if path.relative_to(PACKAGE).parts[0] == "cli":
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                given = node.args
                names = [a.arg for a in given.posonlyargs + given.args + given.kwonlyargs]
                if len(set(names) - {"self", "cls"}) > MOST:
                    long.append(f"{path.relative_to(PACKAGE)}: {node.name}")
    assert len(long) <= ALLOWED, long
