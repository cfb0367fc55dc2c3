"""Force and torque margins with every joint torque within its servo's limit (THEORY A4, A5).

Holding a disturbance takes thrust, and thrust bends the chain: joint torque is
``τ = bias + M λ + D d`` with d the disturbance as a wrench about the CoG. With ``Q λ = w0 - d``
that is a bound on λ alone, ``|bias + D w0 + (M - D Q) λ| ≤ limit``. It depends on where d acts,
which is what D says: a column holds the joint torques that a unit of d there loads.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.errors import AnalysisError
from snakegen.wrench_margins import inputs
from snakegen.wrench_margins.inner_ball import inner_ball, inner_ball_of
from snakegen.wrench_margins.plain.ball_support import minimise
from snakegen.wrench_margins.rays import Bounds
from snakegen.wrench_margins.vectored import apparatus_sets, set_margins

Floats = NDArray[np.float64]
Solve = Callable[[Floats, slice], tuple[float, Floats]]
FORCE, TORQUE, TRUNCATED = slice(0, 3), slice(3, 6), slice(2, 6)  # rows of the disturbance
AT_LIMIT = 1e-3  # a joint within this share of its limit counts as saturated


@dataclass(frozen=True)
class JointLimitedMargins:
    """Margins under joint limits; nan where hover itself breaks a limit.

    Attributes:
        force_bounds, torque_bounds: (2,) lower and upper bound, N and N·m.
        force_direction, torque_direction: (3,) unit, the weakest direction of each.
        force_joints, torque_joints: indices of the joints at their limit there.
        free_force, free_torque: the same margins without joint limits.
        tolerance: asked relative gap.
    """

    force_bounds: Floats
    torque_bounds: Floats
    force_direction: Floats
    torque_direction: Floats
    force_joints: list[int]
    torque_joints: list[int]
    free_force: float
    free_torque: float
    tolerance: float

    @property
    def force(self) -> float:
        """Largest force ball, N: the lower bound."""
        return float(self.force_bounds[0])

    @property
    def torque(self) -> float:
        """Largest torque ball, N·m: the lower bound."""
        return float(self.torque_bounds[0])

    @property
    def closed(self) -> bool:
        """Whether both pairs of bounds agree to the tolerance."""
        pairs = (self.force_bounds, self.torque_bounds)
        return all(np.isnan(b[1]) or b[1] - b[0] <= self.tolerance * b[1] for b in pairs)


@dataclass(frozen=True)
class LimitedProblem:
    """Everything scaled: map (6, n), joint rows (k, n), bias (k,), hover (6,), limit (k,)."""

    map: Floats
    rows: Floats
    bias: Floats
    hover: Floats
    limit: Floats


def limited_problem(
    q: Floats,
    hover: Floats,
    scale: Floats,
    joint_torque: Floats,
    bounds: Bounds,
) -> LimitedProblem:
    k = len(joint_torque)
    bias = inputs.array("joint_bias", bounds.bias, (k,))
    limit = inputs.per_unit("joint_limit", bounds.limit, k)
    if (limit == 0.0).any():
        raise AnalysisError(f"joint_limit[{int(np.argmin(limit))}] is 0; it must be positive, N·m.")
    d = inputs.array("disturbance", bounds.wrench, (k, 6))
    rows, torque = joint_torque - d @ q, scale[3]
    return LimitedProblem(
        q / scale[:, None],
        rows / torque,
        (bias + d @ hover) / torque,
        hover / scale,
        limit / torque,
    )


def joints_at_limit(problem: LimitedProblem, thrust: Floats) -> list[int]:
    torque = problem.bias + problem.rows @ thrust
    return np.flatnonzero(np.abs(torque) >= (1.0 - AT_LIMIT) * problem.limit).tolist()


def limited_slice(
    problem: LimitedProblem, solve: Solve, part: slice, known: float, tolerance: float
) -> tuple[Floats, Floats, list[int]]:
    """Returns scaled bounds (2,), weakest direction and joints at their limit of one slice."""
    size = part.stop - part.start
    if known == 0.0 or np.isnan(known):
        return np.full(2, known), np.full(size, np.nan), []

    def support(e: Floats) -> tuple[float, Floats]:
        upper, thrust = solve(e, part)
        return upper, (problem.map @ thrust - problem.hover)[part]

    if size == 3:
        low, high, e = inner_ball(support, tolerance)
    else:
        low, high, e = inner_ball_of(support, size, tolerance)
    if high < 0.0:
        return np.full(2, np.nan), e, []
    return np.array([low, high]), e, joints_at_limit(problem, solve(e, part)[1])


def held_rows(part: slice) -> slice:
    """Returns the rows that stay at hover: force or torque; none of larger slices."""
    if part.stop - part.start > 3:
        return slice(0, 0)
    return TORQUE if part == FORCE else FORCE


def limited_margins(
    problem: LimitedProblem,
    solve: Solve,
    scale: Floats,
    free: tuple[float, float],
    tolerance: float,
) -> JointLimitedMargins:
    """Runs both slices; ``solve(e, part) → (upper, thrust)``; `free`: without joint limits."""
    found: list[tuple[Floats, Floats, list[int]]] = []
    for part, known in zip((FORCE, TORQUE), free, strict=True):
        bounds, e, joints = limited_slice(problem, solve, part, known, tolerance)
        found.append((bounds * scale[part][0], e, joints))
    (force, along, bent), (turn, about, twisted) = found
    return JointLimitedMargins(
        force, turn, along, about, bent, twisted, free[0], free[1], tolerance
    )


def vectored_joint_limited(
    points: ArrayLike,
    limits: ArrayLike,
    hover_wrench: ArrayLike,
    bounds: Bounds,
    *,
    force_scale: float,
    torque_scale: float,
    tolerance: float = 1e-3,
    drag: ArrayLike = 0.0,
) -> JointLimitedMargins:
    """Returns the certified margins of vectored apparatuses with joint torques within limits.

    The support of a slice is
    ``min Σ L_j ‖v + ω × p_j + c_j ω + M_jᵀμ‖ + Σ limit_i |μ_i| + μ·bias - d·w0``
    over the held half of the twist d = (v, ω) and the joint multipliers μ.

    Args:
        bounds: as `thrust_joint_limited`, but `rows` (k, n, 3): torque of each joint per newton
            of each apparatus' force, the drag along it included.
        points, limits, hover_wrench, force_scale, torque_scale, tolerance, drag: as
            `vectored_margins`.

    Raises:
        AnalysisError: as `vectored_margins`; joint arrays of other shapes; a limit that is 0.
    """
    p = inputs.array("points", points, (None, 3))
    limit = inputs.per_unit("limits", limits, len(p))
    hover, scale = inputs.hover(hover_wrench, None), inputs.scale(force_scale, torque_scale)
    m = inputs.array("joint_torque", bounds.rows, (None, len(p), 3))
    q = inputs.force_map(p, inputs.drags(drag, len(p)))
    problem = limited_problem(q, hover, scale, m.reshape(len(m), -1), bounds)
    joints, strength = len(m), np.r_[limit, problem.limit * scale[0]] / scale[0]
    strength[: len(p)] = np.maximum(strength[: len(p)], 1e-12)
    # from scaled twist to point velocity, per unit of force scale
    moves = (problem.map * scale[0]).reshape(6, -1, 3).transpose(1, 2, 0)
    bends = (problem.rows * scale[0]).reshape(joints, -1, 3).transpose(1, 2, 0)

    def solve(e: Floats, part: slice) -> tuple[float, Floats]:
        held = held_rows(part)
        start, maps = np.zeros((len(strength), 3)), np.zeros((len(strength), 3, 3 + joints))
        start[: len(p)] = moves[:, :, part] @ e
        maps[: len(p), :, :3], maps[: len(p), :, 3:] = moves[:, :, held], bends
        maps[len(p) + np.arange(joints), 0, 3 + np.arange(joints)] = 1.0
        cost = np.r_[problem.hover[held], -problem.bias]
        x, f = np.zeros(3 + joints), np.zeros((len(strength), 3))
        minimise(start, maps, strength, cost, x, f)
        reach = np.linalg.norm(start + maps @ x, axis=1)
        upper = strength @ reach - cost @ x - e @ problem.hover[part]
        return float(upper), f[: len(p)].ravel() * scale[0]

    free = set_margins(
        apparatus_sets(p, limit, drag),
        hover,
        force_scale=force_scale,
        torque_scale=torque_scale,
        tolerance=tolerance,
        wrench_starts=0,
    )
    known = float(free.force), float(free.torque)
    return limited_margins(problem, solve, scale, known, tolerance)
