"""A planned motion as instants for its picture."""

from itertools import product
from pathlib import Path

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.picture.strobe import Instant, draw_strobe
from snakegen.planning.motion import Motion
from snakegen.scene.schema import Scene


def draw_motion(path: Path, motion: Motion, scene: Scene, count: int = 8) -> None:
    """Draws a motion at `count` instants, evenly by how far its CoG has come.

    Args:
        path: PNG to write.
        motion: through the scene.
        scene: whose boxes are drawn.
        count: of pictures.
    """
    times = np.linspace(0.0, motion.path.times[-1], 400)
    steps = np.linalg.norm(np.diff(motion.path.at(times)[:, :3], axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    chosen = np.interp(np.linspace(0.0, way[-1], count), way, times)
    corners = np.array(list(product((-1.0, 1.0), repeat=3)))
    boxes = [
        s.centre + (corners * np.array(s.size)) @ s.rotation.T
        for s in scene.solids
        if s.kind == "box"
    ]
    title = f"{motion.body.robot.name} through {scene.name}"
    draw_strobe(path, [instant(motion, float(t)) for t in chosen], boxes, title)


def instant(motion: Motion, time: float) -> Instant:
    """Returns the body at `time` [s]."""
    body, shapes = motion.body, motion.body.shapes
    now = body.at_pose(motion.path.at(time))
    shift = now.q[:3] - np.array(body.data.oMi[1].translation)
    ends: Floats = body.lines() + shift
    discs = []
    for k in range(shapes.count):
        item = shapes.geometry.geometryObjects[k]
        if item.name.startswith("vectoring apparatus"):
            place = body.data.oMi[int(item.parentJoint)].act(item.placement)
            radius = float(item.geometry.radius)
            discs.append((place.translation + shift, place.rotation[:, 2], radius))
    return Instant(time, np.concatenate([ends[:1], ends[1::2]]), discs)
