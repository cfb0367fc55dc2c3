"""Inertia of solids from mass and size, about the centre of mass; x is the long axis."""

import math
from collections.abc import Sequence

import numpy as np

Diagonal = tuple[float, float, float]


def cylinder(mass: float, radius: float, length: float) -> Diagonal:
    """Returns (Ixx, Iyy, Izz) [kg m²] of a solid cylinder along x; `radius`, `length` in m."""
    across = mass * (3.0 * radius**2 + length**2) / 12.0
    return 0.5 * mass * radius**2, across, across


def tube(mass: float, radius: float, wall: float, length: float) -> Diagonal:
    """Returns (Ixx, Iyy, Izz) [kg m²] of a tube along x: outer `radius`, thickness `wall` in m."""
    squares = radius**2 + max(radius - wall, 0.0) ** 2
    across = mass * (3.0 * squares + length**2) / 12.0
    return 0.5 * mass * squares, across, across


def box(mass: float, size: tuple[float, float, float]) -> Diagonal:
    """Returns (Ixx, Iyy, Izz) [kg m²] of a solid box of edges `size` [m] along x, y, z."""
    x, y, z = (s * s for s in size)
    return mass * (y + z) / 12.0, mass * (x + z) / 12.0, mass * (x + y) / 12.0


def sphere(mass: float, radius: float) -> Diagonal:
    """Returns (Ixx, Iyy, Izz) [kg m²] of a solid sphere."""
    one = 0.4 * mass * radius**2
    return one, one, one


def obeys_triangle(diagonal: Diagonal, tolerance: float = 1e-9) -> bool:
    """Tells whether principal moments belong to a real body: positive, none above the other two."""
    a, b, c = sorted(diagonal)
    return all(map(math.isfinite, diagonal)) and a > 0.0 and c <= (a + b) * (1.0 + tolerance)


def principal(moments: Sequence[float]) -> Diagonal:
    """Returns the principal moments of Ixx Iyy Izz, or of Ixx Iyy Izz Ixy Ixz Iyz [kg m²]."""
    if len(moments) == 3:
        return moments[0], moments[1], moments[2]
    xx, yy, zz, xy, xz, yz = moments
    low, middle, high = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return float(low), float(middle), float(high)
