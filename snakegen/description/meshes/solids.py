"""Closed solids that parts are made of: lofts, prisms and turned bodies, each watertight."""

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh
from trimesh.creation import revolve

Array = NDArray[np.float64]

ABOUT_X = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Turns z into x, x into y and y into z: for bodies turned about z that should lie along x."""

ABOUT_Y = ABOUT_X.T
"""Turns z into y, x into z and y into x: for bodies turned about z that should lie along y."""


def loft(rings: Array) -> Trimesh:
    """Joins convex rings of points into one closed solid.

    Args:
        rings: (m, k, 3) [m]: m rings of k points, all going round in the same sense.

    Returns:
        The solid between the first and the last ring, both capped; outward normals.
    """
    m, k, _ = rings.shape
    column = np.arange(k)
    beside = (column + 1) % k
    faces = []
    for row in range(m - 1):
        a, b = row * k, (row + 1) * k
        faces.append(np.stack([a + column, a + beside, b + beside], axis=1))
        faces.append(np.stack([a + column, b + beside, b + column], axis=1))
    fan = np.arange(1, k - 1)
    last = (m - 1) * k
    faces.append(np.stack([np.zeros_like(fan), fan + 1, fan], axis=1))
    faces.append(np.stack([last + np.zeros_like(fan), last + fan, last + fan + 1], axis=1))
    return _outward(Trimesh(rings.reshape(-1, 3), np.concatenate(faces), process=False))


def prism(outline: Array, axis: str, low: float, high: float) -> Trimesh:
    """Returns the prism of a convex outline.

    Args:
        outline: (k, 2) [m] in the other two axes, in the order x, y, z.
        axis: direction of the prism, ``x``, ``y`` or ``z``.
        low: where it begins on that axis [m].
        high: where it ends [m].
    """
    place = "xyz".index(axis)
    rings = [np.insert(outline, place, height, axis=1) for height in (low, high)]
    return loft(np.array(rings))


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Trimesh:
    """Returns the box between two corners [m]."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    return prism(np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]), "z", z0, z1)


def turned(profile: Array, sections: int = 32, turn: Array | None = None) -> Trimesh:
    """Turns a profile about z.

    Args:
        profile: (k, 2) [m], radius and height; it either begins and ends at radius 0, or is a
            closed outline (first point repeated) off the axis.
        sections: facets round the axis.
        turn: (3, 3) rotation applied afterwards, e.g. `ABOUT_X`.
    """
    solid = _outward(revolve(profile, sections=sections))
    if turn is not None:
        solid = Trimesh(solid.vertices @ turn.T, solid.faces, process=False)
    return solid


def cylinder(
    radius: float, low: float, high: float, axis: str = "z", sections: int = 24, bore: float = 0.0
) -> Trimesh:
    """Returns a cylinder, or a tube if `bore` > 0, between two places on an axis [m]."""
    profile = [[bore, low], [radius, low], [radius, high], [bore, high]]
    if bore > 0.0:
        profile.append(profile[0])
    turn = {"x": ABOUT_X, "y": ABOUT_Y, "z": None}[axis]
    return turned(np.array(profile), sections, turn)


def moved(solid: Trimesh, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Trimesh:
    """Returns the solid shifted by (x, y, z) [m]."""
    return Trimesh(solid.vertices + np.array([x, y, z]), solid.faces, process=False)


def mirrored(solid: Trimesh) -> Trimesh:
    """Returns the solid with y turned into −y, normals still outward."""
    return Trimesh(solid.vertices * [1.0, -1.0, 1.0], solid.faces[:, ::-1], process=False)


def joined(*solids: Trimesh) -> Trimesh:
    """Returns several closed solids as one mesh: watertight, overlaps counted twice in volume."""
    counts = np.cumsum([0] + [len(solid.vertices) for solid in solids])
    faces = [solid.faces + count for solid, count in zip(solids, counts, strict=False)]
    vertices = [solid.vertices for solid in solids]
    return Trimesh(np.concatenate(vertices), np.concatenate(faces), process=False)


def _outward(solid: Trimesh) -> Trimesh:
    if solid.volume < 0.0:
        return Trimesh(solid.vertices, solid.faces[:, ::-1], process=False)
    return solid
