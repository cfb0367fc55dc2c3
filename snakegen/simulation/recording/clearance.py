"""Distances along a run: to the floor, to obstacles, and between parts that may touch."""

import mujoco
import numpy as np

from snakegen.base.geometry import Floats
from snakegen.simulation.flight.elastic import tip_name
from snakegen.simulation.flight.world import World

_FAR = 0.5  # m: what is farther apart than this is recorded as this far
_AT_ONCE = 200_000  # pairs of geoms whose gaps are computed together


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
    count = len(qpos)
    at, axes = np.empty((count, model.ngeom, 3)), np.empty((count, model.ngeom, 9))
    origins = np.empty(count)
    for k, row in enumerate(qpos):
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        at[k], axes[k] = data.geom_xpos, data.geom_xmat
        origins[k] = data.xpos[1:, 2].min()
    low = at[:, own_geoms, 2] - _reach_down(model, axes, own_geoms)
    floor = low.min(axis=1) if own_geoms else origins  # without geometry, the lowest link's origin
    return floor, _least(model, data, pairs, at, axes), _least(model, data, around, at, axes)


def _reach_down(model: mujoco.MjModel, axes: Floats, geoms: list[int]) -> Floats:
    """Returns how far (m, g) [m] geoms reach below their centres; meshes: their bounding balls.

    Args:
        model: of the world.
        axes: (m, ngeom, 9) attitudes.
        geoms: which.
    """
    shape, size, kind = model.geom_type[geoms], model.geom_size[geoms], mujoco.mjtGeom
    up = np.abs(axes[:, geoms, 6:9])  # vertical parts of the geoms' axes
    along = up[:, :, 2]
    across = np.sqrt(np.maximum(0.0, 1.0 - along**2))
    known = [
        (kind.mjGEOM_SPHERE, np.broadcast_to(size[:, 0], along.shape)),
        (kind.mjGEOM_CAPSULE, size[:, 0] + size[:, 1] * along),
        (kind.mjGEOM_CYLINDER, size[:, 0] * across + size[:, 1] * along),
        (kind.mjGEOM_BOX, np.einsum("kgi,gi->kg", up, size)),
    ]
    return np.select(
        [shape == int(k) for k, _ in known], [r for _, r in known], model.geom_rbound[geoms]
    )


def _least(
    model: mujoco.MjModel, data: mujoco.MjData, pairs: np.ndarray, at: Floats, axes: Floats
) -> Floats:
    """Returns the least distances (m,) [m] over pairs of geoms, at most 0.5; inf without pairs.

    Balls round the geoms are looked at first, as many rows at once as fit into memory.

    Args:
        model, data: of the world; the geoms' places in `data` are written over.
        pairs: (p, 2) geoms.
        at, axes: (m, ngeom, 3) m, (m, ngeom, 9), where the geoms are.
    """
    count = len(at)
    if not len(pairs):
        return np.full(count, np.inf)
    a, b = pairs[:, 0], pairs[:, 1]
    reach = model.geom_rbound[a] + model.geom_rbound[b]
    out, block = np.full(count, _FAR), max(1, _AT_ONCE // len(pairs))
    for first in range(0, count, block):
        rows = slice(first, first + block)
        gaps = np.linalg.norm(at[rows, a] - at[rows, b], axis=2) - reach
        for k, gap in enumerate(gaps, first):
            near = np.flatnonzero(gap < _FAR)
            data.geom_xpos[:], data.geom_xmat[:] = at[k], axes[k]
            for i in near[np.argsort(gap[near])]:
                if gap[i] >= out[k]:
                    break
                found = mujoco.mj_geomDistance(model, data, int(a[i]), int(b[i]), out[k], None)
                out[k] = min(out[k], found)
    return out


def _pairs(model: mujoco.MjModel, solid: list[int]) -> np.ndarray:
    """Returns the pairs of the robot's geoms that may touch, (m, 2).

    The halves of an elastic link count as one: what may touch is what may in the rigid robot.
    """
    whole = _wholes(model)
    joined = {(whole[b], whole[int(p)]) for b, p in enumerate(model.body_parentid)}
    for signature in model.exclude_signature:
        joined.add((whole[int(signature) >> 16], whole[int(signature) & 0xFFFF]))
    out = []
    for i, a in enumerate(solid):
        for b in solid[i + 1 :]:
            first, second = whole[int(model.geom_bodyid[a])], whole[int(model.geom_bodyid[b])]
            if first != second and not {(first, second), (second, first)} & joined:
                out.append((a, b))
    return np.array(out, int).reshape(-1, 2)


def _wholes(model: mujoco.MjModel) -> list[int]:
    """Returns for every body itself, or the link whose outer half it is."""
    names = [model.body(b).name for b in range(model.nbody)]
    return [
        int(p) if name == tip_name(names[p]) else b
        for b, (name, p) in enumerate(zip(names, model.body_parentid, strict=True))
    ]
