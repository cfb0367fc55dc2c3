"""What STL meshes and primitives of a link enclose, from their triangles, in NumPy alone.

A lint of a robot with STL meshes then needs neither SciPy nor trimesh, whose import takes longer
than the whole lint. Open meshes and other formats are left to `mesh_rules`.
"""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from snakegen.linter.composites import Floats, placement
from snakegen.linter.finding import number, numbers
from snakegen.linter.xml_tree import Node

_TURNS = 32  # segments of a circle
_VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)")
_HEAD, _ROW = 84, 50  # bytes of a binary STL's head and of a triangle
_PRIMES = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)


def link_triangles(link: Node, locate: Callable[[str], Path | None]) -> Floats | None:
    """Returns the triangles (n, 3, 3) [m, link axes] of all shapes of a link.

    Args:
        link: the element.
        locate: the file of a mesh's name, None where it is not at hand.

    Returns:
        None where a shape is neither a primitive nor a closed STL mesh.
    """
    parts = []
    for part in link.children:
        geometry = part.find("geometry") if part.tag in ("visual", "collision") else None
        for shape in [] if geometry is None else geometry.children:
            found = _shape(shape, locate)
            if found is None or not len(found):
                return None
            rotation, shift = placement(part.find("origin"))
            parts.append(found @ rotation.T + shift)
    return np.concatenate(parts) if parts else None


def enclosed(triangles: Floats) -> tuple[float, Floats]:
    """Returns volume [m³] and inertia (3, 3) [m⁵] about the centre of mass, of density 1.

    Sums over tetrahedra from the mean vertex o: ``V = Σ d/6``, ``∫ x xᵀ = Σ d/120 (Σ v vᵀ + s sᵀ)``
    with d the determinant of a tetrahedron's edges v and ``s = Σ v``.

    Args:
        triangles: (n, 3, 3) m, of closed surfaces, counter-clockwise seen from outside.
    """
    v = triangles - triangles.reshape(-1, 3).mean(axis=0)
    d = np.einsum("ni,ni->n", v[:, 0], np.cross(v[:, 1], v[:, 2]))
    volume = float(d.sum()) / 6.0
    if not abs(volume) > 0.0:
        return 0.0, np.zeros((3, 3))
    s = v.sum(axis=1)
    centre = d @ s / (24.0 * volume)
    weighted = (d[:, None, None] * v).reshape(-1, 3)
    second = weighted.T @ v.reshape(-1, 3) + (d[:, None] * s).T @ s
    second = second / 120.0 - volume * np.outer(centre, centre)
    return volume, np.asarray(np.trace(second) * np.eye(3) - second)


def _shape(shape: Node, locate: Callable[[str], Path | None]) -> Floats | None:
    if shape.tag == "box":
        size = numbers(shape, "size", 3)
        return None if size is None else _prism(4) * (np.array(size) / (2**0.5, 2**0.5, 1.0))
    if shape.tag == "cylinder":
        radius, length = number(shape, "radius"), number(shape, "length")
        if radius is None or length is None:
            return None
        return _prism(_TURNS) * (radius, radius, length)
    if shape.tag == "sphere":
        radius = number(shape, "radius")
        return None if radius is None else radius * _sphere()
    path = locate(shape.attrib.get("filename", "")) if shape.tag == "mesh" else None
    if path is None or path.suffix.lower() != ".stl":
        return None
    scale = np.array(numbers(shape, "scale", 3) or (1.0, 1.0, 1.0))
    found = read_stl(path)
    if found is None or not is_closed(found):
        return None
    found = found.astype(float) * scale
    return found[:, ::-1] if np.prod(scale) < 0.0 else found  # mirrored: outside stays outside


def read_stl(path: Path) -> np.ndarray | None:
    """Returns the triangles (n, 3, 3) of an STL file, binary or text, as float32; None if neither.

    Single precision is what the format has: vertices that meet are equal to the bit.
    """
    data = path.read_bytes()
    if len(data) >= _HEAD:
        count = int.from_bytes(data[80:_HEAD], "little")
        if len(data) == _HEAD + _ROW * count:
            rows = np.frombuffer(data, np.uint8, offset=_HEAD).reshape(count, _ROW)
            return np.ascontiguousarray(rows[:, 12:48]).view("<f4").reshape(count, 3, 3)
    if not data.lstrip().startswith(b"solid"):
        return None
    found = _VERTEX.findall(data)
    if not found or len(found) % 3:
        return None
    try:
        return np.array(found).astype(np.float32).reshape(-1, 3, 3)
    except ValueError:
        return None


def is_closed(triangles: np.ndarray) -> bool:
    """Tells whether each edge is shared by two triangles that pass it in opposite directions.

    Args:
        triangles: (n, 3, 3) float32; vertices are the same where their numbers are.
    """
    corners = np.ascontiguousarray(triangles + np.float32(0.0))  # -0 becomes 0
    if not np.isfinite(corners).all():
        return False
    with np.errstate(over="ignore"):
        keys = (corners.view(np.uint32).astype(np.uint64) * _PRIMES).sum(axis=2, dtype=np.uint64)
    _, vertex = np.unique(keys, return_inverse=True)
    vertex = vertex.reshape(-1, 3).astype(np.int64)
    start, end = vertex.ravel(), np.roll(vertex, -1, axis=1).ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    edge = low * (int(vertex.max(initial=0)) + 1) + high
    order = np.argsort(edge, kind="stable")
    edge, way = edge[order], np.where(start < end, 1, -1)[order]
    if edge.size % 2 or np.any(low == high):
        return False
    pairs = edge.reshape(-1, 2)
    once = np.all(pairs[1:, 0] != pairs[:-1, 1])
    opposite = way.reshape(-1, 2).sum(axis=1) == 0
    return bool(once and np.all(pairs[:, 0] == pairs[:, 1]) and np.all(opposite))


def _prism(turns: int) -> Floats:
    """Returns the triangles of an upright prism of radius and height 1 over a regular polygon."""
    angle = (np.arange(turns + 1) + 0.5) * 2.0 * np.pi / turns
    low = np.column_stack([np.cos(angle), np.sin(angle), np.full(turns + 1, -0.5)])
    high = low + np.array([0.0, 0.0, 1.0])
    a, b, c, e = low[:-1], low[1:], high[1:], high[:-1]
    bottom, top = np.array([0.0, 0.0, -0.5]), np.array([0.0, 0.0, 0.5])
    faces = [(a, b, c), (a, c, e), (b, a, bottom + 0 * a), (e, c, top + 0 * a)]
    return np.concatenate([np.stack(f, axis=1) for f in faces])


def _sphere() -> Floats:
    """Returns the triangles of a sphere of radius 1, by circles of latitude."""
    rows = _TURNS // 2
    across, round_ = (
        np.pi * np.arange(rows + 1) / rows,
        2.0 * np.pi * np.arange(_TURNS + 1) / _TURNS,
    )
    ring = np.column_stack([np.cos(round_), np.sin(round_)])
    points = np.stack(
        [np.column_stack([np.sin(t) * ring, np.full(_TURNS + 1, np.cos(t))]) for t in across]
    )
    a, b, c, e = points[1:, :-1], points[1:, 1:], points[:-1, 1:], points[:-1, :-1]
    quads = [np.stack(f, axis=2).reshape(-1, 3, 3) for f in ((a, b, c), (a, c, e))]
    return np.concatenate(quads)
