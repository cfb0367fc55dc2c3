"""MJCF derived from the URDF through MjSpec: imported, then decorated; never written twice."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from snakegen.base.geometry import (
    Floats,
    quaternion_xyzw,
    rotation_from_xyzw,
    rotation_onto,
    wxyz_from_xyzw,
    xyzw_from_wxyz,
)
from snakegen.description.mjcf.base_mount import Support
from snakegen.description.mjcf.locked_joints import lock_joints
from snakegen.description.mjcf.rolling_contact import decorate_drive
from snakegen.description.mjcf.scene_elements import GRAVITY, add_from_rest, lowest_point
from snakegen.description.mjcf.urdf_import import importable
from snakegen.errors import DescriptionError
from snakegen.robot.modules import Modules, Servo
from snakegen.robot.rotor_shafts import rotor_shafts

__all__ = ["decorate", "lowest_point", "scene"]

_IMPORT = (
    '<mujoco><compiler discardvisual="{}" fusestatic="false" strippath="false" '
    'balanceinertia="false"/></mujoco>'
)
FLOOR_SQUARE = 0.25
"""Side of a square of the floor [m]: the checker has two by two, drawn `1 / (2 side)` a metre."""
_MANY, _ARENA = 1500, 15 << 20  # bodies above which MuJoCo's own memory is too small; bytes
_COLLISION_COLOUR = [0.9, 0.3, 0.3, 0.4]


def decorate(
    urdf: str,
    modules: Modules,
    assets: Mapping[str, bytes],
    *,
    visuals: bool = True,
    rollers: str | None = None,
    folder: Path | None = None,
) -> mujoco.MjSpec:
    """Returns the MJCF of a URDF, with everything that a simulation needs.

    Added: free joint, thrust sites and rotors (drag torque in the gear, motor lag as activation),
    servos, IMU and joint sensors, visual and collision classes, excludes, keyframes, camera,
    light, statistic.

    Args:
        urdf: URDF text.
        modules: what its links carry.
        assets: mesh files by the path that the URDF gives.
        visuals: keep what is only seen; a simulation needs none of it, nor its meshes.
        rollers: how drums touch the ground, in place of the modules' own.
        folder: where mesh paths that `assets` does not have start.

    Raises:
        DescriptionError: MuJoCo cannot read or compile the model.
    """
    ready = importable(urdf, folder, assets, visuals=visuals)
    head = _IMPORT.format("false" if visuals else "true")
    text = re.sub(r"(<robot\b[^>]*>)", lambda m: m.group(1) + head, ready.text, count=1)
    try:
        spec = mujoco.MjSpec.from_string(text, assets=ready.assets)
        _options(spec)
        if folder is not None:  # links without <inertial> weigh nothing, whatever their shapes
            spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
        root = spec.worldbody.first_body()
        if modules.floating:
            root.add_freejoint(name="root")
        _classes(spec)
        lock_joints(spec, urdf)
        _rotors(spec, modules, rotor_shafts(urdf, modules))
        _servos(spec, modules)
        if modules.screws:
            decorate_drive(spec, modules, rollers)
        _sensors(spec, root, modules)
        add_from_rest(spec, root, modules)
    except (ValueError, mujoco.FatalError) as error:
        raise DescriptionError(_refusal(" ".join(str(error).split()))) from None
    return spec


def _refusal(error: str) -> str:
    """Returns what MuJoCo's message of a model that it does not take means, and the remedy."""
    light = re.search(r"larger than mjMINVAL.*Element name '([^']*)'", error, re.S)
    if light is None:
        return f"MuJoCo cannot take the model: {error}"
    return (
        f"MuJoCo cannot take the model: link '{light[1]}' moves without mass or inertia; give it "
        "both, or make its joint fixed."
    )


def _options(spec: mujoco.MjSpec) -> None:
    count = len(spec.bodies)
    if count > _MANY:  # MuJoCo's collision stack grows as the square of the bodies
        spec.memory = _ARENA + 12 * count**2  # and contacts of all links at once
    spec.compiler.savecompiled = False
    spec.compiler.savecanonical = False
    spec.option.timestep = 0.001
    spec.option.gravity = [0.0, 0.0, -GRAVITY]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1280, 960


