"""Hold a place on a slope that grows steeper until the wheels or the body give out.

The slope at which it lets go, over the one that `analyze traction` predicts, is the run's `ratio`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from snakegen.robot.robot import Robot
from snakegen.screw_drive.ground_stance import stance
from snakegen.screw_drive.traction_limits import SIDES, downhill, steepest_slope
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
    """Options of mission `slope`.

    Attributes:
        side: nose_up, nose_down, left_down or right_down
        posture: posture file; straight by default
        until: times the predicted slope, where the ramp ends
        slow: s, from 0.6 of the prediction to the end
        gain: 1/s, K of HA eq 7, with which it holds its place
    """

    side: str = "nose_up"
    posture: Mapping[str, Any] | None = None
    until: float = 1.5
    slow: float = 24.0
    gain: float = 0.5


def applies(robot: Robot) -> bool:
    """A floating base and two or more screw drums."""
    return can_drive(robot)


def fly(robot: Robot, options: Options, settings: RunSettings) -> Recording:
    """Inclines the ground under the drive and returns the judged recording."""
    side = choice(options.side, SIDES, "side")
    q = held_posture(robot, options.posture)
    body = stance(robot, q)
    direction = downhill(body, side)
    held = steepest_slope(body, direction, min(s.friction for s in robot.modules.screws))
    check_figure(robot, held.value, f"slope {side.replace('_', ' ')}")
    load = GroundLoad("slope", direction, *ramp(held.value, options.until, options.slow))
    plan = held_plan(robot, q, load, options.gain, load_thresholds(held), load_facts(load, held))
    return drive(robot, "slope", plan, settings=settings)


def metrics(recording: Recording) -> dict[str, Any]:
    """Returns the slope [rad] at which it let go, over the prediction."""
    return load_metrics(recording)
