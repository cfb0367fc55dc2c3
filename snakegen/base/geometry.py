"""Skew matrices, wrench transport, rotations and quaternion orders: nothing else knows them.

Wrenches are ``[force; torque]``, twists ``[linear; angular]``. Inside snakegen rotations are
matrices; quaternions appear at borders only, as ``xyzw`` (Pinocchio, rerun) or ``wxyz`` (MuJoCo).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


def skew(v: ArrayLike) -> Floats:
    """Returns the (3, 3) matrix with ``skew(v) @ x = v × x``; stacks for `v` (…, 3)."""
    v = np.asarray(v, float)
    out = np.zeros((*v.shape, 3))
    out[..., 0, 1], out[..., 0, 2] = -v[..., 2], v[..., 1]
    out[..., 1, 0], out[..., 1, 2] = v[..., 2], -v[..., 0]
    out[..., 2, 0], out[..., 2, 1] = -v[..., 1], v[..., 0]
    return out


def cross(a: Floats, b: Floats) -> Floats:
    """Returns ``a × b`` of vectors (…, 3); `np.cross` takes four times as long for one."""
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    u, v, w = b[..., 0], b[..., 1], b[..., 2]
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[..., 0], out[..., 1], out[..., 2] = y * w - z * v, z * u - x * w, x * v - y * u
    return out


def unskew(m: ArrayLike) -> Floats:
    """Returns the (3,) vector of the skew part of `m`, the inverse of `skew` (the paper's ∨)."""
    m = np.asarray(m, float)
    return 0.5 * np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])


def move_wrench(wrench: ArrayLike, lever: ArrayLike) -> Floats:
    """Returns the (6,) `wrench` about a point O, given about O + `lever` (m, same axes)."""
    w = np.asarray(wrench, float)
    return np.concatenate([w[:3], w[3:] + cross(np.asarray(lever, float), w[:3])])


def rotation_about(axis: ArrayLike, angle: float) -> Floats:
    """Returns the (3, 3) rotation by `angle` (rad) about the unit `axis` (Rodrigues)."""
    k = skew(axis)
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * (k @ k)


def rotation_onto(direction: ArrayLike) -> Floats:
    """Returns a (3, 3) rotation that turns e_z onto the unit `direction` the short way."""
    x, y, z = np.asarray(direction, float)
    sine = np.hypot(x, y)
    if sine < 1e-12:
        return np.eye(3) if z > 0 else np.diag([1.0, -1.0, -1.0])
    return rotation_about([-y / sine, x / sine, 0.0], float(np.arctan2(sine, z)))


def rotation_from_rpy(rpy: ArrayLike) -> Floats:
    """Returns ``Rz(yaw) Ry(pitch) Rx(roll)`` of `rpy` (rad), URDF's and ROS' fixed-axis order.

    Of one (3,) or of many (…, 3).
    """
    roll, pitch, yaw = np.moveaxis(np.asarray(rpy, float), -1, 0)
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    cy, sy = np.cos(yaw), np.sin(yaw)
    out = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    return np.moveaxis(out, (0, 1), (-2, -1))


def rpy_from_rotation(rotation: ArrayLike) -> Floats:
    """Returns (roll, pitch, yaw) with ``rotation = Rz(yaw) Ry(pitch) Rx(roll)``."""
    r = np.asarray(rotation, float)
    pitch = np.arctan2(-r[2, 0], np.hypot(r[0, 0], r[1, 0]))
    if np.hypot(r[0, 0], r[1, 0]) < 1e-12:  # gimbal lock: roll is set to 0
        return np.array([0.0, pitch, np.arctan2(-r[0, 1], r[1, 1])])
    return np.array([np.arctan2(r[2, 1], r[2, 2]), pitch, np.arctan2(r[1, 0], r[0, 0])])


def quaternion_xyzw(rotation: ArrayLike) -> Floats:
    """Returns the unit quaternion [x, y, z, w] (w ≥ 0) of a (3, 3) rotation (Shepperd)."""
    r = np.asarray(rotation, float)
    trace = np.trace(r)
    candidates = np.array([r[0, 0], r[1, 1], r[2, 2], trace])
    i = int(np.argmax(candidates))
    q = np.empty(4)
    if i == 3:
        q[3] = 1.0 + trace
        q[:3] = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    else:
        j, k = (i + 1) % 3, (i + 2) % 3
        q[i] = 1.0 + r[i, i] - r[j, j] - r[k, k]
        q[j], q[k] = r[j, i] + r[i, j], r[k, i] + r[i, k]
        q[3] = r[k, j] - r[j, k]
    q /= np.linalg.norm(q)
    return -q if q[3] < 0 else q


def quaternions_xyzw(rotation: Floats) -> Floats:
    """Returns unit quaternions xyzw (T, 4) of rotations (T, 3, 3), of either sign.

    Shepperd's way: of ``4 q qᵀ`` the column with the largest diagonal, which is far from 0.
    """
    r = np.asarray(rotation, float)
    square = np.empty((len(r), 4, 4))
    trace = np.trace(r, axis1=1, axis2=2)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        square[:, i, i] = 1.0 + 2.0 * r[:, i, i] - trace
        square[:, i, j] = square[:, j, i] = r[:, i, j] + r[:, j, i]
        square[:, i, 3] = square[:, 3, i] = r[:, k, j] - r[:, j, k]
    square[:, 3, 3] = 1.0 + trace
    best = np.argmax(np.diagonal(square, axis1=1, axis2=2), axis=1)
    column = square[np.arange(len(r)), best]
    return np.asarray(column / np.linalg.norm(column, axis=1, keepdims=True))


def rotation_from_xyzw(quaternion: ArrayLike) -> Floats:
    """Returns the (3, 3) rotation of a quaternion [x, y, z, w] of any positive norm."""
    x, y, z, w = np.asarray(quaternion, float) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def wxyz_from_xyzw(quaternion: ArrayLike) -> Floats:
    """Returns MuJoCo's order of a Pinocchio or rerun quaternion; stacks for (…, 4)."""
    return np.asarray(quaternion, float)[..., [3, 0, 1, 2]]


def xyzw_from_wxyz(quaternion: ArrayLike) -> Floats:
    """Returns Pinocchio's and rerun's order of a MuJoCo quaternion; stacks for (…, 4)."""
    return np.asarray(quaternion, float)[..., [1, 2, 3, 0]]
