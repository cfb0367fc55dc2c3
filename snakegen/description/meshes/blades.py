"""Blades of fans and drums and the wheels on them, as closed solids swept along their curves."""

import math

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh

from snakegen.description.meshes import solids

Array = NDArray[np.float64]


def fan_blade(span: Array, chord: Array, twist: Array, azimuth: float, z: float) -> Trimesh:
    """One blade: lens-shaped sections along the radius, leading edge forward (+azimuth) and up."""
    radial = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
    forward = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    lens = np.array([(0.5, 0.0), (0.1, 0.07), (-0.5, 0.01), (-0.5, -0.01), (0.1, -0.03)])
    rings = []
    for r, c, b in zip(span, chord, twist, strict=True):
        along = math.cos(b) * forward + math.sin(b) * up
        across = -math.sin(b) * forward + math.cos(b) * up
        rings.append(r * radial + z * up + c * (lens[:, :1] * along + lens[:, 1:] * across))
    return solids.loft(np.array(rings))


def ridge(x: Array, azimuth: Array, low: float, high: float, half: float) -> Trimesh:
    """One blade of a drum: a bar of width 2 half from radius low to high along a helix."""
    radial = np.stack([np.zeros_like(x), np.cos(azimuth), np.sin(azimuth)], axis=1)
    around = np.stack([np.zeros_like(x), -np.sin(azimuth), np.cos(azimuth)], axis=1)
    centre = np.stack([x, np.zeros_like(x), np.zeros_like(x)], axis=1)
    corners = [(low, -half), (low, half), (high, half), (high, -half)]
    return solids.loft(np.stack([centre + r * radial + s * around for r, s in corners], axis=1))


def wheel(x: float, azimuth: float, angle: float, reach: float, length: float) -> Trimesh:
    """One wheel whose rim touches radius `reach`, its axle along the blade at (x, azimuth)."""
    radial = np.array([0.0, math.cos(azimuth), math.sin(azimuth)])
    around = np.array([0.0, -math.sin(azimuth), math.cos(azimuth)])
    axle = math.cos(angle) * np.array([1.0, 0.0, 0.0]) + math.sin(angle) * around
    rim = 0.2 * reach
    half = min(0.07 * length, 0.5 * rim)
    disc = solids.cylinder(rim, -half, half, "z", 14)
    turn = np.stack([radial, np.cross(axle, radial), axle], axis=1)
    centre = np.array([x, 0.0, 0.0]) + (reach - rim) * radial
    return Trimesh(disc.vertices @ turn.T + centre, disc.faces, process=False)
