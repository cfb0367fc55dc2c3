"""Allocation of a full wrench to thrusts and gimbal angles: ZN23 eqs 29-47, THEORY A7.

Angles here are in joint order (`vectoring.Mounts`): x1, x2 per apparatus. Where an apparatus has
fewer than two gimbal axes, its force is confined to what the rest can reach.
"""

from math import sqrt

import numpy as np

from snakegen.kernels.control_types import Mounts
from snakegen.kernels.jit import jit
from snakegen.kernels.linear import cross_into, dot, turn_into
from snakegen.kernels.spd import least_norm
from snakegen.kernels.tree import Floats
from snakegen.kernels.vectoring import point_thrust, thrust_point, turned


@jit
def confinement(m: Mounts, angles: Floats) -> Floats:
    """Returns projectors (Ñ, 3, 3), CoG axes, onto the forces that each apparatus can turn to.

    All of space with two gimbal axes, the plane across the axis with one, the line with none.
    """
    n = m.axis.shape[0]
    out, u = np.zeros((n, 3, 3)), np.empty(3)
    for j in range(n):
        one, two = dot(m.first[j], m.first[j]) > 0.5, dot(m.second[j], m.second[j]) > 0.5
        once, twice, _ = turned(m, j, angles[j, 0], angles[j, 1])
        if one and two:
            out[j] = np.eye(3)
        elif two:
            turn_into(once, m.second[j], u)
            out[j] = np.eye(3) - np.outer(u, u)
        else:
            turn_into(twice, m.axis[j], u)
            out[j] = np.outer(u, u)
    return out


@jit
def point_map(points: Floats, drag: Floats, allowed: Floats) -> Floats:
    """Returns the map (6, 3Ñ) from forces in CoG axes to the wrench, ``[E; p× + c E] P``."""
    n = points.shape[0]
    q, moment, column = np.empty((6, 3 * n)), np.empty(3), np.empty(3)
    for j in range(n):
        for c in range(3):
            for k in range(3):
                column[k] = allowed[j, k, c]
            cross_into(points[j], column, moment)
            for k in range(3):
                q[k, 3 * j + c] = column[k]
                q[3 + k, 3 * j + c] = moment[k] + drag[j] * column[k]
    return q


@jit
def wrench_of(m: Mounts, thrust: Floats, angles: Floats) -> Floats:
    """Returns ``Q(φ, θ) λ`` (6,), rotors of an apparatus sharing its thrust: eq 13."""
    out, u, p, moment = np.zeros(6), np.empty(3), np.empty(3), np.empty(3)
    for j in range(thrust.shape[0]):
        _, twice, elbow = turned(m, j, angles[j, 0], angles[j, 1])
        turn_into(twice, m.axis[j], u)
        turn_into(twice, m.point[j], p)
        for k in range(3):
            p[k] += elbow[k]
        cross_into(p, u, moment)
        for k in range(3):
            out[k] += thrust[j] * u[k]
            out[3 + k] += thrust[j] * (moment[k] + m.drag[j] * u[k])
    return out


@jit
def wrench_jacobian(m: Mounts, thrust: Floats, angles: Floats) -> Floats:
    """Returns ``J_w`` (6, 3Ñ), columns [all λ | all x1 | all x2], with ∂p: eqs 42-45."""
    n = thrust.shape[0]
    out = np.zeros((6, 3 * n))
    u, p, arm, axis = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    du, dp, a, b = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for j in range(n):
        once, twice, elbow = turned(m, j, angles[j, 0], angles[j, 1])
        turn_into(twice, m.axis[j], u)
        turn_into(twice, m.point[j], p)
        for k in range(3):
            p[k] += elbow[k]
        cross_into(p, u, a)
        for k in range(3):
            out[k, j] = u[k]
            out[3 + k, j] = a[k] + m.drag[j] * u[k]
        for kind in range(2):
            turn_into(once, m.first[j] if kind == 0 else m.second[j], axis)
            for k in range(3):
                arm[k] = p[k] - (m.origin[j, k] if kind == 0 else elbow[k])
            cross_into(axis, u, du)
            cross_into(axis, arm, dp)
            cross_into(dp, u, a)
            cross_into(p, du, b)
            column = (1 + kind) * n + j
            for k in range(3):
                out[k, column] = thrust[j] * du[k]
                out[3 + k, column] = thrust[j] * (a[k] + b[k] + m.drag[j] * du[k])
    return out


