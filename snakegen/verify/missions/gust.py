"""Hover in a gust: a 1-cos push on the whole body, and how far it carries it off."""

from typing import Any

import numpy as np

from snakegen.errors import MissionError
from snakegen.robot import Robot
from snakegen.verify.plan import Plan, holding, ticks
from snakegen.verify.postures import place, resting_joints
from snakegen.verify.recording import Recording

OPTIONS = {
    "force": [8.0, "N, at its peak"],
    "direction": ["y", "x, y or z"],
    "length": [1.0, "s, of the gust"],
    "duration": [10.0, "s"],
    "height": [1.5, "m, of the CoG"],
    "posture": [None, "posture file; a bent body by default"],
}
_AT = 2.0  # s, when it begins


def applies(robot: Robot) -> bool:
    """A floating base and rotors."""
    return robot.floating and bool(robot.modules.apparatuses)


def plan(
    robot: Robot,
    rate: float,
    *,
    force: float = 8.0,
    direction: str = "y",
    length: float = 1.0,
    duration: float = 10.0,
    height: float = 1.5,
    posture: dict[str, Any] | None = None,
) -> Plan:
    """Returns the plan: hover, and ``F (1 - cos 2πt/T) / 2`` at the CoG."""
    if direction not in ("x", "y", "z"):
        raise MissionError(f"direction '{direction}': x, y or z is needed.")
    if not length > 0:
        raise MissionError(f"length {length:g} s: more than 0 is needed.")
    time = ticks(duration, rate)
    phase = np.clip((time - _AT) / length, 0.0, 1.0)
    push = np.zeros((len(time), 6))
    push[:, "xyz".index(direction)] = 0.5 * force * (1.0 - np.cos(2.0 * np.pi * phase))
    joints = resting_joints(robot, posture)
    cog = np.array([0.0, 0.0, height])
    return holding(
        time,
        joints,
        place(robot, joints, cog),
        cog,
        disturbance=push,
        disturbance_at_cog=True,
        events=((_AT, f"gust of {force:g} N along {direction}"), (_AT + length, "gust over")),
        facts={"gust_end_s": _AT + length},
        thresholds={"recovery_s": {"at_most": duration - _AT - length}},
    )


def metrics(recording: Recording) -> dict[str, Any]:
    """Returns how far the gust carried the CoG, and how long it took to come back to 5 cm."""
    from snakegen.verify.metrics import position_error

    end = float(recording.meta["facts"]["gust_end_s"])
    time, error = recording.times("position"), np.linalg.norm(position_error(recording), axis=1)
    after = np.flatnonzero((time > end) & (error > 0.05))
    back = float(time[after[-1]] - end) if after.size else 0.0
    lost = after.size and after[-1] == len(time) - 1
    return {"carried_off_m": float(error.max()), "recovery_s": None if lost else back}
