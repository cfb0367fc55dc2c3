"""A USD stage with physics: rigid bodies, masses, joints with limits and drives, shapes.

Written with OpenUSD's own API (the extra ``usd``). Links stand side by side under the robot's
prim, where the reference posture (every joint at 0) puts them; joints carry the tree. Angles are
in degrees there, so stiffness and damping are per degree (UsdPhysics).
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats, quaternion_xyzw, rotation_from_rpy
from snakegen.errors import SnakegenError
from snakegen.pipeline.formats.usd_check import check_stage
from snakegen.robot.robot import Robot

_DEGREE = np.pi / 180.0


def write_stage(robot: Robot, path: Path) -> tuple[str, ...]:
    """Writes the robot as a USD stage; returns what it does not carry.

    Args:
        robot: read from a URDF with its meshes beside it.
        path: ``.usda`` (text) or ``.usdc``.

    Raises:
        SnakegenError: OpenUSD is not installed.
        DescriptionError: the stage does not hold what the URDF says.
    """
    try:
        from pxr import Usd, UsdGeom, UsdPhysics
    except ImportError:
        raise SnakegenError(
            "format usd needs OpenUSD, which is not installed: pip install 'snakegen[usd]'"
        ) from None
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    top = UsdGeom.Xform.Define(stage, f"/{_prim(robot.name)}")
    stage.SetDefaultPrim(top.GetPrim())
    UsdPhysics.ArticulationRootAPI.Apply(top.GetPrim())
    scene = UsdPhysics.Scene.Define(stage, "/physics")
    scene.CreateGravityDirectionAttr((0.0, 0.0, -1.0))
    scene.CreateGravityMagnitudeAttr(9.81)
    urdf = ET.fromstring(robot.urdf)
    poses = _poses(urdf)
    prims = {}
    for link in urdf.findall("link"):
        name = link.get("name", "")
        prims[name] = _link(stage, top, link, poses[name], robot.folder)
    for joint in urdf.findall("joint"):
        _joint(stage, top, joint, prims, robot)
    if not robot.floating:
        fixed = UsdPhysics.FixedJoint.Define(stage, top.GetPath().AppendChild("base_mount"))
        fixed.CreateBody1Rel().SetTargets([prims[robot.root_link].GetPath()])
    _rotors(prims, robot)
    stage.GetRootLayer().Save()
    check_stage(robot, path)
    lost = []
    if robot.modules.apparatuses:
        lost.append("thrust: rotors stand as custom attributes (snakegen:rotor:*) on their links")
    if any(joint.find("mimic") is not None for joint in urdf.findall("joint")):
        lost.append("mimic joints turn freely")
    return tuple(lost)


def _link(stage: Any, top: Any, link: ET.Element, pose: Floats, folder: Path | None) -> Any:
    """Defines a link's prim with its mass, visuals and collisions; returns it."""
    from pxr import Gf, UsdGeom, UsdPhysics

    name = link.get("name", "")
    form = UsdGeom.Xform.Define(stage, top.GetPath().AppendChild(_prim(name)))
    prim = form.GetPrim()
    prim.SetCustomDataByKey("urdf_name", name)
    form.AddTransformOp().Set(_matrix(pose))
    UsdPhysics.RigidBodyAPI.Apply(prim)
    inertial = link.find("inertial")
    if inertial is not None:
        mass, centre, inertia = _inertial(inertial)
        values, axes = np.linalg.eigh(inertia)
        axes[:, 0] *= np.sign(np.linalg.det(axes))
        x, y, z, w = quaternion_xyzw(axes)
        api = UsdPhysics.MassAPI.Apply(prim)
        api.CreateMassAttr(mass)
        api.CreateCenterOfMassAttr(Gf.Vec3f(*map(float, centre)))
        api.CreateDiagonalInertiaAttr(Gf.Vec3f(*map(float, values)))
        api.CreatePrincipalAxesAttr(Gf.Quatf(float(w), Gf.Vec3f(float(x), float(y), float(z))))
    for kind in ("visual", "collision"):
        for k, shape in enumerate(link.findall(kind)):
            path = form.GetPath().AppendChild(f"{kind}{k}")
            made = _shape(stage, path, shape, folder)
            if made is None:
                continue
            if kind == "collision":
                UsdPhysics.CollisionAPI.Apply(made.GetPrim())
                UsdGeom.Imageable(made.GetPrim()).CreatePurposeAttr(UsdGeom.Tokens.guide)
    return prim


