"""Allocation of a full wrench to thrusts and gimbal angles: ZN23 eqs 29-47, THEORY A7.

Angles here are in joint order (`vectoring.mounts`): x1, x2 per apparatus. Where an apparatus has
fewer than two gimbal axes, its force is confined to what the rest can reach.
"""

from math import sqrt

import numpy as np

from snakegen.kernels.allocation.confinement import confinement_into
from snakegen.kernels.allocation.gimbals import (
    AXIS,
    EXTRA,
    POINT,
    point_thrust,
    swing_into,
    thrust_line,
    turned_into,
)
from snakegen.kernels.core.cholesky import least_norm_into
from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.mat3 import cross_into, turn_into
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.stack_arrays import scratch
from snakegen.kernels.core.types import Floats

AT_REST = 1e-4  # rad, below which Newton finishes faster than another sweep


@bare
def point_map_into(m: Floats, angles: Floats, allowed: Floats, q: Floats) -> None:
    """Writes the map (6, 3Ñ) from forces in CoG axes to the wrench, ``[E; p× + c E] P``."""
    u, p, moment, column = scratch(3), scratch(3), scratch(3), scratch(3)
    for j in range(m.shape[0]):
        thrust_line(m, j, angles[j], u, p)
        for c in range(3):
            for k in range(3):
                column[k] = allowed[j, k, c]
            cross_into(p, column, moment)
            for k in range(3):
                q[k, 3 * j + c] = column[k]
                q[3 + k, 3 * j + c] = moment[k] + m[j, EXTRA, 0] * column[k]


@jit
def point_map(m: Floats, angles: Floats, allowed: Floats) -> Floats:
    """Returns the map (6, 3Ñ) of `point_map_into`."""
    q = np.empty((6, 3 * m.shape[0]))
    point_map_into(m, angles, allowed, q)
    return q


@bare
def wrench_into(m: Floats, thrust: Floats, angles: Floats, out: Floats) -> None:
    """Writes ``Q(φ, θ) λ`` (6,), rotors of an apparatus sharing its thrust: eq 13."""
    u, p, moment = scratch(3), scratch(3), scratch(3)
    for k in range(6):
        out[k] = 0.0
    for j in range(thrust.shape[0]):
        thrust_line(m, j, angles[j], u, p)
        cross_into(p, u, moment)
        for k in range(3):
            out[k] += thrust[j] * u[k]
            out[3 + k] += thrust[j] * (moment[k] + m[j, EXTRA, 0] * u[k])


@jit
def wrench_of(m: Floats, thrust: Floats, angles: Floats) -> Floats:
    """Returns the wrench (6,) of `wrench_into`."""
    out = np.empty(6)
    wrench_into(m, thrust, angles, out)
    return out


@bare
def forces_into(m: Floats, thrust: Floats, angles: Floats, out: Floats) -> None:
    """Writes the forces (3Ñ,) of apparatus thrusts at gimbal angles, CoG axes: eq 37 back."""
    u, p = scratch(3), scratch(3)
    for j in range(thrust.shape[0]):
        thrust_line(m, j, angles[j], u, p)
        for k in range(3):
            out[3 * j + k] = thrust[j] * u[k]


@jit
def forces_of(m: Floats, thrust: Floats, angles: Floats) -> Floats:
    """Returns the forces (3Ñ,) of `forces_into`."""
    out = np.empty(3 * thrust.shape[0])
    forces_into(m, thrust, angles, out)
    return out


@bare
def wrench_jacobian_into(m: Floats, thrust: Floats, angles: Floats, out: Floats) -> None:
    """Writes ``J_w`` (6, 3Ñ), columns [all λ | all x1 | all x2], with ∂p: eqs 42-45."""
    n = thrust.shape[0]
    u, p, arm, axis = scratch(3), scratch(3), scratch(3), scratch(3)
    du, dp, a, b = scratch(3), scratch(3), scratch(3), scratch(3)
    once, twice, elbow = scratch((3, 3)), scratch((3, 3)), scratch(3)
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
            swing_into(m, j, kind, (once, elbow), u, p, axis, arm, du, dp)
            cross_into(dp, u, a)
            cross_into(p, du, b)
            column = (1 + kind) * n + j
            for k in range(3):
                out[k, column] = thrust[j] * du[k]
                out[3 + k, column] = thrust[j] * (a[k] + b[k] + m[j, EXTRA, 0] * du[k])


@jit
def wrench_jacobian(m: Floats, thrust: Floats, angles: Floats) -> Floats:
    """Returns ``J_w`` (6, 3Ñ) of `wrench_jacobian_into`."""
    out = np.empty((6, 3 * thrust.shape[0]))
    wrench_jacobian_into(m, thrust, angles, out)
    return out


