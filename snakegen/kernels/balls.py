"""Allocation of forces inside balls: the exact one of least forces, and calm ones beside others.

The method is `bounded`'s; a ball's nearest point is a shrunken one. Near its edge the exact answer
moves far for little: a force at its limit can only turn, and the rest must make up for it.
"""

from math import sqrt

import numpy as np

from snakegen.kernels.bounded import HALVINGS, SLACK, STEPS, dual_gap, inner
from snakegen.kernels.jit import jit
from snakegen.kernels.joint_loads import JointLoads, no_loads
from snakegen.kernels.spd import gram, solve_spd
from snakegen.kernels.tree import Floats

BALL_STAGES = (1e-4, 1e-8)  # δ, from … to, by hundreds: round sets bend the dual; less stalls it
CALM = 1e-2  # δ that gives up what would cost more force than a pseudo-inverse takes


@jit
def ball_point(q: Floats, limit: Floats, centre: Floats, mu: Floats) -> tuple[Floats, Floats]:
    """Returns pulls (3Ñ,) ``centre + limit² qᵀ mu`` and their nearest points inside the balls."""
    n = limit.shape[0]
    pull, force = np.zeros(3 * n), np.empty(3 * n)
    for j in range(n):
        size = 0.0
        for c in range(3 * j, 3 * j + 3):
            for i in range(q.shape[0]):
                pull[c] += q[i, c] * mu[i]
            pull[c] = centre[c] + pull[c] * limit[j] * limit[j]
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
    nowhere = np.zeros(matrix.shape[1])
    return climb_balls(matrix, wrench, rows, limit, nowhere, loads, BALL_STAGES[0], BALL_STAGES[1])


@jit
def least_forces(matrix: Floats, wrench: Floats, rows: Floats, limit: Floats) -> Floats:
    """Returns the forces (3Ñ,) of a pseudo-inverse, which may pass their limits: eq 36.

    Least ``Σ (‖f_j‖/limit_j)²``; where the map lacks rank, the nearest wrench in the norm of S.
    """
    n3 = matrix.shape[1]
    q, w, weight = np.empty((6, n3)), np.empty(6), np.empty(n3)
    for i in range(6):
        w[i] = rows[i] * wrench[i]
        for c in range(n3):
            q[i, c] = rows[i] * matrix[i, c]
            weight[c] = limit[c // 3]
    square = gram(q, weight)
    for i in range(6):
        square[i, i] += BALL_STAGES[1]
    mu, forces = solve_spd(square, w), np.zeros(n3)
    for c in range(n3):
        for i in range(6):
            forces[c] += q[i, c] * mu[i] * weight[c] * weight[c]
    return forces


@jit
def near_allocation(
    matrix: Floats, wrench: Floats, rows: Floats, limit: Floats, internal: Floats, calm: int
) -> Floats:
    """Returns forces (3Ñ,) that give `wrench` beside `internal` ones, and move little with it.

    The pseudo-inverse's answer plus what of `internal` (3Ñ,) [N] adds nothing to the wrench. Where
    that passes a limit, the nearest answer inside: exact, or with `calm` as far as it is cheap.
    Arguments else as `ball_allocation`.
    """
    n, lack, beyond = limit.shape[0], wrench.copy(), False
    for c in range(3 * n):
        for i in range(6):
            lack[i] -= matrix[i, c] * internal[c]
    forces = internal + least_forces(matrix, lack, rows, limit)
    for j in range(n):
        beyond |= inner(forces[3 * j : 3 * j + 3], forces[3 * j : 3 * j + 3]) > limit[j] * limit[j]
    if not beyond:
        return forces
    soft, hard = (CALM, CALM) if calm else BALL_STAGES
    return climb_balls(matrix, wrench, rows, limit, forces, no_loads(3 * n), soft, hard)


@jit
def climb_balls(
    matrix: Floats,
    wrench: Floats,
    rows: Floats,
    limit: Floats,
    centre: Floats,
    loads: JointLoads,
    soft: float,
    hard: float,
) -> Floats:
    """Returns `ball_allocation`'s forces (3Ñ,) nearest to `centre`, δ from `soft` to `hard`."""
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
    pull, force = ball_point(q, limit, centre, mu)
    while soft >= 0.5 * hard:
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
                pull, force = ball_point(q, limit, centre, trial)
                climbing = inner(step, ball_gap(q, force, room, trial, w, soft)) < 0.0
                if climbing:
                    high = part
                else:
                    low = part
                    if halving == 0:
                        break
            mu[:] = trial
        soft *= 0.01
    return force
