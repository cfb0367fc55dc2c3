"""Hold a place against a pull at the tail that grows until the wheels give out.

The pull at which it lets go, over the one that `analyze traction` predicts, is the run's `ratio`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from snakegen.robot.robot import Robot
from snakegen.screw_drive.ground_stance import stance
from snakegen.screw_drive.traction_limits import downhill, largest_pull
from snakegen.simulation.drive.load import (
    GroundLoad,
    load_facts,
    load_metrics,
    load_thresholds,
    ramp,
)
from snakegen.simulation.drive.plan import can_drive, check_figure, choice, held_plan, held_posture
from snakegen.simulation.drive.record import drive
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.run_settings import RunSettings


@dataclass(frozen=True)
class Options:
    """Options of mission `tow`.

    Attributes:
        towards: back, ahead, left or right: where the pull is directed
        posture: posture file; straight by default
        until: times the predicted pull, where the ramp ends
        slow: s, from 0.6 of the prediction to the end
        gain: 1/s, K of HA eq 7, with which it holds its place
    """

    towards: str = "back"
    posture: Mapping[str, Any] | None = None
    until: float = 1.5
    slow: float = 24.0
    gain: float = 0.5


_SIDES = {"back": "nose_up", "ahead": "nose_down", "left": "left_down", "right": "right_down"}


def applies(robot: Robot) -> bool:
    """A floating base and two or more screw drums."""
    return can_drive(robot)


def fly(robot: Robot, options: Options, settings: RunSettings) -> Recording:
    """Pulls at the end of the last link and returns the judged recording."""
    towards = choice(options.towards, tuple(_SIDES), "towards")
    q = held_posture(robot, options.posture)
    body = stance(robot, q)
    direction = downhill(body, _SIDES[towards])
    held = largest_pull(body, direction, min(s.friction for s in robot.modules.screws))
    check_figure(robot, held.value, f"pull {towards}")
    link, length = list(robot.modules.lengths.items())[-1]
    time, value = ramp(held.value, options.until, options.slow)
    load = GroundLoad("tow", direction, time, value, link, (length, 0.0, 0.0))
    plan = held_plan(robot, q, load, options.gain, load_thresholds(held), load_facts(load, held))
    return drive(robot, "tow", plan, settings=settings)


def metrics(recording: Recording) -> dict[str, Any]:
    """Returns the pull [N] at which it let go, over the prediction."""
    return load_metrics(recording)
