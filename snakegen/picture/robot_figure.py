"""The robot drawn by matplotlib alone, as sticks and discs: the picture where there is no GL."""

from pathlib import Path
from typing import Any

import numpy as np

from snakegen.picture.figure_arrays import Array, RobotFigure
from snakegen.picture.figure_marks import draw_marks
from snakegen.picture.style import BLUE, GREY, INK, ORANGE, RED, save

ISOMETRIC = (26.0, -62.0)
"""Elevation and azimuth of the eye [degrees]: a little above, from the front right."""

SHADOW = "#d5d9de"
_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 37)


def draw_robot(
    target: Any,
    robot: RobotFigure,
    *,
    thrust_scale: float | None = None,
    title: str = "",
    view: tuple[float, float] = ISOMETRIC,
    floor: float | None = None,
    marks: bool = True,
) -> Path | None:
    """Draws links as rods, joints as balls and rotors as discs.

    The projection is parallel: lengths have one scale along all three axes.

    Args:
        target: the path of a PNG, or matplotlib axes (plain, 2-D) to draw into.
        robot: what is drawn.
        thrust_scale: length of an arrow [m/N]; by default the longest is 0.35 of the size.
        title: over the picture.
        view: elevation and azimuth of the eye [degrees].
        floor: height of a floor for the robot's shadow; None puts it a little under the robot.
        marks: whether links and apparatuses have their numbers, and the marks a legend.

    Returns:
        The path, or None when drawn into given axes.
    """
    segments, size, eye = robot.link_segments, robot.size, _eye(view)
    arrows = robot.arrows(thrust_scale)
    circles = _circles(robot.rotor_positions, robot.rotor_axes, robot.rotor_radius)
    points = np.concatenate([segments.reshape(-1, 3), arrows.reshape(-1, 3), *circles])
    ground = float(points[:, 2].min() - 0.12 * size) if floor is None else floor
    # lines have widths in points: a chain of many links would be all line
    length = (
        float(np.linalg.norm(np.diff(segments, axis=1), axis=-1).mean()) if len(segments) else 0
    )
    thin = float(np.clip(14.0 * length / size, 0.1, 1.0))

    def draw(axes: Any) -> None:
        # arrows are annotations, which do not widen the axes by themselves
        axes.plot(*(eye[:2] @ points.T), ",", alpha=0.0)
        _stage(axes, points, ground, size, eye)
        _shadow(axes, segments, circles, ground, eye, thin)
        _joints_and_arms(axes, segments, robot.rotor_positions, eye, thin)
        _rods(axes, segments, eye, thin)
        _discs(axes, robot.rotor_positions, circles, arrows, eye)
        draw_marks(axes, robot, eye, ground, words=marks)
        if title:
            axes.set_title(title)

    if hasattr(target, "plot"):
        draw(target)
        return None
    return save(target, (9.0, 5.6), lambda figure: draw(figure.add_subplot()))


