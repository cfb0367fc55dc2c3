"""Distances along a run: to the floor, and between parts of the robot that may touch."""

import mujoco
import numpy as np

from snakegen.geometry import Floats
from snakegen.verify.world import World

_FAR = 0.5  # m: what is farther apart than this is recorded as this far


def clearances(world: World, qpos: Floats) -> tuple[Floats, Floats]:
    """Returns floor and self distances (m,) [m] at rows of qpos (m, nq).

    Self distance: between collision geoms of different bodies that the model lets touch, capped
    at 0.5 m; +inf where no such pair exists.
    """
    from snakegen.description.mjcf import lowest_point

    model, data = world.model, mujoco.MjData(world.model)
    pairs = _pairs(model)
    reach = model.geom_rbound
    floor, own = np.empty(len(qpos)), np.full(len(qpos), np.inf)
    for k, row in enumerate(qpos):
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        floor[k] = lowest_point(model, data)
        if not len(pairs):
            continue
        a, b = pairs[:, 0], pairs[:, 1]
        gap = np.linalg.norm(data.geom_xpos[a] - data.geom_xpos[b], axis=1) - reach[a] - reach[b]
        best = _FAR
        for i in np.argsort(gap):
            if gap[i] >= best:
                break
            found = mujoco.mj_geomDistance(model, data, int(a[i]), int(b[i]), best, None)
            best = min(best, found)
        own[k] = best
    return floor, own


def _pairs(model: mujoco.MjModel) -> np.ndarray:
    """Returns the pairs of collision geoms that may touch, (m, 2); planes left out."""
    solid = [
        g
        for g in range(model.ngeom)
        if model.geom_contype[g] and model.geom_type[g] != mujoco.mjtGeom.mjGEOM_PLANE
    ]
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
