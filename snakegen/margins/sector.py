"""Upper bounds of vectored margins under gimbal limits and minimum thrust: the hull's margins.

With |φ| ≤ φm and |θ| ≤ θm an apparatus pushes within a spherical sector of its link's axes, and a
minimum thrust cuts its core out: both sets are non-convex, and their hull reaches farther than
they do. A slice of the hull is a linear program whose columns are found one by one
(`kernels.sector_support`), so the hull's own margin is exact to the tolerance.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.errors import AnalysisError
from snakegen.kernels import sector_support
from snakegen.margins import inputs
from snakegen.margins.inner_ball import inner_ball

Floats = NDArray[np.float64]
GAP = 0.1  # of the tolerance: between the linear program and the hull's support


def hull_bounds(
    p: Floats,
    limit: Floats,
    hover: Floats,
    tolerance: float,
    minimum: Floats,
    gimbal: Floats,
    rotations: Floats,
    drag: Floats | float = 0.0,
) -> tuple[Floats, Floats]:
    """Returns upper bounds (3,) of wrench, force and torque, all scaled, and their twists (3, 6).

    The wrench bound is the lesser of the two slices'; where the hull cannot hold hover it is
    minus the distance to a plane that separates them, and force and torque are nan.
    """
    out, twists = np.full(3, np.nan), np.full((3, 6), np.nan)
    body = (
        np.column_stack([p, np.broadcast_to(drag, len(p))]),
        minimum,
        limit,
        gimbal,
        rotations,
        hover,
    )
    wrenches, owner = np.empty((3 + len(p), 6)), np.empty(3 + len(p), np.int64)
    for k, torque in enumerate((False, True)):
        sector_support.start(torque, *body, wrenches, owner)

        def support(e: Floats, torque: bool = torque) -> tuple[float, Floats]:
            point, inverse = np.empty(3), _inverse(torque, wrenches, owner)
            above = sector_support.support(
                e, torque, *body, GAP * tolerance, wrenches, owner, inverse, point
            )
            return above, point

        _, high, e = inner_ball(support, tolerance, 100)
        if high < 0.0:
            return np.array([high, np.nan, np.nan]), twists
        out[1 + k] = high
        twists[1 + k] = np.r_[np.zeros(3), e] if torque else np.r_[e, np.zeros(3)]
    least = 1 if out[1] <= out[2] else 2
    out[0], twists[0] = out[least], twists[least]
    return out, twists


def _inverse(torque: bool, wrenches: Floats, owner: NDArray[np.int64]) -> Floats:
    """Returns the inverse of the basis matrix that `sector_support.support` goes on from."""
    first, size = (0 if torque else 3), len(owner)
    mixture = owner[None] == np.arange(size - 3)[:, None]
    return np.asarray(np.linalg.inv(np.vstack([wrenches[:, first : first + 3].T, mixture])))


def checked(
    count: int, minimum: ArrayLike, limit: Floats, gimbal: ArrayLike | None, turn: ArrayLike | None
) -> tuple[Floats, Floats, Floats]:
    """Returns minimum (n,), gimbal limits (n, 2) and link rotations (n, 3, 3), checked.

    Raises:
        AnalysisError: wrong shapes, a minimum above its limit, gimbal limits that are negative,
            rotations that are none.
    """
    low = inputs.per_unit("minimum", minimum, count)
    if (low > limit).any():
        at = int(np.argmax(low > limit))
        raise AnalysisError(f"minimum[{at}] = {low[at]:g} is above limits[{at}] = {limit[at]:g}.")
    angles = inputs.array(
        "gimbal_limits", np.pi if gimbal is None else gimbal, (), (2,), (count, 2)
    )
    angles = np.broadcast_to(angles, (count, 2))
    if (angles < 0.0).any():
        raise AnalysisError("gimbal_limits must not be negative: largest |φ| and |θ|, rad.")
    shape = (count, 3, 3)
    given = np.broadcast_to(np.eye(3), shape) if turn is None else turn
    rotations = inputs.array("rotations", given, shape)
    if np.abs(np.einsum("nij,nkj->nik", rotations, rotations) - np.eye(3)).max(initial=0) > 1e-6:
        raise AnalysisError("rotations must hold one rotation matrix (3, 3) for each apparatus.")
    return low, np.minimum(angles, np.pi), rotations
