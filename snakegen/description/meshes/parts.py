"""Meshes where they help the eye, and inertias of solids; everything is drawn, nothing is stored.

Rotors push along +z, links and drums lie along x. Meshes of unit size are scaled by the templates.
"""

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh

from snakegen.base.atomic_io import write_atomically
from snakegen.description.meshes import solids
from snakegen.description.meshes.blades import fan_blade, ridge, wheel
from snakegen.errors import DescriptionError
from snakegen.spec import inertia

Array = NDArray[np.float64]


def ducted_fan(
    diameter: float = 1.0, height: float = 0.7, blades: int = 12, *, spin: int = 1
) -> Trimesh:
    """Returns a ducted fan round the origin, air drawn in from above, thrust along +z.

    Args:
        diameter: outer diameter of the duct's lip [m].
        height: of the duct [m].
        blades: count of rotor blades; the stator behind them has 5 vanes.
        spin: +1 for a rotor that turns counter-clockwise about +z, −1 for its mirror image.

    Raises:
        DescriptionError: a size that is not positive, or a fan without blades.
    """
    _positive(diameter=diameter, height=height, blades=blades)
    r, h = 0.5 * diameter, height
    lip = [(r * (0.95 + 0.05 * c), h * (0.44 + 0.06 * s)) for c, s in _circle(0, 180, 7)]
    duct = [(0.86 * r, -0.5 * h), (0.92 * r, -0.5 * h), (0.94 * r, 0.3 * h), *lip]
    duct += [(0.88 * r, 0.36 * h), (0.88 * r, 0.0), (0.86 * r, -0.5 * h)]
    nose = [(0.26 * r * c, h * (0.2 + 0.22 * s)) for c, s in _circle(0, 90, 6)]
    hub = [(0.0, -0.46 * h), (0.16 * r, -0.42 * h), (0.26 * r, -0.2 * h), *nose[:-1]]
    hub.append((0.0, 0.42 * h))
    parts = [solids.turned(np.array(duct), 48), solids.turned(np.array(hub), 24)]
    span = np.linspace(0.22 * r, 0.875 * r, 4)
    for angle in np.arange(blades) * (2 * math.pi / blades):
        chord = min(0.34, 3.4 / blades) * r * np.linspace(1.0, 0.8, 4)
        twist = np.radians(np.linspace(52.0, 26.0, 4))
        parts.append(fan_blade(span, chord, twist, angle, 0.2 * h))
    for angle in np.arange(5) * (2 * math.pi / 5):
        chord, twist = np.full(4, 0.22 * h), np.radians(np.full(4, 97.0))
        parts.append(fan_blade(span, chord, twist, angle, -0.3 * h))
    fan = solids.joined(*parts)
    return fan if spin > 0 else solids.mirrored(fan)


def joint_cross(size: float = 1.0) -> Trimesh:
    """Returns the cross of a two-axis joint: pin along y at −0.32 size, pin along z at +0.32 size.

    Args:
        size: extent along x [m]; the origin is midway between the two axes.
    """
    _positive(size=size)
    r, pin = 0.18 * size, 0.32 * size
    parts = [solids.box((-pin, -0.7 * r, -0.7 * r), (pin, 0.7 * r, 0.7 * r))]
    for axis, x in (("y", -pin), ("z", pin)):
        body = solids.cylinder(r, -0.3 * size, 0.3 * size, axis)
        axle = solids.cylinder(0.45 * r, -0.42 * size, 0.42 * size, axis, 16)
        parts += [solids.moved(body, x), solids.moved(axle, x)]
    return solids.joined(*parts)


def u_bracket(width: float, reach: float, *, axis: str = "y") -> Trimesh:
    """Returns a fork: a plate at x = 0, two arms, and holes' bosses on the joint axis at x = reach.

    Args:
        width: outer width along the joint axis [m].
        reach: distance from the plate to the joint axis [m].
        axis: the joint axis, ``y`` or ``z``.

    Raises:
        DescriptionError: a size that is not positive or another axis.
    """
    _positive(width=width, reach=reach)
    if axis not in ("y", "z"):
        raise DescriptionError(f"a bracket's joint axis is 'y' or 'z', not {axis!r}.")
    wall, r, half = 0.1 * width, 0.28 * width, 0.5 * width
    plate = solids.box((0.0, -half, -r), (wall, half, r))
    parts = [plate]
    for side in (-1.0, 1.0):
        inner, outer = side * (half - wall), side * half
        low, high = min(inner, outer), max(inner, outer)
        boss = solids.cylinder(0.5 * r, low - 0.4 * wall, high + 0.4 * wall, "y")
        parts += [solids.prism(solids.stadium(0.3 * wall, reach, r), "y", low, high)]
        parts += [solids.moved(boss, reach)]
    fork = solids.joined(*parts)
    if axis == "z":
        turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
        fork = Trimesh(fork.vertices @ turn.T, fork.faces, process=False)
    return fork