def _circles(centres: Array, normals: Array, radii: Array) -> Array:
    """Returns (r, 37, 3): the rims of the rotors' discs."""
    helper = np.where(np.abs(normals[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = np.cross(normals, helper)
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-12)
    second = np.cross(normals, first)
    around = np.cos(_CIRCLE)[:, None] * first[:, None] + np.sin(_CIRCLE)[:, None] * second[:, None]
    return centres[:, None] + radii[:, None, None] * around


def _eye(view: tuple[float, float]) -> Array:
    """Returns (3, 3): rows are right, up and towards the eye of an orthographic view [degrees]."""
    tilt, turn = np.radians(view)
    right = np.array([-np.sin(turn), np.cos(turn), 0.0])
    towards = np.array([np.cos(tilt) * np.cos(turn), np.cos(tilt) * np.sin(turn), np.sin(tilt)])
    return np.array([right, np.cross(towards, right), towards])


def _order(points: Array, eye: Array) -> Array:
    """Returns 10…80 by how near the points (n, 3) are to the eye: what is drawn over what."""
    depth = points @ eye[2]
    if not len(depth):
        return depth
    return 10.0 + 70.0 * (depth - depth.min()) / max(float(np.ptp(depth)), 1e-12)


def _stage(axes: Any, points: Array, ground: float, size: float, eye: Array) -> None:
    """Draws the floor's grid under the robot and fits both into the axes."""
    decade = 10.0 ** np.floor(np.log10(size / 8))
    step = decade * next(s for s in (1.0, 2.0, 5.0, 10.0) if size <= 8 * s * decade)
    x0, y0 = step * np.floor(points[:, :2].min(axis=0) / step - 0.2)
    x1, y1 = step * np.ceil(points[:, :2].max(axis=0) / step + 0.2)
    lines = [[(x, y0, ground), (x, y1, ground)] for x in np.arange(x0, x1 + step / 2, step)]
    lines += [[(x0, y, ground), (x1, y, ground)] for y in np.arange(y0, y1 + step / 2, step)]
    for line in lines:
        axes.plot(*(eye[:2] @ np.transpose(line)), color="#dfe3e8", lw=0.9, zorder=1)
    corner = max(((x, y, ground) for x in (x0, x1) for y in (y0, y1)), key=lambda c: eye[2] @ c)
    axes.annotate(
        f"grid {step:g} m",
        eye[:2] @ corner,
        (0, -4),
        textcoords="offset points",
        ha="center",
        va="top",
        color=GREY,
        fontsize=8,
    )
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.04)
    axes.set_axis_off()


def _shadow(
    axes: Any, segments: Array, circles: Array, ground: float, eye: Array, thin: float
) -> None:
    """Draws what the robot would cast on the floor under light from straight above."""
    flat, rims = segments.copy(), circles.copy()
    flat[..., 2], rims[..., 2] = ground, ground
    for segment in flat:
        axes.plot(
            *(eye[:2] @ segment.T), color=SHADOW, lw=5 * thin, zorder=2, solid_capstyle="round"
        )
    for rim in rims:
        axes.fill(*(eye[:2] @ rim.T), color=SHADOW, lw=0, zorder=2)


def _rods(axes: Any, segments: Array, eye: Array, thin: float) -> None:
    """Draws each link as a shaded tube, with a ball where a joint turns it."""
    order = _order(segments.mean(axis=1), eye)
    for i, (segment, near) in enumerate(zip(segments, order, strict=True)):
        line = eye[:2] @ segment.T
        for width, colour in ((8.0, INK), (5.6, "#57616d"), (1.8, "#9aa4af")):
            axes.plot(*line, color=colour, lw=width * thin, zorder=near, solid_capstyle="round")
        if i == 0:
            continue  # the root has a mark of its own
        # the ball belongs to both links that meet in it
        above = max(near, order[i - 1]) + 0.1
        axes.plot(*line[:, :1], "o", color=ORANGE, ms=9 * thin, mec=INK, mew=thin, zorder=above)


def _joints_and_arms(axes: Any, segments: Array, rotors: Array, eye: Array, thin: float) -> None:
    """Draws what holds the parts together: the gap of a two-axis joint, a rotor's arm."""
    along = segments[:, 1] - segments[:, 0]
    length = float(np.linalg.norm(along, axis=1).mean())
    for tip, root in zip(segments[:-1, 1], segments[1:, 0], strict=True):
        # a longer gap is another branch, not a joint
        if np.linalg.norm(root - tip) < 0.6 * length:
            axes.plot(*(eye[:2] @ np.array([tip, root]).T), color=ORANGE, lw=5 * thin, zorder=9)
    for rotor in rotors:
        share = ((rotor - segments[:, 0]) * along).sum(1) / np.maximum((along**2).sum(1), 1e-12)
        feet = segments[:, 0] + np.clip(share, 0.0, 1.0)[:, None] * along
        foot = feet[np.argmin(np.linalg.norm(feet - rotor, axis=1))]
        axes.plot(*(eye[:2] @ np.array([rotor, foot]).T), color=GREY, lw=2 * thin, zorder=9)


def _discs(axes: Any, rotors: Array, circles: Array, arrows: Array, eye: Array) -> None:
    """Draws each rotor as a disc, and its thrust as an arrow from the disc's middle."""
    for rim, arrow, near in zip(circles, arrows, _order(rotors, eye), strict=True):
        axes.fill(*(eye[:2] @ rim.T), facecolor="#a9c7e8dd", edgecolor=BLUE, lw=1.6, zorder=near)
        tail, tip = (eye[:2] @ arrow.T).T
        axes.plot(*tail, ".", color=BLUE, ms=4, zorder=near + 0.2)
        if np.any(arrow[1] != arrow[0]):
            style = {"arrowstyle": "-|>", "color": RED, "lw": 1.8, "shrinkA": 0, "shrinkB": 0}
            axes.annotate("", tip, tail, arrowprops=style, zorder=near + 0.3)
