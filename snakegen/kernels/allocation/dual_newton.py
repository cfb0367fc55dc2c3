"""Allocation within limits: the answer of least effort inside balls and intervals (THEORY A7).

``min ½ Σ (‖x - c‖ / d)² + ‖S (w - Q x)‖² / (2 δ)`` over a product of balls and intervals. Its
dual has one unknown μ a row whatever the number of rotors: ``x(μ) = nearest point of the set to
c + d² Qᵀ μ`` and ``S⁻² δ μ = w - Q x(μ)``. A semismooth Newton climbs it. A reachable wrench is met
to about δ; an unreachable one is approached as near as the set allows, in the norm of S.

The answer is unique, so where a climb starts decides its length alone: from the top of a problem
near by it takes a step or two, from nowhere it goes by falling δ.
"""

from typing import NamedTuple

import numpy as np

from snakegen.kernels.core.cholesky import factor, solve_factor_into
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.stack_arrays import scratch
from snakegen.kernels.core.types import Floats
from snakegen.kernels.dynamics.joint_loads import JointLoads

STEPS = 30  # at a δ
WARM_STEPS = 8  # after which a climb from near by is given up
MET = 1e-24  # ‖gradient‖², rows scaled
REST = 1e-20  # of what is left to climb; its root bounds the error of x / d
ROUNDED = 1e-13  # left to climb, below which a step that gains little meets rounding
SLACK = 10.0  # a servo's torque counts a hundredth of a thrust in what is made least
TRIALS = 24  # of a step's length


class Bounded(NamedTuple):
    """An allocation within limits, rows scaled; a servo's torque is an interval column."""

    q: Floats  # (m, n) map; three columns a ball, then one an interval
    w: Floats  # (m,) wanted
    limit: Floats  # (b,) radii of the balls, and their d
    centre: Floats  # (3b,) c of the balls; intervals have 0
    spread: Floats  # (n - 3b,) d of the intervals
    lower: Floats  # (n - 3b,)
    upper: Floats  # (n - 3b,)


@bare(no_cpython_wrapper=True)
def nearest_into(p: Bounded, mu: Floats, pull: Floats, x: Floats) -> None:
    """Writes the pulls (n,) ``c + d² Qᵀ μ`` and the nearest points (n,) of the set to them."""
    m, n = p.q.shape
    first = 3 * p.limit.shape[0]
    for c in range(n):
        pull[c] = 0.0
    for i in range(m):
        for c in range(n):
            pull[c] += p.q[i, c] * mu[i]
    for j in range(p.limit.shape[0]):
        size, weight = 0.0, p.limit[j] * p.limit[j]
        for c in range(3 * j, 3 * j + 3):
            pull[c] = p.centre[c] + pull[c] * weight
            size += pull[c] * pull[c]
        shrink = p.limit[j] / np.sqrt(size) if size > weight else 1.0
        for c in range(3 * j, 3 * j + 3):
            x[c] = pull[c] * shrink
    for c in range(first, n):
        k = c - first
        pull[c] *= p.spread[k] * p.spread[k]
        x[c] = min(max(pull[c], p.lower[k]), p.upper[k])


@bare(no_cpython_wrapper=True)
def gap_into(p: Bounded, x: Floats, mu: Floats, soft: float, gap: Floats) -> None:
    """Writes the gradient ``Q x + δ μ - w`` (m,) of the (negated) dual."""
    for i in range(p.q.shape[0]):
        gap[i] = soft * mu[i] - p.w[i]
        for c in range(p.q.shape[1]):
            gap[i] += p.q[i, c] * x[c]


@bare(no_cpython_wrapper=True)
def slope_into(p: Bounded, pull: Floats, soft: float, slope: Floats) -> None:
    """Writes the lower triangle of the derivative (m, m) of ``Q x(μ) + δ μ``.

    A ball's point moves with its pull; outside, across it alone and the less the farther. An
    interval's moves inside alone.
    """
    m, n = p.q.shape
    unit, part = scratch(3), scratch((m, 3))
    for i in range(m):
        for k in range(i):
            slope[i, k] = 0.0
        slope[i, i] = soft
    for j in range(p.limit.shape[0]):
        size = 0.0
        for c in range(3):
            size += pull[3 * j + c] ** 2
        size = np.sqrt(size)
        outside, gain = size > p.limit[j], p.limit[j] * p.limit[j]
        for c in range(3):
            unit[c] = pull[3 * j + c] / size if outside else 0.0
        if outside:
            gain *= p.limit[j] / size
        for i in range(m):
            along = 0.0
            for c in range(3):
                along += p.q[i, 3 * j + c] * unit[c]
            for c in range(3):
                part[i, c] = gain * (p.q[i, 3 * j + c] - along * unit[c])
            for k in range(i + 1):
                for c in range(3):
                    slope[i, k] += part[i, c] * p.q[k, 3 * j + c]
    first = 3 * p.limit.shape[0]
    for c in range(first, n):
        if p.lower[c - first] < pull[c] < p.upper[c - first]:
            gain = p.spread[c - first] * p.spread[c - first]
            for i in range(m):
                if p.q[i, c] != 0.0:
                    for k in range(i + 1):
                        slope[i, k] += gain * p.q[i, c] * p.q[k, c]


