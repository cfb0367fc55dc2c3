"""How far along one ray a disturbance can be held: thrust and joint limits, any allocator.

A push d on the robot, carried by some link, is answered by thrusts with ``Q x = w0 - t d``; joint
torques are ``bias + M x + t D d``. The exact reach is a linear program (balls are cut by tangent
planes until none is passed); a pseudo-inverse reaches the first limit that its straight line meets.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.errors import AnalysisError
from snakegen.wrench_margins import inputs

Floats = NDArray[np.float64]
CUTS = 60  # rounds of tangent planes
_PASSED = 1e-7  # share of a limit by which a ball may be passed unnoticed


@dataclass(frozen=True, eq=False)
class Bounds:
    """Joint torques ``|bias + rows @ x + t (wrench @ d)| ≤ limit`` [N·m]; see `joint_loads`."""

    rows: Floats  # (k, n)
    bias: Floats  # (k,)
    wrench: Floats  # (k, 6)
    limit: Floats  # (k,)


@dataclass(frozen=True, eq=False)
class Reach:
    """The end of a ray.

    Attributes:
        t: multiple of the push; nan where t = 0 is out of reach already, inf if unbounded.
        x: (n,) thrusts or forces there, N.
        stopped: what is at its limit there: ``thrust 3``, ``joint 1`` (counted from 0).
    """

    t: float
    x: Floats
    stopped: tuple[str, ...]


def thrust_ray(
    allocation: ArrayLike,
    lower: ArrayLike,
    upper: ArrayLike,
    hover_wrench: ArrayLike,
    push: ArrayLike,
    bounds: Bounds | None = None,
    *,
    part: slice = slice(0, 6),
) -> Reach:
    """Returns the largest t with ``Q λ = w0 - t d`` (rows `part`) within thrust and joint limits.

    Args:
        allocation: Q, (6, n).
        lower, upper: N, one number or (n,).
        hover_wrench: w0, (6,).
        push: d, (6,), N and N·m, on the robot.
        bounds: of the joints.
        part: rows that must be met; ``slice(2, 6)`` for [f_z; τ].

    Raises:
        AnalysisError: shapes that do not fit, NaN, a push of zero.
    """
    from scipy.optimize import linprog

    q = inputs.array("Q", allocation, (6, None))
    low, high = inputs.limits(lower, upper, q.shape[1])
    hover, d = _ray(hover_wrench, push)
    over, under = _joint_rows(bounds, d, q.shape[1])
    found = linprog(
        np.append(np.zeros(q.shape[1]), -1.0),
        A_ub=over,
        b_ub=under,
        A_eq=np.column_stack([q, d])[part],
        b_eq=hover[part],
        bounds=[*zip(low, high, strict=True), (0.0, None)],
    )
    if found.status == 3:
        return Reach(float("inf"), np.full(q.shape[1], np.nan), ())
    if found.x is None:
        return Reach(float("nan"), np.full(q.shape[1], np.nan), ())
    x, t = found.x[:-1], float(found.x[-1])
    room = np.minimum(high - x, x - low) / np.maximum(high, 1e-12)
    return Reach(t, x, _stopped(room, bounds, x, t, d))


def vectored_ray(
    allocation: ArrayLike,
    limits: ArrayLike,
    hover_wrench: ArrayLike,
    push: ArrayLike,
    bounds: Bounds | None = None,
) -> Reach:
    """Returns the largest t with ``Q_force F = w0 - t d``, ‖F_j‖ ≤ L_j, joints within limits.

    Args:
        allocation: (6, 3n) map of the apparatus forces, in the axes of `bounds`.
        limits: L, N, one number or (n,).
        hover_wrench, push, bounds: as `thrust_ray`; rows of `bounds` (k, 3n).
    """
    from scipy.optimize import linprog

    q = inputs.array("Q", allocation, (6, None))
    n = q.shape[1] // 3
    limit = inputs.per_unit("limits", limits, n)
    hover, d = _ray(hover_wrench, push)
    rows, sides = _joint_rows(bounds, d, 3 * n)
    rows = np.zeros((0, 3 * n + 1)) if rows is None else rows
    sides = np.zeros(0) if sides is None else sides
    box = [(-limit[i // 3], limit[i // 3]) for i in range(3 * n)]
    x, t = np.zeros(3 * n), 0.0
    for _ in range(CUTS):
        found = linprog(
            np.append(np.zeros(3 * n), -1.0),
            A_ub=rows if len(rows) else None,
            b_ub=sides if len(rows) else None,
            A_eq=np.column_stack([q, d]),
            b_eq=hover,
            bounds=[*box, (0.0, None)],
        )
        if found.x is None:
            return Reach(float("inf" if found.status == 3 else "nan"), np.full(3 * n, np.nan), ())
        x, t = found.x[:-1], float(found.x[-1])
        size = np.linalg.norm(x.reshape(n, 3), axis=1)
        passed = np.flatnonzero(size > limit * (1.0 + _PASSED) + 1e-12)
        if not len(passed):
            break
        for j in passed:
            plane = np.zeros(3 * n + 1)
            plane[3 * j : 3 * j + 3] = x[3 * j : 3 * j + 3] / size[j]
            rows, sides = np.vstack([rows, plane]), np.append(sides, limit[j])
    room = 1.0 - np.linalg.norm(x.reshape(n, 3), axis=1) / np.maximum(limit, 1e-12)
    return Reach(t, x, _stopped(room, bounds, x, t, d))


def inverse_ray(
    inverse: ArrayLike,
    hover: ArrayLike,
    push: ArrayLike,
    lower: ArrayLike,
    upper: ArrayLike,
    bounds: Bounds | None = None,
    *,
    balls: bool = False,
    joint_push: ArrayLike | None = None,
) -> Reach:
    """Returns where ``x(t) = P (w0 - t d)`` first meets a limit.

    Args:
        inverse: P, (n, m), the allocator.
        hover, push: w0 and d, (m,), in the rows that P answers.
        lower, upper: N; with `balls` only `upper`, (n/3,), bounds the length of three entries.
        bounds: of the joints.
        joint_push: d as (6,) for `bounds`; `push` if that has six entries.
    """
    p = inputs.array("P", inverse, (None, None))
    w0, d = np.asarray(hover, float), np.asarray(push, float)
    start, slope = p @ w0, -(p @ d)
    low = np.broadcast_to(np.asarray(lower, float), len(start))
    ends, names = [], []
    high = np.asarray(upper, float)
    if balls:
        high = np.broadcast_to(high, len(start) // 3)
        for j, (a, b) in enumerate(zip(start.reshape(-1, 3), slope.reshape(-1, 3), strict=True)):
            ends.append(_leaves_ball(a, b, float(high[j])))
            names.append(f"thrust {j}")
    else:
        high = np.broadcast_to(high, len(start))
        for r in range(len(start)):
            ends.append(_leaves(start[r], slope[r], low[r], high[r]))
            names.append(f"thrust {r}")
    if bounds is not None:
        whole = d if joint_push is None else np.asarray(joint_push, float)
        torque = bounds.bias + bounds.rows @ start
        rate = bounds.rows @ slope + bounds.wrench @ whole
        for i, most in enumerate(bounds.limit):
            ends.append(_leaves(torque[i], rate[i], -most, most))
            names.append(f"joint {i}")
    t = min(ends, default=float("inf"))
    if np.isnan(ends).any():
        t = float("nan")
    first = tuple(n for n, e in zip(names, ends, strict=True) if e <= t * (1.0 + 1e-9))
    return Reach(float(t), start + t * slope, first)


def _leaves(start: float, slope: float, low: float, high: float) -> float:
    """Returns the t ≥ 0 at which ``start + t slope`` leaves [low, high]; nan if it is outside."""
    if not low - 1e-9 <= start <= high + 1e-9:
        return float("nan")
    if abs(slope) < 1e-14:
        return float("inf")
    return max(((high if slope > 0 else low) - start) / slope, 0.0)


def _leaves_ball(start: Floats, slope: Floats, limit: float) -> float:
    """Returns the t ≥ 0 at which ``‖start + t slope‖ = limit``; nan if it is outside at 0."""
    a, b = float(slope @ slope), float(start @ slope)
    c = float(start @ start) - limit**2
    if c > 1e-9:
        return float("nan")
    return float((-b + np.sqrt(b * b - a * min(c, 0.0))) / a) if a > 1e-28 else float("inf")


def _ray(hover_wrench: ArrayLike, push: ArrayLike) -> tuple[Floats, Floats]:
    d = inputs.array("push", push, (6,))
    if not d.any():
        raise AnalysisError("push is zero: a direction needs a length.")
    return inputs.hover(hover_wrench, None), d


def _joint_rows(bounds: Bounds | None, d: Floats, n: int) -> tuple[Floats | None, Floats | None]:
    if bounds is None or not len(bounds.limit):
        return None, None
    if bounds.rows.shape != (len(bounds.limit), n):
        raise AnalysisError(f"joint rows have shape {bounds.rows.shape}; n = {n} is needed.")
    row = np.column_stack([bounds.rows, bounds.wrench @ d])
    return np.vstack([row, -row]), np.r_[bounds.limit - bounds.bias, bounds.limit + bounds.bias]


def _stopped(
    room: Floats, bounds: Bounds | None, x: Floats, t: float, d: Floats
) -> tuple[str, ...]:
    out = [f"thrust {int(j)}" for j in np.flatnonzero(room < 1e-6)]
    if bounds is not None:
        torque = bounds.bias + bounds.rows @ x + t * (bounds.wrench @ d)
        at = np.flatnonzero(np.abs(torque) > (1.0 - 1e-6) * bounds.limit)
        out += [f"joint {int(i)}" for i in at]
    return tuple(out)
