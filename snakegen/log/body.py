"""The moving part of a log: the robot by its URDF, CoG, target ghost, thrusts, disturbance.

Frames carry the kinematics: a rotor's arrow is logged in the rotor link's frame and moves with
it, so nothing but joint angles is written over time.
"""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snakegen.base.geometry import quaternions_xyzw
from snakegen.description.mjcf.urdf_import import locate
from snakegen.log import skeleton as sk
from snakegen.log import style
from snakegen.log.ground import log_ground
from snakegen.log.ground_load import pull
from snakegen.log.scene import Scene, thrust_use
from snakegen.simulation.recording.recording import Recording

Floats = NDArray[np.float64]

_PER_WIND = 0.1  # m an arrow is long, per m/s


def log_body(rec: Any, recording: Recording, view: Scene, mesh_folder: Path | None) -> None:
    """Writes the scene's columns into the rerun recording `rec`."""
    import rerun as rr

    rec.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    columns = [rr.TimeColumn(style.TIMELINE, duration=view.time)]
    if view.skeleton is not None:
        _log_robot(rec, recording, view, view.skeleton, columns, mesh_folder)
        _log_thrusts(rec, recording, view, columns)
    _log_points(rec, recording, view, columns)
    _log_disturbance(rec, recording, view, columns)
    _log_wind(rec, recording, view, columns)
    log_ground(rec, recording, view, columns)


def _log_robot(
    rec: Any,
    recording: Recording,
    view: Scene,
    bones: sk.Skeleton,
    columns: list[Any],
    meshes: Path | None,
) -> None:
    import rerun as rr
    from rerun.urdf import UrdfTree

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot.urdf"
        path.write_text(drawable(recording.meta["urdf"], meshes), encoding="utf-8")
        tree = UrdfTree.from_file_path(path, "world")
        tree.log_urdf_to_recording(rec)
    _make_solid(rec, recording.meta["urdf"], tree)
    rotation, position = view.base
    base = _moved(position, quaternions_xyzw(rotation), "tf#/world", bones.root)
    rec.send_columns("world/motion/base", columns, base)
    for j in bones.moving():
        if j.name in view.angles:
            turned = _moved(*sk.joint_poses(j, view.angles[j.name]), j.parent, j.child)
            rec.send_columns(rr.new_entity_path(["world", "motion", j.name]), columns, turned)
            rec.flush()  # what it has not written yet stays in memory


def _moved(position: Floats, xyzw: Floats, parent: str, child: str) -> Any:
    """Returns the columns of a frame's poses in another: (F, 3) m and (F, 4)."""
    import pyarrow as pa
    import rerun as rr

    frames = len(xyzw)
    return rr.Transform3D.columns(
        translation=position.astype(np.float32),
        quaternion=xyzw.astype(np.float32),
        parent_frame=pa.repeat(parent, frames),  # lists of names cost more than all else
        child_frame=pa.repeat(child, frames),
    )


def _make_solid(rec: Any, urdf: str, tree: Any) -> None:
    """Fills the primitives, which rerun draws as tinted glass with wires."""
    import rerun as rr

    kinds: dict[str, Any] = {
        "box": rr.Boxes3D,
        "cylinder": rr.Cylinders3D,
        "sphere": rr.Ellipsoids3D,
    }
    for link in ET.fromstring(urdf).findall("link"):
        paths = tree.get_visual_geometry_paths(link.get("name", ""))
        for path, visual in zip(paths, link.findall("visual"), strict=False):
            for shape, archetype in kinds.items():
                if visual.find(f"geometry/{shape}") is not None:
                    look = archetype.from_fields(fill_mode=rr.components.FillMode.Solid)
                    rec.log(path, look, static=True)


def _log_thrusts(rec: Any, recording: Recording, view: Scene, columns: list[Any]) -> None:
    import rerun as rr

    if not view.rotors:
        return
    thrust = recording.held("thrust", view.time)
    use = thrust_use(recording, thrust)
    for r in view.rotors:
        path = rr.new_entity_path(["world", "thrust", r.label])
        rec.log(path, rr.CoordinateFrame(r.link), static=True)
        rec.log(path, rr.Arrows3D.from_fields(radii=[0.006 * view.size]), static=True)
        arrows = (thrust[:, r.column, None] * view.newton * r.axis).astype(np.float32)
        colors = style.saturation_colors(use[:, r.column])
        fields: dict[str, Any] = {"vectors": arrows}
        if np.any(r.position):
            fields["origins"] = np.tile(r.position.astype(np.float32), (len(arrows), 1))
        rec.send_columns(path, columns, rr.Arrows3D.columns(**fields, colors=colors))
        rec.flush()


