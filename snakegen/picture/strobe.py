"""A motion through a scene in a row of pictures, as ZN23 Fig 10 shows it; drawn by matplotlib."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from snakegen.base.atomic_io import replace_whole
from snakegen.base.geometry import Floats

_BODY, _LEADER, _SOLID = "#1f6f8b", "#d1495b", "#8d99ae"
_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 25)


@dataclass(frozen=True, eq=False)
class Instant:
    """A body at one instant.

    Attributes:
        time: s.
        line: (n, 3) m, the ends of its rods, root first.
        discs: centre (3,) m, axis (3,) and radius [m] of what each apparatus sweeps.
    """

    time: float
    line: Floats
    discs: list[tuple[Floats, Floats, float]]


def draw_strobe(path: Path, instants: list[Instant], boxes: list[Floats], title: str) -> None:
    """Draws a body at several instants among boxes.

    Args:
        path: PNG to write.
        instants: in order.
        boxes: (8, 3) m, corners of each box, x slowest, z fastest.
        title: over all.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = (len(instants) + 1) // 2
    figure = Figure(figsize=(3.4 * columns, 5.6), dpi=110)
    FigureCanvasAgg(figure)
    cloud = np.concatenate([i.line for i in instants])
    low, high = cloud.min(axis=0) - 0.25, cloud.max(axis=0) + 0.25
    # the longer way of the motion lies across the picture
    azimuth = -60.0 if high[0] - low[0] >= high[1] - low[1] else -30.0
    for k, instant in enumerate(instants):
        axes: Any = figure.add_subplot(2, columns, k + 1, projection="3d", computed_zorder=False)
        _draw_boxes(axes, boxes, low, high)
        axes.plot(*instant.line.T, color=_BODY, linewidth=3.0, zorder=5)
        axes.scatter(*instant.line[0], color=_LEADER, s=22, zorder=6)
        for centre, axis, radius in instant.discs:
            one = np.cross(axis, [0.0, 0.0, 1.0])
            one = one / max(float(np.linalg.norm(one)), 1e-9) if np.any(one) else np.eye(3)[0]
            rim = np.outer(np.cos(_CIRCLE), one) + np.outer(np.sin(_CIRCLE), np.cross(axis, one))
            axes.plot(*(centre + radius * rim).T, color=_BODY, linewidth=1.0, alpha=0.8, zorder=5)
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        axes.set_zlim(max(low[2], 0.0), high[2])
        axes.set_box_aspect(np.maximum(high - low, 0.1), zoom=1.3)
        axes.locator_params(nbins=4)
        axes.view_init(elev=12.0, azim=azimuth)
        axes.set_title(f"{instant.time:.1f} s", fontsize=9)
        axes.tick_params(labelsize=6, pad=-2)
    figure.suptitle(f"{title} (red: root link; circles: what gimbals can sweep)", fontsize=10)
    figure.subplots_adjust(left=0.02, right=0.98, bottom=0.03, top=0.9, wspace=0.12, hspace=0.12)
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_whole(path, lambda part: figure.savefig(part, format="png"))


def _draw_boxes(axes: Any, boxes: list[Floats], low: Floats, high: Floats) -> None:
    """Draws the faces of boxes, cut off where the picture ends."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    faces = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))
    for corners in boxes:
        cut = np.clip(corners, low, high)
        if np.any(np.ptp(cut, axis=0) < 1e-6):
            continue
        parts = [cut[list(face)] for face in faces]
        look = {"facecolor": _SOLID, "edgecolor": "#4a5568", "linewidth": 0.3, "alpha": 0.25}
        axes.add_collection3d(Poly3DCollection(parts, zorder=1, **look))
