"""The moving part of a log: the robot by its URDF, CoG, target ghost, thrusts, disturbance.

Frames carry the kinematics: a rotor's arrow is logged in the rotor link's frame and moves with
it, so nothing but joint angles is written over time.
"""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from snakegen.log import skeleton as sk
from snakegen.log import style
from snakegen.verify.recording import Recording

Floats = NDArray[np.float64]


class Rotor(NamedTuple):
    """A rotor whose thrust is drawn."""

    column: int  # in the channel `thrust`
    label: str
    link: str
    axis: Floats  # (3,) thrust direction in the link's frame


@dataclass(frozen=True)
class Scene:
    """A run seen from its skeleton: what is drawn where, at the instants `time`."""

    time: Floats  # (F,) s
    skeleton: sk.Skeleton | None
    base: sk.Poses  # of the root link
    angles: dict[str, Floats]  # (F,) per joint
    rotors: tuple[Rotor, ...]
    ghost: Floats  # (F, n, 3) m, the body's line at its target; n = 0 where there is none
    size: float  # m, length of the body
    center: Floats  # (3,) m, middle of everything drawn
    radius: float  # m, around it
    newton: float  # m an arrow is long, per newton


def scene(recording: Recording) -> Scene:
    """Works out where things are; arrays of the drawn instants only."""
    index = style.frames(recording.time)
    time = recording.time[index]
    urdf = recording.meta.get("urdf")
    bones = sk.skeleton(urdf) if urdf and "q" in recording.channels else None
    base: sk.Poses = (np.broadcast_to(np.eye(3), (len(time), 3, 3)), np.zeros((len(time), 3)))
    angles: dict[str, Floats] = {}
    lines = np.empty((len(time), 0, 3))
    if bones is not None:
        labels, q = recording.channel("q").labels, recording.held("q", time)
        base, angles = sk.base_poses(labels, q), sk.joint_angles(labels, q)
        lines = bones.body_line(base, angles)
    ghost = _ghost(recording, bones, time, base, angles)
    clouds = [lines.reshape(-1, 3), ghost.reshape(-1, 3)]
    if "position" in recording.channels:
        clouds.append(recording.held("position", time))
    cloud = np.concatenate(clouds)
    cloud = cloud[np.all(np.isfinite(cloud), axis=1)]
    cloud = cloud if len(cloud) else np.zeros((1, 3))
    middle = 0.5 * (cloud.min(axis=0) + cloud.max(axis=0))
    first = lines[0] if lines.shape[1] else np.zeros((1, 3))
    size = float(np.sum(np.linalg.norm(np.diff(first, axis=0), axis=1))) or 1.0
    return Scene(
        time,
        bones,
        base,
        angles,
        _rotors(recording, bones),
        ghost,
        size,
        middle,
        max(float(np.linalg.norm(cloud - middle, axis=1).max()), 0.5 * size),
        _newton(recording, size),
    )


def log_scene(rec: Any, recording: Recording, view: Scene, mesh_folder: Path | None) -> None:
    """Writes the scene's columns into the rerun recording `rec`."""
    import rerun as rr

    rec.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    columns = [rr.TimeColumn(style.TIMELINE, duration=view.time)]
    if view.skeleton is not None:
        _log_robot(rec, recording, view, view.skeleton, columns, mesh_folder)
        _log_thrusts(rec, recording, view, columns)
    _log_points(rec, recording, view, columns)
    _log_disturbance(rec, recording, view, columns)


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
    ticks = len(view.time)
    moved = rr.Transform3D.columns(
        translation=position,
        quaternion=_xyzw(rotation),
        parent_frame=["tf#/world"] * ticks,
        child_frame=[bones.root] * ticks,
    )
    rec.send_columns("world/motion/base", columns, moved)
    for j in bones.moving():
        joint = tree.get_joint_by_name(j.name)
        if joint is not None and j.name in view.angles:
            turned = joint.compute_transform_columns(view.angles[j.name].tolist(), clamp=False)
            rec.send_columns(rr.new_entity_path(["world", "motion", j.name]), columns, turned)


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
        rec.send_columns(path, columns, rr.Arrows3D.columns(vectors=arrows, colors=colors))


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

    if "disturbance" not in recording.channels:
        return
    force = recording.held("disturbance", view.time)[:, :3]
    if not np.any(force):
        return
    at = np.zeros_like(force)
    for name in ("disturbance_point", "position"):
        if name in recording.channels:
            at = np.nan_to_num(recording.held(name, view.time))
            break
    look = rr.Arrows3D.from_fields(colors=[style.DISTURBANCE], radii=[0.008 * view.size])
    rec.log("world/disturbance", look, static=True)
    vectors = (force * view.newton).astype(np.float32)
    rec.send_columns(
        "world/disturbance",
        columns,
        rr.Arrows3D.columns(vectors=vectors, origins=at.astype(np.float32)),
    )


