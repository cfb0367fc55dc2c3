"""Dual-rotor control of attitude and altitude, x and y through tilt and gimbals: ZN23 eqs 20-28.

The mended reading of THEORY A7: f is the world force of eq 15, roll and pitch are those of
``R = Rz(ψ) Ry(pitch) Rx(roll)``, and gimbals point along ``[k_θi f'_x, k_φi f'_y, m g]`` in the
CoG frame as it stands when level (eq 27 prints the link-from-CoG rotation).
"""

from math import asin, atan2, cos, sin, sqrt

import numpy as np

from snakegen.kernels.allocation.gimbals import point_thrust, turned_into
from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.mat3 import cross_into, turn_back_into, turn_into
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.stack_arrays import scratch
from snakegen.kernels.core.types import Floats


@bare
def euler(rotation: Floats) -> tuple[float, float, float]:
    """Returns roll, pitch, yaw [rad] of ``Rz(yaw) Ry(pitch) Rx(roll)``."""
    pitch = asin(min(max(-rotation[2, 0], -1.0), 1.0))
    roll = atan2(rotation[2, 1], rotation[2, 2])
    return roll, pitch, atan2(rotation[1, 0], rotation[0, 0])


@bare
def from_euler_into(roll: float, pitch: float, yaw: float, out: Floats) -> None:
    """Writes ``Rz(yaw) Ry(pitch) Rx(roll)`` (3, 3)."""
    cr, sr, cp, sp, cy, sy = cos(roll), sin(roll), cos(pitch), sin(pitch), cos(yaw), sin(yaw)
    out[0, 0], out[0, 1], out[0, 2] = cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr
    out[1, 0], out[1, 1], out[1, 2] = sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr
    out[2, 0], out[2, 1], out[2, 2] = -sp, cp * sr, cp * cr


@bare
def horizontal(force: Floats, rotation: Floats) -> tuple[float, float]:
    """Returns ``f'_x = f_x cosψ + f_y sinψ`` and ``f'_y = f_y cosψ - f_x sinψ`` [N]."""
    _, _, yaw = euler(rotation)
    ahead = force[0] * cos(yaw) + force[1] * sin(yaw)
    return ahead, force[1] * cos(yaw) - force[0] * sin(yaw)


@bare
def tilted_target_into(
    ahead: float,
    left: float,
    wanted: Floats,
    weight: float,
    gains: Floats,
    most: float,
    out: Floats,
) -> None:
    """Writes the attitude (3, 3) that makes the horizontal force: eqs 23-24.

    ``roll = roll_t - k_φ f'_y / (m g)`` and ``pitch = pitch_t + k_θ f'_x / (m g)`` on top of the
    target's own.

    Args:
        ahead, left: N, f'_x and f'_y from `horizontal`.
        wanted: (3, 3) target attitude; its yaw is kept.
        weight: m g [N].
        gains: (2,) k_φ, k_θ.
        most: rad, clamp of the added roll and pitch.
        out: (3, 3)
    """
    roll, pitch, yaw = euler(wanted)
    roll -= min(max(gains[0] * left / weight, -most), most)
    pitch += min(max(gains[1] * ahead / weight, -most), most)
    from_euler_into(roll, pitch, yaw, out)


@jit
def tilted_target(
    ahead: float, left: float, wanted: Floats, weight: float, gains: Floats, most: float
) -> Floats:
    """Returns the attitude (3, 3) of `tilted_target_into`."""
    out = np.empty((3, 3))
    tilted_target_into(ahead, left, wanted, weight, gains, most, out)
    return out


@bare
def between_into(a: Floats, b: Floats, share: float, out: Floats) -> None:
    """Writes a rotation `share` of the way from a to b, for nearby ones (Gram-Schmidt)."""
    size = along = 0.0
    for i in range(3):
        for k in range(2):
            out[i, k] = (1.0 - share) * a[i, k] + share * b[i, k]
        size += out[i, 0] ** 2
        along += out[i, 0] * out[i, 1]
    rest = 0.0
    for i in range(3):
        out[i, 1] -= along / size * out[i, 0]
        rest += out[i, 1] ** 2
    for i in range(3):
        out[i, 0] /= sqrt(size)
        out[i, 1] /= sqrt(rest)
    for i in range(3):
        k, l = (i + 1) % 3, (i + 2) % 3
        out[i, 2] = out[k, 0] * out[l, 1] - out[l, 0] * out[k, 1]


@bare
def level_axes_into(wanted: Floats, out: Floats) -> None:
    """Writes the target's tilt ``Ry(pitch) Rx(roll)`` (3, 3): CoG axes seen from level ones."""
    roll, pitch, _ = euler(wanted)
    from_euler_into(roll, pitch, 0.0, out)


