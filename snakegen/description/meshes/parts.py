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


def _positive(**values: float) -> None:
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0):
            raise DescriptionError(f"a mesh needs {name} > 0, not {value!r}.")


def _circle(start: float, stop: float, count: int) -> list[tuple[float, float]]:
    angles = np.radians(np.linspace(start, stop, count))
    return [(float(np.cos(a)), float(np.sin(a))) for a in angles]
