"""From the rows of a run to its recording: CoG motion, margins, clearances, power."""

from dataclasses import replace
from typing import Any

import numpy as np

from snakegen import __version__
from snakegen.base.geometry import Floats
from snakegen.control.controller import Controller
from snakegen.control.power import AIR, FIGURE_OF_MERIT
from snakegen.kernels.flight.run_history import cog_history, quaternions, rotations_of
from snakegen.kernels.kinematics.chain import forward
from snakegen.robot.modules import Rotor
from snakegen.robot.posture import configuration_labels
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.flown import Flown
from snakegen.simulation.flight.plan import Plan, frame_targets
from snakegen.simulation.flight.vibration import bends
from snakegen.simulation.flight.world import Ints, World, rotation_of
from snakegen.simulation.recording.bending_signals import elastic_channels
from snakegen.simulation.recording.clearance import clearances
from snakegen.simulation.recording.margins_along import States, margins_along, true_sigma_min
from snakegen.simulation.recording.recording import Channel, Event, Recording, channel
from snakegen.simulation.recording.rotor_signals import power, roll_moments, thrusts

SLOW = 0.1  # s, between two rows of what is computed from the posture
# What follows from states and commands, which stay exact: no sensor tells 1 part in 10^7 of these.
MEASURED = (
    "velocity",
    "angular_velocity",
    "gimbal_torque",
    "joint_torque",
    "sigma_min",
    "floor_contact",
    "power",
    "roll_moment",
)


def record(
    world: World,
    plan: Plan,
    controller: Controller,
    flown: Flown,
    meta: dict[str, Any],
    *,
    margins: bool = True,
) -> Recording:
    """Returns the recording of a flight; without `margins` it is made in a third of the time."""
    windy = bool(np.any(flown.wind))
    channels = flight_channels(world, plan, controller, flown, windy)
    if is_elastic(world, plan, meta):
        channels |= flown_bends(world, plan, flown)
    if margins:
        rows = np.arange(0, flown.ticks, slow_stride(plan.time))
        channels |= margin_channels(world, plan, controller, rows, flown.qpos[rows])
    events = tuple(Event(*e) for e in flown.events)
    return Recording(plan.time[: flown.ticks], channels, events, flight_meta(world, meta))


def is_elastic(world: World, plan: Plan, meta: dict[str, Any]) -> bool:
    """Tells whether a flight records what bends."""
    return bool(meta.get("vibration_damping")) or "pluck" in plan.facts or bends(world)


def flight_channels(
    world: World,
    plan: Plan,
    controller: Controller,
    flown: Flown,
    windy: bool,
) -> dict[str, Channel]:
    """Returns the channels of the ticks of `plan` that were flown, without margins and bends.

    Args:
        world, plan, controller, flown: the flight, or a part of it and that of its plan.
        windy: whether it records the wind.
    """
    robot, n = world.robot, flown.ticks
    motion = _motion(world, controller, flown)
    target = quaternions(np.ascontiguousarray(frame_targets(plan, flown.axes)[0][:n]))
    thrust = thrusts(world, flown)
    gimbals = world.gimbal_joints >= 0
    names = _Names(robot, world)
    joints, turned = world.chain, world.gimbal_joints[gimbals]
    q = world.configurations(flown.qpos)
    channels = {
        "position": channel("position", motion[0]),
        "position_target": channel("position_target", plan.position[:n]),
        "attitude": channel("attitude", quaternions(motion[2])),
        "attitude_target": channel("attitude_target", target),
        "velocity": channel("velocity", motion[1]),
        "angular_velocity": channel("angular_velocity", motion[3]),
        "q": channel("q", q, names.q),
        "thrust": channel("thrust", thrust, names.rotors),
        "thrust_command": channel("thrust_command", flown.command[:, world.rotors], names.rotors),
        "gimbal_angle": channel("gimbal_angle", flown.qpos[:, world.qpos[turned]], names.gimbals),
        "gimbal_command": channel(
            "gimbal_command", flown.command[:, world.gimbals[gimbals]], names.gimbals
        ),
        "gimbal_torque": channel(
            "gimbal_torque", flown.force[:, world.gimbals[gimbals]], names.gimbals
        ),
        "joint_angle": channel("joint_angle", flown.qpos[:, world.qpos[joints]], names.joints),
        "joint_command": channel("joint_command", flown.command[:, world.servos], names.joints),
        "joint_torque": channel("joint_torque", flown.force[:, world.servos], names.joints),
        "sigma_min": channel("sigma_min", _sigma_min(world, plan, controller, flown)),
        "floor_contact": channel("floor_contact", flown.contact),
        "power": channel("power", power(robot, thrust)),
        "roll_moment": channel(
            "roll_moment", roll_moments(robot, thrust, flown.qpos[:, world.qpos]), names.rolls
        ),
    }
    if plan.disturbance is not None:
        channels["disturbance"] = channel("disturbance", plan.disturbance[:n])
        point = motion[0] if plan.disturbance_at_cog else _link_place(world, plan, flown)
        channels["disturbance_point"] = channel("disturbance_point", point)
    channels |= _slow(world, plan, flown, windy)
    return channels | {k: as_measured(channels[k]) for k in MEASURED if k in channels}


