"""Forces of sets that are not convex which give one wrench, from forces that nearly do.

Alternating projections: ``f ← P_S(f + W⁺ (w - W f))``, W the wrench of all forces and P_S the
nearest force of each set, over its patches. Where they meet, the convex pieces near those forces
hold the wrench (THEORY A4, from below).
"""

import numpy as np

from snakegen.kernels.core.jit import jit
from snakegen.kernels.margins.force_sets import patch_farthest, wrench_into

MET = 1e-9  # share of the largest force, of a wrench that is met


@jit
def wrench_inverse(sets):
    """Returns W⁺, (3n, 6): least-norm forces of each wrench, as if no set had limits."""
    n = sets.faces.size
    columns, f, w = np.empty((6, 3 * n)), np.empty(3), np.empty(6)
    for j in range(n):
        for c in range(3):
            f[:] = 0.0
            f[c] = 1.0
            wrench_into(j, f, sets, w)
            columns[:, 3 * j + c] = w
    return np.linalg.pinv(columns, 1e-9)


@jit
def settle(target, hull, inverse, rounds, forces):
    """Moves `forces` (n, 3) to ones of the sets that give the wrench `target` (6,).

    Args:
        target: w, scaled.
        hull: the sets.
        inverse: from `wrench_inverse`.
        rounds: most projections.
        forces: where to begin; updated.

    Returns:
        The norm of the wrench that is missed, scaled.
    """
    n = hull.faces.size
    u, local, w, rest = np.empty(3), np.empty(3), np.empty(6), np.empty(6)
    best, missed = np.empty(3), np.inf
    for _ in range(rounds):
        for j in range(n):
            turn = hull.frames[j]
            for k in range(3):
                local[k] = 0.0
                for c in range(3):
                    local[k] += turn[c, k] * forces[j, c]
            nearest = np.inf
            for i in range(hull.first[j], hull.first[j + 1]):
                row = hull.rows[i]
                along = patch_farthest(local[0], local[1], local[2], row, u)
                strength = min(max(along, row[11]), row[12])
                apart = 0.0
                for k in range(3):
                    apart += (strength * u[k] - local[k]) ** 2
                if apart < nearest:
                    nearest = apart
                    for k in range(3):
                        best[k] = strength * u[k]
            for c in range(3):
                forces[j, c] = turn[c, 0] * best[0] + turn[c, 1] * best[1] + turn[c, 2] * best[2]
        rest[:] = target
        for j in range(n):
            wrench_into(j, forces[j], hull, w)
            for c in range(6):
                rest[c] -= w[c]
        missed = np.sqrt((rest**2).sum())
        if missed < MET * hull.high.max():
            break
        for j in range(n):
            for c in range(3):
                for k in range(6):
                    forces[j, c] += inverse[3 * j + c, k] * rest[k]
    return missed
