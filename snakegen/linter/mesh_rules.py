"""The rules of the linter about declared inertias against the meshes that a link shows.

Closed STL meshes and primitives are read by `triangle_solids`, the rest by yourdfpy as a trimesh
scene. A body whose mass lies inside the convex hull of its shapes has, about an axis a through its
centre of mass c,
``I_a ≤ m · max ‖(p − c) × a‖²`` over the hull's points p: whatever lies above that is no body's.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats, rotation_from_rpy
from snakegen.linter.body_rules import DENSE, THIN
from snakegen.linter.file_rules import resolve_package
from snakegen.linter.finding import Finding, finding, label, number, numbers, shapes
from snakegen.linter.triangle_solids import enclosed, link_triangles
from snakegen.linter.xml_tree import Node

MAX_BYTES = 50_000_000  # of all mesh files together: larger robots are not measured
BEYOND = 4.0  # times the bound, above which an inertia is called too large: a mesh may show a part
SMALL = 1e-3  # share of the evenly filled shapes' inertia below which one is called too small
ASIDE = 0.1  # of the shapes' size, by which a centre of mass may lie outside their hull


@dataclass(frozen=True)
class Solid:
    """What the shapes of a link enclose, link axes: hull points (n, 3) m, volume m³, inertia.

    `unit_inertia` is (3, 3) m⁵ of the shapes filled with density 1 about their own centre.
    """

    points: Floats
    volume: float
    unit_inertia: Floats


def mesh_inertia_faults(robot: Node, text: str, folder: Path) -> Iterator[Finding]:
    """Yields inertias, centres of mass and densities that the meshes of a link contradict.

    Args:
        robot: the root element.
        text: of the whole URDF.
        folder: where relative mesh paths start.
    """
    links = {str(n.attrib.get("name")): n for n in robot.findall("link") if _asked(n)}
    if not links or _bytes(links.values(), folder) > MAX_BYTES:
        return
    for name, solid in _every_solid(links, text, folder).items():
        yield from _contradictions(links[name], solid)


def _every_solid(links: dict[str, Node], text: str, folder: Path) -> dict[str, Solid]:
    """Returns what the shapes of links enclose, in their order; trimesh only where it is needed."""
    out: dict[str, Solid] = {}
    for name, link in links.items():
        triangles = link_triangles(link, lambda uri: _file(uri, folder))
        if triangles is not None:
            volume, tensor = enclosed(triangles)
            if volume > 0.0:
                out[name] = Solid(triangles.reshape(-1, 3), volume, tensor)
    rest = {n: sum(1 for _ in shapes(link)) for n, link in links.items() if n not in out}
    if rest and any(_readable(links[name], folder) for name in rest):
        out |= _solids(text, folder, rest)
    return {name: out[name] for name in links if name in out}


def _readable(link: Node, folder: Path) -> bool:
    """Tells whether every mesh of a link is at hand."""
    meshes = [s for s in shapes(link) if s.tag == "mesh"]
    return all(_file(s.attrib.get("filename", ""), folder) is not None for s in meshes)


def _asked(link: Node) -> bool:
    """Tells whether a link has a mass and a mesh to hold against it."""
    inertial = link.find("inertial")
    mass = None if inertial is None else number(inertial.find("mass"), "value")
    return bool(mass and mass > 0) and any(shape.tag == "mesh" for shape in shapes(link))


def _bytes(links: Any, folder: Path) -> int:
    files = {s.attrib.get("filename", "") for n in links for s in shapes(n) if s.tag == "mesh"}
    found = (_file(uri, folder) for uri in files)
    return sum(path.stat().st_size for path in found if path is not None)


def _file(uri: str, folder: Path) -> Path | None:
    """Returns the file of a mesh, None where it is not at hand."""
    scheme, _, rest = uri.rpartition("://")
    if scheme in ("package", "model"):
        return resolve_package(rest, folder)
    path = folder / rest
    return path if scheme in ("", "file") and path.is_file() else None


def _solids(text: str, folder: Path, counts: dict[str, int]) -> dict[str, Solid]:
    """Returns what the shapes of links enclose, of those whose meshes can all be read.

    `counts` has the number of shapes by link.
    """
    import tempfile

    import yourdfpy

    def located(fname: str) -> str:
        file = _file(fname, folder)
        return fname if file is None else str(file)

    quiet = logging.getLogger("yourdfpy")
    level = quiet.level
    quiet.setLevel(logging.CRITICAL)  # a mesh that is missing is another rule's finding
    try:
        with tempfile.NamedTemporaryFile("w", suffix=".urdf", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            seen = yourdfpy.URDF.load(
                file.name,
                filename_handler=located,
                build_collision_scene_graph=True,
                load_collision_meshes=True,
            )
    except Exception:  # it raises what its parsers meet; other rules say what is wrong with a file
        return {}
    finally:
        quiet.setLevel(level)
    out = {}
    scenes = (seen.scene, seen.collision_scene)
    for name, count in counts.items():
        meshes = [m for scene in scenes for m in _meshes(scene, name, seen.link_map)]
        solid = _enclosed(meshes) if len(meshes) == count else None
        if solid is not None:
            out[name] = solid
    return out


def _meshes(scene: Any, link: str, links: Any) -> list[Any]:
    """Returns the meshes of `link` in a trimesh scene, in the link's axes."""
    if scene is None:
        return []
    out = []
    for node in scene.graph.nodes_geometry:
        owner = node
        while owner not in links:
            owner = scene.graph.transforms.parents[owner]
        if owner == link:
            pose, geometry = scene.graph.get(node, frame_from=link)
            out.append(scene.geometry[geometry].copy().apply_transform(pose))
    return out


