"""One slice's margin of vectored apparatuses for a batch: force or torque, the other left out.

What `vectored.batch` does, at the cost of the slice that is asked for. Everything is scaled.
"""

import numpy as np

from snakegen.kernels.core.jit import jit
from snakegen.kernels.margins.inner_radius import radius, work_space
from snakegen.kernels.margins.vectored import _body_frame, _first_axis, _full_rank, _lost
from snakegen.kernels.margins.wrench_subspace import RANK_TOLERANCE


@jit
def batch(torque, points, limit, hover, tolerance, bounds, twists):
    """Fills the certified bounds (m, 2) and twists (m, 6) of one margin of m postures.

    Both bounds are 0 where the slice has lost a direction, nan where hover is out of reach.

    Args:
        torque: True for the torque margin, False for the force margin.
        points: (m, n, 4) scaled points and drags.
        limit: (n,) scaled.
        hover: (m, 6) scaled.
        tolerance: relative gap.
        bounds, twists: filled.
    """
    work, gram = work_space(), np.empty((6, 6))
    table, order = np.empty((6, 12)), np.empty(6, np.int64)
    frame, tilts, lost = np.empty((3, 3)), np.zeros(2), np.empty((3, 6))
    k = 1 if torque else 0
    for i in range(points.shape[0]):
        p, held, inside = points[i], hover[i], True
        tilts[:] = 0.0
        bounds[i] = np.nan
        if not _full_rank(p, limit, gram, table, order):
            _, inside = _lost(p, limit, held, tilts, lost)
        if not inside:
            continue
        if tilts[k] > RANK_TOLERANCE:
            bounds[i] = 0.0
            twists[i] = lost[1 + k]
            continue
        if torque:
            _body_frame(frame, p)
        else:
            _first_axis(frame, held[0], held[1], held[2])
        low, high, _ = radius(torque, p, limit, held, frame, tolerance, work, twists[i])
        if high >= -1e-12:
            bounds[i, 0], bounds[i, 1] = max(low, 0.0), high
