"""Obstacles of a scene file: boxes, cylinders, pipes, half-spaces, meshes and clouds of points."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from snakegen.base.geometry import rotation_from_rpy, rotation_onto
from snakegen.errors import SceneError, near
from snakegen.scene.field_values import check_names, existing_file, numbers, positive, vector
from snakegen.scene.meshes import point_cloud, triangle_mesh
from snakegen.scene.openings import Opening, pipe, plate
from snakegen.scene.solids import Solid

FIELDS = {
    "box": ("centre", "size", "half", "rpy", "openings"),
    "cylinder": ("from", "to", "radius"),
    "pipe": ("points", "radius", "wall"),
    "half_space": ("point", "normal"),
    "mesh": ("file", "centre", "rpy", "scale"),
    "points": ("file", "radius", "scale"),
}


def read_obstacle(
    item: Any, where: str, number: int, folder: Path
) -> tuple[list[Solid], list[Opening]]:
    """Returns the solids of one obstacle, and the openings through them."""
    if not isinstance(item, dict):
        raise SceneError(f"{where} is no mapping, as in {{box: …}} with centre and size.")
    kind = item.get("kind", "box")
    if kind not in FIELDS:
        raise SceneError(f"{where}: kind: {kind!r} is none.{near(str(kind), FIELDS)}")
    check_names(item, ("name", "kind", *FIELDS[kind]), where)
    name = str(item.get("name", f"{kind}{number}"))
    if "." in name:
        raise SceneError(f"{where}: name: '{name}' must not hold a dot.")
    make: Callable[..., tuple[list[Solid], list[Opening]]] = {
        "box": _box,
        "cylinder": _cylinder,
        "pipe": _pipe,
        "half_space": _half_space,
        "mesh": _mesh,
        "points": _points,
    }[kind]
    return make(item, name, where, folder)


def _box(item: Any, name: str, where: str, _: Path) -> tuple[list[Solid], list[Opening]]:
    centre = vector(item, "centre", where)
    if ("size" in item) == ("half" in item):
        raise SceneError(f"{where}: a box has either 'size' or 'half' lengths.")
    half = vector(item, "half", where) if "half" in item else 0.5 * vector(item, "size", where)
    if np.any(half <= 0.0):
        raise SceneError(f"{where}: lengths must be above 0.")
    rotation = rotation_from_rpy(vector(item, "rpy", where, default=(0.0, 0.0, 0.0)))
    listed = item.get("openings", [])
    if not isinstance(listed, list) or not all(isinstance(x, dict) for x in listed):
        raise SceneError(f"{where}: openings: a list of {{centre: [0, 0], size: [0.5, 0.5]}}.")
    holes = []
    for k, one in enumerate(listed, 1):
        check_names(one, ("centre", "size"), f"{where}: opening {k}")
        size = vector(one, "size", f"{where}: opening {k}", 2)
        if np.any(size <= 0.0):
            raise SceneError(f"{where}: opening {k}: size must be above 0.")
        holes.append((vector(one, "centre", f"{where}: opening {k}", 2, (0.0, 0.0)), size))
    return plate(name, centre, half, rotation, holes)


def _cylinder(item: Any, name: str, where: str, _: Path) -> tuple[list[Solid], list[Opening]]:
    start, end = vector(item, "from", where), vector(item, "to", where)
    length = float(np.linalg.norm(end - start))
    if length < 1e-9:
        raise SceneError(f"{where}: 'from' and 'to' are the same point.")
    size = positive(item, "radius", where), 0.5 * length
    rotation = rotation_onto((end - start) / length)
    return [Solid(name, "cylinder", 0.5 * (start + end), rotation, size)], []


def _pipe(item: Any, name: str, where: str, _: Path) -> tuple[list[Solid], list[Opening]]:
    listed = item.get("points")
    if not isinstance(listed, list) or len(listed) < 2:
        raise SceneError(f"{where}: points: two at least, as in [[0, 0, 1], [0, 0, 2]].")
    points = np.array([numbers(x, f"{where}: point {i}") for i, x in enumerate(listed, 1)])
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if np.any(steps < 1e-6):
        raise SceneError(f"{where}: point {int(np.argmin(steps)) + 2} repeats the one before.")
    wall = positive(item, "wall", where, 0.02)
    return pipe(name, points, positive(item, "radius", where), wall)


def _half_space(item: Any, name: str, where: str, _: Path) -> tuple[list[Solid], list[Opening]]:
    normal = vector(item, "normal", where, default=(0.0, 0.0, 1.0))
    if np.linalg.norm(normal) < 1e-9:
        raise SceneError(f"{where}: normal must not be zero; it points out of the solid.")
    point = vector(item, "point", where, default=(0.0, 0.0, 0.0))
    return [Solid(name, "half_space", point, rotation_onto(normal / np.linalg.norm(normal)))], []


def _mesh(item: Any, name: str, where: str, folder: Path) -> tuple[list[Solid], list[Opening]]:
    scale = positive(item, "scale", where, 1.0)
    vertices, faces = triangle_mesh(existing_file(item, where, folder), scale, where)
    rotation = rotation_from_rpy(vector(item, "rpy", where, default=(0.0, 0.0, 0.0)))
    centre = vector(item, "centre", where, default=(0.0, 0.0, 0.0))
    return [Solid(name, "mesh", centre, rotation, (), vertices, faces)], []


def _points(item: Any, name: str, where: str, folder: Path) -> tuple[list[Solid], list[Opening]]:
    radius = positive(item, "radius", where, 0.02)
    scale = positive(item, "scale", where, 1.0)
    centres, size = point_cloud(existing_file(item, where, folder), scale, radius, where)
    eye = np.eye(3)
    return [Solid(f"{name}.{k}", "sphere", c, eye, (size,)) for k, c in enumerate(centres, 1)], []
