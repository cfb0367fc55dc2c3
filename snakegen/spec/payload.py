"""A payload drawn by a mesh file: which files may be named, and what such a solid weighs where."""

import re
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

from snakegen.base.bounded_text import what_is_there

Triple = tuple[float, float, float]

FOLDER = "meshes"  # next to the URDF
MAX_BYTES = 10_000_084  # an STL of 200,000 triangles
_TAKEN = ("ducted_fan", "joint_cross")  # names of meshes that a build draws itself
_NAME = re.compile(r"[A-Za-z0-9_.-]+")


class Filled(NamedTuple):
    """A filled mesh of mass 1 kg."""

    com: Triple  # m, mesh axes
    inertia: tuple[float, ...]  # m² (kg·m² a kg), Ixx Iyy Izz Ixy Ixz Iyz about the centre of mass
    box_size: Triple  # m, of its bounding box
    box_centre: Triple  # m


def target(name: str) -> str:
    """Returns where a build puts the mesh `name`, relative to the URDF."""
    return f"{FOLDER}/{PurePosixPath(name).name}"


def locate(name: str, folder: Path) -> Path:
    """Returns the file of the mesh that a spec in `folder` names.

    Raises:
        ValueError: outside the folder, missing, or of a kind that some reader of the URDF refuses.
    """
    path = PurePosixPath(name)
    here = folder.resolve()
    outside = path.is_absolute() or "\\" in name or ":" in name or ".." in path.parts
    if outside or not (here / path).resolve().is_relative_to(here):
        raise ValueError(
            f"payload.mesh: '{name}' is outside the spec's folder; put the file next to the spec "
            f"and write '{re.split(r'[/:]', name.replace(chr(92), '/'))[-1]}'"
        )
    if path.suffix.lower() not in (".stl", ".obj"):
        raise ValueError(
            f"payload.mesh: '{name}' is neither .stl nor .obj, which every reader of a URDF takes"
        )
    if not _NAME.fullmatch(path.name) or path.stem in _TAKEN or path.stem.startswith("screw"):
        raise ValueError(
            f"payload.mesh: the name '{path.name}' cannot be used; write letters, digits, _ and -, "
            f"and none of {', '.join(_TAKEN)}, screw…"
        )
    if not (here / path).is_file():
        there = what_is_there(here / path)
        raise ValueError(f"payload.mesh: '{name}' in {folder}: {there}")
    size = (here / path).stat().st_size
    if size > MAX_BYTES:
        raise ValueError(
            f"payload.mesh: '{name}' has {size / 1e6:.4g} MB; up to {MAX_BYTES / 1e6:g} MB are "
            "read (an STL of 200,000 triangles, as many as MuJoCo takes): simplify it"
        )
    if path.suffix.lower() == ".stl" and not _is_binary(here / path):
        raise ValueError(
            f"payload.mesh: '{name}' is no binary STL, the only kind that MuJoCo reads; convert it"
        )
    return here / path


def _is_binary(path: Path) -> bool:
    """Tells whether an STL file is as long as its count of triangles says."""
    with path.open("rb") as file:
        head = file.read(84)
    return len(head) == 84 and path.stat().st_size == 84 + 50 * int.from_bytes(head[80:], "little")


def filled(path: Path) -> Filled:
    """Returns the mass properties of the solid that a mesh file bounds, its density uniform.

    Raises:
        ValueError: no such file, no mesh in it, or a surface that is not closed.
    """
    import trimesh

    try:
        mesh = trimesh.load_mesh(path)
    except Exception as error:
        raise ValueError(
            f"payload.mesh: {path.name} is no mesh that trimesh reads ({error})"
        ) from None
    if not getattr(mesh, "is_watertight", False) or mesh.volume <= 0.0:
        raise ValueError(
            f"payload.mesh: {path.name} is not closed with outward normals, so it has no volume to "
            "spread a mass over; close it, or leave it out and give a sphere"
        )
    tensor = mesh.moment_inertia / mesh.volume
    six = (*tensor.diagonal(), tensor[0, 1], tensor[0, 2], tensor[1, 2])
    low, high = mesh.bounds
    return Filled(
        _digits(mesh.center_mass), _digits(six), _digits(high - low), _digits(0.5 * (high + low))
    )


def _digits(values: Any) -> Any:
    """Returns floats of twelve digits: the last bits differ between machines."""
    return tuple(float(f"{x:.12g}") + 0.0 for x in values)
