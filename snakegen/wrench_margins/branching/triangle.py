"""Distance of a triangle from the origin."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def triangle_distance(corners: Floats) -> float:
    """Returns the distance from the origin to a triangle (3, 3)."""
    a, b, c = corners
    normal = np.cross(b - a, c - a)
    inside = [normal @ np.cross(x, y) for x, y in ((a, b), (b, c), (c, a))]
    if min(inside) >= 0.0 or max(inside) <= 0.0:
        size = np.linalg.norm(normal)
        return float(abs(normal @ a) / size) if size > 0.0 else 0.0
    edges = []
    for x, y in ((a, b), (b, c), (c, a)):
        step = y - x
        share = np.clip(-(x @ step) / max(step @ step, 1e-300), 0.0, 1.0)
        edges.append(float(np.linalg.norm(x + share * step)))
    return min(edges)
