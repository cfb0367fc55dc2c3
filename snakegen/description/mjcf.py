"""MJCF derived from the URDF through MjSpec: imported, then decorated; never written twice."""

import re
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from snakegen.errors import DescriptionError
from snakegen.geometry import quaternion_xyzw, rotation_onto, wxyz_from_xyzw
from snakegen.modules import Modules

GRAVITY = 9.81
_DENSE_BELOW = 60  # degrees of freedom: small models solve faster with a dense Jacobian
_IMPORT = (
    '<mujoco><compiler discardvisual="{}" fusestatic="false" strippath="false" '
    'balanceinertia="false"/></mujoco>'
)
_VISUAL = re.compile(r"<visual\b.*?</visual>", re.DOTALL)


def decorate(
    urdf: str, modules: Modules, assets: Mapping[str, bytes], *, visuals: bool = True
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

    Raises:
        DescriptionError: MuJoCo cannot read or compile the model.
    """
    head = _IMPORT.format("false" if visuals else "true")
    text = urdf if visuals else _VISUAL.sub("", urdf)
    text = re.sub(r"(<robot\b[^>]*>)", lambda m: m.group(1) + head, text, count=1)
    try:
        spec = mujoco.MjSpec.from_string(text, assets=dict(assets))
        _options(spec)
        root = spec.worldbody.first_body()
        if modules.floating:
            root.add_freejoint(name="root")
        _classes(spec)
        _rotors(spec, modules)
        _servos(spec, modules)
        _sensors(spec, root, modules)
        _excludes(spec)
        _scenery(spec, root)
        _keyframes(spec, modules)
    except ValueError as error:
        raise DescriptionError(f"MuJoCo cannot take the model: {error}") from None
    return spec


def scene(robot_file: str, model: str) -> str:
    """Returns scene.xml: the robot on a floor under a sky."""
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
    <material name="floor" texture="floor" texrepeat="2 2" texuniform="true" reflectance="0.05"/>
  </asset>

  <worldbody>
    <geom name="floor" type="plane" size="0 0 0.05" material="floor"/>
  </worldbody>
</mujoco>
"""


def _options(spec: mujoco.MjSpec) -> None:
    spec.compiler.savecompiled = False
    spec.compiler.savecanonical = False
    spec.option.timestep = 0.001
    spec.option.gravity = [0.0, 0.0, -GRAVITY]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1280, 960


def _classes(spec: mujoco.MjSpec) -> None:
    visual = spec.add_default("visual", spec.default)
    visual.geom.contype, visual.geom.conaffinity = 0, 0
    visual.geom.group, visual.geom.density = 2, 0.0
    collision = spec.add_default("collision", spec.default)
    collision.geom.group = 3
    for geom in spec.geoms:
        seen = geom.contype == 0 and geom.conaffinity == 0
        geom.classname, geom.group = (visual, 2) if seen else (collision, 3)


def _rotors(spec: mujoco.MjSpec, modules: Modules) -> None:
    """Adds a site and an actuator per rotor: force along the site's z, κ's torque in the gear."""
    for apparatus in modules.apparatuses:
        for rotor in apparatus.rotors:
            body = spec.body(rotor.link)
            site = body.add_site(name=rotor.link, size=[0.005] * 3, group=4)
            site.quat = wxyz_from_xyzw(quaternion_xyzw(rotation_onto(rotor.axis)))
            actuator = spec.add_actuator(
                name=rotor.link,
                trntype=mujoco.mjtTrn.mjTRN_SITE,
                target=rotor.link,
                gear=[0.0, 0.0, 1.0, 0.0, 0.0, rotor.drag_ratio],
                ctrlrange=[rotor.thrust_min, rotor.thrust_max],
            )
            if rotor.lag > 0:
                actuator.dyntype = mujoco.mjtDyn.mjDYN_FILTEREXACT
                actuator.dynprm[0] = rotor.lag


def _servos(spec: mujoco.MjSpec, modules: Modules) -> None:
    """Adds a position servo per driven joint; force limits come from the URDF's effort.

    The limit moves from the joint to its servo: MuJoCo's joint limit also clips what thrust on
    the links beyond makes of the joint (measured: 0.6 N m lost in hover, and the body folds up).
    """
    for servo in modules.servos:
        joint = spec.joint(servo.joint)
        joint.armature = servo.armature
        joint.frictionloss = servo.friction
        effort = float(joint.actfrcrange[1])
        joint.actfrclimited, joint.actfrcrange = mujoco.mjtLimited.mjLIMITED_FALSE, [0.0, 0.0]
        actuator = spec.add_actuator(
            name=servo.joint,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            target=servo.joint,
            forcerange=[-effort, effort],
            ctrlrange=list(joint.range),
        )
        actuator.set_to_position(kp=servo.stiffness, kv=servo.damping)


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
    for servo in modules.servos:
        for suffix, type_, object_ in (
            ("position", kind.mjSENS_JOINTPOS, thing.mjOBJ_JOINT),
            ("velocity", kind.mjSENS_JOINTVEL, thing.mjOBJ_JOINT),
            ("torque", kind.mjSENS_ACTUATORFRC, thing.mjOBJ_ACTUATOR),
        ):
            name = f"{servo.joint}_{suffix}"
            spec.add_sensor(name=name, type=type_, objtype=object_, objname=servo.joint)


def _excludes(spec: mujoco.MjSpec) -> None:
    """Excludes contact between bodies one body apart, and between those that touch at rest."""
    solid = {b.name for b in spec.bodies if any(g.contype for g in b.geoms)}
    pairs = []
    for body in spec.bodies:
        around = [b.name for b in body.bodies]
        if body.parent is not None and body.parent.name != "world":
            around.insert(0, body.parent.name)
        around = [n for n in around if n in solid]
        if body.name != "world":
            pairs += [(a, b) for i, a in enumerate(around) for b in around[i + 1 :]]
    for first, second in pairs:
        spec.add_exclude(name=f"{first}_{second}", bodyname1=first, bodyname2=second)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    touching = {
        tuple(model.body(model.geom_bodyid[g]).name for g in contact.geom)
        for contact in data.contact
    }
    for first, second in sorted(touching):
        spec.add_exclude(name=f"{first}_{second}", bodyname1=first, bodyname2=second)


def _extent(spec: mujoco.MjSpec) -> tuple[Any, Any, np.ndarray, float]:
    """Returns model, data at rest, and centre and half-diagonal [m] of the box round the bodies."""
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    low = (data.geom_xpos - model.geom_rbound[:, None]).min(axis=0)
    high = (data.geom_xpos + model.geom_rbound[:, None]).max(axis=0)
    return model, data, 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))


