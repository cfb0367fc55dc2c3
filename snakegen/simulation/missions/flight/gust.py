"""Hover in a gust: wind that rises and falls as 1-cos, turbulence beside it if asked for."""

from typing import Any

import numpy as np

from snakegen.errors import MissionError
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.plan import Plan, holding, ticks
from snakegen.simulation.flight.postures import place, resting_joints
from snakegen.simulation.flight.trim import OPTION as TRIM
from snakegen.simulation.flight.wind import one_minus_cosine
from snakegen.simulation.recording.recording import Recording

OPTIONS = {
    "speed": [8.0, "m/s, of the air at the gust's peak"],
    "direction": ["y", "x, y or z, where it blows to"],
    "length": [1.0, "s, of the gust"],
    "turbulence": [0.0, "m/s, standard deviation on each axis (Dryden), all the while"],
    "force": [None, "N, a push of this peak on the whole body instead of wind"],
    "duration": [10.0, "s"],
    "height": [1.5, "m, of the CoG"],
    "posture": [None, "posture file; a bent body by default"],
    "trim": TRIM,
}
_AT = 2.0  # s, when it begins


def applies(robot: Robot) -> bool:
    """A floating base and rotors."""
    return robot.floating and bool(robot.modules.apparatuses)


def plan(
    robot: Robot,
    rate: float,
    *,
    speed: float = 8.0,
    direction: str = "y",
    length: float = 1.0,
    turbulence: float = 0.0,
    force: float | None = None,
    duration: float = 10.0,
    height: float = 1.5,
    posture: dict[str, Any] | None = None,
) -> Plan:
    """Returns the plan: hover, and ``V (1 - cos 2πt/T) / 2`` of wind, or of force at the CoG."""
    if direction not in ("x", "y", "z"):
        raise MissionError(f"direction '{direction}': x, y or z is needed.")
    if not length > 0:
        raise MissionError(f"length {length:g} s: more than 0 is needed.")
    if not turbulence >= 0:
        raise MissionError(f"turbulence {turbulence:g} m/s: 0 or more is needed.")
    if not duration > _AT + length:
        raise MissionError(f"duration {duration:g} s: more than {_AT + length:g} is needed.")
    time = ticks(duration, rate)
    way = np.eye(3)["xyz".index(direction)]
    peak, unit = (speed, "m/s") if force is None else (force, "N")
    gust = one_minus_cosine(time, _AT, length, peak * way)
    blown: dict[str, Any] = {"wind": gust}
    if force is not None:
        push = np.hstack([gust, np.zeros_like(gust)])
        blown = {"disturbance": push, "disturbance_at_cog": True}
    joints = resting_joints(robot, posture)
    cog = np.array([0.0, 0.0, height])
    return holding(
        time,
        joints,
        place(robot, joints, cog),
        cog,
        turbulence=turbulence,
        events=((_AT, f"gust of {peak:g} {unit} along {direction}"), (_AT + length, "gust over")),
        facts={"gust_end_s": _AT + length},
        # turbulence goes on after the gust: there is nothing to come back to
        thresholds={"position_max_m": {"at_most": 0.6}}
        | ({} if turbulence else {"recovery_s": {"at_most": duration - _AT - length}}),
        **blown,
        tracked=False,
    )


def metrics(recording: Recording) -> dict[str, Any]:
    """Returns how far the gust carried the CoG, and how long it took to come back to 5 cm.

    A run that ended before the gust did has not come back: None.
    """
    from snakegen.simulation.recording.signals import position_error

    end = float(recording.meta["facts"]["gust_end_s"])
    time, error = recording.times("position"), np.linalg.norm(position_error(recording), axis=1)
    begun = time >= recording.meta["metrics_window_s"][0]  # what a trim mends is not its doing
    time, error = time[begun], error[begun]
    after = np.flatnonzero((time > end) & (error > 0.05))
    back = float(time[after[-1]] - end) if after.size else 0.0
    lost = not time.size or time[-1] <= end or (after.size and after[-1] == len(time) - 1)
    return {"carried_off_m": float(error.max()), "recovery_s": None if lost else back}
