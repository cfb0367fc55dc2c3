"""Picture of the forces and torques that a tip can carry: two polytopes in space."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from snakegen.picture.style import BLUE, GREY, INK, ORANGE, RED, save

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
_FLAT = 1e-6  # of its size: thinner than this a set of corners is flat


class Set(NamedTuple):
    """A set of loads round 0: its corners (c, 3), what is borne in every direction, and the end.

    `free` (3, f) holds the directions in which it has no end.
    """

    title: str
    unit: str
    corners: Array
    radius: float
    free: Array


def tip_polytope_chart(path: str | Path, sets: Sequence[Set]) -> Path:
    """Draws each set as a body in space, the ball of every direction in it, and its axes.

    Args:
        path: of the PNG.
        sets: one panel each; sets without corners say why in words.
    """

    def draw(figure: "Figure") -> None:
        for k, one in enumerate(sets):
            axes: Any = figure.add_subplot(1, len(sets), k + 1, projection="3d")
            _panel(axes, one, BLUE if k % 2 == 0 else ORANGE)

    return save(path, (4.9 * len(sets), 4.6), draw)


def _panel(axes: Any, one: Set, colour: str) -> None:
    """Draws one set on 3D axes."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    finite = np.isfinite(one.radius)
    words = f"{one.radius:.3g} {one.unit} in every direction" if finite else "no end at all"
    axes.set_title(f"{one.title}: {words}", fontsize=10)
    for name in "xyz":
        getattr(axes, f"set_{name}label")(f"{name} [{one.unit}]")
        getattr(axes, f"{name}axis").set_pane_color((1.0, 1.0, 1.0, 1.0))
        axes.locator_params(axis=name, nbins=5)
    if not len(one.corners):
        axes.text2D(
            0.5, 0.5, "a joint is overloaded already", transform=axes.transAxes, ha="center"
        )
        return
    faces = _faces(one.corners)
    body = Poly3DCollection(faces, facecolor=colour, edgecolor=INK, linewidth=0.4, alpha=0.32)
    axes.add_collection3d(body)
    axes.scatter(*one.corners.T, color=colour, s=8, depthshade=False)
    half = float(np.abs(one.corners).max())
    for axis in half * np.eye(3):
        axes.plot(*np.column_stack([-axis, axis]), color=GREY, linewidth=0.7)
    if finite:
        _ball(axes, one)
    for u in one.free.T:
        axes.plot(*np.column_stack([-half * u, half * u]), color=RED, linewidth=1.6, linestyle=":")
    if one.free.shape[1]:
        axes.text2D(
            0.02, 0.96, "red, dotted: no joint feels it", transform=axes.transAxes, color=RED
        )
    for name in "xyz":
        getattr(axes, f"set_{name}lim")(-half, half)
    axes.set_box_aspect((1, 1, 1))
    axes.view_init(elev=22, azim=-55)


def _ball(axes: Any, one: Set) -> None:
    """Draws what is borne in every direction: a ball, or what the flat set cuts out of it."""
    turn, up = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, np.pi, 13))
    ball = one.radius * np.stack([np.sin(up) * np.cos(turn), np.sin(up) * np.sin(turn), np.cos(up)])
    if one.free.shape[1]:
        keep = np.eye(3) - one.free @ one.free.T
        ball = np.einsum("ij,jkl->ikl", keep, ball)
    axes.plot_wireframe(*ball, color=RED, linewidth=0.4, alpha=0.6)


def _faces(corners: Array) -> list[Array]:
    """Returns the faces of the hull of corners (c, 3): polygons, a single one of a flat set."""
    from scipy.spatial import ConvexHull

    _, size, axes = np.linalg.svd(corners - corners.mean(axis=0))
    if len(corners) < 3 or size[1] <= _FLAT * size[0]:
        return [np.array([corners[0], corners[-1], corners[0]])]
    if size[2] <= _FLAT * size[0]:
        flat = corners @ axes[:2].T
        return [corners[ConvexHull(flat).vertices]]
    hull = ConvexHull(corners)
    scale = np.abs(corners).max()
    planes = np.round(hull.equations / np.array([1.0, 1.0, 1.0, scale]), 6)
    kept, which = np.unique(planes, axis=0, return_inverse=True)
    return [
        _polygon(corners[np.unique(hull.simplices[which.ravel() == k])], kept[k, :3])
        for k in range(len(kept))
    ]


def _polygon(points: Array, normal: Array) -> Array:
    """Returns the corners of a convex face, in order round its normal."""
    first, second = np.linalg.svd(normal[None])[2][1:]
    out = points - points.mean(axis=0)
    return points[np.argsort(np.arctan2(out @ second, out @ first))]
