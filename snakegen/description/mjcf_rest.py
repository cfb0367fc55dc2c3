"""What an MJCF takes from the robot at rest: excluded contacts, camera and light, keyframes.

All of it needs the compiled model once; for a chain of hundreds of links that is most of a build.
"""

from typing import Any

import mujoco
import numpy as np

from snakegen.geometry import Floats, quaternion_xyzw, wxyz_from_xyzw
from snakegen.modules import Modules

GRAVITY = 9.81
_DENSE_BELOW = 60  # degrees of freedom: small models solve faster with a dense Jacobian


def add_from_rest(spec: mujoco.MjSpec, root: Any, modules: Modules) -> None:
    """Adds excludes, camera, light, statistic and keyframes; rotors and servos are there already.

    Args:
        spec: the robot's.
        root: its root body.
        modules: what its links carry.
    """
    _exclude_neighbours(spec)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    _exclude_touching(spec, model, data)
    low = (data.geom_xpos - model.geom_rbound[:, None]).min(axis=0)
    high = (data.geom_xpos + model.geom_rbound[:, None]).max(axis=0)
    centre, radius = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
    spec.stat.center = [0.0, 0.0, 0.5]
    spec.stat.extent = round(2.0 * radius, 3)
    if model.nv < _DENSE_BELOW:
        spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    _camera_and_light(root, centre, radius)
    spec.visual.quality.shadowsize = 8192
    _keyframes(spec, model, data, modules)


def _exclude_neighbours(spec: mujoco.MjSpec) -> None:
    """Excludes contact between solid bodies one body apart: parents, children, siblings."""
    solid = {b.name for b in spec.bodies if any(g.contype for g in b.geoms)}
    for body in spec.bodies:
        around = [b.name for b in body.bodies]
        if body.parent is not None and body.parent.name != "world":
            around.insert(0, body.parent.name)
        around = [n for n in around if n in solid]
        if body.name != "world":
            for i, first in enumerate(around):
                for second in around[i + 1 :]:
                    _exclude(spec, first, second)


def _exclude_touching(spec: mujoco.MjSpec, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Excludes contact between bodies that touch at rest: parts that overlap in the drawing."""
    touching = {
        tuple(sorted(model.body(model.geom_bodyid[g]).name for g in contact.geom))
        for contact in data.contact
    }
    for first, second in sorted(touching):
        _exclude(spec, first, second)


def _exclude(spec: mujoco.MjSpec, first: str, second: str) -> None:
    spec.add_exclude(name=f"{first}_{second}", bodyname1=first, bodyname2=second)


def _camera_and_light(root: Any, centre: Floats, radius: float) -> None:
    """Adds a camera and a light that follow the robot, whose box has half-diagonal `radius` [m]."""
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


def _keyframes(
    spec: mujoco.MjSpec, model: mujoco.MjModel, data: mujoco.MjData, modules: Modules
) -> None:
    """Adds `home` (1 m up, hover thrust; a drive without rotors stands) and `floor` (at rest)."""
    thrust = np.zeros(model.nu)
    rotors = [r for a in modules.apparatuses for r in a.rotors]
    if rotors and modules.floating:
        share = float(model.body_mass.sum()) * GRAVITY / len(rotors)
        for rotor in rotors:
            thrust[model.actuator(rotor.link).id] = min(share, rotor.thrust_max)
    home, floor = np.array(model.qpos0), np.array(model.qpos0)
    if modules.floating:
        floor[2] = model.qpos0[2] - lowest_point(model, data)
        home[2] = floor[2] if modules.screws and not rotors else 1.0
    act = thrust[[i for i in range(model.nu) if model.actuator_dyntype[i]]]
    spec.add_key(name="home", qpos=home, ctrl=thrust, act=act)
    spec.add_key(name="floor", qpos=floor)


def lowest_point(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Returns the least height [m] of any moving collision geom; meshes by their bounding ball."""
    heights = [float("inf")]
    kind = mujoco.mjtGeom
    solid = (model.geom_contype | model.geom_conaffinity) != 0
    for g in np.flatnonzero(solid & (model.geom_bodyid != 0)):
        axes = data.geom_xmat[g].reshape(3, 3)
        size, z = model.geom_size[g], data.geom_xpos[g][2]
        along = abs(axes[2, 2])
        across = np.sqrt(max(0.0, 1.0 - along**2))
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
