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

_UNITS = {"force_margin": "N", "torque_margin": "N·m"}
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
        axes = fig.add_subplot(grid[0, :2])
        _map(axes, fig, table, values, column, joints)
        axes.set_title(_others(robot, table, joints, held or {}))
        _histogram(fig.add_subplot(grid[0, 2]), values, column)
        order = np.argsort(np.where(np.isfinite(values), values, np.inf))[:_WORST]
        for place, row in enumerate(order):
            axes = fig.add_subplot(grid[1, place])
            unit = _UNITS.get(column, "")
            title = (
                f"worst {place + 1}: {values[row]:.3g} {unit}\n{_angles(robot, table, int(row))}"
            )
            _posture(axes, robot, table, int(row), title, held or {})

    return save(path, (12.0, 8.0), draw)


def _map(
    axes: Any, fig: Any, table: pa.Table, values: Any, column: str, joints: tuple[str, str]
) -> None:
    x, y = (np.asarray(table[j], float) for j in joints)
    edges = [_edges(v, len(values)) for v in (x, y)]
    cell = np.full((len(edges[0]) - 1, len(edges[1]) - 1), np.inf)
    i = np.clip(np.digitize(x, edges[0]) - 1, 0, cell.shape[0] - 1)
    j = np.clip(np.digitize(y, edges[1]) - 1, 0, cell.shape[1] - 1)
    np.minimum.at(cell, (i, j), np.where(np.isfinite(values), values, np.inf))
    cell[~np.isfinite(cell)] = np.nan
    image = axes.pcolormesh(edges[0], edges[1], cell.T, cmap="viridis", rasterized=True)
    unit = _UNITS.get(column, "scaled")
    fig.colorbar(image, ax=axes, label=f"least {_words(column)} [{unit}]")
    axes.set_xlabel(f"{joints[0]} [rad]")
    axes.set_ylabel(f"{joints[1]} [rad]")


def _edges(values: Any, count: int) -> Any:
    """Returns the edges of the cells: around each value of a grid, else even ones by the count."""
    levels = np.unique(values)
    if 1 < len(levels) <= count // 2:
        middles = 0.5 * (levels[1:] + levels[:-1])
        return np.concatenate(
            [[2.0 * levels[0] - middles[0]], middles, [2.0 * levels[-1] - middles[-1]]]
        )
    bins = int(np.clip(np.sqrt(count / 25), 6, 80))
    return np.linspace(values.min(), values.max() + 1e-9, bins + 1)


def _words(column: str) -> str:
    return column.replace("_", " ")


def _others(robot: Robot, table: pa.Table, joints: tuple[str, str], held: Mapping[str, Any]) -> str:
    """Returns what the joints do that are not axes of the map."""
    chain = [n for n in robot.chain_joints if n not in joints]
    varied = [n for n in chain if n in table.column_names and len(np.unique(table[n])) > 1]
    still = robot.configuration(dict(held))
    angles = dict(zip(robot.joint_names, robot.angles(still), strict=True))
    kept = [n for n in chain if n not in varied and abs(angles[n]) > 1e-9]
    parts = [f"least over {', '.join(varied)}"] if varied else []
    parts += [f"{n} {angles[n]:+.3g} rad" for n in kept]
    if len(kept) + len(varied) < len(chain):
        parts.append("other joints 0" if parts else "all other joints 0")
    return "; ".join(parts)


def _angles(robot: Robot, table: pa.Table, row: int) -> str:
    """Returns the angles of a posture of the sweep [rad], two a line."""
    names = [n for n in table.column_names if n in robot.chain_joints]
    parts = [f"{n} {table[n][row].as_py():+.2f}" for n in names[:6]]
    lines = [", ".join(parts[k : k + 2]) for k in range(0, len(parts), 2)]
    return "\n".join(lines) + (" …" if len(names) > 6 else "")


def _histogram(axes: Any, values: Any, column: str) -> None:
    finite = values[np.isfinite(values)]
    axes.hist(finite, bins=60, color="#3b6ea5", log=True)
    axes.set_xlabel(f"{_words(column)} [{_UNITS.get(column, 'scaled')}]")
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
    draw_robot(axes, shown, marks=False)
    axes.set_title(title, fontsize=8.5, fontweight="normal")
