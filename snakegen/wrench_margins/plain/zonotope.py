"""Exact margins of a thrust set {Q λ, λ_min ≤ λ ≤ λ_max} in NumPy, one posture (THEORY A4).

In scaled coordinates the set is ``{A x, |x_j| ≤ ½}`` about its centre and hover lies at y. The
normal d of a facet is perpendicular to r - 1 independent columns of A (r the rank), so all subsets
of r - 1 columns give all facets; ``slack(d) = ½ Σ |d·a_j| - |d·y|``, and the margins are the least
slack/‖d‖, slack/‖d_f‖ and slack/‖d_τ‖. The twin of `kernels/margins/zonotope.py`, for batches.
"""

from itertools import combinations
from math import comb

import numpy as np
from numpy.typing import NDArray

from snakegen.base.rounding import least, significant

Floats = NDArray[np.float64]
RANK_TOLERANCE = 1e-6  # of σ_1, THEORY A3
OFF = 1e-9  # how far from its own subspace rounding can put a point of it, scaled
TIED = 1e-9  # relative, of margins at two facets
OUTSIDE = 1e-12  # of the support: a slack below minus this share proves hover out of reach
SUBSETS = 20_000  # of columns, a tenth of a second; the kernel's tree looks at fewer


def small(n: int) -> bool:
    """Tells whether sets of n columns have few enough subsets for `margins`."""
    return comb(n, 5) <= SUBSETS


def margins(a: Floats, y: Floats) -> tuple[Floats, Floats, int]:
    """Returns wrench, force, torque and attitude_altitude margins (4,), their normals, the rank.

    Args:
        a: (6, n) scaled columns ``S q_j (λ_max - λ_min)_j``.
        y: (6,) hover from the set's centre, scaled.

    Returns:
        margins (4,), scaled: wrench is minus the distance, force and torque nan, where hover lies
        outside; normals (4, 6), at which each margin is reached; rank of `a`.
    """
    out, normals = np.full(4, np.nan), np.zeros((4, 6))
    out[:3], normals[:3], rank = _margins(a, y)
    four, normal, _ = _margins(a[2:], y[2:])
    out[3], normals[3, 2:] = four[0], normal[0]
    return out, normals, rank


def _margins(a: Floats, y: Floats) -> tuple[Floats, Floats, int]:
    """Returns margins (3,), normals (3, d) and the rank of `a` (d, n), d = 4 or 6."""
    d = len(a)
    basis, lost = subspace(a)
    r = basis.shape[1]
    thickness = 0.5 * np.abs(lost.T @ a).sum(axis=1)  # thin, not flat, below the rank tolerance
    if (np.abs(lost.T @ y) > thickness + OFF).any():
        return *_outside(a, y), r
    normal = facet_normals(basis.T @ a) @ basis.T
    support = 0.5 * np.abs(normal @ a).sum(axis=1)
    along = normal @ y
    slack = support - np.abs(along)
    if (slack < -OUTSIDE * support).any():
        return *_outside(a, y), r
    normal, slack = np.where(along < 0.0, -1.0, 1.0)[:, None] * normal, np.maximum(slack, 0.0)
    out, found = np.full(3, np.inf), np.zeros((3, d))
    for k, part in enumerate((slice(0, d), slice(0, 3), slice(3, 6))[: 3 if d == 6 else 1]):
        size = np.linalg.norm(normal[:, part], axis=1)
        with np.errstate(divide="ignore"):
            reach = np.where(size > OFF, slack / np.maximum(size, OFF), np.inf)
        if reach.size and np.isfinite(reach).any():
            out[k] = reach.min()
            found[k] = _first(normal[reach <= out[k] * (1.0 + TIED)])
        direction = lost_direction(lost, part) if r < d else None
        if direction is not None:
            out[k], found[k] = 0.0, direction
    return out, found, r


def _first(normals: Floats) -> Floats:
    """Returns of tied normals (m, d) the one that comes last in order, whatever rounding says.

    A normal and its opposite count as one; `ThrustMargins` picks where both tie.
    """
    size = np.abs(normals)
    leading = np.argmax(size > 1e-6 * size.max(axis=1, keepdims=True), axis=1)[:, None]
    key = significant(normals * np.sign(np.take_along_axis(normals, leading, axis=1)), 6)
    return np.asarray(normals[np.lexsort(key.T[::-1])[-1]])


def subspace(a: Floats) -> tuple[Floats, Floats]:
    """Returns orthonormal columns that span `a` (d, n), rank by `RANK_TOLERANCE`, and the rest."""
    u, s, _ = np.linalg.svd(a)
    r = int(np.sum((s > RANK_TOLERANCE * s.max(initial=0.0)) & (s > 0.0)))
    return u[:, :r], u[:, r:]


def facet_normals(a: Floats) -> Floats:
    """Returns unit vectors (m, r), among them the normals of all facets of the set of `a`.

    Those across r - 1 columns (r, n) that are independent.
    """
    r, n = a.shape
    if r < 2:
        return np.ones((1, r))
    subsets = np.array(list(combinations(range(n), r - 1)))
    _, sigma, across = np.linalg.svd(a.T[subsets])
    return across[sigma[:, -1] > OFF * sigma.max(initial=0.0), -1]


def lost_direction(lost: Floats, part: slice) -> Floats | None:
    """Returns the lost direction nearest to one of the axes `part`; None if none is lost there.

    An axis' projection on the span of the columns of `lost` depends on no choice of basis.
    """
    tilt = np.linalg.norm(lost[part], axis=1)
    if tilt.max(initial=0.0) <= OFF:
        return None
    axis = part.start + least(-tilt)
    return lost @ lost[axis] / np.linalg.norm(lost[axis])


def _outside(a: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Returns minus the distance from the set to y, and the unit direction of it."""
    from scipy.optimize import lsq_linear  # workers of a sweep do without it

    x = lsq_linear(a, y, (-0.5, 0.5), method="bvls", tol=1e-14).x
    gap = y - a @ x
    distance = float(np.linalg.norm(gap))
    normals = np.zeros((3, len(a)))
    normals[0] = gap / distance if distance > 0.0 else 0.0
    return np.array([-distance, np.nan, np.nan]), normals
