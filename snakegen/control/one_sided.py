"""Inputs that change one way alone, at a limit, and the wrench that they therefore cannot add."""

import numpy as np

from snakegen.base.geometry import Floats

_LOST = 1e-6  # of the largest column: less is rounding
_SURE = 1e-4  # of the same; the linear program meets its bounds to 1e-7


def one_sided_loss(columns: Floats, rises: Floats, falls: Floats) -> Floats | None:
    """Returns a wrench direction that no change of the inputs adds to, None where all are reached.

    The changes make the cone ``{J x, x_i ≥ 0 where input i only rises, ≤ 0 where it only falls}``.
    It is all of space unless some d ≠ 0 has ``d · J x ≤ 0`` throughout; inputs free both ways
    leave d in the complement of their span, and a linear program finds it there.

    Args:
        columns: (6, k) J, scaled, of rank 6 without the inputs that cannot change.
        rises, falls: (k,) whether each input may rise, and fall.

    Returns:
        d, (6,) unit, in the scaled axes of `columns`.
    """
    from scipy.optimize import linprog

    up, down = np.asarray(rises, bool), np.asarray(falls, bool)
    free, single = columns[:, up & down], up != down
    if not single.any():
        return None
    ways = columns[:, single] * np.where(up[single], 1.0, -1.0)
    left = np.linalg.svd(free, full_matrices=True)
    size = left[1] if free.size else np.zeros(0)
    scale = float(np.linalg.norm(columns, 2))
    rest = np.asarray(left[0])[:, int(np.sum(size > _LOST * scale)) :]
    if rest.shape[1] == 0:
        return None
    seen = (rest.T @ ways).T / scale
    found = linprog(seen.sum(axis=0), A_ub=seen, b_ub=np.zeros(len(seen)), bounds=(-1.0, 1.0))
    if found.x is None or -found.fun <= _SURE:
        return None
    d = rest @ found.x
    return np.asarray(d / np.linalg.norm(d), float)
