"""What a body stands on and passes, in a log: obstacles, and the ground's push on each drum."""

from __future__ import annotations

from typing import Any

import numpy as np

from snakegen.log import style
from snakegen.log.scene import Scene
from snakegen.verify.recording import Recording

_LOW = 0.06  # m, up to which an obstacle is solid: walls and ceilings must not hide the body


def log_ground(rec: Any, recording: Recording, view: Scene, columns: list[Any]) -> None:
    """Writes obstacles once, and an arrow a drum over time."""
    _obstacles(rec, recording)
    _forces(rec, recording, view, columns)


def _obstacles(rec: Any, recording: Recording) -> None:
    import rerun as rr

    boxes = recording.meta.get("obstacles") or []
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
                    rotation_axis_angles=[
                        rr.RotationAxisAngle((1.0, 0.0, 0.0), rr.Angle(rad=boxes[i].get("roll", 0)))
                        for i in chosen
                    ],
                    colors=[style.OBSTACLE],
                    fill_mode=getattr(rr.components.FillMode, mode),
                ),
                static=True,
            )


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
