"""Allocation within limits: the least-norm answer inside a box (THEORY A7); `balls` for balls.

Joint servos bound it too: each is a row ``b·x - y = -bias`` whose y lies in the servo's range.

Both solve ``min ½ Σ (x / d)² + ‖S (w - Q x)‖² / (2 δ)`` over a convex set. Its dual has six
unknowns μ whatever the number of rotors: ``x(μ) = nearest point of the set to d² Qᵀ μ`` and
``S⁻² δ μ = w - Q x(μ)``. A damped semismooth Newton climbs it. A reachable wrench is met to about
δ; an unreachable one is approached as near as the set allows, in the norm of S.
"""

import numpy as np

from snakegen.kernels.jit import jit
from snakegen.kernels.joint_loads import JointLoads
from snakegen.kernels.spd import solve_spd
from snakegen.kernels.tree import Floats

BOX_STAGES = (1e-4, 1e-7, 1e-10)  # δ: the last is far below what a rotor can resolve
STEPS = 30
SLACK = 10.0  # a servo's torque counts a hundredth of a thrust in what is made least
HALVINGS = 24


@jit
def box_point(q: Floats, weight: Floats, lower: Floats, upper: Floats, mu: Floats) -> Floats:
    """Returns the point of the box nearest to ``weight² qᵀ mu`` in the norm of 1 / weight."""
    x = np.empty(q.shape[1])
    for c in range(q.shape[1]):
        pull = 0.0
        for i in range(q.shape[0]):
            pull += q[i, c] * mu[i]
        x[c] = min(max(pull * weight[c] * weight[c], lower[c]), upper[c])
    return x


@jit
def dual_gap(q: Floats, x: Floats, mu: Floats, wrench: Floats, soft: float) -> Floats:
    """Returns the gradient ``q x + soft μ - w`` of the (negated) dual, rows scaled."""
    gap = np.empty(q.shape[0])
    for i in range(q.shape[0]):
        gap[i] = soft * mu[i] - wrench[i]
        for c in range(q.shape[1]):
            gap[i] += q[i, c] * x[c]
    return gap


@jit
def inner(a: Floats, b: Floats) -> float:
    """Returns ``a · b``."""
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i] * b[i]
    return total


@jit
def box_allocation(
    matrix: Floats, wrench: Floats, rows: Floats, weight: Floats, lower: Floats, upper: Floats
) -> Floats:
    """Returns the thrusts (n,) inside [lower, upper] that give `wrench` with least ``‖x/weight‖``.

    Args:
        matrix: (m, n) allocation map.
        wrench: (m,) wanted.
        rows: (m,) scale S of the wrench's rows; it decides what is given up when out of reach.
        weight: (n,) d, usually the largest thrusts.
        lower, upper: (n,) N.
    """
    m, n = matrix.shape
    q, w = np.empty((m, n)), np.empty(m)
    for i in range(m):
        w[i] = rows[i] * wrench[i]
        for c in range(n):
            q[i, c] = rows[i] * matrix[i, c]
    mu, trial = np.zeros(m), np.zeros(m)
    x = box_point(q, weight, lower, upper, mu)
    for soft in BOX_STAGES:
        for _ in range(STEPS):
            gap = dual_gap(q, x, mu, w, soft)
            if inner(gap, gap) < 1e-24:
                break
            step = solve_spd(box_slope(q, weight, lower, upper, x, soft), gap)
            low, high = 0.0, 1.0
            for halving in range(HALVINGS):
                part = high if halving == 0 else 0.5 * (low + high)
                for i in range(mu.shape[0]):
                    trial[i] = mu[i] - part * step[i]
                x = box_point(q, weight, lower, upper, trial)
                climbing = inner(step, dual_gap(q, x, trial, w, soft)) < 0.0
                if climbing:
                    high = part
                else:
                    low = part
                    if halving == 0:
                        break
            mu[:] = trial
    return x


@jit
def box_slope(
    q: Floats, weight: Floats, lower: Floats, upper: Floats, x: Floats, soft: float
) -> Floats:
    """Returns the derivative (m, m) of ``q x(μ) + soft μ``: only thrusts off their limits move."""
    slope = np.zeros((q.shape[0], q.shape[0]))
    for i in range(q.shape[0]):
        slope[i, i] = soft
    for c in range(q.shape[1]):
        if lower[c] < x[c] < upper[c]:
            for i in range(q.shape[0]):
                for k in range(q.shape[0]):
                    slope[i, k] += weight[c] * weight[c] * q[i, c] * q[k, c]
    return slope


@jit
def box_within(
    matrix: Floats,
    wrench: Floats,
    rows: Floats,
    weight: Floats,
    lower: Floats,
    upper: Floats,
    loads: JointLoads,
) -> Floats:
    """Returns `box_allocation`'s thrusts (n,) that keep the joints' bounds too.

    Each bound adds a row and a column: its servo's torque, a thrust of the box ±limit.
    """
    m, n = matrix.shape
    k = loads.limit.shape[0]
    q, w, scale = np.zeros((m + k, n + k)), np.empty(m + k), np.empty(m + k)
    d, low, high = np.empty(n + k), np.empty(n + k), np.empty(n + k)
    q[:m, :n], q[m:, :n] = matrix, loads.rows
    w[:m], w[m:], scale[:m], scale[m:] = wrench, -loads.bias, rows, rows[m - 1]
    d[:n], low[:n], high[:n] = weight, lower, upper
    for i in range(k):
        q[m + i, n + i] = -1.0
        d[n + i] = SLACK * loads.limit[i]
        low[n + i], high[n + i] = -loads.limit[i], loads.limit[i]
    return box_allocation(q, w, scale, d, low, high)[:n]
