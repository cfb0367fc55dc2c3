"""Virtual-single-rotor allocation of one wrench, in NumPy: ZN23 eqs 29-47, THEORY A7.

The readable twins of `kernels/allocation/fully_actuated.py`. Angles are in joint order: x1, x2 per
apparatus, joint 1 nearer to the link. Where an apparatus has fewer than two gimbal axes, its force
is confined to what the rest can reach.
"""

import numpy as np

from snakegen.base.geometry import Floats, cross, skew
from snakegen.kernels.allocation.fully_actuated import AT_REST
from snakegen.kernels.allocation.gimbals import AXIS, EXTRA, FIRST, LEVER, ORIGIN, POINT, SECOND
from snakegen.robot.gimbal_geometry import point_thrust, turned

SINGULAR = 1e-9  # of σ_1: directions that a pseudo-inverse leaves alone


def least_norm(q: Floats, weight: Floats, wrench: Floats) -> Floats:
    """Returns the x (n,) with ``q x = wrench`` of least ``‖x / weight‖``: eqs 22, 36, 46."""
    return weight * (np.linalg.pinv(q * weight, rcond=SINGULAR) @ wrench)


def least_singular_value(q: Floats, rows: Floats, weight: Floats) -> float:
    """Returns σ_min of ``diag(rows) q diag(weight)``, 0 if there are fewer columns than rows."""
    sigma = np.linalg.svd(rows[:, None] * q * weight, compute_uv=False)
    return float(sigma[-1]) if len(sigma) == len(rows) else 0.0


def thrust_lines(m: Floats, angles: Floats) -> tuple[Floats, Floats]:
    """Returns thrust directions and points (Ñ, 3) [m] of apparatuses at `angles` (Ñ, 2)."""
    u, p = np.empty((len(m), 3)), np.empty((len(m), 3))
    for j, x in enumerate(angles):
        once, twice = turned(m, j, x)
        u[j] = twice @ m[j, AXIS]
        p[j] = m[j, ORIGIN] + once @ m[j, LEVER] + twice @ m[j, POINT]
    return u, p


def confinement(m: Floats, angles: Floats) -> Floats:
    """Returns projectors (Ñ, 3, 3), CoG axes, onto the forces that each apparatus can turn to.

    All of space with two gimbal axes, the plane across the axis with one, the line with none.
    """
    out = np.tile(np.eye(3), (len(m), 1, 1))
    for j, x in enumerate(angles):
        once, twice = turned(m, j, x)
        if m[j, SECOND] @ m[j, SECOND] < 0.5:
            u = twice @ m[j, AXIS]
            out[j] = np.outer(u, u)
        elif m[j, FIRST] @ m[j, FIRST] < 0.5:
            a = once @ m[j, SECOND]
            out[j] -= np.outer(a, a)
    return out


def point_map(m: Floats, angles: Floats, allowed: Floats) -> Floats:
    """Returns the map (6, 3Ñ) from forces in CoG axes to the wrench, ``[E; p× + c E] P``: eq 34."""
    _, p = thrust_lines(m, angles)
    moment = skew(p) + m[:, EXTRA, :1, None] * np.eye(3)
    blocks = np.concatenate([allowed, moment @ allowed], axis=1)
    return blocks.transpose(1, 0, 2).reshape(6, -1)


def wrench_of(m: Floats, thrust: Floats, angles: Floats) -> Floats:
    """Returns ``Q(φ, θ) λ`` (6,), rotors of an apparatus sharing its thrust: eq 13."""
    u, p = thrust_lines(m, angles)
    moment = cross(p, u) + m[:, EXTRA, :1] * u
    return np.asarray(thrust @ np.hstack([u, moment]))


def wrench_jacobian(m: Floats, thrust: Floats, angles: Floats) -> Floats:
    """Returns ``J_w`` (6, 3Ñ), columns [all λ | all x1 | all x2], with ∂p: eqs 42-45.

    ``∂u = a × u``, ``∂p = a × (p - o)`` of a joint with axis a through o.
    """
    (u, p), c = thrust_lines(m, angles), m[:, EXTRA, :1]
    columns = [np.hstack([u, cross(p, u) + c * u])]
    turns = [turned(m, j, x)[0] for j, x in enumerate(angles)]
    elbows = np.array([m[j, ORIGIN] + t @ m[j, LEVER] for j, t in enumerate(turns)]).reshape(-1, 3)
    for kind, origin in ((FIRST, m[:, ORIGIN]), (SECOND, elbows)):
        a = np.array([t @ m[j, kind] for j, t in enumerate(turns)]).reshape(-1, 3)
        du, dp = cross(a, u), cross(a, p - origin)
        moment = cross(dp, u) + cross(p, du) + c * du
        columns.append(thrust[:, None] * np.hstack([du, moment]))
    return np.vstack(columns).T