def as_measured(signal: Channel) -> Channel:
    """Returns a channel to the 24 bits of a float32: half of its bytes in a log are then zeros."""
    with np.errstate(over="ignore"):  # a run that diverged
        return replace(signal, values=signal.values.astype(np.float32).astype(np.float64))


class _Names:
    """Labels of the channels."""

    def __init__(self, robot: Robot, world: World) -> None:
        self.rotors = [r.label for a in robot.modules.apparatuses for r in a.rotors]
        self.gimbals = [
            n for a in robot.modules.apparatuses for n in (a.roll, a.pitch) if n is not None
        ]
        self.rolls = [a.roll for a in robot.modules.apparatuses if a.roll is not None]
        self.joints = [robot.joint_names[i] for i in world.chain]
        self.q = configuration_labels(robot)


def _motion(
    world: World, controller: Controller, flown: Flown
) -> tuple[Floats, Floats, Floats, Floats]:
    """Returns true CoG position, velocity, attitude and rate along the run."""
    law, (rotation, position, angles) = controller.law, _states(world, flown.qpos)
    out = cog_history(
        world.robot.tree,
        law.axes_body,
        law.axes_rotation,
        rotation,
        position,
        np.ascontiguousarray(flown.qvel[:, :3]),
        np.einsum("tij,tj->ti", rotation, flown.qvel[:, 3:6]),
        angles,
        np.ascontiguousarray(flown.qvel[:, world.qvel]),
    )
    return out[0], out[1], out[2], out[3]


def _link_place(world: World, plan: Plan, flown: Flown) -> Floats:
    """Returns the origin (T, 3) of the disturbed link along the run."""
    robot, q = world.robot, flown.qpos
    if plan.disturbance_link in ("", robot.root_link):
        return q[:, :3]
    body, _, origin = robot.body_of_link(plan.disturbance_link)
    out = np.empty((len(q), 3))
    for k, row in enumerate(q):
        turn, at = forward(robot.tree, rotation_of(row[3:7]), row[:3].copy(), row[world.qpos])
        out[k] = at[body] + turn[body] @ origin
    return out


def _states(world: World, qpos: Floats) -> States:
    """Returns base attitudes, positions and joint angles of rows of qpos."""
    return (
        rotations_of(np.ascontiguousarray(qpos[:, 3:7])),
        np.ascontiguousarray(qpos[:, :3]),
        np.ascontiguousarray(qpos[:, world.qpos]),
    )


