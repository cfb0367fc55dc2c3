"""Solids of a scene as MuJoCo geoms, so that contact with them is real."""

from typing import Any

import mujoco
import numpy as np

from snakegen.base.geometry import Floats, quaternion_xyzw, wxyz_from_xyzw
from snakegen.scene.solids import Solid
from snakegen.simulation.flight.plan import Box

_FAR = 30.0  # m, half width of a half-space's block
_DEEP = 1.0  # m, half its depth
_SHEET = 1e-3  # m, thickness of a mesh's triangle, inward


def add_obstacle(spec: mujoco.MjSpec, one: Box | Solid) -> None:
    """Adds an obstacle's geoms to the world.

    A half-space becomes a block; a mesh that is not convex a sheet for each of its triangles, since
    MuJoCo collides with hulls alone.
    """
    kind = mujoco.mjtGeom
    if isinstance(one, Box):
        spec.worldbody.add_geom(
            name=one.name, type=kind.mjGEOM_BOX, pos=one.centre, size=one.half,
            quat=[np.cos(0.5 * one.roll), np.sin(0.5 * one.roll), 0.0, 0.0],
        )  # fmt: skip
        return
    place: dict[str, Any] = {"pos": one.centre, "quat": _quaternion(one.rotation)}
    if one.kind == "mesh":
        for k, part in enumerate(_parts(one), 1):
            name = f"{one.name}.{k}"
            spec.add_mesh(
                name=name,
                uservert=part.ravel(),
                inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX,
            )
            spec.worldbody.add_geom(name=name, type=kind.mjGEOM_MESH, meshname=name, **place)
        return
    if one.kind == "half_space":
        place["pos"] = one.centre - _DEEP * one.rotation[:, 2]
    shape, size = {
        "box": (kind.mjGEOM_BOX, one.size),
        "cylinder": (kind.mjGEOM_CYLINDER, [*one.size, 0.0]),
        "sphere": (kind.mjGEOM_SPHERE, [*one.size, 0.0, 0.0]),
        "half_space": (kind.mjGEOM_BOX, [_FAR, _FAR, _DEEP]),
    }[one.kind]
    spec.worldbody.add_geom(name=one.name, type=shape, size=size, **place)


def _parts(one: Solid) -> list[Floats]:
    """Returns vertices (v, 3) of convex parts that have the mesh's surface."""
    import trimesh

    vertices, faces = np.asarray(one.vertices), np.asarray(one.faces)
    if trimesh.Trimesh(vertices, faces, process=False).is_convex:
        return [vertices]
    corners = vertices[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normal, axis=1)
    inward = -_SHEET * normal / np.maximum(size, 1e-12)[:, None]
    return [
        np.concatenate([c, c + i])
        for c, i, s in zip(corners, inward, size, strict=True)
        if s > 1e-12
    ]


def _quaternion(rotation: Floats) -> Floats:
    return np.asarray(wxyz_from_xyzw(quaternion_xyzw(rotation)))


def described(one: Box | Solid) -> dict[str, Any]:
    """Returns an obstacle for the log: plain data, `rotation` (3, 3) where it is turned."""
    if isinstance(one, Box):
        return vars(one)
    out = one.to_json()
    if one.kind == "box":
        out["half"] = out["size"]
    return out
