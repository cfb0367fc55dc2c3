"""What a screw drive does with its shape held: speeds by direction, and the radii of its turns."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from snakegen.screw_drive.kinematics import Floats, ScrewGeometry


@dataclass(frozen=True)
class DirectionCone:
    """Largest speed in every direction of travel at a held shape, in P's axes."""

    direction: Floats  # (m,) rad
    speed: Floats  # (m,) m/s; 0 where the wheels cannot enforce that direction

    def width(self, speed: float) -> float:
        """Returns the total angle [rad] of directions in which `speed` can be reached."""
        return float(2 * np.pi * np.mean(self.speed >= speed))


def direction_cone(
    geometry: ScrewGeometry, shape: ArrayLike, screw_rate: float, count: int = 360
) -> DirectionCone:
    """Returns the speeds of pure translation that screws of `screw_rate` [rad/s] reach.

    Rates are linear in the twist, so the speed is ``min_i screw_rate / |rate_i per m/s|``. Where
    the axles leave a twist free (rank < 3) a direction with a part along it cannot be enforced.
    """
    rows = geometry.rows(shape, geometry.scale)
    angle = np.arange(count, dtype=np.float64) * (2 * np.pi / count)
    twists = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(count)])
    peak = np.abs(twists @ rows.T / geometry.drive()).max(axis=1)
    _, sigma, right = np.linalg.svd(rows)
    free = right[int((sigma > 1e-6 * sigma[0]).sum()) :]
    enforced = np.linalg.norm(twists @ free.T, axis=1) < 1e-9
    with np.errstate(divide="ignore"):
        return DirectionCone(angle, np.where(enforced, screw_rate / peak, 0.0).astype(np.float64))


def fixed_shape_radii(
    geometry: ScrewGeometry, shape: ArrayLike, speed: float, screw_rate: float
) -> tuple[float, float]:
    """Returns the smallest radii [m] of P's path, left and right, at `speed`, the shape held.

    Forward is -x of P's axes (the body trails). Each screw allows ``|a_i v + b_i ω| ≤ |limit|``:
    an interval of ω; inf where P cannot turn at that speed, or the speed cannot be reached.
    """
    rows = geometry.rows(shape)
    limit = screw_rate * np.abs(geometry.drive())
    ahead, turn = -rows[:, 0] * speed, rows[:, 2]
    if np.linalg.matrix_rank(rows / [1, 1, geometry.scale], tol=1e-6) < 3:
        return math.inf, math.inf
    if (np.abs(ahead) > limit).any():
        return math.inf, math.inf
    moving = np.abs(turn) > 1e-12
    if not moving.any():
        return 0.0, 0.0
    most = np.stack(
        [(limit - ahead)[moving] / turn[moving], (-limit - ahead)[moving] / turn[moving]]
    )
    sides = float(most.max(axis=0).min()), -float(most.min(axis=0).max())
    left, right = (speed / fastest if fastest > 0 else math.inf for fastest in sides)
    return left, right