def _shape(stage: Any, path: Any, element: ET.Element, folder: Path | None) -> Any:
    """Defines the shape of a visual or collision; None for a mesh that cannot be found."""
    from pxr import Gf, UsdGeom

    geometry = element.find("geometry")
    if geometry is None or not len(geometry):
        return None
    form, pose = geometry[0], _pose(element.find("origin"))
    if form.tag == "box":
        made = UsdGeom.Cube.Define(stage, path)
        made.CreateSizeAttr(1.0)
        scale = np.array(_floats(form.get("size"), 3))
    elif form.tag == "sphere":
        made = UsdGeom.Sphere.Define(stage, path)
        made.CreateRadiusAttr(float(form.get("radius", "0")))
        scale = np.ones(3)
    elif form.tag in ("cylinder", "capsule"):
        kind = UsdGeom.Cylinder if form.tag == "cylinder" else UsdGeom.Capsule
        made = kind.Define(stage, path)
        made.CreateAxisAttr(UsdGeom.Tokens.z)
        made.CreateRadiusAttr(float(form.get("radius", "0")))
        made.CreateHeightAttr(float(form.get("length", "0")))
        scale = np.ones(3)
    else:
        solid = _mesh(form, folder)
        if solid is None:
            return None
        made = UsdGeom.Mesh.Define(stage, path)
        made.CreatePointsAttr([Gf.Vec3f(*map(float, p)) for p in solid.vertices])
        made.CreateFaceVertexCountsAttr([3] * len(solid.faces))
        made.CreateFaceVertexIndicesAttr(solid.faces.ravel().tolist())
        made.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        scale = np.array(_floats(form.get("scale", "1 1 1"), 3))
    made.AddTransformOp().Set(_matrix(pose @ np.diag([*scale, 1.0])))
    colour = element.find("material/color")
    if colour is not None:
        made.CreateDisplayColorAttr([Gf.Vec3f(*_floats(colour.get("rgba"), 4)[:3])])
    return made


def _mesh(form: ET.Element, folder: Path | None) -> Any:
    import trimesh

    name = form.get("filename", "")
    if folder is None or "://" in name or not (folder / name).is_file():
        return None
    return trimesh.load(folder / name, force="mesh")


def _joint(stage: Any, top: Any, joint: ET.Element, prims: dict[str, Any], robot: Robot) -> None:
    """Defines a joint; what moves does so along or about its frame's x, with limits and drive."""
    from pxr import Gf, UsdPhysics

    name, kind = joint.get("name", ""), joint.get("type", "fixed")
    path = top.GetPath().AppendChild(f"{_prim(name)}_joint")
    made: Any
    if kind in ("revolute", "continuous"):
        made = UsdPhysics.RevoluteJoint.Define(stage, path)
    elif kind == "prismatic":
        made = UsdPhysics.PrismaticJoint.Define(stage, path)
    else:
        made = UsdPhysics.FixedJoint.Define(stage, path)
    made.GetPrim().SetCustomDataByKey("urdf_name", name)
    parent, child = _ends(joint)
    made.CreateBody0Rel().SetTargets([prims[parent].GetPath()])
    made.CreateBody1Rel().SetTargets([prims[child].GetPath()])
    origin = _pose(joint.find("origin"))
    turn = np.eye(3)
    if kind in ("revolute", "continuous", "prismatic"):
        element = joint.find("axis")
        axis = np.array(_floats("1 0 0" if element is None else element.get("xyz"), 3))
        turn = _onto_x(axis / np.linalg.norm(axis))
    x, y, z, w = quaternion_xyzw(origin[:3, :3] @ turn)
    made.CreateLocalPos0Attr(Gf.Vec3f(*map(float, origin[:3, 3])))
    made.CreateLocalRot0Attr(Gf.Quatf(float(w), Gf.Vec3f(float(x), float(y), float(z))))
    x, y, z, w = quaternion_xyzw(turn)
    made.CreateLocalPos1Attr(Gf.Vec3f(0.0, 0.0, 0.0))
    made.CreateLocalRot1Attr(Gf.Quatf(float(w), Gf.Vec3f(float(x), float(y), float(z))))
    if kind in ("revolute", "continuous", "prismatic"):
        made.CreateAxisAttr("X")
        _limits_and_drive(made, joint, robot)


