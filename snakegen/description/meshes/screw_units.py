"""The meshes of a robot's drums: unlike fans they cannot be scaled, for a helix has an angle."""

import math
from typing import Any

from trimesh import Trimesh

from snakegen.description.meshes import solids
from snakegen.description.meshes.parts import screw_drum


def drum_meshes(resolved: dict[str, Any]) -> dict[str, Trimesh]:
    """Returns the meshes of a resolved spec's drums by name, one for each helix angle.

    Blades run through the wheels where these stand on blades; wheels in a ring get a bare hub.
    """
    part = resolved.get("screw_drive")
    if part is None:
        return {}
    out = {}
    for i, alpha in enumerate(part["alpha"]):
        if alpha not in part["alpha"][:i]:
            out[f"screw_drum_{i + 1}"] = _drum(part, alpha, part["wheels"][i])
    return out


def _drum(part: dict[str, Any], alpha: float, wheels: dict[str, Any]) -> Trimesh:
    radius, length = part["radius"], part["length"]
    if part["rollers"] != "helix_capsule":
        rim = radius - 2.0 * part["wheel_radius"]
        return solids.joined(
            solids.cylinder(0.5 * radius, -0.5 * length, 0.5 * length, "x", 32),
            solids.cylinder(rim, -part["wheel_radius"], part["wheel_radius"], "x", 32),
        )
    _, y, z = wheels["position"][0]
    return screw_drum(
        radius,
        length,
        alpha,
        blades=part["blades"],
        wheels_per_blade=0,
        axle_radius=math.hypot(y, z),
    )
