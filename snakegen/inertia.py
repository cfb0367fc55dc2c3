"""Inertia of solids from mass and size, about the centre of mass; x is the long axis."""

import math
from pathlib import Path
from typing import Any, NamedTuple

Diagonal = tuple[float, float, float]
Triple = tuple[float, float, float]


class Filled(NamedTuple):
    """A filled mesh of mass 1 kg."""

    com: Triple  # m, mesh axes
    inertia: tuple[float, ...]  # m² (kg m² a kg), Ixx Iyy Izz Ixy Ixz Iyz about the centre of mass
    box_size: Triple  # m, of its bounding box
    box_centre: Triple  # m


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


def filled_mesh(path: Path) -> Filled:
    """Returns the mass properties of the solid that a mesh file bounds, its density uniform.

    Raises:
        ValueError: no such file, no mesh in it, or a surface that is not closed.
    """
    import trimesh

    if not path.is_file():
        raise ValueError(f"{path.name}: no such file in {path.parent}")
    try:
        mesh = trimesh.load_mesh(path)
    except Exception as error:
        raise ValueError(f"{path.name}: no mesh that trimesh reads ({error})") from None
    if not getattr(mesh, "is_watertight", False) or mesh.volume <= 0.0:
        raise ValueError(
            f"{path.name}: not closed with outward normals, so it has no volume to spread a mass "
            "over; close it"
        )
    tensor = mesh.moment_inertia / mesh.volume
    six = (*tensor.diagonal(), tensor[0, 1], tensor[0, 2], tensor[1, 2])
    low, high = mesh.bounds
    return Filled(
        _digits(mesh.center_mass), _digits(six), _digits(high - low), _digits(0.5 * (high + low))
    )


def _digits(values: object) -> Any:
    """Returns floats of twelve digits: the last bits differ between machines."""
    return tuple(float(f"{x:.12g}") + 0.0 for x in values)  # type: ignore[attr-defined]