def _log_points(rec: Any, recording: Recording, view: Scene, columns: list[Any]) -> None:
    import rerun as rr

    radius = 0.014 * view.size
    if "position" in recording.channels:
        at = recording.held("position", view.time)
        rec.log(
            "world/cog", rr.Points3D.from_fields(radii=[radius], colors=[style.COG]), static=True
        )
        rec.send_columns("world/cog", columns, rr.Points3D.columns(positions=at))
        trace = rr.LineStrips3D([at], colors=[(*style.COG, 90)], radii=[0.1 * radius])
        rec.log("world/cog_path", trace, static=True)
    if "position_target" in recording.channels:
        goal = recording.held("position_target", view.time)
        look = rr.Points3D.from_fields(radii=[radius], colors=[style.TARGET])
        rec.log("world/target/cog", look, static=True)
        rec.send_columns("world/target/cog", columns, rr.Points3D.columns(positions=goal))
        trace = rr.LineStrips3D([goal], colors=[(*style.TARGET, 90)], radii=[0.1 * radius])
        rec.log("world/target/path", trace, static=True)
    if view.ghost.shape[1]:
        line = rr.LineStrips3D.from_fields(colors=[style.TARGET], radii=[0.22 * radius])
        rec.log("world/target/ghost", line, static=True)
        strips = view.ghost.astype(np.float32)
        rec.send_columns("world/target/ghost", columns, rr.LineStrips3D.columns(strips=strips))


def _log_disturbance(rec: Any, recording: Recording, view: Scene, columns: list[Any]) -> None:
    import rerun as rr

    towed = pull(recording, view.time, 0.4 * view.size)
    if "disturbance" not in recording.channels and towed is None:
        return
    force = recording.held("disturbance", view.time)[:, :3] if towed is None else towed
    if not np.any(force):
        return
    at = np.zeros_like(force)
    for name in ("disturbance_point", "position"):
        if name in recording.channels:
            at = np.nan_to_num(recording.held(name, view.time))
            break
    if towed is not None and view.skeleton is not None:  # at the tail
        at = view.skeleton.body_line(view.base, view.angles)[:, -1]
    look = rr.Arrows3D.from_fields(colors=[style.DISTURBANCE], radii=[0.008 * view.size])
    rec.log("world/disturbance", look, static=True)
    vectors = (force if towed is not None else force * view.newton).astype(np.float32)
    rec.send_columns(
        "world/disturbance",
        columns,
        rr.Arrows3D.columns(vectors=vectors, origins=at.astype(np.float32)),
    )


def _log_wind(rec: Any, recording: Recording, view: Scene, columns: list[Any]) -> None:
    """Draws the wind as an arrow that ends over the CoG, a metre for 10 m/s."""
    import rerun as rr

    if not {"wind", "position"} <= recording.channels.keys():
        return
    blows = _PER_WIND * recording.held("wind", view.time)
    over = recording.held("position", view.time) + np.array([0.0, 0.0, 0.35 * view.size])
    look = rr.Arrows3D.from_fields(colors=[style.WIND], radii=[0.008 * view.size])
    rec.log("world/wind", look, static=True)
    arrows = rr.Arrows3D.columns(
        vectors=blows.astype(np.float32), origins=(over - blows).astype(np.float32)
    )
    rec.send_columns("world/wind", columns, arrows)


def drawable(urdf: str, meshes: Path | None) -> str:
    """Returns the URDF with absolute mesh paths and a colour on every visual.

    rerun drops meshes whose relative path does not lead to a file from the URDF's folder. Those
    that are nowhere are left out here: rerun would warn of each, over several lines.
    """
    robot = ET.fromstring(urdf)
    for link in robot.iter("link"):
        for kind in ("visual", "collision"):
            for shape in link.findall(kind):
                mesh = shape.find("geometry/mesh")
                name = "" if mesh is None else mesh.get("filename", "")
                if mesh is None or (meshes is None and "://" not in name):
                    continue
                path = locate(name, () if meshes is None else (meshes,))
                if path is None:
                    link.remove(shape)
                else:
                    mesh.set("filename", str(path.resolve()))
    grey = " ".join(f"{c / 255:.3f}" for c in style.BARE_LINK) + " 1"
    for visual in robot.iter("visual"):
        if visual.find("material") is None:
            material = ET.SubElement(visual, "material", name="bare")
            ET.SubElement(material, "color", rgba=grey)
    return ET.tostring(robot, encoding="unicode")
