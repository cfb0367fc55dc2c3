"""The picture of a robot: rendered by MuJoCo, or drawn by matplotlib where no GL is to be had."""

from pathlib import Path

import numpy as np

from snakegen.geometry import Floats
from snakegen.kernels.chain import centre_of_gravity, forward
from snakegen.robot import Robot


def robot_picture(robot: Robot, scene: Path, png: Path) -> str:
    """Writes the picture of `robot`; returns "" or the reason why it is a drawing.

    Args:
        robot: drawn in the posture of all joints at 0 if it cannot be rendered.
        scene: MJCF that is rendered in its ``home`` keyframe.
        png: the file to write.
    """
    from snakegen.description.picture import render
    from snakegen.plot_robot import draw_robot
    from snakegen.posture import neutral

    done = render(scene, png, camera="track", width=1280, height=800)
    if done:
        return ""
    draw_robot(png, **figure(robot, neutral(robot)))
    return f"drawn as a figure, not rendered: {done.reason}"


def figure(robot: Robot, q: Floats) -> dict[str, Floats]:
    """Returns the arrays of `plot_robot.draw_robot` for a posture: segments, rotors, CoG; world."""
    base, origin = robot.base_pose(q)
    rotation, position = forward(robot.tree, base, origin, robot.angles(q))
    _, cog = centre_of_gravity(robot.tree, rotation, position)
    segments = []
    for name, length in robot.modules.lengths.items():
        body, turned, offset = robot.body_of_link(name)
        start = position[body] + rotation[body] @ offset
        tip = start + rotation[body] @ turned @ np.array([length, 0.0, 0.0])
        segments.append((start, tip))
    if not segments:
        parents = robot.tree.parent
        segments = [(position[parents[i]], position[i]) for i in range(1, len(parents))]
    rotors = robot.rotors
    places = [position[b] + rotation[b] @ p for b, p in zip(rotors.body, rotors.position)]
    axes = [rotation[b] @ a for b, a in zip(rotors.body, rotors.axis)]
    sizes = [0.5 * r.diameter for m in robot.modules.apparatuses for r in m.rotors]
    return {
        "link_segments": np.array(segments, float).reshape(-1, 2, 3),
        "rotor_positions": np.array(places, float).reshape(-1, 3),
        "rotor_axes": np.array(axes, float).reshape(-1, 3),
        "rotor_radius": np.array(sizes, float),
        "cog": np.array(cog),
    }