def aim_forces(
    m: Floats, forces: Floats, lower: Floats, upper: Floats, last: Floats
) -> tuple[Floats, Floats]:
    """Returns thrust (Ñ,) and angles (Ñ, 2) for forces (Ñ, 3) in CoG axes: eqs 37-39.

    An apparatus that is asked for nothing keeps its `last` angles.
    """
    thrust, angles = np.linalg.norm(forces, axis=1), np.array(last)
    for j in range(len(thrust)):
        if thrust[j] <= 1e-9:
            continue
        point_thrust(m, j, forces[j] / thrust[j], last[j], lower[j], upper[j], angles[j])
    return thrust, angles


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

    ``F = D (Q_force D)^# w``, each round with the thrust points where the round before turned
    them; fewer are run when the angles rest.
    """
    thrust, angles = np.zeros(len(m)), np.array(last)
    for _ in range(sweeps):
        q, before = point_map(m, angles, confinement(m, angles)), angles
        forces = least_norm(q, np.repeat(limit, 3), wrench).reshape(-1, 3)
        thrust, angles = aim_forces(m, forces, lower, upper, angles)
        if np.abs(angles - before).max(initial=0.0) < AT_REST:
            break
    return thrust, angles


def refine(
    m: Floats,
    wrench: Floats,
    thrust: Floats,
    angles: Floats,
    limit: Floats,
    rows: Floats,
    steps: int,
    residual: float,
) -> tuple[Floats, Floats, int, float]:
    """Runs Newton on ``ε = w - Q(φ, θ) λ``; thrust, angles, steps taken and ‖ε‖: eqs 40-47.

    ``δ = J_w^# ε`` with δλ measured in m g / Ñ newtons per radian, halved until ``‖S ε‖`` falls.

    Args:
        m: (Ñ, 10, 3) from `mounts`.
        wrench: (6,) wanted, CoG axes.
        thrust, angles: (Ñ,) N and (Ñ, 2) rad, where to start.
        limit: (Ñ,) N; an apparatus whose limit is 0 is lost and stays out.
        rows: (6,) the scaling S of the wrench.
        steps: most steps.
        residual: N and N·m, where to stop.
    """
    n = len(thrust)
    weight = np.repeat([1.0 / (rows[0] * n), 1.0, 1.0], n) * np.tile(limit > 0.0, 3)
    error = wrench - wrench_of(m, thrust, angles)
    for step in range(steps):
        if np.linalg.norm(error) <= residual:
            return thrust, angles, step, float(np.linalg.norm(error))
        delta = least_norm(wrench_jacobian(m, thrust, angles), weight, error)
        before, part = np.linalg.norm(rows * error), 1.0
        for _ in range(8):
            more = part * delta
            new_thrust = thrust + more[:n]
            new_angles = angles + np.column_stack([more[n : 2 * n], more[2 * n :]])
            error = wrench - wrench_of(m, new_thrust, new_angles)
            if np.linalg.norm(rows * error) < before:
                break
            part *= 0.5
        thrust, angles = new_thrust, new_angles
    return thrust, angles, steps, float(np.linalg.norm(error))


def least_answer(
    m: Floats,
    limit: Floats,
    wrench: Floats,
    rows: Floats,
    last: Floats,
    bounds: tuple[Floats, Floats],
    sweeps: int,
    newton: int,
    residual: float,
) -> tuple[Floats, Floats, float, int, float]:
    """Returns the printed allocator's thrust (Ñ,), angles (Ñ, 2), σ_min(J_w), Newton steps, ‖ε‖.

    `sweeps` of eq 36, then Newton, eqs 29-47; `bounds` are the angles' (Ñ, 2) lower and upper.
    """
    thrust, angles = spread_forces(m, wrench, limit, *bounds, last, sweeps)
    thrust, angles, steps, size = refine(m, wrench, thrust, angles, limit, rows, newton, residual)
    columns = np.concatenate([limit, np.ones(2 * len(limit))])
    sigma = least_singular_value(wrench_jacobian(m, thrust, angles), rows, columns)
    return thrust, angles, sigma, steps, size
