"""Inertia of solids from mass and size, about the centre of mass; x is the long axis."""

import math
from collections.abc import Sequence

import numpy as np

Diagonal = tuple[float, float, float]
SERVO_DENSITY = 1260.0  # kg/m³, of the cross of DRAGON with its two servos


def cylinder(mass: float, radius: float, length: float) -> Diagonal:
    """Returns (Ixx, Iyy, Izz) [kg·m²] of a solid cylinder along x; `radius`, `length` in m."""
    across = mass * (3.0 * radius**2 + length**2) / 12.0
    return 0.5 * mass * radius**2, across, across


def tube(mass: float, radius: float, wall: float, length: float) -> Diagonal:
    """Returns (Ixx, Iyy, Izz) [kg·m²] of a tube along x: outer `radius`, thickness `wall` in m."""
    squares = radius**2 + max(radius - wall, 0.0) ** 2
    across = mass * (3.0 * squares + length**2) / 12.0
    return 0.5 * mass * squares, across, across


def box(mass: float, size: tuple[float, float, float]) -> Diagonal:
    """Returns (Ixx, Iyy, Izz) [kg·m²] of a solid box of edges `size` [m] along x, y, z."""
    x, y, z = (s * s for s in size)
    return mass * (y + z) / 12.0, mass * (x + z) / 12.0, mass * (x + y) / 12.0


def joint_cross(mass: float, gap: float, radius: float) -> Diagonal:
    """Returns (Ixx, Iyy, Izz) [kg·m²] of a two-axis joint's cross, filled evenly.

    As templates/parts/joint.xacro shows it: a web along x, and across each end a drum with a
    thinner axle through it, one along y, one along z. Its pins reach 15 mm beyond axes `gap` [m]
    apart; it is larger where that encloses less than its mass takes at the density of servos, or
    does not stand out of rods of `radius` [m].
    """
    width, ends = 0.252, np.zeros(3)
    web = volume = 0.64 * width**2
    for wide, length in ((0.18, 0.6), (0.081, 0.84)):
        one = math.pi * wide**2 * length
        axial, side, _ = cylinder(one, wide, length)
        far = one * 0.32**2  # from the middle
        ends += [side, axial + far, side + far]
        volume += 2.0 * one
    size = max(gap + 0.03, 3.3 * radius, (mass / (SERVO_DENSITY * volume)) ** (1.0 / 3.0))
    unit = np.array(box(web, (0.64, width, width))) + ends + ends[[0, 2, 1]]
    xx, yy, zz = (float(x) for x in unit * mass / volume * size**2)
    return xx, yy, zz


def sphere(mass: float, radius: float) -> Diagonal:
    """Returns (Ixx, Iyy, Izz) [kg·m²] of a solid sphere."""
    one = 0.4 * mass * radius**2
    return one, one, one


def obeys_triangle(diagonal: Diagonal, tolerance: float = 1e-9) -> bool:
    """Tells whether principal moments belong to a real body: positive, none above the other two."""
    a, b, c = sorted(diagonal)
    return all(map(math.isfinite, diagonal)) and a > 0.0 and c <= (a + b) * (1.0 + tolerance)


def principal(moments: Sequence[float]) -> Diagonal:
    """Returns the principal moments of Ixx Iyy Izz, or of Ixx Iyy Izz Ixy Ixz Iyz [kg·m²]."""
    if len(moments) == 3:
        return moments[0], moments[1], moments[2]
    xx, yy, zz, xy, xz, yz = moments
    low, middle, high = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return float(low), float(middle), float(high)
