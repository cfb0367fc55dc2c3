"""What an MJCF takes from the robot at rest: excluded contacts, camera and light, keyframes.

All of it needs the compiled model once; for a chain of hundreds of links that is most of a build.
"""

from typing import Any

import mujoco
import numpy as np

from snakegen.base.geometry import Floats, quaternion_xyzw, wxyz_from_xyzw
from snakegen.base.rounding import significant
from snakegen.description.mjcf.neighbours import OVERLAP, exclude, exclude_neighbours
from snakegen.robot.modules import Modules

GRAVITY = 9.81
_DENSE_BELOW = 60  # degrees of freedom: small models solve faster with a dense Jacobian


def add_from_rest(spec: mujoco.MjSpec, root: Any, modules: Modules) -> None:
    """Adds excludes, camera, light, statistic and keyframes; rotors and servos are there already.

    Args:
        spec: the robot's.
        root: its root body.
        modules: what its links carry.
    """
    exclude_neighbours(spec, modules)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    _exclude_touching(spec, model, data)
    low, high = _box(model, data)
    centre, radius = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
    spec.stat.center = [0.0, 0.0, 0.5]
    spec.stat.extent = round(2.0 * radius, 3)
    if model.nv < _DENSE_BELOW:
        spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    turn = data.xmat[model.body(root.name).id].reshape(3, 3)
    _camera_and_light(root, centre, radius, turn)
    spec.visual.quality.shadowsize = 8192
    _keyframes(spec, root, model, data, modules)


def _box(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Floats, Floats]:
    """Returns the corners of a box round the robot; round its bodies where it has no geometry."""
    places, radii = data.geom_xpos, model.geom_rbound[:, None]
    if model.ngeom == 0:
        places, radii = data.xpos[1:], np.full((model.nbody - 1, 1), 0.1)
    return (places - radii).min(axis=0), (places + radii).max(axis=0)


def _exclude_touching(spec: mujoco.MjSpec, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Excludes contact between bodies that touch at rest: parts that overlap in the drawing."""
    touching = {
        tuple(sorted(model.body(model.geom_bodyid[g]).name for g in contact.geom))
        for contact in data.contact
    }
    for first, second in sorted(touching):
        exclude(spec, first, second, OVERLAP)


def _camera_and_light(root: Any, centre: Floats, radius: float, turn: Floats) -> None:
    """Adds a camera and a light that follow the robot.

    Args:
        root: its root body.
        centre: (3,) m, of the box round it.
        radius: m, half that box's diagonal.
        turn: (3, 3) attitude of the root.
    """
    away = np.array([0.35, -1.0, 0.55])
    away /= np.linalg.norm(away)
    right = np.cross([0.0, 0.0, 1.0], away)
    right /= np.linalg.norm(right)
    up = np.cross(away, right)
    camera = root.add_camera(name="track", mode=mujoco.mjtCamLight.mjCAMLIGHT_TRACKCOM)
    camera.pos = [round(float(x), 4) for x in turn.T @ (centre + 2.2 * radius * away)]
    attitude = turn.T @ np.column_stack([right, up, away])
    camera.quat = wxyz_from_xyzw(quaternion_xyzw(attitude)).round(6)
    camera.fovy = 40.0
    down = np.array([-0.1, 0.3, -1.0])
    above = centre - (1.5 * radius + 1.5) * down / np.linalg.norm(down)
    root.add_light(  # near the robot: a far one leaves its shadow coarse
        name="sun",
        mode=mujoco.mjtCamLight.mjCAMLIGHT_TRACKCOM,
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=[round(float(x), 4) for x in turn.T @ above],
        dir=turn.T @ down,
        diffuse=[0.55] * 3,
        castshadow=True,
    )


def _keyframes(
    spec: mujoco.MjSpec, root: Any, model: mujoco.MjModel, data: mujoco.MjData, modules: Modules
) -> None:
    """Adds `home` (1 m up, hover thrust; a drive without rotors stands) and `floor` (at rest).

    A free robot starts at rest on the floor, not with its root's origin in it.
    """
    rotors = [r for a in modules.apparatuses for r in a.rotors]
    thrust = _hover_thrust(model, data, rotors) if modules.floating else np.zeros(model.nu)
    home, floor = np.array(model.qpos0), np.array(model.qpos0)
    if modules.floating:
        low = lowest_point(model, data)
        floor[2] = model.qpos0[2] - (low if np.isfinite(low) else 0.0)
        home[2] = floor[2] if modules.screws and not rotors else 1.0
    home, floor, thrust = significant(home), significant(floor), significant(thrust)
    if modules.floating and not modules.screws:
        root.pos = floor[:3]
    act = thrust[[i for i in range(model.nu) if model.actuator_dyntype[i]]]
    spec.add_key(name="home", qpos=home, ctrl=thrust, act=act)
    spec.add_key(name="floor", qpos=floor)


def _hover_thrust(model: mujoco.MjModel, data: mujoco.MjData, rotors: list[Any]) -> Floats:
    """Returns controls (nu,) whose thrusts, of least norm, carry the weight at rest at `data`.

    ``Σ λ_i moment_i = bias`` in the six rows of the free joint, moments with drag. Thrusts stay
    within their limits, so a posture that cannot hover is carried as far as it goes.
    """
    control = np.zeros(model.nu)
    if not rotors:
        return control
    data.ctrl[:] = 0.0
    mujoco.mj_forward(model, data)
    moment = np.zeros((model.nu, model.nv))
    mujoco.mju_sparse2dense(
        moment, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind
    )
    ids = [model.actuator(rotor.label).id for rotor in rotors]
    q, wanted = moment[ids, :6].T, data.qfrc_bias[:6]
    found = np.linalg.lstsq(q, wanted, rcond=1e-9)[0]
    low = np.array([rotor.thrust_min for rotor in rotors])
    high = np.array([rotor.thrust_max for rotor in rotors])
    if np.any(found < low) or np.any(found > high):
        from scipy.optimize import lsq_linear

        found = lsq_linear(q, wanted, (low, np.maximum(high, low + 1e-9))).x
    control[ids] = found
    return control


def lowest_point(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Returns the least height [m] of any moving collision geom; meshes by their bounding ball.

    Of a body without such geometry, the lowest origin of its links.
    """
    heights: list[float] = []
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
    origins = data.xpos[model.body_weldid != 0, 2]
    return float(min(heights, default=min(origins, default=np.inf)))