def _limits_and_drive(made: Any, joint: ET.Element, robot: Robot) -> None:
    from pxr import UsdPhysics

    name, slides = joint.get("name", ""), joint.get("type") == "prismatic"
    limit = joint.find("limit")
    unit = 1.0 if slides else 1.0 / _DEGREE
    if limit is not None and joint.get("type") != "continuous":
        made.CreateLowerLimitAttr(float(limit.get("lower", "0")) * unit)
        made.CreateUpperLimitAttr(float(limit.get("upper", "0")) * unit)
    servo = next((s for s in robot.modules.servos if s.joint == name), None)
    if servo is None:
        return
    drive = UsdPhysics.DriveAPI.Apply(made.GetPrim(), "linear" if slides else "angular")
    drive.CreateTypeAttr("force")
    drive.CreateStiffnessAttr(servo.stiffness / unit)
    drive.CreateDampingAttr(servo.damping / unit)
    drive.CreateTargetPositionAttr(0.0)
    if limit is not None and float(limit.get("effort", "0")) > 0:
        drive.CreateMaxForceAttr(float(limit.get("effort", "0")))


def _rotors(prims: dict[str, Any], robot: Robot) -> None:
    """Writes each rotor's data as custom attributes of its link."""
    from pxr import Gf, Sdf

    for apparatus in robot.modules.apparatuses:
        for rotor in apparatus.rotors:
            prim = prims[rotor.link]
            axis = prim.CreateAttribute("snakegen:rotor:axis", Sdf.ValueTypeNames.Float3)
            axis.Set(Gf.Vec3f(*map(float, rotor.axis)))
            for key in ("thrust_min", "thrust_max", "drag_ratio", "lag"):
                made = prim.CreateAttribute(f"snakegen:rotor:{key}", Sdf.ValueTypeNames.Double)
                made.Set(float(getattr(rotor, key)))


def _poses(urdf: ET.Element) -> dict[str, Floats]:
    """Returns each link's pose (4, 4) in the root's frame, every joint at 0."""
    joints = urdf.findall("joint")
    children = {_ends(j)[1] for j in joints}
    root = next(
        link.get("name", "") for link in urdf.findall("link") if link.get("name") not in children
    )
    out, waiting = {root: np.eye(4)}, list(joints)
    while waiting:
        ready = [j for j in waiting if _ends(j)[0] in out]
        for j in ready:
            parent, child = _ends(j)
            out[child] = out[parent] @ _pose(j.find("origin"))
        waiting = [j for j in waiting if j not in ready]
    return out


def _ends(joint: ET.Element) -> tuple[str, str]:
    """Returns the names of a joint's parent and child links."""
    found = [joint.find(end) for end in ("parent", "child")]
    parent, child = ("" if e is None else e.get("link", "") for e in found)
    return parent, child


def _inertial(element: ET.Element) -> tuple[float, Floats, Floats]:
    pose = _pose(element.find("origin"))
    mass, given = element.find("mass"), element.find("inertia")
    i = {k: float(given.get(k, "0")) for k in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")}  # type: ignore[union-attr]
    own = np.array(
        [
            [i["ixx"], i["ixy"], i["ixz"]],
            [i["ixy"], i["iyy"], i["iyz"]],
            [i["ixz"], i["iyz"], i["izz"]],
        ]
    )
    turn = pose[:3, :3]
    return float(mass.get("value", "0")), pose[:3, 3], turn @ own @ turn.T  # type: ignore[union-attr]


def _pose(origin: ET.Element | None) -> Floats:
    out = np.eye(4)
    if origin is not None:
        out[:3, :3] = rotation_from_rpy(_floats(origin.get("rpy", "0 0 0"), 3))
        out[:3, 3] = _floats(origin.get("xyz", "0 0 0"), 3)
    return out


def _onto_x(axis: Floats) -> Floats:
    """Returns a rotation whose x is `axis`."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    y = np.cross(axis, other)
    y /= np.linalg.norm(y)
    return np.column_stack([axis, y, np.cross(axis, y)])


def _matrix(pose: Floats) -> Any:
    from pxr import Gf

    return Gf.Matrix4d(*map(float, pose.T.ravel()))  # USD multiplies rows


def _floats(text: str | None, count: int) -> list[float]:
    values = [float(v) for v in (text or "").split()]
    return values if len(values) == count else [0.0] * count


def _prim(name: str) -> str:
    """Returns `name` as a prim may be called."""
    out = re.sub(r"\W", "_", name, flags=re.ASCII)
    return out if out and not out[0].isdigit() else f"_{out}"