def _classes(spec: mujoco.MjSpec) -> None:
    """Sorts geoms into what is seen (group 2) and what collides (group 3, translucent)."""
    visual = spec.add_default("visual", spec.default)
    visual.geom.contype, visual.geom.conaffinity = 0, 0
    visual.geom.group, visual.geom.density = 2, 0.0
    collision = spec.add_default("collision", spec.default)
    collision.geom.group, collision.geom.rgba = 3, _COLLISION_COLOUR
    for geom in spec.geoms:
        if geom.contype == 0 and geom.conaffinity == 0:
            geom.classname, geom.group = visual, 2
        else:
            geom.classname, geom.group, geom.rgba = collision, 3, _COLLISION_COLOUR


def _rotors(spec: mujoco.MjSpec, modules: Modules, shafts: frozenset[str]) -> None:
    """Adds a site and an actuator per rotor: force along the site's z, κ's torque in the gear."""
    for apparatus in modules.apparatuses:
        for rotor in apparatus.rotors:
            body, position, rotation = _carrier(spec, rotor.link, shafts)
            position = position + rotation @ np.array(rotor.position)
            site = body.add_site(name=rotor.label, size=[0.005] * 3, group=4)
            turned = rotation @ rotation_onto(rotor.axis)
            site.pos, site.quat = position, wxyz_from_xyzw(quaternion_xyzw(turned))
            actuator = spec.add_actuator(
                name=rotor.label,
                trntype=mujoco.mjtTrn.mjTRN_SITE,
                target=rotor.label,
                gear=[0.0, 0.0, 1.0, 0.0, 0.0, rotor.drag_ratio],
                ctrlrange=[rotor.thrust_min, rotor.thrust_max],
            )
            if rotor.lag > 0:
                actuator.dyntype = mujoco.mjtDyn.mjDYN_FILTEREXACT
                actuator.dynprm[0] = rotor.lag


def _carrier(spec: mujoco.MjSpec, link: str, shafts: frozenset[str]) -> tuple[Any, Floats, Floats]:
    """Returns the body that a rotor pushes, and the rotor's position and attitude in it.

    A URDF may let the rotor spin on a joint of its own: thrust and drag then act on what carries
    that joint, since nothing could hold the drag torque on a shaft that turns freely.
    """
    body, position, rotation = spec.body(link), np.zeros(3), np.eye(3)
    chain, here = [], body
    while here.name != "world" and not here.joints:
        chain.append(here)
        here = here.parent
    if not any(joint.name in shafts for joint in here.joints):
        return body, position, rotation
    for below in (*chain, here):
        turn = rotation_from_xyzw(xyzw_from_wxyz(np.array(below.quat)))
        position, rotation = np.array(below.pos) + turn @ position, turn @ rotation
    return here.parent, position, rotation


def _limited(joint: Any) -> bool:
    return bool(joint.range[0] < joint.range[1])


def _servos(spec: mujoco.MjSpec, modules: Modules) -> None:
    """Adds a position servo per driven joint; force limits come from the URDF's effort.

    The limit moves from the joint to its servo: MuJoCo's joint limit also clips what thrust on
    the links beyond makes of the joint (measured: 0.6 N·m lost in hover, and the body folds up).
    Servos of one make share a class.
    """
    gimbals = {n for a in modules.apparatuses for n in (a.roll, a.pitch)}
    classes: dict[tuple[Any, ...], Any] = {}
    for servo in modules.servos:
        kind = "gimbal" if servo.joint in gimbals else "joint"
        make = (kind, servo.stiffness, servo.damping, servo.armature, servo.friction)
        if make not in classes:
            count = sum(key[0] == kind for key in classes)
            name = f"{kind}_servo{count + 1 if count else ''}"
            classes[make] = _servo_class(spec, name, servo)
        joint = spec.joint(servo.joint)
        effort = float(joint.actfrcrange[1])
        joint.classname = classes[make]
        joint.armature, joint.frictionloss = servo.armature, servo.friction
        joint.actfrclimited, joint.actfrcrange = mujoco.mjtLimited.mjLIMITED_AUTO, [0.0, 0.0]
        actuator = spec.add_actuator(
            classes[make],
            name=servo.joint,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            target=servo.joint,
        )
        if effort > 0:
            actuator.forcerange = [-effort, effort]
        if _limited(joint):
            actuator.ctrlrange = list(joint.range)


def _servo_class(spec: mujoco.MjSpec, name: str, servo: Servo) -> Any:
    made = spec.add_default(name, spec.default)
    made.joint.armature, made.joint.frictionloss = servo.armature, servo.friction
    made.actuator.set_to_position(kp=servo.stiffness, kv=servo.damping)
    return made


