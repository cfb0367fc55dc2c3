"""Missions, by folder: every module in ``flight/``, ``drive/`` and ``arm/`` is one.

A mission has a docstring whose first line says what it shows, ``applies(robot) -> bool`` whose
docstring says what it needs, ``OPTIONS`` (name → [default, help]) and
``plan(robot, rate, **options) -> Plan`` with `rate` the ticks per second. An option `trim` is not
passed on: a hover of that many seconds is flown before the plan (`trim.trimmed`). It may have
``metrics(recording) -> dict``, numbers of its own, and ``gains(gains) -> Gains``, if it has to fly
with others than the robot's. What is no aerial flight (an arm, a drive) has, instead of `plan`,
``fly(robot, *, seed, ideal, options, progress) -> Recording`` that returns the judged recording.
A YAML file in place of a name is the mission `path` with that file.
"""

import ast
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from snakegen.errors import MissionError, near


@cache
def _files() -> dict[str, Path]:
    """Returns the file of each mission by name."""
    found = sorted(Path(__file__).parent.glob("*/*.py"), key=lambda path: path.stem)
    return {path.stem: path for path in found if path.stem != "__init__"}


@cache
def missions() -> dict[str, str]:
    """Returns what each mission shows, by name, without importing any."""
    out = {}
    for name, path in _files().items():
        text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        out[name] = text.splitlines()[0] if text else ""
    return out


def module_of(name: str) -> ModuleType:
    """Imports and returns the module of mission `name`, one of `missions()`."""
    return import_module(f"{__name__}.{_files()[name].parent.name}.{name}")


def mission(name: str, robot: Any) -> Any:
    """Returns the module of mission `name`, or of `path` for a mission file.

    Raises:
        MissionError: no such mission, or one that does not apply to `robot`.
    """
    if is_file(name):
        name = "path"
    if name not in missions():
        raise MissionError(f"there is no mission '{name}'.{near(name, missions())}")
    module = module_of(name)
    if not module.applies(robot):
        needs = " ".join((module.applies.__doc__ or "").split()).rstrip(".").lower()
        raise MissionError(f"mission '{name}' does not suit {robot.name}; it needs {needs}.")
    return module


def is_file(name: str) -> bool:
    """Tells whether a mission is named by its file."""
    return name.endswith((".yaml", ".yml"))
