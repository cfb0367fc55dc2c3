"""A USD stage held against Pinocchio's model, read back through USD's own API."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from snakegen.base.geometry import Floats
from snakegen.errors import DescriptionError
from snakegen.robot.robot import Robot

_DEGREE = np.pi / 180.0
_SINGLE = 1e-5  # USD keeps masses, axes and limits in single precision


def check_stage(robot: Robot, path: Path) -> None:
    """Reads a stage back through USD's own API and holds it against Pinocchio's model.

    Mass, centre of mass and inertia of the whole body in the reference posture, and axis, limits
    and effort of each joint.

    Raises:
        DescriptionError: names what differs.
    """
    from pxr import Usd, UsdGeom, UsdPhysics

    stage = Usd.Stage.Open(str(path))
    cache = UsdGeom.XformCache()
    total, first, bodies = 0.0, np.zeros(3), []
    for prim in stage.Traverse():
        if not prim.HasAPI(UsdPhysics.MassAPI):
            continue
        api = UsdPhysics.MassAPI(prim)
        world = np.array(cache.GetLocalToWorldTransform(prim)).T
        mass = api.GetMassAttr().Get()
        centre = (world @ [*api.GetCenterOfMassAttr().Get(), 1.0])[:3]
        q = api.GetPrincipalAxesAttr().Get()
        turn = world[:3, :3] @ _rotation(np.array([*q.GetImaginary(), q.GetReal()]))
        inertia = turn @ np.diag(list(api.GetDiagonalInertiaAttr().Get())) @ turn.T
        bodies.append((mass, centre, inertia))
        total, first = total + mass, first + mass * centre
    cog = first / total if total > 0 else first
    inertia = np.zeros((3, 3))
    for mass, centre, own in bodies:
        d = centre - cog
        inertia += own + mass * (d @ d * np.eye(3) - np.outer(d, d))
    _refuse(robot, path, total, cog, inertia)
    for prim in stage.Traverse():
        if prim.IsA(UsdPhysics.RevoluteJoint):
            _check_joint(robot, path, UsdPhysics.RevoluteJoint(prim), cache, stage)


def _refuse(robot: Robot, path: Path, mass: float, cog: Floats, inertia: Floats) -> None:
    """Raises where the composite body differs from Pinocchio's by more than single precision."""
    model, data = robot.model, robot.model.createData()
    pin.crba(model, data, pin.neutral(model))
    whole = pin.computeTotalMass(model) + (0.0 if robot.floating else model.inertias[0].mass)
    if abs(mass - whole) > _SINGLE * max(whole, 1.0):
        raise DescriptionError(f"{path.name}: mass {mass:.6g} kg, the URDF's is {whole:.6g} kg.")
    if not robot.floating:
        return
    pin.ccrba(model, data, pin.neutral(model), np.zeros(model.nv))
    right = np.asarray(data.Ig.inertia)
    gaps = {
        "centre of mass": np.abs(cog - np.asarray(data.com[0])).max(),
        "inertia": np.abs(inertia - right).max() / max(np.abs(right).max(), 1e-12),
    }
    for what, gap in gaps.items():
        if gap > _SINGLE:
            raise DescriptionError(f"{path.name}: {what} differs from the URDF's by {gap:.1e}.")


def _check_joint(robot: Robot, path: Path, joint: Any, cache: Any, stage: Any) -> None:
    name = str(joint.GetPrim().GetCustomDataByKey("urdf_name"))
    model, data = robot.model, robot.model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    number = model.getJointId(name)
    unit = np.zeros(model.nv)
    unit[model.joints[number].idx_v] = 1.0
    pin.forwardKinematics(model, data, pin.neutral(model), unit)
    child = stage.GetPrimAtPath(joint.GetBody1Rel().GetTargets()[0])
    frame = model.getFrameId(str(child.GetCustomDataByKey("urdf_name")), pin.FrameType.BODY)
    rate = pin.getFrameVelocity(model, data, frame, pin.LOCAL).angular
    q = joint.GetLocalRot1Attr().Get()
    axis = _rotation(np.array([*q.GetImaginary(), q.GetReal()]))[:, 0]
    if np.abs(axis - rate).max() > _SINGLE:
        raise DescriptionError(f"{path.name}: axis of {name} differs from the URDF's.")
    low, high, _ = robot.limits([name])
    free = model.joints[number].nq == 2
    for said, right in ((joint.GetLowerLimitAttr(), low[0]), (joint.GetUpperLimitAttr(), high[0])):
        given = said.Get()
        if not free and abs(given * _DEGREE - right) > _SINGLE:
            raise DescriptionError(f"{path.name}: limit of {name} differs from the URDF's.")


def _rotation(xyzw: Floats) -> Floats:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_quat(xyzw).as_matrix())
