"""Distance of a triangle from the origin."""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Point = tuple[float, float, float]


def triangle_distance(corners: Floats) -> float:
    """Returns the distance from the origin to a triangle (3, 3).

    In plain floats: arrays of three cost more to make than to multiply, and a search asks often.
    """
    a, b, c = (tuple(row) for row in corners.tolist())
    normal = _cross(_minus(b, a), _minus(c, a))
    inside = [_dot(normal, _cross(x, y)) for x, y in ((a, b), (b, c), (c, a))]
    if min(inside) >= 0.0 or max(inside) <= 0.0:
        size = sqrt(_dot(normal, normal))
        return abs(_dot(normal, a)) / size if size > 0.0 else 0.0
    return min(_edge_distance(x, y) for x, y in ((a, b), (b, c), (c, a)))


def _edge_distance(x: Point, y: Point) -> float:
    """Returns the distance from the origin to the segment from x to y."""
    step = _minus(y, x)
    share = min(max(-_dot(x, step) / max(_dot(step, step), 1e-300), 0.0), 1.0)
    nearest = (x[0] + share * step[0], x[1] + share * step[1], x[2] + share * step[2])
    return sqrt(_dot(nearest, nearest))


def _minus(x: Point, y: Point) -> Point:
    return (x[0] - y[0], x[1] - y[1], x[2] - y[2])


def _dot(x: Point, y: Point) -> float:
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]


def _cross(x: Point, y: Point) -> Point:
    return (x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0])
