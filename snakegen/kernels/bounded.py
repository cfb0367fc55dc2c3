"""Allocation within limits: the least-norm answer inside a box, or inside balls (THEORY A7).

Joint servos bound it too: each is a row ``b·x - y = -bias`` whose y lies in the servo's range.

Both solve ``min ½ Σ (x / d)² + ‖S (w - Q x)‖² / (2 δ)`` over a convex set. Its dual has six
unknowns μ whatever the number of rotors: ``x(μ) = nearest point of the set to d² Qᵀ μ`` and
``S⁻² δ μ = w - Q x(μ)``. A damped semismooth Newton climbs it. A reachable wrench is met to about
δ; an unreachable one is approached as near as the set allows, in the norm of S.
"""

from math import sqrt

import numpy as np

from snakegen.kernels.jit import jit
from snakegen.kernels.joint_loads import JointLoads
from snakegen.kernels.spd import solve_spd
from snakegen.kernels.tree import Floats

BOX_STAGES = (1e-4, 1e-7, 1e-10)  # δ: the last is far below what a rotor can resolve
BALL_STAGES = (1e-4, 1e-6, 1e-8)  # round sets bend the dual; a smaller δ stalls out of reach
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
def ball_point(q: Floats, limit: Floats, mu: Floats) -> tuple[Floats, Floats]:
    """Returns pulls (3Ñ,) ``limit² qᵀ mu`` and their nearest points inside the balls."""
    n = limit.shape[0]
    pull, force = np.zeros(3 * n), np.empty(3 * n)
    for j in range(n):
        size = 0.0
        for c in range(3 * j, 3 * j + 3):
            for i in range(q.shape[0]):
                pull[c] += q[i, c] * mu[i]
            pull[c] *= limit[j] * limit[j]
            size += pull[c] * pull[c]
        shrink = min(1.0, limit[j] / sqrt(size)) if size > 0.0 else 1.0
        for c in range(3 * j, 3 * j + 3):
            force[c] = pull[c] * shrink
    return pull, force


@jit
def ball_slope(
    q: Floats, limit: Floats, pull: Floats, room: Floats, mu: Floats, soft: float
) -> Floats:
    """Returns the derivative (m, m) of ``q x(μ) - y(μ) + soft μ``."""
    m, first = q.shape[0], q.shape[0] - room.shape[0]
    slope, part, unit = np.zeros((m, m)), np.empty(m), np.empty(3)
    for i in range(m):
        slope[i, i] = soft
    for i in range(room.shape[0]):
        stiff = (SLACK * room[i]) ** 2
        if abs(stiff * mu[first + i]) < room[i]:
            slope[first + i, first + i] += stiff
    for j in range(limit.shape[0]):
        size = sqrt(pull[3 * j] ** 2 + pull[3 * j + 1] ** 2 + pull[3 * j + 2] ** 2)
        outside = size > limit[j]
        gain = limit[j] * limit[j] * (limit[j] / size if outside else 1.0)
        for i in range(m):
            for k in range(m):
                for c in range(3 * j, 3 * j + 3):
                    slope[i, k] += gain * q[i, c] * q[k, c]
        if outside:
            for c in range(3):
                unit[c] = pull[3 * j + c] / size
            for i in range(m):
                part[i] = 0.0
                for c in range(3):
                    part[i] += q[i, 3 * j + c] * unit[c]
            for i in range(m):
                for k in range(m):
                    slope[i, k] -= gain * part[i] * part[k]
    return slope


@jit
def ball_gap(q: Floats, x: Floats, room: Floats, mu: Floats, wrench: Floats, soft: float) -> Floats:
    """Returns the gradient ``q x - y + soft μ - w`` of the (negated) dual, rows scaled.

    ``y = -(SLACK room)² μ`` of the last rows, clipped to ±room: the torques of the servos.
    """
    gap = dual_gap(q, x, mu, wrench, soft)
    first = q.shape[0] - room.shape[0]
    for i in range(room.shape[0]):
        y = -((SLACK * room[i]) ** 2) * mu[first + i]
        gap[first + i] -= min(max(y, -room[i]), room[i])
    return gap


@jit
def ball_allocation(
    matrix: Floats, wrench: Floats, rows: Floats, limit: Floats, loads: JointLoads
) -> Floats:
    """Returns forces (3Ñ,), ``‖f_j‖ ≤ limit_j``, giving `wrench` with least ``Σ (‖f_j‖/limit_j)²``.

    Args:
        matrix: (6, 3Ñ) force map; three columns an apparatus, projected where it is confined.
        wrench: (6,) wanted.
        rows: (6,) scale S of the wrench's rows.
        limit: (Ñ,) N.
        loads: bounds of the joints on the forces, k ≥ 0 of them.
    """
    n3, k = matrix.shape[1], loads.limit.shape[0]
    q, w, room = np.empty((6 + k, n3)), np.empty(6 + k), np.empty(k)
    for i in range(6):
        w[i] = rows[i] * wrench[i]
        for c in range(n3):
            q[i, c] = rows[i] * matrix[i, c]
    for i in range(k):
        w[6 + i], room[i] = -rows[3] * loads.bias[i], rows[3] * loads.limit[i]
        for c in range(n3):
            q[6 + i, c] = rows[3] * loads.rows[i, c]
    mu, trial = np.zeros(6 + k), np.zeros(6 + k)
    pull, force = ball_point(q, limit, mu)
    for soft in BALL_STAGES:
        for _ in range(STEPS):
            gap = ball_gap(q, force, room, mu, w, soft)
            if inner(gap, gap) < 1e-24:
                break
            step = solve_spd(ball_slope(q, limit, pull, room, mu, soft), gap)
            low, high = 0.0, 1.0
            for halving in range(HALVINGS):
                part = high if halving == 0 else 0.5 * (low + high)
                for i in range(mu.shape[0]):
                    trial[i] = mu[i] - part * step[i]
                pull, force = ball_point(q, limit, trial)
                climbing = inner(step, ball_gap(q, force, room, trial, w, soft)) < 0.0
                if climbing:
                    high = part
                else:
                    low = part
                    if halving == 0:
                        break
            mu[:] = trial
    return force


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
