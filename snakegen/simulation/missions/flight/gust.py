"""Hover in a gust: wind that rises and falls as 1-cos, with turbulence if requested."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.errors import MissionError
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.plan import Plan, holding, ticks
from snakegen.simulation.flight.postures import (
    PostureOption,
    place,
    resting_attitude,
    resting_joints,
)
from snakegen.simulation.flight.trim import TrimOption
from snakegen.simulation.flight.wind import one_minus_cosine
from snakegen.simulation.recording.recording import Recording


@dataclass(frozen=True)
class Options(PostureOption, TrimOption):
    """Options of mission `gust`.

    Attributes:
        speed: m/s, of the air at the gust's peak
        direction: x, y or z, where it blows to
        length: s, of the gust
        turbulence: m/s, standard deviation on each axis (Dryden), all the while
        force: N, a push of this peak on the whole body instead of wind
        duration: s
        height: m, of the CoG
    """

    speed: float = 8.0
    direction: str = "y"
    length: float = 1.0
    turbulence: float = 0.0
    force: float | None = None
    duration: float = 10.0
    height: float = 1.5


_AT = 2.0  # s, when it begins


def applies(robot: Robot) -> bool:
    """A floating base and rotors."""
    return robot.floating and bool(robot.modules.apparatuses)


def plan(robot: Robot, rate: float, options: Options) -> Plan:
    """Returns the plan: hover, and ``V (1 - cos 2πt/T) / 2`` of wind, or of force at the CoG."""
    if options.direction not in ("x", "y", "z"):
        raise MissionError(f"direction '{options.direction}': x, y or z is needed.")
    if not options.length > 0:
        raise MissionError(f"length {options.length:g} s: more than 0 is needed.")
    if not options.turbulence >= 0:
        raise MissionError(f"turbulence {options.turbulence:g} m/s: 0 or more is needed.")
    if not options.duration > _AT + options.length:
        raise MissionError(
            f"duration {options.duration:g} s: more than {_AT + options.length:g} is needed."
        )
    time = ticks(options.duration, rate)
    way = np.eye(3)["xyz".index(options.direction)]
    peak, unit = (options.speed, "m/s") if options.force is None else (options.force, "N")
    gust = one_minus_cosine(time, _AT, options.length, peak * way)
    blown: dict[str, Any] = {"wind": gust}
    if options.force is not None:
        push = np.hstack([gust, np.zeros_like(gust)])
        blown = {"disturbance": push, "disturbance_at_cog": True}
    joints = resting_joints(robot, options.posture)
    attitude = resting_attitude(robot, options.posture, "gust")
    cog = np.array([0.0, 0.0, options.height])
    return holding(
        time,
        joints,
        place(robot, joints, cog, attitude),
        cog,
        turbulence=options.turbulence,
        events=(
            (_AT, f"gust of {peak:g} {unit} along {options.direction}"),
            (_AT + options.length, "gust over"),
        ),
        facts={"gust_end_s": _AT + options.length},
        # turbulence goes on after the gust: there is nothing to come back to
        thresholds={"position_max_m": {"at_most": 0.6}}
        | (
            {}
            if options.turbulence
            else {"recovery_s": {"at_most": options.duration - _AT - options.length}}
        ),
        **blown,
        tracked=False,
        disturbed=options.turbulence == 0.0,
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
