"""Solids of a scene: convex primitives, half-spaces and closed triangle meshes, with coal shapes.

Everything a scene file can say is reduced to these five; openings and pipes become boxes
(`scene.openings`).
"""

from dataclasses import dataclass, field
from typing import Any

import coal
import numpy as np

from snakegen.base.geometry import Floats

KINDS = ("box", "cylinder", "sphere", "half_space", "mesh")


@dataclass(frozen=True, eq=False)
class Solid:
    """A rigid obstacle.

    Attributes:
        name: of the solid; parts of one obstacle are named ``ceiling.1``, ``ceiling.2``.
        kind: one of `KINDS`.
        centre: (3,) m, world; of a half-space a point on its face.
        rotation: (3, 3) attitude; a cylinder's axis and a half-space's outward normal are z.
        size: box: half lengths (3,); cylinder: radius, half length; sphere: radius [m].
        vertices, faces: of a mesh, (n, 3) m in its own axes and (m, 3) indices.
    """

    name: str
    kind: str
    centre: Floats
    rotation: Floats = field(default_factory=lambda: np.eye(3))
    size: tuple[float, ...] = ()
    vertices: Floats | None = None
    faces: Any = None

    def shape(self) -> Any:
        """Returns coal's shape of it, in its own axes."""
        if self.kind == "box":
            return coal.Box(*(2.0 * np.array(self.size)))
        if self.kind == "cylinder":
            return coal.Cylinder(self.size[0], 2.0 * self.size[1])
        if self.kind == "sphere":
            return coal.Sphere(self.size[0])
        if self.kind == "half_space":
            return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
        model = coal.BVHModelOBBRSS()
        model.beginModel(len(self.faces), len(self.vertices if self.vertices is not None else ()))
        model.addVertices(np.asfortranarray(self.vertices))
        model.addTriangles(np.asfortranarray(self.faces, dtype=np.int64))
        model.endModel()
        return model

    def distances(self, points: Floats) -> Floats:
        """Returns signed distances (m,) [m] of world points (m, 3) from its surface.

        Exact outside; inside a box or cylinder minus the depth. Meshes: unsigned, from their
        surface, within the spacing of its samples.
        """
        local = (points - self.centre) @ self.rotation
        if self.kind == "half_space":
            return np.asarray(local[:, 2])
        if self.kind == "sphere":
            return np.asarray(np.linalg.norm(local, axis=1) - self.size[0])
        if self.kind == "box":
            gap = np.abs(local) - np.array(self.size)
        elif self.kind == "cylinder":
            across = np.hypot(local[:, 0], local[:, 1]) - self.size[0]
            gap = np.stack([across, np.abs(local[:, 2]) - self.size[1]], axis=1)
        else:
            return self._from_surface(local)
        outside = np.linalg.norm(np.maximum(gap, 0.0), axis=1)
        return np.asarray(outside + np.minimum(gap.max(axis=1), 0.0))

    def _from_surface(self, local: Floats) -> Floats:
        """Returns unsigned distances (m,) [m] of points in the mesh's axes from its samples."""
        from scipy.spatial import cKDTree

        samples = _samples(np.asarray(self.vertices), np.asarray(self.faces), 0.02)
        return np.asarray(cKDTree(samples).query(local)[0])

    def bounds(self) -> tuple[Floats, Floats] | None:
        """Returns the least and greatest corner (3,) [m, world]; None where it has no end."""
        if self.kind == "half_space":
            return None
        if self.kind == "mesh":
            points = np.asarray(self.vertices) @ self.rotation.T + self.centre
            return points.min(axis=0), points.max(axis=0)
        half = {
            "box": lambda s: np.array(s),
            "cylinder": lambda s: np.array([s[0], s[0], s[1]]),
            "sphere": lambda s: np.full(3, s[0]),
        }[self.kind](self.size)
        reach = np.abs(self.rotation) @ half
        return self.centre - reach, self.centre + reach

    def to_json(self) -> dict[str, Any]:
        """Returns plain data: `from_json` reads it back."""
        out: dict[str, Any] = {
            "name": self.name,
            "kind": self.kind,
            "centre": [float(x) for x in self.centre],
            "rotation": [[float(x) for x in row] for row in self.rotation],
            "size": [float(x) for x in self.size],
        }
        if self.kind == "mesh":
            out["vertices"] = np.asarray(self.vertices).tolist()
            out["faces"] = np.asarray(self.faces).tolist()
        return out


def from_json(data: dict[str, Any]) -> Solid:
    """Returns the solid of `Solid.to_json`'s data."""
    mesh = data["kind"] == "mesh"
    return Solid(
        str(data["name"]),
        str(data["kind"]),
        np.array(data["centre"], float),
        np.array(data["rotation"], float),
        tuple(float(x) for x in data["size"]),
        np.array(data["vertices"], float) if mesh else None,
        np.array(data["faces"], np.int64) if mesh else None,
    )


def _samples(vertices: Floats, faces: Any, spacing: float) -> Floats:
    """Returns points (n, 3) on triangles, about `spacing` [m] apart."""
    corner = vertices[faces]
    sides = corner[:, [1, 2]] - corner[:, [0]]
    longest = np.linalg.norm(np.diff(corner[:, [0, 1, 2, 0]], axis=1), axis=2).max(axis=1)
    out = [vertices]
    for level in np.unique(steps := np.clip(np.ceil(longest / spacing), 1, 200).astype(int)):
        a, b = np.meshgrid(np.arange(level + 1), np.arange(level + 1))
        weights = np.stack([a, b], axis=-1)[(a + b) <= level] / level
        mine = steps == level
        points = corner[mine, None, 0] + np.einsum("wk,tkd->twd", weights, sides[mine])
        out.append(points.reshape(-1, 3))
    return np.concatenate(out)
