"""The picture of a log without graphics drivers: matplotlib, from the log's own data."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snakegen.base.atomic_io import replace_whole
from snakegen.errors import LogError, SnakegenError
from snakegen.log import plots, style
from snakegen.log.ground_load import as_it_stands, plane_corners, pull
from snakegen.log.plain_solids import draw_solids
from snakegen.log.scene import Scene, scene, thrust_use
from snakegen.simulation.recording.recording import Recording

Floats = NDArray[np.float64]
SHOWN = (
    "position error",
    "attitude error",
    "thrust",
    "joints",
    "margins",
    "clearance",
    "scaled margins",
    "screws",
)


def draw(recording: Recording, png: Path, at: float, size: tuple[int, int]) -> None:
    """Draws the robot at `at` seconds next to the run's main curves.

    Raises:
        LogError: `png` cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(size[0] / 100, size[1] / 100), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    shown = plots.series(recording)
    among = "obstacle_distance" in recording.channels
    kinds = [g for g in SHOWN if among or g != "clearance"]
    groups = [g for g in kinds if any(s.group == g for s in shown)][: 6 if among else 5]
    grid = figure.add_gridspec(max(len(groups), 1), 2, width_ratios=[3, 2])
    body: Any = figure.add_subplot(grid[:, 0], projection="3d")
    _draw_body(body, recording, at)
    for row, group in enumerate(groups):
        axes = figure.add_subplot(grid[row, 1])
        _draw_group(axes, [s for s in shown if s.group == group], at)
        axes.set_title(group, loc="left", fontsize=9)
        if row == len(groups) - 1:
            axes.set_xlabel("t [s]", fontsize=8)
    verdict = recording.verdict
    figure.suptitle(_title(recording, at) + (f" — {verdict.summary()}" if verdict else ""))
    try:
        replace_whole(png, lambda part: figure.savefig(part, format="png"))
    except SnakegenError as error:
        raise LogError(str(error)) from None


def _draw_body(axes: Any, simulated: Recording, at: float) -> None:
    recording = as_it_stands(simulated)
    view = scene(recording)
    frame = max(int(np.searchsorted(view.time, at + 1e-9)) - 1, 0)
    points = [view.center[None]]
    if view.skeleton is not None:
        points += _draw_links(axes, recording, view, frame)
    if view.ghost.shape[1]:
        line = view.ghost[frame]
        axes.plot(*line.T, "--", color=_rgb(style.TARGET), lw=1.2, label="target")
        points.append(line)
    if "position" in recording.channels:
        path = recording.held("position", view.time)
        axes.plot(*path.T, color="0.7", lw=0.8)
        free = "q" not in recording.channels or "qw" in recording.channel("q").labels
        what = "head" if "slip" in recording.channels else "CoG" if free else "tip"
        axes.plot(*path[frame][:, None], "o", color="black", ms=5, label=what)
        points.append(path[frame][None])
    points += draw_solids(axes, recording, view, at)
    plane = plane_corners(simulated, view.time[frame : frame + 1])
    if plane is not None:
        axes.plot_trisurf(*plane[0].T, color=_rgb(style.OBSTACLE), alpha=0.4)
    cloud = np.concatenate(points)
    middle = 0.5 * (cloud.max(axis=0) + cloud.min(axis=0))
    reach = max(0.5 * float(np.ptp(cloud, axis=0).max()), 0.3 * view.size)
    for name, centre in zip("xyz", middle, strict=True):
        getattr(axes, f"set_{name}lim")(centre - reach, centre + reach)
        getattr(axes, f"set_{name}label")(f"{name} [m]")
    axes.zaxis.set_rotate_label(False)
    axes.set_zlabel("z [m]", rotation=90)
    axes.set_box_aspect((1, 1, 1))
    axes.view_init(elev=24, azim=-119)  # the viewer's own direction of sight
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="upper left", fontsize=8)


def _draw_links(axes: Any, recording: Recording, view: Scene, frame: int) -> list[Floats]:
    """Draws links as lines and thrusts as arrows; returns the points drawn."""
    bones = view.skeleton
    if bones is None:
        return []
    one = slice(frame, frame + 1)
    angles = {name: values[one] for name, values in view.angles.items()}
    base = (view.base[0][one], view.base[1][one])
    poses = bones.poses(base, angles)
    turning = recording.channels.get("screw_rate")
    drums = {j.child for j in bones.joints if turning is not None and j.name in turning.labels}
    wheels = [poses[j.child][1][0] for j in bones.joints if j.parent in drums]
    if wheels:
        axes.scatter(*np.array(wheels).T, color="0.4", s=14, depthshade=False)
    for j in bones.joints:
        if j.parent in drums:
            continue
        ends = np.concatenate([poses[j.parent][1], poses[j.child][1]])
        axes.plot(*ends.T, color="0.55", lw=1.5)
    line = bones.body_line(base, angles)[0]
    axes.plot(*line.T, color="0.25", lw=4, solid_capstyle="round")
    drawn = [line, *(w[None] for w in wheels)]
    towed = pull(recording, view.time[one], 0.4 * view.size)
    if towed is not None:
        axes.quiver(*line[-1], *towed[0], color=_rgb(style.DISTURBANCE), lw=2)
    if not view.rotors:
        return drawn
    thrust = recording.held("thrust", view.time[one])
    colors = style.saturation_colors(thrust_use(recording, thrust))[0] / 255.0
    for r in view.rotors:
        rotation, position = poses[r.link]
        arrow = rotation[0] @ r.axis * thrust[0, r.column] * view.newton
        start = position[0] + rotation[0] @ r.position
        axes.quiver(*start, *arrow, color=colors[r.column], lw=2, arrow_length_ratio=0.2)
        drawn.append(np.stack([start, start + arrow]))
    return drawn


def _draw_group(axes: Any, shown: list[plots.Series], at: float) -> None:
    """Draws curves of one meaning, their names next to them; what was asked is dim and thin."""
    first, units = 0, {s.unit for s in shown}
    for s in shown:
        start = 0 if s.asked else first
        for i, label in enumerate(s.labels):
            limit = s.name == plots.LIMIT
            words = label + (f" [{s.unit}]" if len(units) > 1 else "")
            axes.plot(
                s.time,
                s.values[:, i],
                color=_rgb(style.LIMIT if limit else style.color(start + i, dim=s.asked)),
                lw=0.6 if s.asked else 1.0,
                label=None if s.asked else words,
                zorder=1.5 if s.asked else 2.0,
            )
        first += 0 if s.asked else len(s.labels)
    axes.axvline(at, color="0.4", lw=0.8)
    axes.set_ylabel(", ".join(dict.fromkeys(s.unit for s in shown)), fontsize=8)
    axes.tick_params(labelsize=7)
    axes.grid(alpha=0.3)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=6.5, frameon=False)


def _title(recording: Recording, at: float) -> str:
    parts = [str(recording.meta[k]) for k in ("robot", "mission", "mode") if recording.meta.get(k)]
    return " · ".join([*parts, f"t = {at:.2f} s"])


def _rgb(color: tuple[int, int, int]) -> tuple[float, float, float]:
    """Returns a colour for white paper: the viewer's ground is dark, its colours bright."""
    return (0.8 * color[0] / 255, 0.8 * color[1] / 255, 0.8 * color[2] / 255)
