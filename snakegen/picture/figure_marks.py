"""What names the parts of a drawn robot: numbers of links and apparatuses, marks with a legend."""

from typing import Any

import numpy as np

from snakegen.picture.figure_arrays import Array, RobotFigure
from snakegen.picture.style import BLUE, INK, RED

PURPLE = "#7a5195"


def draw_marks(
    axes: Any, robot: RobotFigure, eye: Array, ground: float, *, words: bool = True
) -> None:
    """Marks the root, the centre of gravity and payloads; names links and apparatuses.

    Args:
        axes: plain matplotlib axes that hold the robot's projection.
        robot: what was drawn.
        eye: (3, 3), rows right, up and towards the eye.
        ground: height of the floor [m].
        words: False leaves out the names and the legend.
    """
    flat = eye[:2]
    if len(robot.link_segments):
        shape, name = ("s", "root, bolted") if robot.bolted else ("D", "root")
        _mark(axes, flat @ robot.link_segments[0, 0], shape, INK, 8, name)
    for k, place in enumerate(robot.payloads):
        _mark(axes, flat @ place, "h", PURPLE, 10, "" if k else "payload")
    if robot.cog is not None:
        foot = np.array([*robot.cog[:2], ground])
        axes.plot(*(flat @ np.array([robot.cog, foot]).T), color=RED, lw=1, ls=":", zorder=3)
        _mark(axes, flat @ robot.cog, "o", RED, 9, "centre of gravity")
    if not words:
        return
    _names_of_links(axes, robot, flat)
    numbers = np.asarray(robot.rotor_apparatus, int)
    for number in dict.fromkeys(numbers.tolist()):
        _number(axes, flat @ robot.rotor_positions[numbers == number].T, number)
    if len(numbers):
        label = {"ls": "", "marker": "o", "mfc": "white", "mec": BLUE, "label": "apparatus"}
        axes.plot([], [], ms=11, **label)
    longest = np.abs(robot.thrusts).max(initial=0.0)
    if longest > 0:
        axes.plot([], [], color=RED, lw=1.8, label=f"thrust, longest {longest:.3g} N")
    axes.legend(loc="upper right")


def _mark(axes: Any, at: Array, shape: str, colour: str, size: float, label: str) -> None:
    look = {"color": colour, "ms": size, "mec": "white", "mew": 1.5, "ls": "", "zorder": 90}
    axes.plot(*at[:, None], shape, label=label or None, **look)


def _names_of_links(axes: Any, robot: RobotFigure, flat: Array) -> None:
    """Writes each link's name under its middle, off the line by which it is drawn."""
    many = len(robot.link_names) > 12
    for name, segment in zip(robot.link_names, robot.link_segments, strict=False):
        middle = flat @ segment.mean(axis=0)
        along = flat @ (segment[1] - segment[0])
        across = np.array([along[1], -along[0]]) / max(float(np.linalg.norm(along)), 1e-9)
        across = across if across[1] <= 0 else -across
        axes.annotate(
            name,
            middle,
            tuple((8 if many else 12) * across),
            textcoords="offset points",
            ha="left" if across[0] > 0.5 else "right" if across[0] < -0.5 else "center",
            va="top",
            fontsize=6.5 if many else 8.5,
            zorder=95,
            path_effects=_halo(),
        )


def _number(axes: Any, rotors: Array, number: int) -> None:
    """Writes an apparatus's number in a ring over its rotors (2, r)."""
    axes.annotate(
        str(number),
        (rotors[0].mean(), rotors[1].max()),
        (0, 13),
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=8.5,
        color=BLUE,
        weight="bold",
        zorder=96,
        bbox={"boxstyle": "circle,pad=0.25", "fc": "white", "ec": BLUE, "lw": 1.2},
    )


def _halo() -> list[Any]:
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=2.5, foreground="white")]
