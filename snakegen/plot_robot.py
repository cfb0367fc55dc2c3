"""The robot drawn by matplotlib alone, as sticks and discs: the picture where there is no GL."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from snakegen.errors import SnakegenError
from snakegen.plot_style import BLUE, GREY, INK, ORANGE, PALE, RED, save

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

ISOMETRIC = (26.0, -62.0)
"""Elevation and azimuth of the eye [degrees]: a little above, from the front right."""

_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 37)


def draw_robot(
    target: Any,
    link_segments: Array,
    rotor_positions: Array | None = None,
    rotor_axes: Array | None = None,
    rotor_radius: Array | float = 0.05,
    *,
    thrusts: Array | None = None,
    thrust_scale: float | None = None,
    cog: Array | None = None,
    labels: Sequence[str] | None = None,
    title: str = "",
    view: tuple[float, float] = ISOMETRIC,
    floor: float | None = None,
) -> Path | None:
    """Draws links as rods, joints as balls and rotors as discs, to one scale on all three axes.

    Args:
        target: the path of a PNG, or a matplotlib 3-D axes to draw into.
        link_segments: (n, 2, 3) [m], both ends of each link in the world.
        rotor_positions: (r, 3) [m]; None for a robot without rotors.
        rotor_axes: (r, 3) directions of thrust.
        rotor_radius: (r,) or one [m].
        thrusts: (r,) [N]; an arrow along each axis.
        thrust_scale: length of an arrow [m/N]; by default the longest is 0.35 of the size.
        cog: (3,) [m] centre of gravity.
        labels: (n,) names of the links.
        title: over the picture.
        view: elevation and azimuth of the eye [degrees].
        floor: height of a floor for the robot's shadow; None puts it a little under the robot.

    Returns:
        The path, or None when drawn into given axes.

    Raises:
        SnakegenError: arrays of other shapes, or numbers that are not finite.
    """
    segments = _checked("link_segments", link_segments, (None, 2, 3))
    empty = np.zeros((0, 3))
    rotors = _checked(
        "rotor_positions", empty if rotor_positions is None else rotor_positions, (None, 3)
    )
    count = len(rotors)
    axes_of = _checked("rotor_axes", empty if rotor_axes is None else rotor_axes, (count, 3))
    radii = _checked("rotor_radius", np.broadcast_to(rotor_radius, count), (count,))
    thrust = _checked("thrusts", np.zeros(count) if thrusts is None else thrusts, (count,))
    if labels is not None and len(labels) != len(segments):
        raise SnakegenError(f"draw_robot: {len(labels)} labels for {len(segments)} links.")
    norms = np.linalg.norm(axes_of, axis=1, keepdims=True)
    axes_of = axes_of / np.where(norms > 0, norms, 1.0)
    size = float(np.ptp(np.concatenate([segments.reshape(-1, 3), rotors]), axis=0).max()) or 1.0
    longest = np.abs(thrust).max(initial=0.0)
    scale = (
        (0.35 * size / longest if longest > 0 else 0.0) if thrust_scale is None else thrust_scale
    )
    arrows = np.stack([rotors, rotors + (scale * thrust)[:, None] * axes_of], axis=1)

    points = np.concatenate(
        [segments.reshape(-1, 3), arrows.reshape(-1, 3), *_circles(rotors, axes_of, radii)]
    )
    ground = float(points[:, 2].min() - 0.12 * size) if floor is None else floor

    def draw(axes: Any) -> None:
        axes.view_init(*view)
        _stage(axes, points, ground, size)
        _shadow(axes, segments, _circles(rotors, axes_of, radii), ground)
        _rods(axes, segments, labels, view)
        _discs(axes, rotors, _circles(rotors, axes_of, radii), arrows, view)
        if cog is not None:
            x, y, z = _checked("cog", cog, (3,))
            axes.plot([x, x], [y, y], [z, ground], color=RED, lw=0.9, ls=":", zorder=3)
            axes.plot([x], [y], [z], "o", color=RED, ms=8, mec="white", zorder=90, label="CoG")
            axes.legend(loc="upper right")
        if title:
            axes.set_title(title)

    if hasattr(target, "plot"):
        draw(target)
        return None

    def on_figure(figure: "Figure") -> None:
        axes: Any = figure.add_subplot(projection="3d", computed_zorder=False)
        draw(axes)

    return save(target, (9.0, 6.0), on_figure)


def _checked(name: str, values: Any, shape: tuple[int | None, ...]) -> Array:
    array = np.asarray(values, dtype=float)
    fits = array.ndim == len(shape) and all(
        want is None or have == want for have, want in zip(array.shape, shape, strict=True)
    )
    if not fits or not np.isfinite(array).all():
        wanted = ", ".join("n" if want is None else str(want) for want in shape)
        raise SnakegenError(
            f"draw_robot: {name} must be finite and of shape ({wanted}), not {array.shape}."
        )
    return array


def _circles(centres: Array, normals: Array, radii: Array) -> Array:
    """Returns (r, 37, 3): the rims of the rotors' discs."""
    helper = np.where(np.abs(normals[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = np.cross(normals, helper)
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-12)
    second = np.cross(normals, first)
    around = np.cos(_CIRCLE)[:, None] * first[:, None] + np.sin(_CIRCLE)[:, None] * second[:, None]
    return centres[:, None] + radii[:, None, None] * around


def _nearness(points: Array, view: tuple[float, float]) -> Array:
    """Returns 10…80 by how near the points (n, 3) are to the eye: what is drawn over what."""
    tilt, turn = np.radians(view)
    eye = [np.cos(tilt) * np.cos(turn), np.cos(tilt) * np.sin(turn), np.sin(tilt)]
    depth = points @ np.array(eye)
    return 10.0 + 70.0 * (depth - depth.min()) / max(float(np.ptp(depth)), 1e-12)


def _stage(axes: Any, points: Array, ground: float, size: float) -> None:
    """Sets equal scales round the robot and draws the floor with its grid."""
    low, high = points.min(axis=0), points.max(axis=0)
    low[2] = min(ground, low[2])
    half = np.maximum(0.5 * (high - low) + 0.04 * size, 0.16 * size)
    middle = 0.5 * (low + high)
    step = next(s for s in (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 1e9) if size / s <= 8)
    lines = []
    reach = half[:2] + 0.5 * step
    first = np.floor((middle[:2] - reach) / step).astype(int)
    last = np.ceil((middle[:2] + reach) / step).astype(int)
    (x0, y0), (x1, y1) = first * step, last * step
    lines += [[(x, y0, ground), (x, y1, ground)] for x in step * np.arange(first[0], last[0] + 1)]
    lines += [[(x0, y, ground), (x1, y, ground)] for y in step * np.arange(first[1], last[1] + 1)]
    for line in lines:
        axes.plot(*zip(*line, strict=True), color=PALE, lw=0.9, zorder=1)
    axes.text(x1, y0, ground, f" grid {step:g} m", color=GREY, fontsize=8, zorder=1)
    low, high = middle - half, middle + half
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(2.0 * half, zoom=1.25)
    axes.set_axis_off()


def _shadow(axes: Any, segments: Array, circles: Array, ground: float) -> None:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    for segment in segments:
        axes.plot(
            segment[:, 0],
            segment[:, 1],
            [ground] * 2,
            color="#d5d9de",
            lw=4,
            zorder=2,
            solid_capstyle="round",
        )
    flat = circles.copy()
    flat[..., 2] = ground
    if len(flat):
        axes.add_collection3d(Poly3DCollection(flat, facecolor="#d5d9de", zorder=2))


def _rods(
    axes: Any, segments: Array, labels: Sequence[str] | None, view: tuple[float, float]
) -> None:
    order = _nearness(segments.mean(axis=1), view)
    for i, (segment, near) in enumerate(zip(segments, order, strict=True)):
        for width, colour in ((6.5, INK), (3.6, "#57616d"), (1.2, "#98a2ad")):
            axes.plot(*segment.T, color=colour, lw=width, zorder=near, solid_capstyle="round")
        axes.plot(*segment[:1].T, "o", color=ORANGE, ms=7.5, mec=INK, zorder=near + 0.5)
        if labels is not None:
            middle = segment.mean(axis=0)
            axes.text(*middle, f"{labels[i]}\n", fontsize=8.5, ha="center", va="bottom", zorder=95)


def _discs(
    axes: Any, rotors: Array, circles: Array, arrows: Array, view: tuple[float, float]
) -> None:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    if not len(rotors):
        return
    for rim, arrow, near in zip(circles, arrows, _nearness(rotors, view), strict=True):
        axes.add_collection3d(
            Poly3DCollection(
                [rim], facecolor="#a9c7e8", edgecolor=BLUE, lw=1.6, alpha=0.85, zorder=near
            )
        )
        axes.plot(*arrow[:1].T, ".", color=BLUE, ms=4, zorder=near + 0.2)
        if np.any(arrow[1] != arrow[0]):
            axes.quiver(
                *arrow[0],
                *(arrow[1] - arrow[0]),
                color=RED,
                lw=1.8,
                arrow_length_ratio=0.18,
                zorder=near + 0.3,
            )
