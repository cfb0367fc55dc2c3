"""The picture of a robot: rendered by MuJoCo, or drawn by matplotlib where no GL is to be had."""

import re
from pathlib import Path

import numpy as np

from snakegen.base.geometry import Floats, wxyz_from_xyzw
from snakegen.description.mjcf.decorate import FLOOR_SQUARE
from snakegen.picture.figure_arrays import RobotFigure
from snakegen.robot.kinematics import centre_of_gravity, forward
from snakegen.robot.robot import Robot

LONG = 12  # links; longer chains are drawn coiled
GAP = 1.2  # lengths between the turns of a coil


def robot_picture(robot: Robot, scene: Path, png: Path) -> str:
    """Writes the picture of `robot`; returns "" or the reason why it is a drawing.

    Args:
        robot: drawn in the posture of all joints at 0 if it cannot be rendered.
        scene: MJCF that is rendered in its ``home`` keyframe.
        png: the file to write.
    """
    from snakegen.picture.mujoco_render import render
    from snakegen.picture.robot_figure import draw_robot

    q = posture_shown(robot)
    shown = figure(robot, q)
    labels = _labels(shown) if len(shown.link_names) <= LONG else []
    qpos, scale = _qpos(robot, q, scene).tolist(), f"floor squares {FLOOR_SQUARE:g} m"
    done = render(scene, png, qpos=qpos, labels=labels, caption=scale)
    if done:
        return ""
    draw_robot(png, shown)
    return f"drawn as a figure, not rendered: {done.reason}"


def _labels(shown: RobotFigure) -> list[tuple[str, list[float]]]:
    """Returns the links' names and where they stand: below the middle of each link."""
    below = np.array([0.0, 0.0, -0.06 * shown.size])
    middles = shown.link_segments.mean(axis=1) + below
    return list(zip(shown.link_names, middles.tolist(), strict=False))


def posture_shown(robot: Robot) -> Floats:
    """Returns the posture of the picture: bent a little; drives on the ground, others 0.6 m up."""
    from snakegen.robot.posture import set_angle

    q = np.array(robot.configuration())
    names = list(robot.chain_joints)
    low, high, _ = robot.limits(names)
    stands = bool(robot.modules.screws) and not robot.modules.apparatuses
    lengths = robot.modules.lengths
    coil = _coil(names) if len(lengths) > LONG else {}
    for k, name in enumerate(names):
        bend = 0.9 if name.endswith("_yaw") else (-0.3, 0.3)[(k // 2) % 2]
        if stands:
            bend = (0.6, 0.3, -0.5)[(k // 2) % 3] if name.endswith("_yaw") else 0.0
        if len(lengths) > 5:
            bend *= 5.0 / len(lengths) * (1.0, -1.0)[(k // 6) % 2]
        if coil:
            bend = coil.get(name, 0.0)
        set_angle(robot, q, name, float(np.clip(bend, low[k], high[k])))
    if robot.floating:
        q[2] = robot.modules.screws[0].radius if stands else 0.6
    return q


def _coil(names: list[str]) -> dict[str, float]:
    """Returns the angles of a flat coil, as a snake at rest: a long chain stretched is a thread.

    Each joint turns by length over radius of an Archimedean spiral of `GAP` lengths a turn.
    """
    joints = [n for n in names if n.endswith("_yaw")] or names
    turned, angles = 0.0, {}
    for name in joints:
        angles[name] = 1.0 / (GAP * (1.0 + turned / (2.0 * np.pi)))
        turned += angles[name]
    return angles


def _qpos(robot: Robot, q: Floats, scene: Path) -> Floats:
    """Returns q in MuJoCo's order for the model of `scene`."""
    from snakegen.description.mjcf.files import load_model

    model = load_model(scene)
    out = np.array(model.qpos0)
    if robot.floating:
        out[:3], out[3:7] = q[:3], wxyz_from_xyzw(q[3:7])
    for name, angle in zip(robot.joint_names, robot.angles(q), strict=True):
        out[model.joint(name).qposadr[0]] = angle
    return out


def figure(robot: Robot, q: Floats, thrusts: Floats | None = None) -> RobotFigure:
    """Returns `robot` in a posture as `draw_robot` takes it.

    Args:
        robot: what is drawn.
        q: its configuration.
        thrusts: (r,) N of the rotors, drawn as arrows.
    """
    base, origin = robot.base_pose(q)
    rotation, position = forward(robot.tree, base, origin, robot.angles(q))
    _, cog = centre_of_gravity(robot.tree, rotation, position)
    segments, names = [], []
    for name, length in robot.modules.lengths.items():
        body, turned, offset = robot.body_of_link(name)
        start = position[body] + rotation[body] @ offset
        tip = start + rotation[body] @ turned @ np.array([length, 0.0, 0.0])
        segments.append((start, tip))
        names.append(name)
    if not segments:
        parents = robot.tree.parent
        segments = [(position[parents[i]], position[i]) for i in range(1, len(parents))]
    if len(names) > 12:
        names = [name.removeprefix("link") for name in names]
    rotors = robot.rotors
    places = [
        position[b] + rotation[b] @ p for b, p in zip(rotors.body, rotors.position, strict=True)
    ]
    axes = [rotation[b] @ a for b, a in zip(rotors.body, rotors.axis, strict=True)]
    loads = []
    for name in payload_links(robot):
        body, _, offset = robot.body_of_link(name)
        loads.append(position[body] + rotation[body] @ offset)
    apparatuses = list(enumerate(robot.modules.apparatuses, start=1))
    return RobotFigure(
        np.array(segments, float).reshape(-1, 2, 3),
        np.array(places, float).reshape(-1, 3),
        np.array(axes, float).reshape(-1, 3),
        np.array([0.5 * r.diameter for _, m in apparatuses for r in m.rotors], float),
        [k for k, m in apparatuses for _ in m.rotors],
        np.zeros(0) if thrusts is None else thrusts,
        np.array(cog),
        np.array(loads, float).reshape(-1, 3),
        names,
        bolted=not robot.floating,
    )


def payload_links(robot: Robot) -> list[str]:
    """Returns the links that a spec's payloads became: payload1, payload2, …"""
    return [f.name for f in robot.model.frames if re.fullmatch(r"payload[1-9]\d*", f.name)]
