"""A robot for a page: its visuals as one binary glTF, its joints as plain data.

yourdfpy reads the URDF's visuals and meshes, trimesh writes them; the page turns the joints.
"""

from __future__ import annotations

import logging
import tempfile
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np

from snakegen.errors import DescriptionError
from snakegen.log.body import drawable
from snakegen.log.ground import box_attitude
from snakegen.log.skeleton import skeleton

PLAIN = "#9aa3ad"  # of a page whose robot has no visuals


def body_glb(urdf: str, folder: Path | None) -> bytes:
    """Returns every visual of a URDF as glTF; node ``L3_1`` is the second visual of link 3.

    Links count in the order of `body_links`; a node stands in its link's frame.

    Args:
        urdf: URDF text.
        folder: where relative mesh paths start; None leaves meshes out.

    Raises:
        DescriptionError: yourdfpy cannot read the URDF.
    """
    import trimesh
    import yourdfpy

    logging.getLogger("yourdfpy").setLevel(logging.ERROR)  # a mesh that is missing is left out
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "robot.urdf"
        path.write_text(drawable(urdf, folder), encoding="utf-8")
        try:
            seen = yourdfpy.URDF.load(str(path), load_collision_meshes=False).scene
        except Exception as error:  # yourdfpy raises what its parsers meet
            raise DescriptionError(f"yourdfpy cannot read the URDF: {error}") from None
    number = {name: i for i, name in enumerate(body_links(urdf))}
    out = trimesh.Scene()
    counts: dict[int, int] = {}
    for node in seen.graph.nodes_geometry:
        link = _link_of(seen.graph, node, number)
        pose, geometry = seen.graph.get(node, frame_from=link)
        i = number[link]
        k = counts[i] = counts.get(i, -1) + 1
        out.add_geometry(
            seen.geometry[geometry], node_name=f"L{i}_{k}", geom_name=geometry, transform=pose
        )
    return bytes(out.export(file_type="glb")) if counts else b""


def _link_of(graph: Any, node: str, links: dict[str, int]) -> str:
    while node not in links:
        node = graph.transforms.parents[node]
    return node


def body_links(urdf: str) -> list[str]:
    """Returns the names of a URDF's links, the root first, parents before children."""
    bones = skeleton(urdf)
    return [bones.root, *(j.child for j in bones.joints)]


def body_joints(urdf: str) -> list[dict[str, Any]]:
    """Returns the joints as the page reads them.

    Each has ``name``, ``kind``, ``parent`` and ``child`` (numbers of links), ``origin`` (4 × 4,
    by columns), ``axis``, ``low`` and ``high``; one that mimics has ``follows``, ``ratio`` and
    ``offset``.
    """
    bones = skeleton(urdf)
    ranges = {e.get("name", ""): _range(e) for e in ET.fromstring(urdf).findall("joint")}
    number = {name: i for i, name in enumerate(body_links(urdf))}
    out = []
    for j in bones.joints:
        origin = np.eye(4)
        origin[:3, :3], origin[:3, 3] = j.rotation, j.translation
        out.append(
            {
                "name": j.name,
                "kind": j.kind,
                "parent": number[j.parent],
                "child": number[j.child],
                "origin": origin.T.ravel().round(9).tolist(),
                "axis": j.axis.tolist(),
            }
            | ranges[j.name]
        )
    return out


def boxes(obstacles: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Returns the boxes among a log's obstacles as the page draws them; other solids are left out.

    Each has ``at`` (3,) and ``size`` (3,) [m], whole lengths, and the quaternion ``xyzw``.
    """
    out = []
    for one in obstacles:
        if "half" not in one:
            continue
        out.append(
            {
                "at": list(one["centre"]),
                "size": [2.0 * h for h in one["half"]],
                "xyzw": box_attitude(one).tolist(),
            }
        )
    return out


def _range(joint: ET.Element) -> dict[str, Any]:
    limit, mimic = joint.find("limit"), joint.find("mimic")
    out: dict[str, Any] = {"low": -np.pi, "high": np.pi}
    if limit is not None and joint.get("type") != "continuous":
        low, high = float(limit.get("lower", "0")), float(limit.get("upper", "0"))
        if low < high:
            out = {"low": low, "high": high}
    if mimic is not None:
        out |= {
            "follows": mimic.get("joint", ""),
            "ratio": float(mimic.get("multiplier", "1")),
            "offset": float(mimic.get("offset", "0")),
        }
    return out
