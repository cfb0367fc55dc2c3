"""Joints whose limits are one angle: MuJoCo's importer reads them as joints without limits."""

import xml.etree.ElementTree as ET

import mujoco

WIDTH = 1e-10  # rad or m: a range of no width is refused


def lock_joints(spec: mujoco.MjSpec, urdf: str) -> None:
    """Gives each joint of `spec` whose lower and upper limit are the same a range around it.

    Args:
        spec: made of the URDF.
        urdf: URDF text.
    """
    for joint in ET.fromstring(urdf).iterfind("joint"):
        limit = joint.find("limit")
        if limit is None or joint.get("type") not in ("revolute", "prismatic"):
            continue
        low, high = float(limit.get("lower", 0.0)), float(limit.get("upper", 0.0))
        made = spec.joint(str(joint.get("name")))
        if low == high and made is not None:
            made.limited = mujoco.mjtLimited.mjLIMITED_TRUE
            made.range = [low - WIDTH, high + WIDTH]
