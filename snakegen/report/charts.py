"""Pictures from plain arrays: the robot as a stick-and-disc figure, and the charts of a report.

matplotlib is imported where it is used, always with the Agg canvas, and the PNG carries no date:
the same arrays give the same bytes.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from snakegen.errors import SnakegenError
from snakegen.picture.robot_figure import draw_robot
from snakegen.picture.style import BLUE, CYCLE, GREY, INK, ORANGE, PALE, RED, save

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "draw_robot",
    "hover_thrust_chart",
    "joint_torque_chart",
    "limit_chart",
    "margin_map",
    "singular_value_chart",
    "sphere_grid",
    "time_series",
]

Array = NDArray[np.float64]


def limit_chart(
    path: str | Path,
    values: Array,
    lower: Array | float,
    upper: Array | float,
    names: Sequence[str],
    *,
    title: str,
    unit: str,
) -> Path:
    """Bars of values inside their limits; a bar beyond 90 % of a limit is orange, outside red.

    Args:
        path: of the PNG.
        values: (n,).
        lower: (n,) or one, the limits below.
        upper: (n,) or one, the limits above.
        names: (n,) labels of the bars.
        title: of the chart.
        unit: of the values.

    Raises:
        SnakegenError: lengths that differ.
    """
    values = np.asarray(values, dtype=float)
    lower, upper = (np.broadcast_to(np.asarray(b, float), values.shape) for b in (lower, upper))
    _same_length(path, values=values, names=names)
    use = np.where(values >= 0, values / np.where(upper > 0, upper, np.nan), 0.0)
    use = np.where(values < 0, values / np.where(lower < 0, lower, np.nan), use)
    outside = (values > upper * (1 + 1e-9) + 1e-12) | (values < lower - 1e-9 * abs(lower) - 1e-12)
    colours = [RED if o else ORANGE if u > 0.9 else BLUE for o, u in zip(outside, use, strict=True)]

    def draw(figure: "Figure") -> None:
        from matplotlib.patheffects import withStroke

        axes = figure.add_subplot()
        place = np.arange(len(values))
        axes.bar(place, upper - lower, bottom=lower, width=0.72, color=PALE, label="within limits")
        axes.bar(place, values, width=0.5, color=colours)
        for bound in (lower, upper):
            axes.hlines(bound, place - 0.36, place + 0.36, color=INK, linewidth=1.2)
        top, bottom = max(upper.max(), values.max(), 0), min(lower.min(), values.min(), 0)
        for x, value in zip(place, values, strict=True) if len(values) <= 16 else ():
            down = value < 0
            axes.annotate(
                f"{value:.3g}".replace("-", "−"),
                (x, value),
                (0, -3 if down else 3),
                textcoords="offset points",
                ha="center",
                va="top" if down else "bottom",
                fontsize=8.5,
                zorder=6,
                path_effects=[withStroke(linewidth=2.5, foreground="white")],
            )
        axes.axhline(0.0, color=GREY, linewidth=0.8)
        span = (top - bottom) or 1.0
        axes.set_ylim(bottom - (0.08 * span if bottom < 0 else 0), top + 0.08 * span)
        axes.set_xticks(
            place,
            names,
            rotation=0 if _short(names) else 40,
            ha="center" if _short(names) else "right",
        )
        axes.grid(axis="x", visible=False)
        axes.set_ylabel(unit)
        axes.set_title(title)

    return save(path, (max(5.0, 0.62 * len(values) + 1.6), 3.4), draw)


def hover_thrust_chart(
    path: str | Path,
    thrusts: Array,
    lower: Array | float,
    upper: Array | float,
    names: Sequence[str],
) -> Path:
    """Bars of hover thrusts (n,) [N] inside the rotors' limits; see `limit_chart`."""
    return limit_chart(path, thrusts, lower, upper, names, title="Hover thrust", unit="N")


def joint_torque_chart(
    path: str | Path, torques: Array, limits: Array | float, names: Sequence[str]
) -> Path:
    """Bars of joint torques (n,) [N·m] inside ± the servos' limits; see `limit_chart`."""
    limits = np.asarray(limits, dtype=float)
    return limit_chart(path, torques, -limits, limits, names, title="Joint torque", unit="N·m")


def singular_value_chart(
    path: str | Path, values: Mapping[str, Array], *, tolerance: float = 1e-6
) -> Path:
    """Scaled singular values of each matrix, over σ1, on a log axis; below the tolerance is lost.

    Args:
        path: of the PNG.
        values: by the name of the matrix, (k,) in falling order.
        tolerance: of the rank, relative to σ1.
    """
    floor = 1e-3 * tolerance

    def draw(figure: "Figure") -> None:
        axes = figure.add_subplot()
        count = max((len(v) for v in values.values()), default=0)
        width = 0.8 / max(len(values), 1)
        for i, (name, sigma) in enumerate(values.items()):
            first = sigma[0] if len(sigma) and sigma[0] > 0 else 1.0
            relative = np.asarray(sigma, dtype=float) / first
            place = np.arange(len(relative)) + (i - (len(values) - 1) / 2) * width
            lost = relative <= tolerance
            label = f"{name}: rank {np.count_nonzero(~lost)}"
            colour = CYCLE[i % len(CYCLE)]
            height = np.maximum(relative, floor) - floor
            axes.bar(place, height, 0.9 * width, floor, color=colour, label=label)
            axes.plot(place[lost], np.full(lost.sum(), 2.5 * floor), "x", color=colour)
        label = f"rank tolerance {tolerance:g}\n× below it: lost"
        axes.axhline(tolerance, color=RED, linewidth=1.2, linestyle="--", label=label)
        axes.set_yscale("log")
        axes.set_ylim(floor, 4.0)
        axes.set_xlim(-0.6, count - 0.4)
        axes.set_xticks(range(count), [f"σ{i + 1}" for i in range(count)])
        axes.grid(axis="x", visible=False)
        axes.set_ylabel("σ / σ1")
        axes.set_title("Scaled singular values")
        axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0))

    return save(path, (7.6, 3.4), draw)


