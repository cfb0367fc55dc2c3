"""A way for a point through a scene: Dijkstra's on a grid, where room is worth a detour."""

from dataclasses import replace
from itertools import product

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from snakegen.base.geometry import Floats
from snakegen.errors import PlanError
from snakegen.scene.schema import Scene
from snakegen.scene.solids import Solid

ROOM = 0.35  # m, of clearance: more is worth nothing
_GRID = 0.08  # m
_AROUND = 1.2  # m, beyond start, goal and openings
_MOST = 150_000  # nodes; the grid grows coarser above
_LEAST = 0.02  # m, clearance of the point


class BlockedWay(PlanError):
    """No way even for a point.

    Attributes:
        names: of the obstacles each of which blocks it alone.
    """

    def __init__(self, message: str, names: tuple[str, ...]) -> None:
        """Keeps the names."""
        super().__init__(message)
        self.names = names


def way_through(scene: Scene) -> tuple[Floats, list[Floats]]:
    """Returns a way for a point from start to goal, and the openings' lines on it.

    Raises:
        BlockedWay: what blocks the way.
    """
    if scene.start is None or scene.goal is None:
        raise PlanError(f"{scene.name}: a plan needs start and goal.")
    way = guide(scene, scene.start.cog, scene.goal.cog, _LEAST)
    if way is not None:
        return way, openings_on(scene, way)
    solid = (s for s in scene.solids if s.kind != "half_space")
    blocking = []
    for name in sorted({s.name.partition(".")[0] for s in solid}):
        left = tuple(s for s in scene.solids if s.name.partition(".")[0] != name)
        without = replace(scene, solids=left)
        if guide(without, scene.start.cog, scene.goal.cog, _LEAST) is not None:
            blocking.append(name)
    what = f"{', '.join(blocking)} blocks it" if blocking else "several obstacles block it"
    raise BlockedWay(
        f"{scene.name}: no way from start to goal, even for a single rod: {what}.", tuple(blocking)
    )


def distances(solids: tuple[Solid, ...], points: Floats) -> Floats:
    """Returns the least signed distances (m,) [m] of points (m, 3) from solids."""
    out = np.full(len(points), np.inf)
    for solid in solids:
        out = np.minimum(out, solid.distances(points))
    return out


def guide(scene: Scene, start: Floats, goal: Floats, least: float) -> Floats | None:
    """Returns points (m, 3) from `start` to `goal` that keep `least` clear; None without a way.

    Args:
        scene: obstacles.
        start, goal: (3,) m.
        least: m, clearance of the point.
    """
    marks = [start, goal, *(p for way in scene.openings for p in way.line)]
    low, high = np.min(marks, axis=0) - _AROUND, np.max(marks, axis=0) + _AROUND
    step = max(_GRID, float(np.cbrt(np.prod(high - low) / _MOST)))
    # a node stands in the middle of the first opening
    anchor = scene.openings[0].centre if scene.openings else start
    axes = [np.arange(np.ceil((a - o) / step), np.floor((b - o) / step) + 1) * step + o
            for a, b, o in zip(low, high, anchor, strict=True)]  # fmt: skip
    shape = tuple(len(a) for a in axes)
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    clear = distances(scene.solids, points)
    free = (clear > least).reshape(shape)
    cost = (1.0 + 8.0 * np.clip(1.0 - clear / ROOM, 0.0, 1.0) ** 2).reshape(shape)
    index = np.arange(len(points)).reshape(shape)
    rows, columns, weights = [], [], []
    for move in product((-1, 0, 1), repeat=3):
        if move <= (0, 0, 0):
            continue
        here = tuple(slice(max(-m, 0), n - max(m, 0)) for m, n in zip(move, shape, strict=True))
        there = tuple(slice(max(m, 0), n - max(-m, 0)) for m, n in zip(move, shape, strict=True))
        open_ = free[here] & free[there]
        rows.append(index[here][open_])
        columns.append(index[there][open_])
        size = step * float(np.linalg.norm(move))
        weights.append(0.5 * size * (cost[here] + cost[there])[open_])
    entries = (np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns)))
    graph = coo_matrix(entries, shape=(len(points), len(points))).tocsr()
    open_nodes = np.flatnonzero(free.ravel())
    if not len(open_nodes):
        return None
    ends = [
        int(open_nodes[np.argmin(np.linalg.norm(points[open_nodes] - p, axis=1))])
        for p in (start, goal)
    ]
    far, before = dijkstra(graph, directed=False, indices=ends[0], return_predecessors=True)
    if not np.isfinite(far[ends[1]]):
        return None
    nodes = [ends[1]]
    while nodes[-1] != ends[0]:
        nodes.append(int(before[nodes[-1]]))
    return np.concatenate([start[None], points[nodes[::-1]], goal[None]])


def openings_on(scene: Scene, way: Floats) -> list[Floats]:
    """Returns the lines (m, 3) through the openings that a way passes, in its order and sense."""
    found: list[tuple[int, Floats]] = []
    for opening in sorted(scene.openings, key=lambda o: -_length(o.line)):
        if any(_distance(opening.centre, line) < 0.25 for _, line in found):
            continue  # the hole of a wall round a pipe, or the like
        middle = opening.line.mean(axis=0) if len(opening.line) == 2 else opening.line[0]
        gaps = np.linalg.norm(way - middle, axis=1)
        k = int(np.argmin(gaps))
        if gaps[k] > 0.5 * max(opening.size) + 0.1:
            continue
        ends = [int(np.argmin(np.linalg.norm(way - p, axis=1))) for p in opening.line[[0, -1]]]
        line = opening.line if ends[0] <= ends[1] else opening.line[::-1]
        found.append((min(ends), line))
    return [line for _, line in sorted(found, key=lambda pair: pair[0])]


def _length(line: Floats) -> float:
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def _distance(point: Floats, line: Floats) -> float:
    """Returns the distance [m] of a point from a line of points, at its samples."""
    share = np.linspace(0.0, 1.0, 40)[:, None, None]
    samples = line[:-1] + share * (line[1:] - line[:-1])
    return float(np.linalg.norm(samples - point, axis=2).min())
