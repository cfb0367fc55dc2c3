"""The exact optimum of a vectored margin: worst direction, twist and forces, by Newton's method.

A margin is ``min over dᵀM d = 1 of Σ h_j(B_j d) - d·w0`` over twists d = (v, ω), ``B_j = [E, -p_j×
+ c_j E]`` and h_j the support of apparatus j's set; M keeps the force rows (force margin), the
torque rows (torque margin) or all (wrench margin). Its stationary points solve, with forces f_j
and the value μ,

    Σ B_jᵀ f_j - w0 = μ M d,     f_j = Π_j(f_j + σ_j B_j d),     dᵀM d = 1,

Π_j the projection on the set. The projection is semismooth, so Newton's method needs no guess of
which apparatus stands on the twist axis (``B_j d = 0``, where f_j lies inside its set): from the
certified search's twist two or three steps end at rounding. Source: THEORY A9.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from snakegen.base.geometry import Floats

P = TypeVar("P")
STEPS = 40
ROUNDED = (3e-3, 0.1, 1e-4)  # of the fastest point: a first guess's forces turn over this speed
SOLVED = 1e-12  # residual, of the sum of limits
DAMPED = 1e-10  # on the diagonal: two apparatuses on one axis share a force that no equation fixes


@dataclass(frozen=True)
class Saddle:
    """A stationary point of a margin's problem, scaled.

    Attributes:
        value: μ, the scaled margin there.
        twist: (6,) d, or as many as the problem has dimensions.
        forces: (n, 3) f_j, which give ``w0 + μ M d``.
        solved: whether the residual is rounding.
    """

    value: float
    twist: Floats
    forces: Floats
    solved: bool


def force_jacobians(points: Floats) -> Floats:
    """Returns B (n, 3, 6) of points and drags (n, 4): thrust-point speed of a twist."""
    x, y, z, c = np.asarray(points, float).T
    out = np.zeros((len(points), 3, 6))
    out[:, [0, 1, 2], [0, 1, 2]] = 1.0
    out[:, [0, 1, 2], [3, 4, 5]] = c[:, None]
    out[:, 0, 4], out[:, 0, 5] = z, -y
    out[:, 1, 3], out[:, 1, 5] = -z, x
    out[:, 2, 3], out[:, 2, 4] = y, -x
    return out


def saddle_point(
    points: Floats,
    spans: Floats,
    low: Floats,
    high: Floats,
    hover: Floats,
    rows: Floats,
    d: Floats,
    rounded: float = ROUNDED[0],
) -> Saddle:
    """Returns the stationary point that Newton's method reaches from the twist d.

    Args:
        points: (n, 4) scaled points and drags.
        spans: (n, 3, 3) orthonormal columns that span each set in CoG axes, 0 where it has fewer:
            three for a ball, two for a disc, one for a segment.
        low, high: (n,) scaled; a segment reaches from low to high, balls and discs to high.
        hover: (6,) scaled.
        rows: (6,) diagonal of M.
        d: (6,) start.
        rounded: one of `ROUNDED`, to be tried in turn.
    """
    return newton(force_jacobians(points), spans, (low, high), hover, rows, d, rounded)


def newton(
    jacobians: Floats,
    spans: Floats,
    limits: tuple[Floats, Floats],
    hover: Floats,
    rows: Floats,
    d: Floats,
    rounded: float = ROUNDED[0],
) -> Saddle:
    """Returns the stationary point in any number c of dimensions, from d (c,).

    Args:
        jacobians: B (n, 3, c), what a direction moves each force's point by.
        spans: (n, 3, 3), as `saddle_point`.
        limits: low and high, (n,) each.
        hover: (c,) what the forces must give.
        rows: (c,) diagonal of M.
        d: (c,) start.
        rounded: one of `ROUNDED`.
    """
    low, high = limits
    n, m, c = len(high), 3 * len(high), len(hover)
    dims = (spans**2).sum(axis=1).round().sum(axis=1)
    segment = dims < 1.5
    onto = spans @ spans.transpose(0, 2, 1)
    d = d / np.sqrt(d @ (rows * d))
    speed = jacobians @ d
    reach = max(float(np.linalg.norm(speed, axis=1).max()), 1e-12)
    stiff = np.maximum(high, -low) / reach
    size = float(np.maximum(high, -low).sum())

    def project(y: Floats) -> tuple[Floats, Floats]:
        """Returns Π(y) (n, 3) and its derivatives (n, 3, 3)."""
        inside = np.einsum("jab,jb->ja", onto, y)
        length = np.linalg.norm(inside, axis=1)
        unit = inside / np.maximum(length, 1e-300)[:, None]
        out = length > high
        share = np.where(out, high / np.maximum(length, 1e-300), 1.0)
        turn = onto - np.where(out, 1.0, 0.0)[:, None, None] * unit[:, :, None] * unit[:, None, :]
        value, slope = inside * share[:, None], turn * share[:, None, None]
        for j in np.flatnonzero(segment):
            axis = spans[j, :, 0]
            along = float(axis @ y[j])
            value[j] = axis * min(max(along, low[j]), high[j])
            slope[j] = onto[j] if low[j] < along < high[j] else 0.0
        return value, slope

    def split(x: Floats) -> tuple[Floats, Floats, float]:
        """Returns d (c,), f (n, 3) and μ of x, all of them in a row."""
        return x[:c], x[c:-1].reshape(n, 3), float(x[-1])

    def residual(x: Floats) -> tuple[Floats, Floats]:
        d, f, mu = split(x)
        value, slope = project(f + stiff[:, None] * (jacobians @ d))
        gap = np.einsum("jck,jc->k", jacobians, f) - hover - mu * rows * d
        return np.concatenate([gap, (f - value).ravel(), [0.5 * (1.0 - d @ (rows * d))]]), slope

    def matrix(x: Floats, slope: Floats) -> Floats:
        d, _, mu = split(x)
        a = np.zeros((c + 1 + m, c + 1 + m))
        a[:c, :c] = -mu * np.diag(rows)
        a[:c, -1] = a[-1, :c] = -rows * d
        a[:c, c:-1] = jacobians.transpose(2, 0, 1).reshape(c, m)
        for j in range(n):
            at = slice(c + 3 * j, c + 3 * j + 3)
            a[at, at] = np.eye(3) - slope[j]
            a[at, :c] = -stiff[j] * slope[j] @ jacobians[j]
        a -= DAMPED * np.diag(np.r_[np.ones(c), -np.ones(m), 0.0])
        return a

    f, _ = project(stiff[:, None] * speed / rounded)
    mu = float((f * speed).sum() - d @ hover)
    x, left, _ = damped_newton(residual, matrix, np.r_[d, f.ravel(), mu], SOLVED * size, STEPS)
    d, f, mu = split(x)
    return Saddle(mu, d, f, bool(np.abs(left).max() < SOLVED * size))


def damped_newton(
    residual: Callable[[Floats], tuple[Floats, P]],
    matrix: Callable[[Floats, P], Floats],
    x: Floats,
    solved: float,
    steps: int,
) -> tuple[Floats, Floats, P]:
    """Returns (x, residual, parts) where Newton's method ends, steps halved until they help.

    Args:
        residual: x → (residual, parts that `matrix` uses too).
        matrix: (x, parts) → derivative of the residual.
        x: start.
        solved: residual that is rounding; the method goes on to a hundredth of it.
        steps: most of them.
    """
    left, parts = residual(x)
    for _ in range(steps):
        if np.abs(left).max() < 0.01 * solved:
            break
        step = np.linalg.solve(matrix(x, parts), -left)
        share, before = 1.0, np.linalg.norm(left)
        while True:
            trial = x + share * step
            left, parts = residual(trial)
            if np.linalg.norm(left) < before * (1.0 - 1e-4 * share) or share < 1e-3:
                break
            share *= 0.5
        x = trial
        if np.linalg.norm(left) >= before:  # rounding, or lost
            break
    return x, left, parts