def _sensors(spec: mujoco.MjSpec, root: Any, modules: Modules) -> None:
    """Adds IMU, pose and velocity of the root link, CoG, and position and torque of each joint."""
    kind, thing = mujoco.mjtSensor, mujoco.mjtObj
    root.add_site(name="imu", size=[0.005] * 3, group=4)
    site, subtree = thing.mjOBJ_SITE, thing.mjOBJ_BODY
    for name, type_, object_, target in (
        ("imu_gyro", kind.mjSENS_GYRO, site, "imu"),
        ("imu_accelerometer", kind.mjSENS_ACCELEROMETER, site, "imu"),
        ("imu_quaternion", kind.mjSENS_FRAMEQUAT, site, "imu"),
        ("root_position", kind.mjSENS_FRAMEPOS, site, "imu"),
        ("root_velocity", kind.mjSENS_FRAMELINVEL, site, "imu"),
        ("cog_position", kind.mjSENS_SUBTREECOM, subtree, root.name),
        ("cog_velocity", kind.mjSENS_SUBTREELINVEL, subtree, root.name),
    ):
        spec.add_sensor(name=name, type=type_, objtype=object_, objname=target)
    for suffix, type_, object_ in (
        ("position", kind.mjSENS_JOINTPOS, thing.mjOBJ_JOINT),
        ("velocity", kind.mjSENS_JOINTVEL, thing.mjOBJ_JOINT),
        ("torque", kind.mjSENS_ACTUATORFRC, thing.mjOBJ_ACTUATOR),
    ):
        for servo in modules.servos:
            name = f"{servo.joint}_{suffix}"
            spec.add_sensor(name=name, type=type_, objtype=object_, objname=servo.joint)
    for screw in modules.screws:
        for suffix, type_ in (
            ("rate", kind.mjSENS_ACTUATORVEL),
            ("torque", kind.mjSENS_ACTUATORFRC),
        ):
            name, actuator = f"{screw.joint}_{suffix}", thing.mjOBJ_ACTUATOR
            spec.add_sensor(name=name, type=type_, objtype=actuator, objname=screw.joint)


def scene(robot_file: str, model: str, floor: float = 0.0, supports: Sequence[Support] = ()) -> str:
    """Returns scene.xml: the robot above a floor under a sky, its base held by its supports.

    Args:
        robot_file: name of the MJCF beside it.
        model: name of the robot.
        floor: m, height of the floor.
        supports: what holds a fixed base.
    """
    held = "".join(f"\n    {_support(one)}" for one in supports)
    repeat = 0.5 / FLOOR_SQUARE
    return f"""<mujoco model="{model} scene">
  <include file="{robot_file}"/>

  <visual>
    <headlight diffuse="0.5 0.5 0.5" ambient="0.35 0.35 0.35" specular="0.1 0.1 0.1"/>
    <rgba haze="0.82 0.87 0.92 1"/>
    <global azimuth="130" elevation="-20"/>
  </visual>

  <asset>
    <texture name="sky" type="skybox" builtin="gradient" rgb1="0.86 0.91 0.96" rgb2="0.55 0.67 0.80"
             width="256" height="1536"/>
    <texture name="floor" type="2d" builtin="checker" rgb1="0.80 0.81 0.82" rgb2="0.74 0.75 0.77"
             width="256" height="256"/>
    <material name="floor" texture="floor" texrepeat="{repeat:g} {repeat:g}" texuniform="true"
              reflectance="0.05"/>
  </asset>

  <worldbody>
    <geom name="floor" type="plane" pos="0 0 {floor:g}" size="0 0 0.05" material="floor" contype="3"
          conaffinity="3"/>{held}
  </worldbody>
</mujoco>
"""


def _support(one: Support) -> str:
    """Returns a support as a geom, solid to links and rollers alike."""
    quat = wxyz_from_xyzw(quaternion_xyzw(one.rotation))

    def text(values: Any) -> str:
        return " ".join(f"{x:.6g}" for x in np.round(values, 6) + 0.0)

    return (
        f'<geom name="{one.name}" type="{one.kind}" size="{text(one.size)}"\n          '
        f'pos="{text(one.position)}" quat="{text(quat)}" rgba="0.55 0.57 0.60 1"\n          '
        'contype="3" conaffinity="3"/>'
    )