def thrust_use(recording: Recording, thrust: Floats) -> Floats:
    """Returns thrust / limit (0 where the run states no limit)."""
    upper = recording.meta.get("limits", {}).get("thrust_max")
    return np.zeros_like(thrust) if upper is None else thrust / np.asarray(upper, float)


def drawable(urdf: str, meshes: Path | None) -> str:
    """Returns the URDF with absolute mesh paths and a colour on every visual.

    rerun drops meshes whose relative path does not lead to a file from the URDF's folder.
    """
    robot = ET.fromstring(urdf)
    for mesh in robot.iter("mesh"):
        name = mesh.get("filename", "")
        if meshes is not None and "://" not in name:
            mesh.set("filename", str((meshes / name).resolve()))
    grey = " ".join(f"{c / 255:.3f}" for c in style.BARE_LINK) + " 1"
    for visual in robot.iter("visual"):
        if visual.find("material") is None:
            material = ET.SubElement(visual, "material", name="bare")
            ET.SubElement(material, "color", rgba=grey)
    return ET.tostring(robot, encoding="unicode")


def _rotors(recording: Recording, bones: sk.Skeleton | None) -> tuple[Rotor, ...]:
    """Returns the rotors that the URDF has; without a list, thrusts are named as their links."""
    if bones is None or "thrust" not in recording.channels:
        return ()
    links = {bones.root, *(j.child for j in bones.joints)}
    labels = recording.channel("thrust").labels
    listed = recording.meta.get("rotors") or [{"link": label} for label in labels]
    rotors = []
    for i, (rotor, label) in enumerate(zip(listed, labels, strict=False)):
        if rotor["link"] in links:
            axis = np.asarray(rotor.get("axis", (0.0, 0.0, 1.0)), float)
            rotors.append(Rotor(i, label, rotor["link"], axis))
    return tuple(rotors)


def _newton(recording: Recording, size: float) -> float:
    """Returns metres an arrow per newton: the largest thrust is a quarter of the body, ≤ 0.5 m."""
    upper = recording.meta.get("limits", {}).get("thrust_max")
    if upper is None and "thrust" in recording.channels:
        upper = np.nanmax(recording.channel("thrust").values)
    largest = float(np.max(upper)) if upper is not None else recording.meta.get("weight_n", 10.0)
    return min(0.25 * size, 0.5) / max(largest, 1e-9)


def _ghost(
    recording: Recording,
    bones: sk.Skeleton | None,
    time: Floats,
    base: sk.Poses,
    angles: dict[str, Floats],
) -> Floats:
    """Returns the body's line where position, attitude and joints should be.

    The CoG's place in the root link is the one it has now, which is exact while the joints
    follow their commands.
    """
    wanted = {"position", "position_target", "attitude", "attitude_target"}
    if bones is None or not wanted <= recording.channels.keys():
        return np.empty((len(time), 0, 3))
    place = {name: recording.held(name, time) for name in wanted}
    now = sk.rotations_from_xyzw(place["attitude"])
    goal = sk.rotations_from_xyzw(place["attitude_target"])
    turn = goal @ np.swapaxes(now, 1, 2)
    lever = base[1] - place["position"]
    at = place["position_target"] + np.einsum("tij,tj->ti", turn, lever)
    asked = dict(angles)
    if "joint_command" in recording.channels:
        command = recording.channel("joint_command")
        asked.update(zip(command.labels, recording.held("joint_command", time).T, strict=True))
    return bones.body_line((turn @ base[0], at), asked)


def _xyzw(rotation: Floats) -> Floats:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(rotation).as_quat())
