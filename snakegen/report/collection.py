"""The results of every analysis that applies to a robot in a posture."""

from dataclasses import dataclass
from typing import Any

from snakegen.analysis import catalogue
from snakegen.base.geometry import Floats
from snakegen.robot.robot import Robot


@dataclass(frozen=True)
class Page:
    """The results of all analyses that apply, by command, in report order."""

    robot: Robot
    q: Floats
    results: dict[str, Any]


def collect(robot: Robot, q: Floats) -> Page:
    """Runs every analysis that applies to `robot` at q."""
    results = {}
    for command, entry in catalogue().items():
        if not entry.report:
            continue
        module = entry.load()
        if module.applies(robot):
            results[command] = module.analyze(robot, q)
    return Page(robot, q, results)