def sphere_grid(rows: int = 61, columns: int = 121) -> Array:
    """Returns (rows, columns, 3) unit vectors: elevation −90°…90° by azimuth −180°…180°."""
    elevation = np.linspace(-np.pi / 2, np.pi / 2, rows)[:, None]
    azimuth = np.linspace(-np.pi, np.pi, columns)[None, :]
    flat = np.cos(elevation)
    parts = (flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation) + 0 * azimuth)
    return np.stack(parts, axis=-1)


def margin_map(
    path: str | Path,
    values: Array,
    *,
    title: str,
    unit: str,
    weakest: tuple[float, Sequence[float]] | None = None,
) -> Path:
    """A margin over all directions, as a map of the sphere; its weakest direction is marked.

    Args:
        path: of the PNG.
        values: (rows, columns) at the directions of ``sphere_grid(rows, columns)``.
        title: of the map.
        unit: of the values.
        weakest: the least value and its direction (3,), where they are known better than the grid
            shows them.

    Raises:
        SnakegenError: values that are not such a grid, or none of them finite.
    """
    values = np.asarray(values, dtype=float)
    if values.ndim != 2 or not np.isfinite(values).any():
        raise SnakegenError(f"{path}: a margin map needs a (rows, columns) grid of finite values.")
    rows, columns = values.shape
    elevation = np.linspace(-np.pi / 2, np.pi / 2, rows)
    azimuth = np.linspace(-np.pi, np.pi, columns)
    row, column = np.unravel_index(np.nanargmin(values), values.shape)
    low, at = values[row, column], (azimuth[column], elevation[row])
    if weakest is not None:
        low, (x, y, z) = weakest
        at = (math.atan2(y, x), math.atan2(z, math.hypot(x, y)))

    def draw(figure: "Figure") -> None:
        axes: Any = figure.add_subplot(projection="mollweide")
        shown = axes.pcolormesh(
            azimuth, elevation, values, cmap="viridis", shading="gouraud", rasterized=True
        )
        if np.ptp(values[np.isfinite(values)]) > 1e-9 * abs(low):
            axes.contour(azimuth, elevation, values, 6, colors="white", linewidths=0.5, alpha=0.6)
        axes.grid(color="white", alpha=0.25, linewidth=0.5)
        axes.plot(*at, "o", markersize=13, markerfacecolor="none", mec="white", mew=4.5)
        axes.plot(*at, "o", markersize=13, markerfacecolor="none", mec=RED, mew=2.5)
        for degrees, name in ((-176, "−x"), (-90, "−y"), (0, "+x"), (90, "+y"), (176, "−x")):
            axes.text(math.radians(degrees), 0.0, name, color="white", ha="center", va="center")
        axes.set_xticks(np.radians([-90, 0, 90]), [])
        axes.set_yticks(np.radians([-60, -30, 0, 30, 60]))
        axes.set_title(f"{title}: weakest {low:.3g} {unit} (red ring), +z at the top", pad=12)
        figure.colorbar(shown, ax=axes, shrink=0.8, label=unit)

    return save(path, (7.6, 3.9), draw)


def time_series(
    path: str | Path,
    time: Array,
    panels: Mapping[str, Mapping[str, Array]],
    *,
    title: str = "",
    limits: Mapping[str, Sequence[float]] | None = None,
) -> Path:
    """Panels of curves over one time axis.

    Args:
        path: of the PNG.
        time: (n,) [s].
        panels: by the label of the panel's axis, e.g. ``position error [m]``, its curves (n,) by
            name.
        title: of the whole.
        limits: by the label of a panel, levels drawn as dashed lines.

    Raises:
        SnakegenError: no panels, or a curve that is not as long as `time`.
    """
    if not panels:
        raise SnakegenError(f"{path}: a time series needs at least one panel.")
    for curves in panels.values():
        _same_length(path, time=time, **curves)

    def draw(figure: "Figure") -> None:
        rows: Any = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        for axes, (label, curves) in zip(rows, panels.items(), strict=True):
            for name, values in curves.items():
                axes.plot(time, values, linewidth=1.2, label=name)
            for level in (limits or {}).get(label, ()):
                axes.axhline(level, color=RED, linewidth=1.0, linestyle="--")
            axes.set_ylabel(label)
            axes.margins(x=0)
            if len(curves) > 1 or next(iter(curves), ""):
                axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8.5)
        rows[-1].set_xlabel("time [s]")
        if title:
            rows[0].set_title(title)

    return save(path, (8.2, 0.8 + 1.7 * len(panels)), draw)


def _short(names: Sequence[str]) -> bool:
    return max((len(name) for name in names), default=0) <= 7


def _same_length(path: str | Path, **arrays: Any) -> None:
    counts = {name: len(array) for name, array in arrays.items()}
    if len(set(counts.values())) > 1:
        listed = ", ".join(f"{name} {count}" for name, count in counts.items())
        raise SnakegenError(f"{path}: cannot be drawn, the lengths differ: {listed}.")