def _enclosed(meshes: list[Any]) -> Solid | None:
    """Returns what meshes enclose together; an open one counts as its convex hull."""
    import trimesh

    points = [np.asarray(m.vertices, float) for m in meshes if len(m.vertices) > 3]
    if not points:
        return None
    try:
        hull = trimesh.convex.convex_hull(np.concatenate(points))
        closed = [m if m.is_watertight else m.convex_hull for m in meshes]
        filled: Any = trimesh.util.concatenate(closed)
        properties = filled.mass_properties  # of density 1, about the centre of mass
    except Exception:  # Qhull refuses flat sets of points: a sheet bounds nothing
        return None
    if not properties.volume > 0.0:
        return None
    return Solid(
        np.asarray(hull.vertices, float), float(properties.volume), np.asarray(properties.inertia)
    )


def _contradictions(link: Node, solid: Solid) -> Iterator[Finding]:
    """Yields what mass, centre of mass and inertia of a link cannot have within its shapes."""
    inertial = link.find("inertial")
    if inertial is None:
        return
    where, mass = label(link), number(inertial.find("mass"), "value") or 0.0
    origin = inertial.find("origin")
    com = np.array(numbers(origin, "xyz", 3) or (0.0, 0.0, 0.0))
    density = mass / solid.volume
    if not THIN <= density <= DENSE:
        message = f"{mass:g} kg in meshes of {solid.volume:.3g} m³ is {density:.3g} kg/m³"
        yield finding("mesh_density", where, inertial.line, message)
    low, high = solid.points.min(axis=0), solid.points.max(axis=0)
    size = float(np.linalg.norm(high - low))
    aside = float(np.linalg.norm(com - np.clip(com, low, high)))
    if aside > ASIDE * size:
        message = f"its centre of mass lies {aside:.3g} m outside its meshes, {size:.3g} m in size"
        yield finding("mesh_com_outside", where, inertial.line, message)
        return  # the bound below would be that of a body somewhere else
    node = inertial.find("inertia")
    entries = [number(node, name) for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")]
    if node is None or any(e is None for e in entries):
        return
    xx, xy, xz, yy, yz, zz = (float(e) for e in entries if e is not None)
    moments, axes = np.linalg.eigh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    axes = rotation_from_rpy(numbers(origin, "rpy", 3) or (0.0, 0.0, 0.0)) @ axes
    arms = solid.points - com
    along = arms @ axes
    most = mass * np.max(np.sum(arms**2, axis=1)[:, None] - along**2, axis=0)
    worst = int(np.argmax(moments / np.maximum(most, 1e-300)))
    if moments[worst] > BEYOND * most[worst]:
        message = (
            f"a moment of inertia of {moments[worst]:.3g} kg·m²; {mass:g} kg inside its meshes "
            f"have at most {most[worst]:.3g}"
        )
        yield finding("mesh_inertia_large", where, node.line, message)
        return
    even = float(np.linalg.eigvalsh(solid.unit_inertia)[-1]) * density
    if moments[-1] < SMALL * even:
        message = (
            f"a largest moment of inertia of {moments[-1]:.3g} kg·m²; {mass:g} kg that fill its "
            f"meshes evenly have {even:.3g}"
        )
        yield finding("mesh_inertia_small", where, node.line, message)