def _sigma_min(world: World, plan: Plan, controller: Controller, flown: Flown) -> Floats:
    """Returns the controller's σ_min (T,), less the rotors that it does not know to be lost."""
    if not plan.failures:
        return flown.sigma_min
    command = flown.command[:, np.maximum(world.gimbals, 0)]
    gimbals = np.where(world.gimbals >= 0, command, 0.0)
    thrust = flown.command[:, world.rotors]
    believed, states = flown.sigma_min, _states(world, flown.qpos)
    return true_sigma_min(controller, plan, believed, states, thrust, gimbals)


def slow_stride(time: Floats) -> int:
    """Returns how many ticks lie between two rows of what is computed from the posture."""
    return max(1, round(SLOW / (time[1] - time[0]))) if len(time) > 1 else 1


def _slow(world: World, plan: Plan, flown: Flown, windy: bool) -> dict[str, Channel]:
    """Returns clearances, battery and wind, at 10 Hz."""
    rows = np.arange(0, flown.ticks, slow_stride(plan.time))
    time = plan.time[rows]
    floor, own, obstacle = clearances(world, flown.qpos[rows])
    out = {"floor_distance": channel("floor_distance", floor, time=time)}
    if plan.obstacles:
        out["obstacle_distance"] = channel("obstacle_distance", obstacle, time=time)
    out["battery_used"] = channel("battery_used", flown.used[rows], time=time)
    if windy:
        out["wind"] = channel("wind", flown.wind[rows], time=time)
    if not np.all(np.isposinf(own)):  # inf: the robot has no parts that could touch
        out["self_distance"] = channel("self_distance", own, time=time)
    return out


def margin_channels(
    world: World, plan: Plan, controller: Controller, rows: Ints, qpos: Floats
) -> dict[str, Channel]:
    """Returns margins of the modes flown at ticks `rows` of a plan, `qpos` (m, nq) being there."""
    found = margins_along(world.robot, controller, plan, rows, _states(world, qpos))
    return {name: channel(name, values, time=plan.time[rows]) for name, values in found.items()}


def flown_bends(world: World, plan: Plan, flown: Flown) -> dict[str, Channel]:
    """Returns the channels of what bends, of all ticks flown of a plan."""
    dt = float(plan.time[1] - plan.time[0]) if flown.ticks > 1 else 1.0
    asked = flown.command[:, world.servos]
    found = elastic_channels(world, flown.qpos, flown.qvel, asked, dt)
    return {name: as_measured(each) for name, each in found.items()}


def _rotor_meta(rotor: Rotor) -> dict[str, Any]:
    """Returns where a log draws a rotor's thrust."""
    place = {"position": list(rotor.position)} if any(rotor.position) else {}
    return {"link": rotor.link, "axis": list(rotor.axis), **place}


def flight_meta(world: World, meta: dict[str, Any]) -> dict[str, Any]:
    """Returns what the log says about the run in addition to its signals."""
    robot = world.robot
    rotors = [r for a in robot.modules.apparatuses for r in a.rotors]
    efforts = robot.limits([robot.joint_names[i] for i in world.chain])[2]
    turned = world.gimbal_joints[world.gimbal_joints >= 0]
    lower, upper, gimbal_efforts = robot.limits([robot.joint_names[i] for i in turned])
    return {
        "robot": robot.name,
        "version": __version__,
        "weight_n": robot.force_scale,
        "urdf": robot.urdf,
        "urdf_sha256": robot.urdf_hash,
        "rotors": [_rotor_meta(r) for r in rotors],
        "limits": {
            "thrust_min": [r.thrust_min for r in rotors],
            "thrust_max": [r.thrust_max for r in rotors],
            "joint_torque": efforts.tolist(),
            "gimbal_torque": gimbal_efforts.tolist(),
            "gimbal_lower": lower.tolist(),
            "gimbal_upper": upper.tolist(),
            "roll_moment": robot.limits(_Names(robot, world).rolls)[2].tolist(),
        },
        "power_model": f"thrust^1.5/sqrt(2 rho A)/{FIGURE_OF_MERIT}, rho {AIR}",
    } | meta