@jit
def level_axes(wanted: Floats) -> Floats:
    """Returns the tilt (3, 3) of `level_axes_into`."""
    out = np.empty((3, 3))
    level_axes_into(wanted, out)
    return out


@bare
def vectored_gimbals_into(
    m: Floats,
    ahead: float,
    left: float,
    tilt: Floats,
    weight: float,
    gains: Floats,
    lower: Floats,
    upper: Floats,
    last: Floats,
    out: Floats,
) -> None:
    """Writes gimbal angles (Ñ, 2), joint order, along ``[k_θi f'_x, k_φi f'_y, m g]``: eqs 25-28.

    Args:
        m: (Ñ, 10, 3) from `vectoring.mounts`.
        ahead, left: N, f'_x and f'_y from `horizontal`.
        tilt: (3, 3) from `level_axes`.
        weight: m g [N].
        gains: (Ñ, 2) k_φi, k_θi.
        lower, upper: (Ñ, 2) rad, joint order.
        last: (Ñ, 2) rad, joint order.
        out: (Ñ, 2) rad.
    """
    level, direction = scratch(3), scratch(3)
    for j in range(last.shape[0]):
        level[0], level[1], level[2] = gains[j, 1] * ahead, gains[j, 0] * left, weight
        size = sqrt(level[0] ** 2 + level[1] ** 2 + level[2] ** 2)
        for k in range(3):
            level[k] /= size
        turn_back_into(tilt, level, direction)
        point_thrust(m, j, direction, last[j], lower[j], upper[j], out[j])


@jit
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
    """Returns the gimbal angles (Ñ, 2) of `vectored_gimbals_into`."""
    out = np.empty(last.shape)
    vectored_gimbals_into(m, ahead, left, tilt, weight, gains, lower, upper, last, out)
    return out


@bare
def rotor_map_into(m: Floats, rotor: Floats, angles: Floats, q: Floats) -> None:
    """Writes ``Q_dual`` (6, n) at the given gimbal angles (joint order), CoG held: eqs 7-10."""
    u, p, moment = scratch(3), scratch(3), scratch(3)
    once, twice, elbow = scratch((3, 3)), scratch((3, 3)), scratch(3)
    turned = -1
    for r in range(rotor.shape[0]):
        j = int(rotor[r, 2, 1])
        if j != turned:  # rotors of an apparatus stand together
            turned_into(m, j, angles[j, 0], angles[j, 1], once, twice, elbow)
            turned = j
        turn_into(twice, rotor[r, 0], p)
        turn_into(twice, rotor[r, 1], u)
        for k in range(3):
            p[k] += elbow[k]
        cross_into(p, u, moment)
        for k in range(3):
            q[k, r] = u[k]
            q[3 + k, r] = moment[k] + rotor[r, 2, 0] * u[k]


@jit
def rotor_map(m: Floats, rotor: Floats, angles: Floats) -> Floats:
    """Returns the map (6, n) of `rotor_map_into`."""
    q = np.empty((6, rotor.shape[0]))
    rotor_map_into(m, rotor, angles, q)
    return q


@bare
def truncated_into(q: Floats, tilt: Floats, out: Floats) -> None:
    """Writes rows ``[f_z; τ]`` (4, n) of a map (6, n): eqs 20-21.

    z is the level axis of the target attitude: the CoG frame's own z when the target is level.
    """
    for c in range(q.shape[1]):
        out[0, c] = tilt[2, 0] * q[0, c] + tilt[2, 1] * q[1, c] + tilt[2, 2] * q[2, c]
        for k in range(3):
            out[1 + k, c] = q[3 + k, c]


@jit
def truncated(q: Floats, tilt: Floats) -> Floats:
    """Returns the rows (4, n) of `truncated_into`."""
    out = np.empty((4, q.shape[1]))
    truncated_into(q, tilt, out)
    return out


@bare
def truncated_wrench_into(wrench: Floats, tilt: Floats, out: Floats) -> None:
    """Writes ``[f_z; τ]`` (4,) of a wrench (6,)."""
    out[0] = tilt[2, 0] * wrench[0] + tilt[2, 1] * wrench[1] + tilt[2, 2] * wrench[2]
    for k in range(3):
        out[1 + k] = wrench[3 + k]


@jit
def truncated_wrench(wrench: Floats, tilt: Floats) -> Floats:
    """Returns ``[f_z; τ]`` (4,) of a wrench (6,)."""
    out = np.empty(4)
    truncated_wrench_into(wrench, tilt, out)
    return out
