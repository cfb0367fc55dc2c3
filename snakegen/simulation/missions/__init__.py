"""Missions, by folder: every module in ``flight/``, ``drive/`` and ``arm/`` is one.

A mission has a docstring whose first line says what it shows, ``applies(robot) -> bool`` whose
docstring says what it needs, ``Options``, a frozen dataclass (`options`), and
``plan(robot, rate, options) -> Plan`` with `rate` the ticks per second. With a `TrimOption` a
hover of that many seconds is flown before the plan (`trim.trimmed`). It may have
``metrics(recording) -> dict``, numbers of its own, and ``gains(gains) -> Gains``, if it has to fly
with others than the robot's. What is no aerial flight (an arm, a drive) has, instead of `plan`,
``fly(robot, options, settings) -> Recording`` that returns the judged recording.
A YAML file in place of a name is the mission `path` with that file.
"""

import ast
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from snakegen.errors import MissionError, near
from snakegen.simulation.missions.options import checked_options


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
    if lacking := needs(name, robot):
        raise MissionError(f"mission '{name}' does not suit {robot.name}; it needs {lacking}.")
    return module_of(name)


def needs(name: str, robot: Any) -> str:
    """Returns what mission `name` needs that `robot` does not have; empty where it applies."""
    module = module_of(name)
    if module.applies(robot):
        return ""
    return " ".join((module.applies.__doc__ or "").split()).rstrip(".").lower()


def is_file(name: str) -> bool:
    """Tells whether a mission is named by its file."""
    return name.endswith((".yaml", ".yml"))


def planned(name: str, robot: Any, rate: float = 200.0, **options: Any) -> Any:
    """Returns the plan of flight mission `name` with the given options, `rate` ticks a second.

    Raises:
        MissionError: as `mission`, or an option that it does not have.
    """
    module = mission(name, robot)
    return module.plan(robot, rate, checked_options(name, module.Options, options))
