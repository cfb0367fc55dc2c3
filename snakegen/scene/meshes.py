"""Meshes and point clouds of a scene, read by trimesh and NumPy and checked."""

from pathlib import Path
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.errors import SceneError

MOST_TRIANGLES = 5000
MOST_BALLS = 2000


def triangle_mesh(path: Path, scale: float, where: str) -> tuple[Floats, Any]:
    """Returns vertices (n, 3) [m] and faces (m, 3) of a closed mesh.

    Raises:
        SceneError: no mesh, too many triangles, or a surface that is not closed.
    """
    import trimesh

    try:
        mesh = trimesh.load(str(path), force="mesh")
    except Exception as error:  # trimesh's readers raise of every kind
        raise SceneError(f"{where}: {path.name} cannot be read as a mesh ({error}).") from None
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise SceneError(f"{where}: {path.name} holds no triangles.")
    if len(mesh.faces) > MOST_TRIANGLES:
        raise SceneError(
            f"{where}: {path.name} has {len(mesh.faces)} triangles; {MOST_TRIANGLES} at most: "
            "simplify it."
        )
    mesh.merge_vertices()
    if not mesh.is_watertight:
        edges = np.sort(mesh.edges, axis=1)
        _, counts = np.unique(edges, axis=0, return_counts=True)
        raise SceneError(
            f"{where}: {path.name} is not closed: {int(np.sum(counts != 2))} of {len(counts)} "
            "edges do not join two triangles; what is inside is not defined."
        )
    return scale * np.array(mesh.vertices, float), np.array(mesh.faces, np.int64)


def point_cloud(path: Path, scale: float, radius: float, where: str) -> tuple[Floats, float]:
    """Returns centres (n, 3) and the radius [m] of balls that hold every point's ball.

    Points are merged on a grid until there are at most 2000 balls, which then grow by half the
    grid's diagonal: what was covered stays so.

    Raises:
        SceneError: neither CSV nor PLY, fewer than three columns, no points.
    """
    points: Any
    if path.suffix.lower() == ".ply":
        import trimesh

        try:
            cloud: Any = trimesh.load(str(path))
            points = np.array(cloud.vertices, float)
        except Exception as error:
            raise SceneError(f"{where}: {path.name} cannot be read ({error}).") from None
    elif path.suffix.lower() == ".csv":
        try:
            points = np.genfromtxt(path, delimiter=",", dtype=float, ndmin=2)
        except ValueError as error:
            raise SceneError(f"{where}: {path.name}: {' '.join(str(error).split())}") from None
        if len(points) and np.all(np.isnan(points[0])):
            points = points[1:]  # a line of headings
    else:
        raise SceneError(f"{where}: {path.name}: a point cloud is a .csv or a .ply file.")
    if points.ndim != 2 or points.shape[1] < 3 or not len(points):
        raise SceneError(f"{where}: {path.name}: rows of x, y, z are needed.")
    points = points[:, :3]
    bad = np.flatnonzero(~np.all(np.isfinite(points), axis=1))
    if len(bad):
        raise SceneError(f"{where}: {path.name}: point {bad[0] + 1} is not finite.")
    points, grid, merged = scale * points, 0.5 * radius, scale * points
    while len(merged) > MOST_BALLS:
        cells = np.unique(np.floor(points / grid).astype(np.int64), axis=0)
        merged, grid = (cells + 0.5) * grid, 1.5 * grid
    grown = 0.0 if len(merged) == len(points) else 0.5 * np.sqrt(3.0) * grid / 1.5
    return merged, radius + float(grown)
