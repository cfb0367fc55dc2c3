"""Allocation of a full wrench to thrusts and gimbal angles: ZN23 eqs 29-47, THEORY A7.

Angles here are in joint order (`vectoring.mounts`): x1, x2 per apparatus. Where an apparatus has
fewer than two gimbal axes, its force is confined to what the rest can reach.
"""

from math import sqrt

import numpy as np

from snakegen.kernels.jit import jit
from snakegen.kernels.linear import cross_into, dot, turn_into
from snakegen.kernels.spd import least_norm
from snakegen.kernels.tree import Floats
from snakegen.kernels.vectoring import (
    AXIS,
    EXTRA,
    FIRST,
    ORIGIN,
    POINT,
    SECOND,
    point_thrust,
    thrust_line,
    turned_into,
)

AT_REST = 1e-4  # rad, below which Newton finishes faster than another sweep
UNSCALED = np.ones(6)


@jit
def confinement(m: Floats, angles: Floats) -> Floats:
    """Returns projectors (Ñ, 3, 3), CoG axes, onto the forces that each apparatus can turn to.

    All of space with two gimbal axes, the plane across the axis with one, the line with none.
    """
    n = m.shape[0]
    out, u = np.zeros((n, 3, 3)), np.empty(3)
    once, twice, elbow = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for j in range(n):
        one, two = dot(m[j, FIRST], m[j, FIRST]) > 0.5, dot(m[j, SECOND], m[j, SECOND]) > 0.5
        if one and two:
            for k in range(3):
                out[j, k, k] = 1.0
            continue
        turned_into(m, j, angles[j, 0], angles[j, 1], once, twice, elbow)
        if two:
            turn_into(once, m[j, SECOND], u)
            across_into(u, out[j])
        else:
            turn_into(twice, m[j, AXIS], u)
            along_into(u, out[j])
    return out


@jit
def along_into(u: Floats, out: Floats) -> None:
    """Writes the projector (3, 3) onto the line along unit u."""
    for i in range(3):
        for k in range(3):
            out[i, k] = u[i] * u[k]


@jit
def across_into(u: Floats, out: Floats) -> None:
    """Writes the projector (3, 3) onto the plane across unit u."""
    for i in range(3):
        for k in range(3):
            out[i, k] = -u[i] * u[k]
        out[i, i] += 1.0


@jit
def point_map(m: Floats, angles: Floats, allowed: Floats) -> Floats:
    """Returns the map (6, 3Ñ) from forces in CoG axes to the wrench, ``[E; p× + c E] P``."""
    n = m.shape[0]
    q, moment, column = np.empty((6, 3 * n)), np.empty(3), np.empty(3)
    u, p = np.empty(3), np.empty(3)
    for j in range(n):
        thrust_line(m, j, angles[j], u, p)
        for c in range(3):
            for k in range(3):
                column[k] = allowed[j, k, c]
            cross_into(p, column, moment)
            for k in range(3):
                q[k, 3 * j + c] = column[k]
                q[3 + k, 3 * j + c] = moment[k] + m[j, EXTRA, 0] * column[k]
    return q


@jit
def wrench_of(m: Floats, thrust: Floats, angles: Floats) -> Floats:
    """Returns ``Q(φ, θ) λ`` (6,), rotors of an apparatus sharing its thrust: eq 13."""
    out, u, p, moment = np.zeros(6), np.empty(3), np.empty(3), np.empty(3)
    for j in range(thrust.shape[0]):
        thrust_line(m, j, angles[j], u, p)
        cross_into(p, u, moment)
        for k in range(3):
            out[k] += thrust[j] * u[k]
            out[3 + k] += thrust[j] * (moment[k] + m[j, EXTRA, 0] * u[k])
    return out


@jit
def forces_of(m: Floats, thrust: Floats, angles: Floats) -> Floats:
    """Returns the forces (3Ñ,) of apparatus thrusts at gimbal angles, CoG axes: eq 37 back."""
    out, u, p = np.empty(3 * thrust.shape[0]), np.empty(3), np.empty(3)
    for j in range(thrust.shape[0]):
        thrust_line(m, j, angles[j], u, p)
        for k in range(3):
            out[3 * j + k] = thrust[j] * u[k]
    return out


@jit
def wrench_jacobian(m: Floats, thrust: Floats, angles: Floats) -> Floats:
    """Returns ``J_w`` (6, 3Ñ), columns [all λ | all x1 | all x2], with ∂p: eqs 42-45."""
    n = thrust.shape[0]
    out = np.zeros((6, 3 * n))
    u, p, arm, axis = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    du, dp, a, b = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    once, twice, elbow = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for j in range(n):
        turned_into(m, j, angles[j, 0], angles[j, 1], once, twice, elbow)
        turn_into(twice, m[j, AXIS], u)
        turn_into(twice, m[j, POINT], p)
        for k in range(3):
            p[k] += elbow[k]
        cross_into(p, u, a)
        for k in range(3):
            out[k, j] = u[k]
            out[3 + k, j] = a[k] + m[j, EXTRA, 0] * u[k]
        for kind in range(2):
            turn_into(once, m[j, FIRST + kind], axis)
            for k in range(3):
                arm[k] = p[k] - (m[j, ORIGIN, k] if kind == 0 else elbow[k])
            cross_into(axis, u, du)
            cross_into(axis, arm, dp)
            cross_into(dp, u, a)
            cross_into(p, du, b)
            column = (1 + kind) * n + j
            for k in range(3):
                out[k, column] = thrust[j] * du[k]
                out[3 + k, column] = thrust[j] * (a[k] + b[k] + m[j, EXTRA, 0] * du[k])
    return out


