"""Margins guaranteed over an uncertain mass and uncertain thrust limits: no sampling.

The set shrinks when limits do, and every margin is a minimum of ``(h(d) - d·w0)/‖…‖`` over
directions, so it is concave in w0: over the segment of hover wrenches that an uncertain mass
gives, its least value stands at an end. Limits that each lie within ± y of their nominal values
hold at least [λ_min (1 + y), λ_max (1 - y)].
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.wrench_margins import inputs
from snakegen.wrench_margins.force_sets import ForceSets
from snakegen.wrench_margins.thrust import ThrustMargins, thrust_margins
from snakegen.wrench_margins.vectored import VectoredMargins, set_margins

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class GuaranteedMargins:
    """Margins that hold for every mass and thrust limit within the stated shares.

    Attributes:
        wrench, force, torque: as of the margins themselves; for vectored sets the certified lower
            bounds. force and torque are nan where hover is infeasible somewhere in the range.
        attitude_altitude: nan for vectored sets.
        light, heavy: the margins at the two ends of the mass range, limits reduced.
    """

    wrench: Floats
    force: Floats
    torque: Floats
    attitude_altitude: Floats
    light: ThrustMargins | VectoredMargins
    heavy: ThrustMargins | VectoredMargins


def guaranteed_thrust(
    allocation: ArrayLike,
    lower: ArrayLike,
    upper: ArrayLike,
    hover_wrench: ArrayLike,
    *,
    force_scale: float,
    torque_scale: float,
    mass: float = 0.0,
    thrust: float = 0.0,
) -> GuaranteedMargins:
    """Returns the margins that hold for a mass ± `mass` and limits ± `thrust` (fractions).

    Exact where `lower` is 0, else a guaranteed value below the worst. The scales stay nominal.

    Raises:
        AnalysisError: as `thrust_margins`; fractions outside [0, 1); limits that cross.
    """
    x, y = inputs.share("mass", mass), inputs.share("thrust", thrust)
    low, high = inputs.array("lower", lower, (), (None,)), inputs.array("upper", upper, (), (None,))
    hover = inputs.array("hover_wrench", hover_wrench, (6,), (None, 6))
    light, heavy = (
        thrust_margins(
            allocation,
            low * (1.0 + y),
            high * (1.0 - y),
            hover * factor,
            force_scale=force_scale,
            torque_scale=torque_scale,
        )
        for factor in (1.0 - x, 1.0 + x)
    )
    return GuaranteedMargins(
        np.minimum(light.wrench, heavy.wrench),
        np.minimum(light.force, heavy.force),
        np.minimum(light.torque, heavy.torque),
        np.minimum(light.attitude_altitude, heavy.attitude_altitude),
        light,
        heavy,
    )


def guaranteed_vectored(
    sets: ForceSets,
    hover_wrench: ArrayLike,
    *,
    force_scale: float,
    torque_scale: float,
    tolerance: float = 1e-3,
    mass: float = 0.0,
    thrust: float = 0.0,
) -> GuaranteedMargins:
    """Returns the lower bounds that hold for a mass ± `mass` and limits ± `thrust` (fractions).

    The drag per newton and gimbal limits are taken as known. Where sets are not convex the bounds
    are those of the two ends of the mass range, not of what lies between. Other arguments: as
    `set_margins`.

    Raises:
        AnalysisError: as `set_margins`; fractions outside [0, 1).
    """
    x, y = inputs.share("mass", mass), inputs.share("thrust", thrust)
    hover = inputs.array("hover_wrench", hover_wrench, (6,), (None, 6))
    light, heavy = (
        set_margins(
            sets.weakened(y),
            hover * factor,
            force_scale=force_scale,
            torque_scale=torque_scale,
            tolerance=tolerance,
        )
        for factor in (1.0 - x, 1.0 + x)
    )
    least = np.minimum(light.bounds[..., 0], heavy.bounds[..., 0])
    return GuaranteedMargins(
        least[..., 0],
        least[..., 1],
        least[..., 2],
        np.full(least.shape[:-1], np.nan)[()],
        light,
        heavy,
    )
