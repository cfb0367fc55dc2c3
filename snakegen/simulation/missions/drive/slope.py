"""Hold a place on a slope that grows steeper until the wheels or the body give out.

The slope at which it lets go, over the one that `analyze traction` predicts, is the run's `ratio`.
"""

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
from snakegen.simulation.drive.plan import can_drive, check_figure, choice, held_plan
from snakegen.simulation.drive.record import drive
from snakegen.simulation.recording.recording import Recording

OPTIONS: dict[str, list[Any]] = {
    "side": ["nose_up", "nose_up, nose_down, left_down or right_down"],
    "posture": [None, "posture file; straight by default"],
    "until": [1.5, "times the predicted slope, where the ramp ends"],
    "slow": [24.0, "s, from 0.6 of the prediction to the end"],
    "gain": [0.5, "1/s, K of HA eq 7, with which it holds its place"],
}


def applies(robot: Robot) -> bool:
    """A floating base and two or more screw drums."""
    return can_drive(robot)


def fly(
    robot: Robot, *, seed: int, ideal: bool, options: dict[str, Any], progress: Any
) -> Recording:
    """Inclines the ground under the drive and returns the judged recording."""
    o = {k: v[0] for k, v in OPTIONS.items()} | options
    side = choice(o["side"], SIDES, "side")
    q = robot.configuration(o["posture"] or {})
    body = stance(robot, q)
    direction = downhill(body, side)
    held = steepest_slope(body, direction, min(s.friction for s in robot.modules.screws))
    check_figure(robot, held.value, f"slope {side.replace('_', ' ')}")
    load = GroundLoad("slope", direction, *ramp(held.value, o["until"], o["slow"]))
    plan = held_plan(robot, q, load, o["gain"], load_thresholds(held), load_facts(load, held))
    how = {"seed": seed, "ideal": ideal, "progress": progress}
    return drive(robot, "slope", plan, **how)


def metrics(recording: Recording) -> dict[str, Any]:
    """Returns the slope [rad] at which it let go, over the prediction."""
    return load_metrics(recording)