@jit
def aim_forces(
    m: Floats, forces: Floats, lower: Floats, upper: Floats, thrust: Floats, angles: Floats
) -> None:
    """Writes thrust (Ñ,) and angles (Ñ, 2) for forces (3Ñ,) in CoG axes: eqs 37-39.

    `angles` holds the last ones on entry; an apparatus that is asked for nothing keeps them.
    """
    out, direction = np.empty(2), np.empty(3)
    for j in range(thrust.shape[0]):
        size = sqrt(forces[3 * j] ** 2 + forces[3 * j + 1] ** 2 + forces[3 * j + 2] ** 2)
        thrust[j] = size
        if size > 1e-9:
            for k in range(3):
                direction[k] = forces[3 * j + k] / size
            point_thrust(m, j, direction, angles[j], lower[j], upper[j], out)
            angles[j] = out


@jit
def spread_forces(
    m: Floats,
    wrench: Floats,
    limit: Floats,
    lower: Floats,
    upper: Floats,
    last: Floats,
    sweeps: int,
) -> tuple[Floats, Floats]:
    """Returns thrust (Ñ,) and angles (Ñ, 2) by `sweeps` fixed-point rounds of eqs 36-39.

    Each round puts the thrust points where the round before turned them; fewer are run when the
    angles rest, as they do from the tick before. Forces are of least
    ``Σ (‖f_j‖ / limit_j)²``.
    """
    n = limit.shape[0]
    angles, thrust, weight = last.copy(), np.zeros(n), np.empty(3 * n)
    for j in range(n):
        for c in range(3):
            weight[3 * j + c] = limit[j]
    for _ in range(sweeps):
        before = angles.copy()
        q = point_map(m, angles, confinement(m, angles))
        aim_forces(m, least_norm(q, weight, wrench), lower, upper, thrust, angles)
        moved = 0.0
        for j in range(n):
            moved = max(moved, abs(angles[j, 0] - before[j, 0]), abs(angles[j, 1] - before[j, 1]))
        if moved < AT_REST:
            break
    return thrust, angles


@jit
def missing(
    m: Floats, wrench: Floats, thrust: Floats, angles: Floats, rows: Floats, error: Floats
) -> float:
    """Writes ``ε = w - Q(φ, θ) λ`` into `error` (6,) and returns ``‖diag(rows) ε‖``: eq 40."""
    given, total = wrench_of(m, thrust, angles), 0.0
    for k in range(6):
        error[k] = wrench[k] - given[k]
        total += (rows[k] * error[k]) ** 2
    return sqrt(total)


@jit
def refine(
    m: Floats,
    wrench: Floats,
    thrust: Floats,
    angles: Floats,
    limit: Floats,
    rows: Floats,
    scale: float,
    steps: int,
    residual: float,
) -> tuple[int, float]:
    """Runs Newton on ``ε = w - Q(φ, θ) λ`` in place; returns steps taken and ‖ε‖: eqs 40-47.

    ``δ = J_w^# ε`` with δλ measured in `scale` newtons per radian, halved until ``‖S ε‖`` falls.

    Args:
        m: (Ñ, 10, 3) from `vectoring.mounts`.
        wrench: (6,) wanted, CoG axes.
        thrust: (Ñ,) N, start and result.
        angles: (Ñ, 2) rad, start and result.
        limit: (Ñ,) N; an apparatus whose limit is 0 is lost and stays out.
        rows: (6,) the scaling S of the wrench.
        scale: N.
        steps: most steps.
        residual: N and N m, where to stop.
    """
    n = thrust.shape[0]
    weight, error = np.empty(3 * n), np.empty(6)
    for c in range(3 * n):
        weight[c] = scale if c < n else 1.0
        if limit[c % n] <= 0.0:
            weight[c] = 0.0
    new_thrust, new_angles = thrust, angles
    for step in range(steps + 1):
        size = missing(m, wrench, thrust, angles, UNSCALED, error)
        if size <= residual or step == steps:
            return step, size
        delta = least_norm(wrench_jacobian(m, thrust, angles), weight, error)
        before, part = missing(m, wrench, thrust, angles, rows, error), 1.0
        for _ in range(8):
            new_thrust, new_angles = thrust.copy(), angles.copy()
            for j in range(n):
                new_thrust[j] += part * delta[j]
                new_angles[j, 0] += part * delta[n + j]
                new_angles[j, 1] += part * delta[2 * n + j]
            if missing(m, wrench, new_thrust, new_angles, rows, error) < before:
                break
            part *= 0.5
        thrust[:], angles[:] = new_thrust, new_angles
    return steps, size
