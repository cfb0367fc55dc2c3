"""Where an affine law of forces leaves the convex pieces that hold it."""

import numpy as np
from numpy.typing import NDArray

from snakegen.kernels.margins.convex_pieces import pieces_into
from snakegen.kernels.margins.force_sets import SEGMENT, Sets
from snakegen.kernels.margins.limited_margins import empty_pieces
from snakegen.wrench_margins.force_sets import ForceSets
from snakegen.wrench_margins.quadric import leaves_ball, leaves_plane

Floats = NDArray[np.float64]
SLACK = 1e-9  # share of the largest force by which a command may pass a face


def pieces_near(sets: ForceSets, anchors: Floats) -> Sets:
    """Returns the convex pieces of `sets`, N and m, near the forces `anchors` (n, 3), CoG axes."""
    hull = sets.hull()
    convex = empty_pieces(hull)
    pieces_into(np.ascontiguousarray(anchors, float), hull, convex)
    return convex


def leaves_sets(sets: ForceSets, start: Floats, gain: Floats) -> list[Floats]:
    """Returns for each apparatus the shortest d (m,) at which ``f0 + K d`` leaves its piece.

    Args:
        sets: of one posture.
        start: f0, (3n,) N, CoG axes; pieces are those near it.
        gain: K, (3n, m).

    Returns:
        nan where f0 lies outside; inf where K never leaves.
    """
    convex = pieces_near(sets, start.reshape(-1, 3))
    exits = []
    for j in range(len(sets)):
        f, k = start[3 * j : 3 * j + 3], gain[3 * j : 3 * j + 3]
        m, low, high = convex.axis[j], convex.low[j], convex.high[j]
        if convex.faces[j] == SEGMENT:
            across = np.linalg.svd(m[None])[2][1:]
            faces = [*across, *-across]
            ends = [_plane(f, k, a, 0.0, high) for a in faces]
            ends += [_plane(f, k, m, low, high), _plane(f, k, -m, -high, high)]
        else:
            ends = [_plane(f, k, a, 0.0, high) for a in convex.normals[j, : convex.faces[j]]]
            if low > 0.0:
                ends.append(_plane(f, k, m, low, high))
            ends.append(leaves_ball(f, k, float(high)))
        exits.append(min(ends, key=lambda d: -1.0 if np.isnan(d).any() else np.linalg.norm(d)))
    return exits


def _plane(f: Floats, gain: Floats, normal: Floats, low: float, high: float) -> Floats:
    """Returns where ``normal · f`` falls to `low`."""
    room = float(normal @ f) - low
    slack = SLACK * max(high, 1e-300)
    rate = gain.T @ normal
    rate = np.where(np.abs(rate) <= SLACK * np.abs(gain).max(initial=0.0), 0.0, rate)
    return leaves_plane(-rate, 0.0 if -slack <= room < 0.0 else room)