def gimbal_ring(inner_radius: float, width: float, *, pins: float = 0.25) -> Trimesh:
    """Returns a ring round the x axis with two pins along y.

    Args:
        inner_radius: of the ring [m].
        width: along x [m].
        pins: length of a pin over the inner radius.
    """
    _positive(inner_radius=inner_radius, width=width, pins=pins)
    outer = 1.16 * inner_radius
    ring = solids.cylinder(outer, -0.5 * width, 0.5 * width, "x", 48, bore=inner_radius)
    low, high = 1.06 * inner_radius, 1.16 * inner_radius + pins * inner_radius
    right = solids.cylinder(0.35 * width, low, high, "y", 16)
    left = solids.cylinder(0.35 * width, -high, -low, "y", 16)
    return solids.joined(ring, left, right)


def apparatus_yoke(tube_radius: float, offset: float, width: float) -> Trimesh:
    """Returns the roll module: a sleeve on the link's tube and two posts up to the pitch axis.

    Args:
        tube_radius: of the link's tube along x [m].
        offset: height of the pitch axis (along y) over the tube's axis [m].
        width: outer distance of the posts along y [m].
    """
    _positive(tube_radius=tube_radius, offset=offset, width=width)
    sleeve = 1.45 * tube_radius
    post, half = 0.08 * width, 0.5 * width
    parts = [solids.cylinder(sleeve, -1.5 * sleeve, 1.5 * sleeve, "x", 32, bore=tube_radius)]
    # the foot stays over the bore, so that the tube passes
    foot = max(tube_radius, 0.2 * offset)
    parts.append(
        solids.box((-0.6 * sleeve, -half, foot), (0.6 * sleeve, half, foot + 0.5 * sleeve))
    )
    # a little inside the foot: edges that coincide would weld into edges of four faces
    base, top = foot + 0.1 * sleeve, max(offset, foot + 0.5 * sleeve)
    outline = solids.stadium(base, top, 0.55 * sleeve)[:, ::-1]
    for side in (-1.0, 1.0):
        low, high = sorted((side * (half - post), side * half))
        parts.append(solids.prism(outline, "y", low, high))
        eye = solids.cylinder(0.35 * sleeve, low - 0.3 * post, high + 0.3 * post, "y", 16)
        parts.append(solids.moved(eye, z=offset))
    return solids.joined(*parts)


def screw_drum(
    radius: float,
    length: float,
    helix_angle: float,
    *,
    hand: int = 1,
    blades: int = 8,
    wheels_per_blade: int = 4,
    axle_radius: float | None = None,
) -> Trimesh:
    """Returns a drum along x with helical blades and the outline of the wheels on them.

    A blade at azimuth t about x follows ``t = t0 + x tan(α) / r``, so that at the ground it points
    along ``[cos α, sin α]``, the wheels' axles of HA eq 3.

    Args:
        radius: where the wheels touch the ground [m].
        length: of the drum along x, centred [m].
        helix_angle: α [rad], below 90° either way.
        hand: ±1, multiplies α.
        blades: count of blades.
        wheels_per_blade: wheels on each; 0 when the wheels are bodies of their own.
        axle_radius: where the blades run along the axles [m]; `radius` if absent.

    Raises:
        DescriptionError: a size that is not positive, or an angle of 90° and more.
    """
    _positive(radius=radius, length=length, blades=blades)
    if not abs(helix_angle) < math.pi / 2:
        raise DescriptionError(f"the helix angle {helix_angle:g} rad must be within ±π/2.")
    slope = math.tan(helix_angle * (1 if hand > 0 else -1)) / (axle_radius or radius)
    parts = [solids.cylinder(0.5 * radius, -0.5 * length, 0.5 * length, "x", 32)]
    for cap in (-0.5 * length, 0.47 * length):
        parts.append(solids.cylinder(0.62 * radius, cap, cap + 0.03 * length, "x", 32))
    wheel_x = (np.arange(wheels_per_blade) + 0.5) / max(wheels_per_blade, 1) * length - length / 2
    for t0 in np.arange(blades) * (2 * math.pi / blades) - math.pi / 2:
        x = np.linspace(-0.47 * length, 0.47 * length, 9)
        parts.append(ridge(x, t0 + slope * x, 0.45 * radius, 0.82 * radius, 0.045 * radius))
        for place in wheel_x:
            t = t0 + slope * place
            parts.append(wheel(place, t, math.atan(slope * radius), radius, length))
    return solids.joined(*parts)


