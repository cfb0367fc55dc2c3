"""What a body stands on and passes, in a log: obstacles, and the ground's push on each drum."""

from __future__ import annotations

from typing import Any

import numpy as np

from snakegen.base.geometry import Floats, quaternion_xyzw
from snakegen.log import style
from snakegen.log.scene import Scene
from snakegen.simulation.recording.recording import Recording

_RING = 0.025  # m, between the rings of a hole
_LOW = 0.06  # m, up to which an obstacle is solid: walls and ceilings must not hide the body


def log_ground(rec: Any, recording: Recording, view: Scene, columns: list[Any]) -> None:
    """Writes obstacles once, and an arrow a drum over time."""
    _obstacles(rec, recording)
    _hole(rec, recording)
    _forces(rec, recording, view, columns)


def _obstacles(rec: Any, recording: Recording) -> None:
    import rerun as rr

    solids = recording.meta.get("obstacles") or []
    boxes = [one for one in solids if "half" in one]
    _other_solids(rec, [one for one in solids if "half" not in one])
    if not boxes:
        return
    over = [box["centre"][2] + box["half"][2] > _LOW for box in boxes]
    for name, chosen, mode in (
        ("ground", [i for i, high in enumerate(over) if not high], "Solid"),
        ("over", [i for i, high in enumerate(over) if high], "MajorWireframe"),
    ):
        if chosen:
            rec.log(
                f"world/obstacles/{name}",
                rr.Boxes3D(
                    centers=[boxes[i]["centre"] for i in chosen],
                    half_sizes=[boxes[i]["half"] for i in chosen],
                    quaternions=[rr.Quaternion(xyzw=box_attitude(boxes[i])) for i in chosen],
                    colors=[style.OBSTACLE],
                    fill_mode=getattr(rr.components.FillMode, mode),
                ),
                static=True,
            )


def box_attitude(box: dict[str, Any]) -> Floats:
    """Returns the quaternion [x, y, z, w] of a box: its `rotation`, or its `roll` about x."""
    if "rotation" in box:
        return quaternion_xyzw(np.array(box["rotation"], float))
    half = 0.5 * float(box.get("roll", 0.0))
    return np.array([np.sin(half), 0.0, 0.0, np.cos(half)])


def _other_solids(rec: Any, solids: list[dict[str, Any]]) -> None:
    """Writes cylinders, balls and meshes; a half-space is drawn as a sheet of its face."""
    import rerun as rr

    colour = [style.OBSTACLE]
    look: Any
    cylinders = [one for one in solids if one.get("kind") == "cylinder"]
    if cylinders:
        look = rr.Cylinders3D(
            lengths=[2.0 * one["size"][1] for one in cylinders],
            radii=[one["size"][0] for one in cylinders],
            centers=[one["centre"] for one in cylinders],
            quaternions=[rr.Quaternion(xyzw=box_attitude(one)) for one in cylinders],
            colors=colour,
        )
        rec.log("world/obstacles/cylinders", look, static=True)
    balls = [one for one in solids if one.get("kind") == "sphere"]
    if balls:
        look = rr.Points3D(
            [one["centre"] for one in balls], radii=[one["size"][0] for one in balls], colors=colour
        )
        rec.log("world/obstacles/points", look, static=True)
    for one in solids:
        if one.get("kind") == "mesh":
            corners = np.array(one["vertices"], float) @ np.array(one["rotation"], float).T
            look = rr.Mesh3D(
                vertex_positions=corners + np.array(one["centre"], float),
                triangle_indices=one["faces"],
                albedo_factor=(*style.OBSTACLE, 110),
            )
            rec.log(f"world/obstacles/{one['name']}", look, static=True)


def _hole(rec: Any, recording: Recording) -> None:
    """Draws a hole's centreline and rings about it, as wide as the room that the body has."""
    import rerun as rr

    facts = recording.meta.get("facts") or {}
    if "centreline_m" not in facts:
        return
    room = float(facts["room_m"])
    strips = hole_strips(np.array(facts["centreline_m"]), room)
    look = rr.LineStrips3D(strips, colors=[style.OBSTACLE], radii=[0.05 * room])
    rec.log("world/obstacles/hole", look, static=True)


def hole_strips(line: Floats, room: float) -> list[Floats]:
    """Returns a hole's centreline (n, 3) [m], then rings of radius `room` [m] along it."""
    arcs = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    turn = np.linspace(0.0, 2.0 * np.pi, 33)[:, None]
    strips = [line]
    for s in np.linspace(0.0, arcs[-1], max(int(arcs[-1] / _RING), 1) + 1):
        k = min(max(int(np.searchsorted(arcs, s)) - 1, 0), len(line) - 2)
        step = line[k + 1] - line[k]
        at = line[k] + step * (s - arcs[k]) / np.linalg.norm(step)
        _, one, other = np.linalg.svd(step[None])[2]
        strips.append(at + room * (np.cos(turn) * one + np.sin(turn) * other))
    return strips


def _forces(rec: Any, recording: Recording, view: Scene, columns: list[Any]) -> None:
    """Draws each drum's force where it acts; the usual arrow is a third of the body, over it."""
    import rerun as rr

    if not {"contact_point", "contact_force"} <= recording.channels.keys():
        return
    force = np.nan_to_num(recording.held("contact_force", view.time))
    point = np.nan_to_num(recording.held("contact_point", view.time))
    force[view.time > recording.times("contact_force")[-1] + 0.1] = 0.0  # it has taken off
    size = np.linalg.norm(force.reshape(-1, 3), axis=1)
    usual = float(np.median(size[size > 0])) if (size > 0).any() else 1.0
    scale = 0.3 * min(view.size, 1.5) / usual
    labels = recording.channel("contact_force").labels
    for i in range(force.shape[1] // 3):
        path = f"world/contact/{labels[3 * i].rpartition('_')[0]}"
        look = rr.Arrows3D.from_fields(colors=[style.CONTACT], radii=[0.004 * view.size])
        rec.log(path, look, static=True)
        part = slice(3 * i, 3 * i + 3)
        rec.send_columns(
            path,
            columns,
            rr.Arrows3D.columns(
                vectors=(scale * force[:, part]).astype(np.float32),
                origins=point[:, part].astype(np.float32),
            ),
        )
