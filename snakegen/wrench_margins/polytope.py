"""Facets of a growing polytope of points, by qhull."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

Floats = NDArray[np.float64]
FLAT = 1e-12  # of the widest extent, below which points have none


def facets(points: Floats) -> tuple[Floats, Floats]:
    """Returns unit normals (f, 3) and offsets (f,) of the hull of points (m, 3); none if flat.

    Thin hulls are stretched to a round shape first: qhull's tolerance is of the widest extent.
    """
    if len(points) < 4:
        return np.empty((0, 3)), np.empty(0)
    middle = points.mean(axis=0)
    _, spread, axes = np.linalg.svd(points - middle, full_matrices=False)
    if spread[2] <= FLAT * spread[0]:
        return np.empty((0, 3)), np.empty(0)
    stretch = axes.T / spread
    normals = ConvexHull((points - middle) @ stretch).equations[:, :3] @ stretch.T
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return normals, (points @ normals.T).max(axis=0)
