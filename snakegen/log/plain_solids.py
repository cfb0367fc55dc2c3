"""Floor and obstacles of a run in matplotlib's picture of it."""

from __future__ import annotations

from typing import Any

import numpy as np

from snakegen.base.geometry import Floats, rotation_from_xyzw
from snakegen.log import style
from snakegen.log.ground import box_attitude, hole_strips
from snakegen.log.ground_load import plane_corners
from snakegen.log.scene import Scene
from snakegen.simulation.recording.recording import Recording

_LOOK = tuple(part / 255 for part in style.OBSTACLE)
_NEAR = 1.0  # lengths of the body: solids farther away would make it small
_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 25)
# the faces of a box, by its corners (x slowest, z fastest)
_FACES = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))


def draw_solids(axes: Any, recording: Recording, view: Scene, at: float) -> list[Floats]:
    """Draws what is near the body at `at` seconds; returns the points that must be in the picture.

    Args:
        axes: matplotlib's, in three dimensions.
        recording: its meta data name the solids.
        view: where the body is.
        at: the instant [s].
    """
    middle = view.center
    if "position" in recording.channels:
        middle = recording.held("position", np.array([at]))[0]
    drawn = []
    solids = recording.meta.get("obstacles") or []
    opacity = 0.22 if len(solids) <= 8 else 0.05  # the staves of a pipe must not hide what is in it
    for solid in solids:
        seen = _draw(axes, solid, middle, _NEAR * view.size, opacity)
        near = np.abs(seen - middle).max(axis=1, initial=0.0) < 1.001 * _NEAR * view.size
        drawn.append(seen[near])
    facts = recording.meta.get("facts") or {}
    if "centreline_m" in facts:
        strips = hole_strips(np.array(facts["centreline_m"]), float(facts["room_m"]))
        for strip in strips:
            axes.plot(*strip.T, color=_LOOK, lw=0.6)
        drawn.append(strips[0])
    floor = _floor(axes, recording, middle, view.size)
    return [points for points in (*drawn, floor) if len(points)]


def _draw(axes: Any, solid: dict[str, Any], middle: Floats, reach: float, opacity: float) -> Floats:
    """Draws a solid, cut to `reach` about `middle` where it is a box; returns its points."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    look = {"facecolor": (*_LOOK, opacity), "edgecolor": (*_LOOK, 4.0 * opacity), "linewidth": 0.6}
    centre = np.array(solid.get("centre", (0.0, 0.0, 0.0)), float)
    if "half" in solid:
        turn = rotation_from_xyzw(box_attitude(solid))
        half = np.array(solid["half"], float)
        local = turn.T @ (middle - centre)
        low, high = np.maximum(-half, local - reach), np.minimum(half, local + reach)
        if np.any(low >= high):
            return np.zeros((0, 3))
        signs = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)])
        corners = centre + np.where(signs == 1, high, low) @ turn.T
        axes.add_collection3d(Poly3DCollection([corners[list(f)] for f in _FACES], **look))
        return corners
    if solid.get("kind") == "cylinder":
        radius, half_length = solid["size"][:2]
        turn = rotation_from_xyzw(box_attitude(solid))
        axis = np.array([0.0, 0.0, 1.0])
        rim = radius * np.column_stack([np.cos(_CIRCLE), np.sin(_CIRCLE), 0.0 * _CIRCLE])
        ends = [centre + (rim + z * axis) @ turn.T for z in (-half_length, half_length)]
        sides = [np.array([*ends[0][k : k + 2], *ends[1][k : k + 2][::-1]]) for k in range(24)]
        axes.add_collection3d(Poly3DCollection(sides, **{**look, "linewidth": 0.2}))
        return np.concatenate(ends)
    if solid.get("kind") == "sphere":
        axes.scatter(*centre, color=_LOOK, s=12)
        return centre[None]
    if solid.get("kind") == "mesh":
        corners = np.array(solid["vertices"], float) @ np.array(solid["rotation"], float).T + centre
        axes.plot_trisurf(
            *corners.T, triangles=np.array(solid["faces"]), color=(*_LOOK, 0.3), linewidth=0.0
        )
        return corners
    return np.zeros((0, 3))


def _floor(axes: Any, recording: Recording, middle: Floats, size: float) -> Floats:
    """Draws the floor's grid under a free body that is near it; returns the point below it."""
    labels = recording.channel("q").labels if "q" in recording.channels else ()
    sloping = plane_corners(recording, np.zeros(1)) is not None
    if "qw" not in labels or sloping or not -0.1 * size <= middle[2] <= 1.5 * _NEAR * size:
        return np.zeros((0, 3))
    step = next(s for s in (0.05, 0.1, 0.2, 0.5, 1.0, 2.0) if size <= 8 * s or s == 2.0)
    low = step * np.floor((middle[:2] - 0.75 * size) / step)
    count = int(np.ceil(1.5 * size / step)) + 1
    for k in range(count + 1):
        x, y = low + k * step
        axes.plot([x, x], [low[1], low[1] + count * step], [0.0, 0.0], color="0.82", lw=0.6)
        axes.plot([low[0], low[0] + count * step], [y, y], [0.0, 0.0], color="0.82", lw=0.6)
    return np.array([[middle[0], middle[1], 0.0]])