@bare
def inner(a: Floats, b: Floats) -> float:
    """Returns ``a · b``."""
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i] * b[i]
    return total


@bare(no_cpython_wrapper=True)
def stride(
    p: Bounded, soft: float, fall: float, step: Floats, mu: Floats, pull: Floats, x: Floats,
    gap: Floats,
) -> None:  # fmt: skip
    """Goes against `step` in place: all of it, or to where the climb along it ends.

    Along a step the dual is concave, so a chord between a point below the top and one beyond it
    (the older one halved when it stays: the Illinois rule) finds the top. A point below it that
    leaves a fifth of the slope is good enough: it is higher than the start for certain.

    Args:
        fall: ``step · gap`` at the start, > 0.
        mu: (m,) where the step begins, and where it ends.
        pull, x, gap: at its end.
    """
    start = scratch(mu.shape[0])
    for i in range(mu.shape[0]):
        start[i] = mu[i]
    low, high, left, over, side, part = 0.0, 1.0, fall, 0.0, 0, 1.0
    for trial in range(TRIALS):
        for i in range(mu.shape[0]):
            mu[i] = start[i] - part * step[i]
        nearest_into(p, mu, pull, x)
        gap_into(p, x, mu, soft, gap)
        slope = inner(step, gap)
        if (slope >= 0.0 and (trial == 0 or slope < 0.2 * fall)) or inner(gap, gap) < MET:
            return
        if slope >= 0.0:
            over *= 0.5 if side > 0 else 1.0
            low, left, side = part, slope, 1
        else:
            left *= 0.5 if side < 0 else 1.0
            high, over, side = part, slope, -1
        part = low + (high - low) * left / (left - over)


@bare(no_cpython_wrapper=True)
def climb(p: Bounded, soft: float, steps: int, mu: Floats, x: Floats) -> bool:
    """Climbs the dual at one δ from `mu` (m,) on, in place; tells whether it reached the top.

    `x` (n,) is the answer. ``fall = gradient · step`` is twice what Newton expects to gain; as
    the effort is convex of modulus 1 in x / d, its root bounds how far x still is.
    """
    m, n = p.q.shape
    pull, gap, step, low = scratch(n), scratch(m), scratch(m), scratch((m, m))
    nearest_into(p, mu, pull, x)
    gap_into(p, x, mu, soft, gap)
    before = np.inf
    for _ in range(steps):
        if inner(gap, gap) < MET:
            return True
        slope_into(p, pull, soft, low)
        factor(low)
        solve_factor_into(low, gap, step)
        fall = inner(gap, step)
        if fall < REST or (fall < ROUNDED and fall > 0.1 * before):
            return True
        before = fall
        stride(p, soft, fall, step, mu, pull, x, gap)
    return inner(gap, gap) < MET


@bare
def ascend(p: Bounded, soft: float, factor: float, hard: float, mu: Floats, x: Floats) -> None:
    """Writes the answer x (n,) at δ = `hard`, and the top μ (m,) of its dual.

    From `mu` on; from 0 by falling δ, `soft` times `factor` a stage, where it is NaN or where
    that fails.
    """
    warm, steps, now = mu[0] == mu[0], WARM_STEPS, hard
    if not warm:
        start_anew(mu)
        steps, now = STEPS, soft
    while now >= 0.5 * hard:
        arrived = climb(p, now, steps, mu, x)
        now *= factor
        if warm and not arrived:
            start_anew(mu)
            warm, steps, now = False, STEPS, soft


@bare
def start_anew(mu: Floats) -> None:
    """Sets μ (m,) to 0."""
    for i in range(mu.shape[0]):
        mu[i] = 0.0


@bare
def scaled_into(matrix: Floats, wrench: Floats, rows: Floats, q: Floats, w: Floats) -> None:
    """Writes the map (m, n) and the wrench (m,), rows scaled, into the first rows of q and w."""
    for i in range(matrix.shape[0]):
        w[i] = rows[i] * wrench[i]
        for c in range(matrix.shape[1]):
            q[i, c] = rows[i] * matrix[i, c]


@bare(no_cpython_wrapper=True)
def servos_into(loads: JointLoads, scale: float, q: Floats, w: Floats) -> None:
    """Writes the bounds of k joints into the last k rows of q (m, n) and w.

    Each is a row ``b·x - y = -bias`` whose y, an interval column, is its servo's torque.
    """
    k, n = loads.rows.shape
    first, column = q.shape[0] - k, q.shape[1] - k
    for i in range(first + k):
        for c in range(k):
            q[i, column + c] = -1.0 if i == first + c else 0.0
    for i in range(k):
        w[first + i] = -scale * loads.bias[i]
        for c in range(n):
            q[first + i, c] = scale * loads.rows[i, c]


@bare(no_cpython_wrapper=True)
def intervals_into(
    loads: JointLoads, scale: float, spread: Floats, lower: Floats, upper: Floats
) -> None:
    """Writes d and the ends of the servos' torques into the last k of them."""
    k = loads.limit.shape[0]
    first = spread.shape[0] - k
    for i in range(k):
        room = scale * loads.limit[i]
        spread[first + i] = SLACK * room
        lower[first + i], upper[first + i] = -room, room
