"""The robots of THEORY A3's table as plain arrays: equal links, built by hand."""

import numpy as np
from scipy.spatial.transform import Rotation

LENGTH, MASS, SEPARATION = 0.42, 2.0, 0.2


def chain(count, posture):
    """Returns apparatus positions from the CoG (n, 3) and link rotations (n, 3, 3)."""
    rotation, at, positions, rotations = np.eye(3), np.zeros(3), [], []
    for i in range(count):
        positions.append(at + rotation @ [LENGTH / 2, 0, 0])
        rotations.append(rotation)
        at = at + rotation @ [LENGTH, 0, 0]
        pitch, yaw = {
            "straight": (0.0, 0.0),
            "planar": (0.0, np.pi / 3),
            "spatial": (0.6 * (-1) ** i, 0.8),
        }[posture]
        rotation = rotation @ Rotation.from_euler("YZ", [pitch, yaw]).as_matrix()
    points = np.array(positions)
    return points - points.mean(axis=0), np.array(rotations)


def dual_map(points, rotations, kappa=0.01, alternate=True):
    """Returns Q_dual (6, 2n) with every thrust vertical (THEORY A1, A2)."""
    columns = []
    for j, (p, rotation) in enumerate(zip(points, rotations, strict=True)):
        up = rotation.T @ [0.0, 0.0, 1.0]
        phi = np.arctan2(-up[1], up[2])
        theta = np.arctan2(up[0], -up[1] * np.sin(phi) + up[2] * np.cos(phi))
        frame = rotation @ Rotation.from_euler("XY", [phi, theta]).as_matrix()
        first = -1 if alternate and j % 2 else 1
        for side, spin in ((0.5, first), (-0.5, -first)):
            u, at = frame[:, 2], p + frame @ [0.0, side * SEPARATION, 0.0]
            columns.append(np.r_[u, np.cross(at, u) - kappa * spin * u])
    return np.array(columns).T
