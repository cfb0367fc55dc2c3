"""Distances along a run: to the floor, to obstacles, and between parts that may touch."""

import mujoco
import numpy as np

from snakegen.geometry import Floats
from snakegen.verify.world import World

_FAR = 0.5  # m: what is farther apart than this is recorded as this far


def clearances(world: World, qpos: Floats) -> tuple[Floats, Floats, Floats]:
    """Returns floor, self and obstacle distances (m,) [m] at rows of qpos (m, nq).

    Self distance: between collision geoms of different bodies that the model lets touch, capped
    at 0.5 m; +inf where no such pair exists.
    """
    model, data = world.model, mujoco.MjData(world.model)
    solid = [g for g in range(model.ngeom) if model.geom_contype[g]]
    own_geoms = [g for g in solid if model.geom_bodyid[g] != 0]
    walls = [
        g
        for g in solid
        if model.geom_bodyid[g] == 0 and model.geom_type[g] != mujoco.mjtGeom.mjGEOM_PLANE
    ]
    pairs = _pairs(model, own_geoms)
    around = np.array([(a, b) for a in own_geoms for b in walls], int).reshape(-1, 2)
    floor = np.empty(len(qpos))
    own, obstacle = np.full(len(qpos), np.inf), np.full(len(qpos), np.inf)
    for k, row in enumerate(qpos):
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        floor[k] = float(np.min(data.geom_xpos[own_geoms, 2] - _reach_down(model, data, own_geoms)))
        if len(pairs):
            own[k] = _least(model, data, pairs)
        if len(around):
            obstacle[k] = _least(model, data, around)
    return floor, own, obstacle


def _reach_down(model: mujoco.MjModel, data: mujoco.MjData, geoms: list[int]) -> Floats:
    """Returns how far (m,) [m] geoms reach below their centres; meshes: their bounding balls."""
    shape, size, kind = model.geom_type[geoms], model.geom_size[geoms], mujoco.mjtGeom
    axes = np.abs(data.geom_xmat[geoms, 6:9])  # vertical parts of the geoms' axes
    along = axes[:, 2]
    across = np.sqrt(np.maximum(0.0, 1.0 - along**2))
    known = [
        (kind.mjGEOM_SPHERE, size[:, 0]),
        (kind.mjGEOM_CAPSULE, size[:, 0] + size[:, 1] * along),
        (kind.mjGEOM_CYLINDER, size[:, 0] * across + size[:, 1] * along),
        (kind.mjGEOM_BOX, np.einsum("gi,gi->g", axes, size)),
    ]
    return np.select(
        [shape == int(k) for k, _ in known], [r for _, r in known], model.geom_rbound[geoms]
    )


def _least(model: mujoco.MjModel, data: mujoco.MjData, pairs: np.ndarray) -> float:
    """Returns the least distance [m] over pairs of geoms, at most 0.5; balls round them first."""
    a, b = pairs[:, 0], pairs[:, 1]
    reach = model.geom_rbound
    gap = np.linalg.norm(data.geom_xpos[a] - data.geom_xpos[b], axis=1) - reach[a] - reach[b]
    best = _FAR
    for i in np.argsort(gap):
        if gap[i] >= best:
            break
        found = mujoco.mj_geomDistance(model, data, int(a[i]), int(b[i]), best, None)
        best = min(best, found)
    return float(best)


def _pairs(model: mujoco.MjModel, solid: list[int]) -> np.ndarray:
    """Returns the pairs of the robot's geoms that may touch, (m, 2)."""
    excluded = {int(s) for s in model.exclude_signature}
    out = []
    for i, a in enumerate(solid):
        for b in solid[i + 1 :]:
            first, second = int(model.geom_bodyid[a]), int(model.geom_bodyid[b])
            if first == second or first in (model.body_parentid[second],):
                continue
            if second == model.body_parentid[first]:
                continue
            low, high = min(first, second), max(first, second)
            if (low << 16) + high in excluded or (high << 16) + low in excluded:
                continue
            out.append((a, b))
    return np.array(out, int).reshape(-1, 2)
