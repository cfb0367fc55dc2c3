"""Margins of fixed rotors with every joint torque within its servo's limit: linear programs."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.wrench_margins import inputs
from snakegen.wrench_margins.joint_limited import (
    TRUNCATED,
    JointLimitedMargins,
    LimitedProblem,
    Solve,
    held_rows,
    limited_margins,
    limited_problem,
    limited_slice,
)
from snakegen.wrench_margins.rays import Bounds
from snakegen.wrench_margins.thrust import thrust_margins

Floats = NDArray[np.float64]


def thrust_joint_limited(
    allocation: ArrayLike,
    lower: ArrayLike,
    upper: ArrayLike,
    hover_wrench: ArrayLike,
    bounds: Bounds,
    *,
    force_scale: float,
    torque_scale: float,
    tolerance: float = 1e-3,
) -> JointLimitedMargins:
    """Returns the margins of fixed rotors with joint torques within limits (linear programs).

    Args:
        bounds: of the joint torques: `rows` M, (k, n), torque of each joint per newton of each
            rotor; `bias` with rotors off (gravity), in the posture; `wrench` D, (k, 6), per unit of
            disturbance wrench about the CoG, for the place where it acts (0: on a link that loads
            no joint); `limit`, one number or (k,).
        allocation, lower, upper, hover_wrench, force_scale, torque_scale: as `thrust_margins`.
        tolerance: relative gap of the bounds.

    Raises:
        AnalysisError: as `thrust_margins`; joint arrays of other shapes; a limit that is 0.
    """
    limits = (lower, upper)
    scale = inputs.scale(force_scale, torque_scale)
    problem, solve = _rotors(allocation, limits, hover_wrench, scale, bounds)
    free = thrust_margins(
        allocation, *limits, hover_wrench, force_scale=force_scale, torque_scale=torque_scale
    )
    return limited_margins(
        problem, solve, scale, (float(free.force), float(free.torque)), tolerance
    )


def truncated_joint_limited(
    allocation: ArrayLike,
    lower: ArrayLike,
    upper: ArrayLike,
    hover_wrench: ArrayLike,
    bounds: Bounds,
    *,
    force_scale: float,
    torque_scale: float,
    tolerance: float = 1e-3,
) -> tuple[Floats, Floats, list[int]]:
    """Returns the margin over ``[f_z; τ]`` of fixed rotors with joint torques within limits.

    The horizontal force is free: an under-actuated body answers it by its attitude.

    Args:
        allocation … tolerance: as `thrust_joint_limited`.

    Returns:
        Scaled bounds (2,), nan where hover itself breaks a limit; the weakest direction (4,),
        scaled, of the rotors' wrench; the indices of the joints at their limit there.
    """
    limits = (lower, upper)
    scale = inputs.scale(force_scale, torque_scale)
    problem, solve = _rotors(allocation, limits, hover_wrench, scale, bounds)
    free = thrust_margins(
        allocation, *limits, hover_wrench, force_scale=force_scale, torque_scale=torque_scale
    )
    known = float(free.attitude_altitude)
    return limited_slice(
        problem, solve, TRUNCATED, known if known >= 0.0 else float("nan"), tolerance
    )


def _rotors(
    allocation: ArrayLike,
    limits: tuple[ArrayLike, ArrayLike],
    hover_wrench: ArrayLike,
    scale: Floats,
    bounds: Bounds,
) -> tuple[LimitedProblem, Solve]:
    """Returns the scaled problem of fixed rotors, and its support by linear programs."""
    q = inputs.array("Q", allocation, (6, None))
    low, high = inputs.limits(*limits, q.shape[1])
    hover = inputs.hover(hover_wrench, None)
    rows = inputs.array("joint_torque", bounds.rows, (None, q.shape[1]))
    problem = limited_problem(q, hover, scale, rows, bounds)

    def solve(e: Floats, part: slice) -> tuple[float, Floats]:
        from scipy.optimize import linprog

        held = held_rows(part)
        found = linprog(
            -(e @ problem.map[part]),
            A_ub=np.vstack([problem.rows, -problem.rows]),
            b_ub=np.r_[problem.limit - problem.bias, problem.limit + problem.bias],
            A_eq=problem.map[held],
            b_eq=problem.hover[held],
            bounds=np.c_[low, high],
        )
        if found.x is None:
            return -1.0, np.zeros(q.shape[1])
        return float(-found.fun - e @ problem.hover[part]), found.x

    return problem, solve
