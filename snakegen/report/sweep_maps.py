"""Pictures of a sweep: the least margin over two joints, its histogram, the worst postures."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from snakegen.errors import AnalysisError
from snakegen.picture.robot_figure import draw_robot
from snakegen.picture.robot_picture import figure
from snakegen.picture.style import save
from snakegen.robot.robot import Robot

_UNITS = {"force_margin": "N", "torque_margin": "N m"}
_WORST = 3


def sweep_map(
    path: Path,
    robot: Robot,
    table: pa.Table,
    column: str,
    joints: tuple[str, str],
    held: Mapping[str, Any] | None = None,
) -> Path:
    """Draws `column` over two joints (least value in each cell), its histogram, the worst three.

    Args:
        path: of the PNG.
        robot: whose postures they are.
        table: of a sweep.
        column: a margin.
        joints: the two axes of the map.
        held: joint angles and attitude that all postures share, as `Robot.configuration` takes.

    Raises:
        AnalysisError: a joint or margin that the sweep does not have, or no finite value.
    """
    for name in (*joints, column):
        if name not in table.column_names:
            raise AnalysisError(f"the sweep has no column '{name}'.")
    values = np.asarray(table[column], float)
    if not np.isfinite(values).any():
        raise AnalysisError(f"'{column}' is finite at no posture of the sweep.")

    def draw(fig: Any) -> None:
        grid = fig.add_gridspec(2, 3, height_ratios=[1.5, 1.0])
        _map(fig.add_subplot(grid[0, :2]), fig, table, values, column, joints)
        _histogram(fig.add_subplot(grid[0, 2]), values, column)
        order = np.argsort(np.where(np.isfinite(values), values, np.inf))[:_WORST]
        for place, row in enumerate(order):
            axes = fig.add_subplot(grid[1, place])
            title = f"{values[row]:.3g} {_UNITS.get(column, '')}"
            _posture(axes, robot, table, int(row), title, held or {})

    return save(path, (12.0, 8.0), draw)


def _map(
    axes: Any, fig: Any, table: pa.Table, values: Any, column: str, joints: tuple[str, str]
) -> None:
    x, y = (np.asarray(table[j], float) for j in joints)
    bins = int(np.clip(np.sqrt(len(values) / 25), 6, 80))
    edges = [np.linspace(v.min(), v.max() + 1e-9, bins + 1) for v in (x, y)]
    cell = np.full((bins, bins), np.inf)
    i = np.clip(np.digitize(x, edges[0]) - 1, 0, bins - 1)
    j = np.clip(np.digitize(y, edges[1]) - 1, 0, bins - 1)
    np.minimum.at(cell, (i, j), np.where(np.isfinite(values), values, np.inf))
    cell[~np.isfinite(cell)] = np.nan
    image = axes.pcolormesh(edges[0], edges[1], cell.T, cmap="viridis", rasterized=True)
    unit = _UNITS.get(column, "scaled")
    fig.colorbar(image, ax=axes, label=f"least {column} [{unit}]")
    axes.set_xlabel(f"{joints[0]} [rad]")
    axes.set_ylabel(f"{joints[1]} [rad]")


def _histogram(axes: Any, values: Any, column: str) -> None:
    finite = values[np.isfinite(values)]
    axes.hist(finite, bins=60, color="#3b6ea5", log=True)
    axes.set_xlabel(f"{column} [{_UNITS.get(column, 'scaled')}]")
    axes.set_ylabel("postures")
    lost = 1.0 - len(finite) / len(values)
    axes.set_title(
        f"{len(values):,} postures" + (f", {100 * lost:.1f} % cannot hover" if lost else "")
    )


def _posture(
    axes: Any, robot: Robot, table: pa.Table, row: int, title: str, held: Mapping[str, Any]
) -> None:
    names = [n for n in table.column_names if n in robot.joint_names]
    posture = dict(held) | {n: table[n][row].as_py() for n in names}
    shown = figure(robot, robot.configuration(posture, gimbals="hover"))
    draw_robot(axes, shown, title=title, marks=False)