def unit_meshes() -> dict[str, Trimesh]:
    """Returns the meshes that the templates scale: ``ducted_fan`` and ``joint_cross`` of size 1."""
    return {"ducted_fan": ducted_fan(), "joint_cross": joint_cross()}


def write_meshes(folder: str | Path, meshes: Mapping[str, Trimesh]) -> dict[str, Path]:
    """Writes each mesh as ``folder/name.stl``; the same mesh always gives the same bytes.

    Coordinates are rounded to 1 µm, so that the last bit of a sine does not reach the file.

    Args:
        folder: made when absent.
        meshes: by file name without the ending.

    Returns:
        The paths by name.
    """
    paths = {name: Path(folder) / f"{name}.stl" for name in meshes}
    for name, mesh in meshes.items():
        write_atomically(paths[name], stl_bytes(mesh))
    return paths


def stl_bytes(mesh: Trimesh) -> bytes:
    """Returns a mesh as binary STL: 80 bytes of header, a count, 50 bytes a triangle."""
    corners = np.round(np.asarray(mesh.vertices)[np.asarray(mesh.faces)], 6) + 0.0
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    corners, normal, size = (a[size[:, 0] > 0] for a in (corners, normal, size))
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("zero", "<u2")])
    rows = np.zeros(len(corners), record)
    # a rounded unit normal is plenty for shading and does not carry the last bit either
    rows["normal"] = np.round(normal / size, 4) + 0.0
    rows["corners"] = corners
    header = b"binary STL, metres, made by snakegen".ljust(80, b"\0")
    return header + np.uint32(len(rows)).astype("<u4").tobytes() + rows.tobytes()


def box_inertia(mass: float, size: tuple[float, float, float]) -> Array:
    """Returns the (3, 3) inertia [kg m²] about its centre of a box of edges `size` [m]."""
    return np.diag(inertia.box(mass, size))


def cylinder_inertia(mass: float, radius: float, length: float) -> Array:
    """Returns the (3, 3) inertia [kg m²] about its centre of a solid cylinder along x."""
    return np.diag(inertia.cylinder(mass, radius, length))


def tube_inertia(mass: float, outer_radius: float, inner_radius: float, length: float) -> Array:
    """Returns the (3, 3) inertia [kg m²] about its centre of a tube along x."""
    return np.diag(inertia.tube(mass, outer_radius, outer_radius - inner_radius, length))


def mesh_inertia(mesh: Trimesh, mass: float) -> tuple[Array, Array]:
    """Returns the centre of mass (3,) [m] and the (3, 3) inertia about it of a filled mesh.

    Args:
        mesh: a closed mesh with outward normals; its density is uniform.
        mass: of the whole [kg].

    Raises:
        DescriptionError: a mesh with holes or without volume, whose inertia means nothing.
    """
    if not mesh.is_watertight or mesh.volume <= 0.0:
        raise DescriptionError(
            "the mesh is not closed with outward normals, so it has no volume to spread a mass "
            "over; close it, or give the inertia."
        )
    properties = mesh.mass_properties
    return np.array(properties.center_mass), np.array(properties.inertia) * (mass / mesh.volume)


def _positive(**values: float) -> None:
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0):
            raise DescriptionError(f"a mesh needs {name} > 0, not {value!r}.")


def _circle(start: float, stop: float, count: int) -> list[tuple[float, float]]:
    angles = np.radians(np.linspace(start, stop, count))
    return [(float(np.cos(a)), float(np.sin(a))) for a in angles]