@jit
def aim_forces(
    m: Mounts, forces: Floats, lower: Floats, upper: Floats, thrust: Floats, angles: Floats
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
def thrust_points(m: Mounts, angles: Floats) -> Floats:
    """Returns (Ñ, 3) m, where the apparatuses push at these angles, from the CoG."""
    points = np.empty((angles.shape[0], 3))
    for j in range(angles.shape[0]):
        thrust_point(m, j, angles[j, 0], angles[j, 1], points[j])
    return points


@jit
def spread_forces(
    m: Mounts,
    wrench: Floats,
    limit: Floats,
    lower: Floats,
    upper: Floats,
    last: Floats,
    sweeps: int,
) -> tuple[Floats, Floats]:
    """Returns thrust (Ñ,) and angles (Ñ, 2) by `sweeps` fixed-point rounds of eqs 36-39.

    Each round puts the thrust points where the round before turned them. Forces are of least
    ``Σ (‖f_j‖ / limit_j)²``.
    """
    n = limit.shape[0]
    angles, thrust = last.copy(), np.zeros(n)
    weight = np.repeat(limit, 3)
    for _ in range(sweeps):
        q = point_map(thrust_points(m, angles), m.drag, confinement(m, angles))
        aim_forces(m, least_norm(q, weight, wrench), lower, upper, thrust, angles)
    return thrust, angles


@jit
def error_size(error: Floats, rows: Floats) -> float:
    """Returns ``‖diag(rows) error‖``."""
    total = 0.0
    for k in range(6):
        total += (rows[k] * error[k]) ** 2
    return sqrt(total)


@jit
def refine(
    m: Mounts,
    wrench: Floats,
    thrust: Floats,
    angles: Floats,
    rows: Floats,
    scale: float,
    steps: int,
    residual: float,
) -> tuple[int, float]:
    """Runs Newton on ``ε = w - Q(φ, θ) λ`` in place; returns steps taken and ‖ε‖: eqs 40-47.

    ``δ = J_w^# ε`` with δλ measured in `scale` newtons per radian, halved until ``‖S ε‖`` falls.

    Args:
        m: the mounts.
        wrench: (6,) wanted, CoG axes.
        thrust: (Ñ,) N, start and result.
        angles: (Ñ, 2) rad, start and result.
        rows: (6,) the scaling S of the wrench.
        scale: N.
        steps: most steps.
        residual: N and N m, where to stop.
    """
    n = thrust.shape[0]
    weight = np.ones(3 * n)
    weight[:n] = scale
    error = wrench - wrench_of(m, thrust, angles)
    for step in range(steps):
        size = sqrt(np.sum(error * error))
        if size <= residual:
            return step, size
        delta = least_norm(wrench_jacobian(m, thrust, angles), weight, error)
        before, part = error_size(error, rows), 1.0
        for _ in range(8):
            new_thrust, new_angles = thrust.copy(), angles.copy()
            for j in range(n):
                new_thrust[j] += part * delta[j]
                new_angles[j, 0] += part * delta[n + j]
                new_angles[j, 1] += part * delta[2 * n + j]
            new_error = wrench - wrench_of(m, new_thrust, new_angles)
            if error_size(new_error, rows) < before:
                break
            part *= 0.5
        thrust[:], angles[:], error[:] = new_thrust, new_angles, new_error
    return steps, sqrt(np.sum(error * error))
