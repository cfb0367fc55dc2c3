"""The wrenches that a tip can carry within the joint torque limits: ``|τ0 - Jᵀ w| ≤ limit``.

A polytope in wrench space with two faces a joint (THEORY C: τ = τ0 - Jᵀ w_ext). Every question
about one direction is closed form; only the corners need a hull.
"""

import numpy as np
from scipy.spatial import ConvexHull, HalfspaceIntersection

from snakegen.kernels.core.types import Floats

RANK_TOLERANCE = 1e-9  # of the largest singular value


def capacity(J: Floats, torque: Floats, limit: Floats, directions: Floats) -> Floats:
    """Returns the largest t with ``|τ0 - t Jᵀ u| ≤ limit`` for each direction u.

    Args:
        J: (k, n) rows of the tip's Jacobian, those of the wrench space asked about.
        torque: (n,) N·m, the joints' own load τ0.
        limit: (n,) N·m.
        directions: (m, k).

    Returns:
        (m,) t ≥ 0 in the unit of u; inf where u loads no joint; NaN where τ0 alone is too much.
    """
    if np.any(np.abs(torque) > limit):
        return np.full(len(directions), np.nan)
    slope = -directions @ J  # (m, n)
    room = np.where(slope > 0, limit - torque, limit + torque)
    tiny = np.abs(slope) <= RANK_TOLERANCE * max(np.max(np.abs(J), initial=0.0), 1e-300)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(tiny, np.inf, room / np.abs(slope))
    return np.min(t, axis=1, initial=np.inf)


def inscribed(J: Floats, torque: Floats, limit: Floats) -> tuple[float, int, Floats]:
    """Returns the radius of the largest ball of wrenches round 0, its joint and its direction.

    ``min_i (limit_i - |τ0_i|) / ‖J_i‖`` over the joints that the wrench loads. Joint -1 and inf
    where it loads none; a negative radius says which joint is overloaded without it.
    """
    norms = np.linalg.norm(J, axis=0)
    moved = norms > RANK_TOLERANCE * max(np.max(norms, initial=0.0), 1e-300)
    if not np.any(moved):
        return np.inf, -1, np.zeros(len(J))
    with np.errstate(divide="ignore", invalid="ignore"):
        radius = np.where(moved, (limit - np.abs(torque)) / norms, np.inf)
    lowest = float(np.min(radius))  # of equals the first: rounding does not choose the joint
    i = int(np.flatnonzero(radius <= lowest + 1e-9 * abs(lowest))[0])
    sign = -1.0 if torque[i] > RANK_TOLERANCE * limit[i] else 1.0  # unloaded, either way is worst
    return float(radius[i]), i, sign * J[:, i] / norms[i]


def corners(J: Floats, torque: Floats, limit: Floats) -> tuple[Floats, Floats]:
    """Returns the corners of the set of wrenches and a basis of what loads no joint.

    Args:
        J, torque, limit: as in `capacity`, k rows (3 for forces alone).

    Returns:
        corners (c, k) in the span of J, empty where τ0 alone is too much, and free (k, f): unit
        columns that no joint feels, along which the set has no end.
    """
    k, held = len(J), np.isfinite(limit)  # a joint without a limit bounds nothing
    J, torque, limit = J[:, held], torque[held], limit[held]
    full = np.linalg.svd(J, full_matrices=True)
    u, s = np.asarray(full[0], np.float64), full[1]
    rank = int(np.sum(s > RANK_TOLERANCE * max(np.max(s, initial=0.0), 1e-300)))
    basis, free = u[:, :rank], u[:, rank:]
    if rank == 0 or np.any(np.abs(torque) >= limit):
        return np.zeros((0, k)), free
    faces = (basis.T @ J).T  # (n, rank): τ = τ0 - faces y
    keep = np.linalg.norm(faces, axis=1) > RANK_TOLERANCE * s[0]
    normals = np.vstack([faces[keep], -faces[keep]])
    bounds = np.concatenate([(limit + torque)[keep], (limit - torque)[keep]])
    if rank == 1:
        a = normals[:, 0]
        ends = np.array([np.max(bounds[a < 0] / a[a < 0]), np.min(bounds[a > 0] / a[a > 0])])
        return ends[:, None] @ basis.T, free
    unit = np.linalg.norm(normals, axis=1)
    planes = np.column_stack([normals / unit[:, None], -bounds / unit])
    points = HalfspaceIntersection(planes, np.zeros(rank)).intersections
    return np.asarray(points[ConvexHull(points).vertices] @ basis.T, float), free


def stiffness(J: Floats, servo: Floats) -> tuple[Floats, Floats]:
    """Returns compliance ``C = J diag(1/k) Jᵀ`` of the tip and its (pseudo-)inverse.

    Args:
        J: (6, n) tip Jacobian, [linear; angular].
        servo: (n,) N·m/rad, inf for a rigid joint.

    Returns:
        compliance (6, 6), stiffness (6, 6). A direction that no joint yields in is infinitely
        stiff: it lies in the null space of the compliance and is left out of the inverse.
    """
    compliance = (J / servo) @ J.T
    inverse = np.linalg.pinv(compliance, rcond=1e-10, hermitian=True)
    return compliance, np.asarray(inverse, np.float64)
