"""Dual-rotor control of one tick, in NumPy: ZN23 eqs 20-28, THEORY A7.

The readable twins of `kernels/allocation/underactuated.py` and `dual_rotor.py`: the horizontal
force is made by tilt and gimbals, ``[f_z; τ]`` by the rotors' thrusts. Angles in joint order.
"""

import numpy as np

from snakegen.base.geometry import Floats, cross, rotation_from_rpy, rpy_from_rotation
from snakegen.control.vectored_allocation import least_norm, least_singular_value
from snakegen.kernels.allocation.gimbals import LEVER, ORIGIN
from snakegen.robot.gimbal_geometry import point_thrust, turned


def horizontal(force: Floats, rotation: Floats) -> tuple[float, float]:
    """Returns ``f'_x = f_x cosψ + f_y sinψ`` and ``f'_y = f_y cosψ - f_x sinψ`` [N]."""
    yaw = rpy_from_rotation(rotation)[2]
    ahead = force[0] * np.cos(yaw) + force[1] * np.sin(yaw)
    return float(ahead), float(force[1] * np.cos(yaw) - force[0] * np.sin(yaw))


def tilted_target(
    ahead: float, left: float, wanted: Floats, weight: float, gains: Floats, most: float
) -> Floats:
    """Returns the attitude (3, 3) that makes the horizontal force: eqs 23-24.

    ``roll = roll_t - k_φ f'_y / (m g)`` and ``pitch = pitch_t + k_θ f'_x / (m g)``.

    Args:
        ahead, left: N, f'_x and f'_y from `horizontal`.
        wanted: (3, 3) target attitude; its yaw is kept.
        weight: m g [N].
        gains: (2,) k_φ, k_θ.
        most: rad, clamp of the added roll and pitch.
    """
    roll, pitch, yaw = rpy_from_rotation(wanted)
    roll -= np.clip(gains[0] * left / weight, -most, most)
    pitch += np.clip(gains[1] * ahead / weight, -most, most)
    return rotation_from_rpy([roll, pitch, yaw])


def level_axes(wanted: Floats) -> Floats:
    """Returns the target's tilt ``Ry(pitch) Rx(roll)`` (3, 3): CoG axes seen from level ones."""
    roll, pitch, _ = rpy_from_rotation(wanted)
    return rotation_from_rpy([roll, pitch, 0.0])


def vectored_gimbals(
    m: Floats,
    ahead: float,
    left: float,
    tilt: Floats,
    weight: float,
    gains: Floats,
    lower: Floats,
    upper: Floats,
    last: Floats,
) -> Floats:
    """Returns gimbal angles (Ñ, 2) along ``[k_θi f'_x, k_φi f'_y, m g]``: eqs 25-28.

    Args:
        m: (Ñ, 10, 3) from `mounts`.
        ahead, left: N, f'_x and f'_y from `horizontal`.
        tilt: (3, 3) from `level_axes`.
        weight: m g [N].
        gains: (Ñ, 2) k_φi, k_θi.
        lower, upper, last: (Ñ, 2) rad.
    """
    out = np.empty(last.shape)
    for j, (roll_gain, pitch_gain) in enumerate(gains):
        level = np.array([pitch_gain * ahead, roll_gain * left, weight])
        direction = tilt.T @ (level / np.linalg.norm(level))
        point_thrust(m, j, direction, last[j], lower[j], upper[j], out[j])
    return out


def rotor_map(m: Floats, rotor: Floats, angles: Floats) -> Floats:
    """Returns ``Q_dual`` (6, n) at gimbal `angles` (Ñ, 2), CoG held: eqs 7-10."""
    q = np.empty((6, len(rotor)))
    for r, (point, axis, (ratio, apparatus, _)) in enumerate(rotor):
        j = int(apparatus)
        once, twice = turned(m, j, angles[j])
        u, p = twice @ axis, m[j, ORIGIN] + once @ m[j, LEVER] + twice @ point
        q[:3, r], q[3:, r] = u, cross(p, u) + ratio * u
    return q


def truncated(q: Floats, tilt: Floats) -> Floats:
    """Returns rows ``[f_z; τ]`` (4, n) of a map (6, n), z the target's level axis: eqs 20-21."""
    return np.vstack([tilt[2] @ q[:3], q[3:]])


def truncated_wrench(wrench: Floats, tilt: Floats) -> Floats:
    """Returns ``[f_z; τ]`` (4,) of a wrench (6,)."""
    return np.concatenate([[tilt[2] @ wrench[:3]], wrench[3:]])


def allocate_dual(
    q: Floats, wanted: Floats, rows: Floats, thrust_max: Floats
) -> tuple[Floats, float]:
    """Returns rotor thrusts ``λ = D (Q_trunc D)^# [f_z; τ]`` (n,), scaled σ_min(Q_trunc): eq 22.

    Args:
        q: (4, n) truncated map at the gimbal angles in use.
        wanted: (4,) ``[f_z; τ]``.
        rows: (4,) their scale.
        thrust_max: (n,) N, D.
    """
    return least_norm(q, thrust_max, wanted), least_singular_value(q, rows, thrust_max)