def _scenery(spec: mujoco.MjSpec, root: Any) -> None:
    """Adds a camera that follows the robot, a light, and the statistic that viewers start from."""
    model, _, centre, radius = _extent(spec)
    spec.stat.center = [0.0, 0.0, 0.5]
    spec.stat.extent = round(2.0 * radius, 3)
    if model.nv < _DENSE_BELOW:
        spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    away = np.array([0.35, -1.0, 0.55])
    away /= np.linalg.norm(away)
    right = np.cross([0.0, 0.0, 1.0], away)
    right /= np.linalg.norm(right)
    up = np.cross(away, right)
    camera = root.add_camera(name="track", mode=mujoco.mjtCamLight.mjCAMLIGHT_TRACKCOM)
    camera.pos = [round(float(x), 4) for x in centre + 2.2 * radius * away]
    camera.quat = wxyz_from_xyzw(quaternion_xyzw(np.column_stack([right, up, away]))).round(6)
    camera.fovy = 40.0
    down = np.array([-0.1, 0.3, -1.0])
    above = centre - (1.5 * radius + 1.5) * down / np.linalg.norm(down)
    root.add_light(  # near the robot: a far one leaves its shadow coarse
        name="sun",
        mode=mujoco.mjtCamLight.mjCAMLIGHT_TRACKCOM,
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=[round(float(x), 4) for x in above],
        dir=down,
        diffuse=[0.55] * 3,
        castshadow=True,
    )
    spec.visual.quality.shadowsize = 8192


def _keyframes(spec: mujoco.MjSpec, modules: Modules) -> None:
    """Adds `home` (1 m up, hover thrust) and `floor` (at rest on the ground, rotors off)."""
    model, data, _, _ = _extent(spec)
    thrust = np.zeros(model.nu)
    rotors = [r for a in modules.apparatuses for r in a.rotors]
    if rotors:
        share = float(model.body_mass.sum()) * GRAVITY / len(rotors)
        for rotor in rotors:
            thrust[model.actuator(rotor.link).id] = min(share, rotor.thrust_max)
    home, floor = np.array(model.qpos0), np.array(model.qpos0)
    if modules.floating:
        home[2], floor[2] = 1.0, -lowest_point(model, data)
    act = thrust[[i for i in range(model.nu) if model.actuator_dyntype[i]]]
    spec.add_key(name="home", qpos=home, ctrl=thrust, act=act)
    spec.add_key(name="floor", qpos=floor)


def lowest_point(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Returns the least height [m] of any collision geom: spheres, capsules, cylinders, boxes."""
    heights = [float("inf")]
    kind = mujoco.mjtGeom
    for g in np.flatnonzero(model.geom_contype):
        axes = data.geom_xmat[g].reshape(3, 3)
        size, z = model.geom_size[g], data.geom_xpos[g][2]
        along = abs(axes[2, 2])
        across = np.sqrt(max(0.0, 1.0 - along**2))
        if model.geom_type[g] == kind.mjGEOM_PLANE:
            continue
        if model.geom_type[g] == kind.mjGEOM_SPHERE:
            reach = size[0]
        elif model.geom_type[g] == kind.mjGEOM_CAPSULE:
            reach = size[0] + size[1] * along
        elif model.geom_type[g] == kind.mjGEOM_CYLINDER:
            reach = size[0] * across + size[1] * along
        elif model.geom_type[g] == kind.mjGEOM_BOX:
            reach = float(np.abs(axes[2]) @ size)
        else:
            reach = model.geom_rbound[g]
        heights.append(z - reach)
    return float(min(heights))