@bare
def aim_forces(
    m: Floats, forces: Floats, lower: Floats, upper: Floats, thrust: Floats, angles: Floats
) -> None:
    """Writes thrust (Ñ,) and angles (Ñ, 2) for forces (3Ñ,) in CoG axes: eqs 37-39.

    `angles` holds the last ones on entry; an apparatus that is asked for nothing keeps them.
    """
    out, direction = scratch(2), scratch(3)
    for j in range(thrust.shape[0]):
        size = sqrt(forces[3 * j] ** 2 + forces[3 * j + 1] ** 2 + forces[3 * j + 2] ** 2)
        thrust[j] = size
        if size > 1e-9:
            for k in range(3):
                direction[k] = forces[3 * j + k] / size
            point_thrust(m, j, direction, angles[j], lower[j], upper[j], out)
            angles[j, 0], angles[j, 1] = out[0], out[1]


@bare
def spread_forces(
    m: Floats,
    wrench: Floats,
    limit: Floats,
    lower: Floats,
    upper: Floats,
    last: Floats,
    sweeps: int,
    thrust: Floats,
    angles: Floats,
) -> None:
    """Writes thrust (Ñ,) and angles (Ñ, 2) by `sweeps` fixed-point rounds of eqs 36-39.

    Each round puts the thrust points where the round before turned them; fewer are run when the
    angles rest, as they do from the tick before. Forces are of least
    ``Σ (‖f_j‖ / limit_j)²``.
    """
    n = limit.shape[0]
    before, weight, forces = scratch((n, 2)), scratch(3 * n), scratch(3 * n)
    allowed, q = scratch((n, 3, 3)), scratch((6, 3 * n))
    for j in range(n):
        thrust[j], angles[j, 0], angles[j, 1] = 0.0, last[j, 0], last[j, 1]
        for c in range(3):
            weight[3 * j + c] = limit[j]
    for _ in range(sweeps):
        for j in range(n):
            before[j, 0], before[j, 1] = angles[j, 0], angles[j, 1]
        confinement_into(m, angles, allowed)
        point_map_into(m, angles, allowed, q)
        least_norm_into(q, weight, wrench, forces)
        aim_forces(m, forces, lower, upper, thrust, angles)
        moved = 0.0
        for j in range(n):
            moved = max(moved, abs(angles[j, 0] - before[j, 0]), abs(angles[j, 1] - before[j, 1]))
        if moved < AT_REST:
            break


@bare
def missing(
    m: Floats, wrench: Floats, thrust: Floats, angles: Floats, rows: Floats, error: Floats
) -> tuple[float, float]:
    """Writes ``ε = w - Q(φ, θ) λ`` (6,) and returns ``‖ε‖`` and ``‖diag(rows) ε‖``: eq 40."""
    wrench_into(m, thrust, angles, error)
    plain, scaled = 0.0, 0.0
    for k in range(6):
        error[k] = wrench[k] - error[k]
        plain += error[k] ** 2
        scaled += (rows[k] * error[k]) ** 2
    return sqrt(plain), sqrt(scaled)


@bare
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
        residual: N and N·m, where to stop.
    """
    n = thrust.shape[0]
    weight, error, delta, jacobian = scratch(3 * n), scratch(6), scratch(3 * n), scratch((6, 3 * n))
    new_thrust, new_angles = scratch(n), scratch((n, 2))
    for c in range(3 * n):
        weight[c] = scale if c < n else 1.0
        if limit[c % n] <= 0.0:
            weight[c] = 0.0
    size, scaled = missing(m, wrench, thrust, angles, rows, error)
    for step in range(steps):
        if size <= residual:
            return step, size
        wrench_jacobian_into(m, thrust, angles, jacobian)
        least_norm_into(jacobian, weight, error, delta)
        before, part = scaled, 1.0
        for _ in range(8):
            for j in range(n):
                new_thrust[j] = thrust[j] + part * delta[j]
                new_angles[j, 0] = angles[j, 0] + part * delta[n + j]
                new_angles[j, 1] = angles[j, 1] + part * delta[2 * n + j]
            size, scaled = missing(m, wrench, new_thrust, new_angles, rows, error)
            if scaled < before:
                break
            part *= 0.5
        for j in range(n):
            thrust[j], angles[j, 0], angles[j, 1] = (
                new_thrust[j],
                new_angles[j, 0],
                new_angles[j, 1],
            )
    return steps, size
