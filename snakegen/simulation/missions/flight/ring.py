"""Pluck the body in hover and let it swing out: how fast its vibration dies.

Fly it twice, with and without ``--set control.vibration_damping=…``, and `inspect` both logs side
by side: ZN23 section 6 proposes to suppress what swings by redundant thrust.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.analysis.allocation import allocation
from snakegen.base.geometry import Floats
from snakegen.errors import MissionError
from snakegen.robot.configuration import Configuration
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.plan import Plan, holding, knots_for, through, ticks
from snakegen.simulation.flight.postures import (
    PostureOption,
    place,
    resting_attitude,
    resting_joints,
)
from snakegen.simulation.missions.flight.transform import waypoints
from snakegen.simulation.recording.recording import Recording
from snakegen.wrench_margins.rays import thrust_ray
from snakegen.wrench_margins.vectored import set_margins


@dataclass(frozen=True)
class Options(PostureOption):
    """Options of mission `ring`.

    Attributes:
        force: N, at its peak, on the last link; 20, less where the body takes less, by default
        direction: x, y or z
        length: s, of the pluck
        duration: s
        moving: pluck it while it changes shape, as `transform` does
        height: m, of the CoG
    """

    force: float | None = None
    direction: str = "y"
    length: float = 0.15
    duration: float = 8.0
    moving: bool = False
    height: float = 1.5


_AT = 2.0  # s, when it is plucked
_RATE = 0.31  # rad/s, fastest joint while it moves
_FORCE, _SHARE = 20.0, 0.8  # N, of a pluck; share of what the analysis says is held
_LEFT = 0.1  # share of the largest energy below which it counts as swung out


def applies(robot: Robot) -> bool:
    """A floating base, rotors and driven joints."""
    return robot.floating and bool(robot.modules.apparatuses) and bool(robot.modules.servos)


def plan(robot: Robot, rate: float, options: Options) -> Plan:
    """Returns the plan: hover, and ``F (1 - cos 2πt/T) / 2`` at the last link's origin.

    `moving`: through the first `duration` seconds of `transform`'s motion.
    """
    if options.direction not in ("x", "y", "z"):
        raise MissionError(f"direction '{options.direction}': x, y or z is needed.")
    if not options.length > 0:
        raise MissionError(f"length {options.length:g} s: more than 0 is needed.")
    if not options.duration > _AT + options.length:
        raise MissionError(
            f"duration {options.duration:g} s: more than {_AT + options.length:g} is needed."
        )
    time = ticks(options.duration, rate)
    joints = resting_joints(robot, options.posture)
    attitude = resting_attitude(robot, options.posture, "ring")
    cog = np.array([0.0, 0.0, options.height])
    link, way = list(robot.modules.lengths)[-1], np.eye(3)["xyz".index(options.direction)]
    held = held_force(robot, place(robot, joints, cog, attitude), link, way)
    force = min(_FORCE, _SHARE * held) if options.force is None else options.force
    phase = np.clip((time - _AT) / options.length, 0.0, 1.0)
    push = np.zeros((len(time), 6))
    push[:] = 0.5 * force * np.outer(1.0 - np.cos(2.0 * np.pi * phase), np.r_[way, 0.0, 0.0, 0.0])
    if options.moving:
        if options.posture is not None:
            raise MissionError("ring takes a posture or a motion (moving=true), not both.")
        goals = waypoints(robot)
        joints, _, _ = through(time, knots_for(goals, _RATE), goals)
    return holding(
        time,
        joints,
        place(robot, np.atleast_2d(joints)[0], cog, attitude),
        cog,
        disturbance=push,
        disturbance_link=link,
        events=(
            (_AT, f"plucked with {force:.3g} N along {options.direction}"),
            (_AT + options.length, "let go"),
        ),
        facts={
            "pluck": {
                "start_s": _AT,
                "end_s": _AT + options.length,
                "force_N": force,
                "steady_force_held_N": held,
            }
        },
        tracked=False,
        disturbed=not options.moving,
    )


def held_force(robot: Robot, q: Floats, link: str, way: Floats) -> float:
    """Returns the largest steady force [N] along `way` (3,), world, held on a link's origin.

    Of the thrust limits of the mode flown; in dual-rotor mode of ``[f_z; τ]``, since a body that
    leans takes the rest. 0 where hover is out of reach.
    """
    a = allocation(robot, q)
    base, origin = robot.base_pose(q)
    arm = base.T @ (Configuration(robot, q).link_pose(link)[1] - origin) - a.cog
    along = base.T @ way
    push = np.r_[along, np.cross(arm, along)]
    if robot.modules.control.get("mode") == "dual_rotor" or not robot.gimbal_names:
        limits = robot.rotors.thrust_min, robot.rotors.thrust_max
        held = thrust_ray(a.dual, *limits, a.hover_wrench, push, part=slice(2, 6)).t
    else:
        scale: dict[str, Any] = {
            "force_scale": robot.force_scale,
            "torque_scale": robot.torque_scale,
        }
        found = set_margins(robot.force_sets(q), a.hover_wrench, wrench_starts=0, **scale)
        held = float(found.directional(-push))
    return held if np.isfinite(held) else 0.0


def metrics(recording: Recording) -> dict[str, Any]:
    """Returns how far it swung, mode by mode and in all, and how long.

    ``swing_j_s`` is the modes' energy over the time after the pluck; ``decay_s`` is when a tenth
    of the largest energy is left for good, None where it never is.
    """
    if "modal_energy" not in recording.channels:
        return {}
    pluck = recording.meta["facts"]["pluck"]
    time = recording.times("modal_energy")
    modes = recording.channel("modal_energy").values[time >= pluck["start_s"]]
    since = time[time >= pluck["start_s"]] - pluck["end_s"]
    if not np.any(since > 0.0):
        return {}
    total = modes.sum(axis=1)
    after = since >= 0.0
    return {
        "modal_energy_max_j": float(total.max()),
        "decay_s": decay(since, total),
        "modal_decay_s": [decay(since, mode) for mode in modes.T],
        "swing_j_s": float(np.trapezoid(total[after], since[after])),
        "modal_swing_j_s": [float(np.trapezoid(m[after], since[after])) for m in modes.T],
    }


def decay(since: Floats, energy: Floats) -> float | None:
    """Returns the time [s] from which on a tenth of the largest energy is not passed again."""
    swings = np.flatnonzero(energy > _LEFT * energy.max())
    if swings[-1] == len(energy) - 1:
        return None
    return max(float(since[swings[-1] + 1]), 0.0)
