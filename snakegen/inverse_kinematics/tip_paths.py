"""Paths for a tip and ports for a body, checked: circles, tables, openings."""

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.geometry import Floats
from snakegen.base.number_table import read_number_table
from snakegen.errors import AnalysisError
from snakegen.inverse_kinematics.path_following import Port
from snakegen.statics.joint_torques import finite

XYZ = ("x", "y", "z")


def circle(
    centre: ArrayLike, radius: float, normal: ArrayLike, duration: float, dt: float = 0.01
) -> Floats:
    """Returns a circle (m, 3) [m], once round in `duration` [s], at rest at its ends.

    Raises:
        AnalysisError: a radius or duration that is not positive, a normal of length 0.
    """
    n = finite(normal, (3,), "normal")
    if not (radius > 0 and duration > 0 and dt > 0 and np.linalg.norm(n) > 0):
        raise AnalysisError(
            f"circle: radius {radius:g} m, duration {duration:g} s and dt {dt:g} s must be above "
            "0, its normal no zero vector."
        )
    first, second = np.linalg.svd(n[None])[2][1:]
    t = np.linspace(0.0, 1.0, max(int(round(duration / dt)), 2) + 1)
    angle = 2 * np.pi * t**3 * (10 - 15 * t + 6 * t * t)  # rate and acceleration vanish at the ends
    ring = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second
    return np.asarray(finite(centre, (3,), "centre") + radius * ring)


def through(gate: Port, depth: float, duration: float, dt: float = 0.01) -> Floats:
    """Returns the straight way (m, 3) [m] in through a port along its axis, at rest at its ends.

    It begins a quarter of the depth before the port's plane.

    Raises:
        AnalysisError: a depth or duration that is not positive.
    """
    if not (depth > 0 and duration > 0 and dt > 0):
        raise AnalysisError("a way through a port needs a depth, duration and dt above 0.")
    t = np.linspace(0.0, 1.0, max(int(round(duration / dt)), 2) + 1)
    share = t**3 * (10 - 15 * t + 6 * t * t)
    along = -0.25 * depth + 1.25 * depth * share
    return np.asarray(gate.centre + along[:, None] * gate.axis)


def port(centre: ArrayLike, axis: ArrayLike, radius: float) -> Port:
    """Returns an opening the body must pass, its axis pointing inwards.

    Raises:
        AnalysisError: an axis of length 0, a radius that is not positive.
    """
    a = finite(axis, (3,), "port axis")
    if not (np.linalg.norm(a) > 0 and radius > 0):
        raise AnalysisError("port: an axis and a radius above 0 are needed.")
    return Port(finite(centre, (3,), "port centre"), a / np.linalg.norm(a), float(radius))


def port_of(given: Port | str | None) -> Port | None:
    """Returns a port from its seven numbers."""
    if given is None or isinstance(given, Port):
        return given
    x = finite(given, (7,), "port")
    return port(x[:3], x[3:6], float(x[6]))


def checked_path(path: ArrayLike) -> Floats:
    """Returns a path, or the table of one, as (m, 3) m with m ≥ 2 finite points.

    A file is a CSV, Parquet or YAML table of x, y, z; a CSV may leave its header out.
    """
    if isinstance(path, str):
        path = read_number_table(path, XYZ).stack(XYZ)
    out = np.asarray(path, float)
    if out.ndim != 2 or out.shape[1] != 3 or len(out) < 2:
        given = " × ".join(map(str, out.shape))
        raise AnalysisError(f"path: {given} numbers; two rows or more of x,y,z are needed.")
    return finite(out, out.shape, "path")
