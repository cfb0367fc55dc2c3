"""Upper bounds of vectored margins under gimbal limits and minimum thrust: the hull's margins.

With |φ| ≤ φm and |θ| ≤ θm an apparatus pushes within a spherical sector of its link's axes, and a
minimum thrust cuts its core out: both sets are non-convex, and their hull reaches farther than
they do. The hull's support is closed-form (clamp φ, then θ); a slice of it is a linear program
whose columns are found one by one, so the hull's own margin is exact to the tolerance.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.errors import AnalysisError
from snakegen.margins import inputs
from snakegen.margins.inner_ball import inner_ball

Floats = NDArray[np.float64]
GAP = 0.1  # of the tolerance: between the linear program and the hull's support
KEPT = 12  # rounds of columns that stay for the next direction
PENALTY = 1e3  # of a held wrench that the columns found so far cannot hold


def thrust_direction(phi: Floats, theta: Floats) -> Floats:
    """Returns ``[sinθ, -sinφ cosθ, cosφ cosθ]`` (…, 3), link axes (THEORY A1)."""
    return np.stack(
        [np.sin(theta), -np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)], axis=-1
    )


def farthest(d: Floats, gimbal: Floats) -> Floats:
    """Returns the unit thrust (n, 3) of each sector that lies farthest along d (n, 3).

    Args:
        d: directions, link axes.
        gimbal: (n, 2) limits of φ and θ, rad.
    """
    best, most = np.zeros_like(d), np.full(len(d), -np.inf)
    peak = np.arctan2(-d[:, 1], d[:, 2])  # of -d_y sinφ + d_z cosφ; its trough lies opposite
    for phi in (peak, peak + np.pi, peak - np.pi, -gimbal[:, 0], gimbal[:, 0]):
        phi = np.clip(phi, -gimbal[:, 0], gimbal[:, 0])
        across = -d[:, 1] * np.sin(phi) + d[:, 2] * np.cos(phi)
        for theta in (np.arctan2(d[:, 0], across), -gimbal[:, 1], gimbal[:, 1]):
            u = thrust_direction(phi, np.clip(theta, -gimbal[:, 1], gimbal[:, 1]))
            value = (u * d).sum(axis=1)
            better = value > most
            best[better], most[better] = u[better], value[better]
    return best


class _Hull:
    """The columns found so far, scaled, and the slice supports they give."""

    def __init__(
        self,
        p: Floats,
        low: Floats,
        high: Floats,
        gimbal: Floats,
        turn: Floats,
        hover: Floats,
        tolerance: float,
    ) -> None:
        self.gap = GAP * tolerance
        self.p, self.low, self.high, self.gimbal, self.turn = p, low, high, gimbal, turn
        self.hover = hover
        self.wrenches = np.zeros((0, 6))
        self.owner = np.zeros(0, np.int64)
        for d in np.vstack([np.eye(6), -np.eye(6)]):
            self._price(d)

    def _price(self, twist: Floats) -> Floats:
        """Adds each apparatus' farthest force along the twist; returns its support (n,)."""
        speed = twist[:3] + np.cross(twist[3:], self.p)
        local = np.einsum("nji,nj->ni", self.turn, speed)
        u = farthest(local, self.gimbal)
        along = (u * local).sum(axis=1)
        strength = np.where(along > 0.0, self.high, self.low)
        force = np.einsum("nij,nj->ni", self.turn, u) * strength[:, None]
        columns = np.hstack([force, np.cross(self.p, force)])
        self.wrenches = np.vstack([self.wrenches, columns])
        self.owner = np.r_[self.owner, np.arange(len(self.p))]
        return along * strength

    def support(self, e: Floats, torque: bool) -> tuple[float, Floats]:
        """Returns an upper bound of the slice along e, and a point of it seen from hover."""
        from scipy.optimize import linprog  # heavy, and not needed by workers of sweeps

        part, held = (slice(3, 6), slice(0, 3)) if torque else (slice(0, 3), slice(3, 6))
        twist, n, upper = np.zeros(6), len(self.p), np.inf
        point = np.zeros(3)
        first = 12 * n  # the axes' columns span every direction: they stay
        last = max(len(self.owner) - KEPT * n, first)
        self.wrenches = np.vstack([self.wrenches[:first], self.wrenches[last:]])
        self.owner = np.r_[self.owner[:first], self.owner[last:]]
        for _ in range(30):
            k = len(self.owner)
            weights = (self.owner == np.arange(n)[:, None]).astype(float)
            found = linprog(
                np.r_[-(self.wrenches[:, part] @ e), np.full(6, PENALTY)],
                A_eq=np.block(
                    [
                        [self.wrenches[:, held].T, np.eye(3), -np.eye(3)],
                        [weights, np.zeros((n, 6))],
                    ]
                ),
                b_eq=np.r_[self.hover[held], np.ones(n)],
                bounds=(0.0, None),
            )
            share = found.x[:k]
            point = self.wrenches[:, part].T @ share - self.hover[part]
            twist[part], twist[held] = e, found.eqlin.marginals[:3]
            upper = min(upper, self._price(twist).sum() - twist @ self.hover)
            reached = -found.fun - e @ self.hover[part]
            if upper < 0.0 or upper - reached <= self.gap * upper:
                break
        return float(upper), point


def hull_bounds(
    p: Floats,
    limit: Floats,
    hover: Floats,
    tolerance: float,
    minimum: Floats,
    gimbal: Floats,
    rotations: Floats,
) -> tuple[Floats, Floats]:
    """Returns upper bounds (3,) of wrench, force and torque, all scaled, and their twists (3, 6).

    The wrench bound is the lesser of the two slices'; where the hull cannot hold hover it is
    minus the distance to a plane that separates them, and force and torque are nan.
    """
    hull = _Hull(p, minimum, limit, gimbal, rotations, hover, tolerance)
    out, twists = np.full(3, np.nan), np.full((3, 6), np.nan)
    for k, torque in enumerate((False, True)):

        def support(e: Floats, torque: bool = torque) -> tuple[float, Floats]:
            return hull.support(e, torque)

        _, high, e = inner_ball(support, tolerance, 100)
        if high < 0.0:
            return np.array([high, np.nan, np.nan]), twists
        out[1 + k] = high
        twists[1 + k] = np.r_[np.zeros(3), e] if torque else np.r_[e, np.zeros(3)]
    least = 1 if out[1] <= out[2] else 2
    out[0], twists[0] = out[least], twists[least]
    return out, twists


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
