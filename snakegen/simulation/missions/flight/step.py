"""Step in each axis, one after the other: rise time, overshoot and settling of every loop."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats, rotation_from_rpy, rotation_from_xyzw, rpy_from_rotation
from snakegen.control.controller import flight_controller, gain_set
from snakegen.control.poles import settling_times
from snakegen.errors import MissionError
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.plan import Plan, holding, ticks
from snakegen.simulation.flight.plant import Imperfections
from snakegen.simulation.flight.postures import (
    PostureOption,
    place,
    resting_attitude,
    resting_joints,
)
from snakegen.simulation.flight.trim import TrimOption
from snakegen.simulation.recording.recording import Recording


@dataclass(frozen=True)
class Options(PostureOption, TrimOption):
    """Options of mission `step`.

    Attributes:
        size: m, step of x, y and z
        turn: rad, step of roll, pitch and yaw (dual-rotor mode: yaw alone)
        hold: s, after each step; 6, or what the slowest of these loops needs to settle
        height: m, of the CoG
    """

    size: float = 0.5
    turn: float = 0.2
    hold: float | None = None
    height: float = 1.5


_FIRST = 1.0  # s, before the first step
_BAND = 0.05  # share of the step within which it counts as settled
_LEAST = 6.0  # s, after a step
_AXES = ("x", "y", "z", "roll", "pitch", "yaw")


def applies(robot: Robot) -> bool:
    """A floating base and rotors."""
    return robot.floating and bool(robot.modules.apparatuses)


def plan(robot: Robot, rate: float, options: Options) -> Plan:
    """Returns the plan: the target jumps, axis by axis, and stays."""
    tilts = robot.modules.control.get("mode") != "dual_rotor"
    axes = [a for a in _AXES if tilts or a not in ("roll", "pitch")]
    hold = _needed(robot, axes) if options.hold is None else options.hold
    if not (hold > 0 and options.size != 0 and options.turn != 0):
        raise MissionError("step needs hold > 0 s, and a size and a turn other than 0.")
    time = ticks(_FIRST + hold * len(axes), rate)
    joints = resting_joints(robot, options.posture)
    attitude = resting_attitude(robot, options.posture, "step")
    cog = np.array([0.0, 0.0, options.height])
    position = np.repeat(cog[None], len(time), axis=0)
    rpy = np.zeros((len(time), 3))
    steps = []
    for i, axis in enumerate(axes):
        at, k = _FIRST + i * hold, _AXES.index(axis)
        (position[:, k] if k < 3 else rpy[:, k - 3])[time >= at] += (
            options.size if k < 3 else options.turn
        )
        steps.append({"axis": axis, "time_s": at, "size": options.size if k < 3 else options.turn})
    return holding(
        time,
        joints,
        place(robot, joints, cog, attitude),
        cog,
        position=position,
        rotation=np.array([rotation_from_rpy(x) @ attitude for x in rpy]),
        events=tuple((s["time_s"], f"step in {s['axis']}") for s in steps),
        facts={"steps": steps, "hold_s": hold},
        # a step's own error is its size: the response is judged, not the distance
        thresholds={
            "position_rmse_m": {"at_most": abs(options.size)},
            "position_max_m": {"at_most": 1.5 * abs(options.size) + 0.1},
            "gimbal_torque_limit_share": None,  # a jump asks for all that a servo has
            "overshoot": {"at_most": 0.5},
            "settling_s": {"at_most": hold},
        },
        tracked=False,
    )


def _needed(robot: Robot, axes: list[str]) -> float:
    """Returns s a step: a quarter more than the linear loops of the robot's gains settle in.

    6 s at least; where a loop is unstable nothing is worth waiting for.
    """
    controller, plant = flight_controller(robot), Imperfections.of(robot.modules.plant)
    lag = max((r.lag for a in robot.modules.apparatuses for r in a.rotors), default=0.0)
    found = settling_times(
        controller, gain_set(robot), controller.mode, lag=lag, delay=plant.delay, band=_BAND
    )
    longest = max(found[a] for a in axes)
    if not np.isfinite(longest):
        return _LEAST
    return float(max(_LEAST, np.ceil(2.0 * 1.25 * longest) / 2.0))


def metrics(recording: Recording) -> dict[str, Any]:
    """Returns rise time (10 to 90 %), overshoot (share) and settling (5 %, s), axis by axis."""
    facts = recording.meta["facts"]
    time = recording.times("position")
    signals = _signals(recording)
    out: dict[str, dict[str, float | None]] = {"rise_s": {}, "overshoot": {}, "settling_s": {}}
    for step in facts["steps"]:
        start = float(step["time_s"])
        inside = (time >= start) & (time < start + float(facts["hold_s"]))
        if not inside.any():
            continue
        x = signals[:, _AXES.index(step["axis"])]
        before = x[time < start][-20:].mean()
        progress = (x[inside] - before) / float(step["size"])
        since = time[inside] - start
        for name, value in zip(out, response(since, progress), strict=True):
            out[name][step["axis"]] = value
    worst = {}
    for name, by_axis in out.items():
        values = list(by_axis.values())
        missing = not values or any(v is None for v in values)
        worst[name] = None if missing else max(v for v in values if v is not None)
        worst |= {f"{name.removesuffix('_s')}_{a}{_unit(name)}": v for a, v in by_axis.items()}
    return worst


def response(since: Floats, progress: Floats) -> tuple[float | None, float, float | None]:
    """Returns rise time [s], overshoot (share) and settling time [s] of a step from 0 to 1.

    None where the response never gets there, or has not settled at the end.
    """
    tenth, most = np.flatnonzero(progress >= 0.1), np.flatnonzero(progress >= 0.9)
    rise = float(since[most[0]] - since[tenth[0]]) if most.size else None
    outside = np.flatnonzero(np.abs(progress - 1.0) > _BAND)
    settled = float(since[outside[-1]]) if outside.size else 0.0
    if outside.size and outside[-1] == len(since) - 1:
        return rise, max(float(progress.max()) - 1.0, 0.0), None
    return rise, max(float(progress.max()) - 1.0, 0.0), settled


def _unit(name: str) -> str:
    return "_s" if name.endswith("_s") else ""


def _signals(recording: Recording) -> Floats:
    """Returns (T, 6): CoG [m], roll, pitch and yaw [rad] from its first target, world axes."""
    first = rotation_from_xyzw(recording.channel("attitude_target").values[0])
    rpy = np.array(
        [
            rpy_from_rotation(rotation_from_xyzw(x) @ first.T)
            for x in recording.channel("attitude").values
        ]
    )
    return np.column_stack([recording.channel("position").values, np.unwrap(rpy, axis=0)])
