"""The no-slip rows of a screw drive in NumPy: HA eqs 3-6 as THEORY part B reads them.

The readable twin of `kernels/screw/constraints.py`, which drives and searches.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def no_slip_rows(w: Floats, alpha: Floats, link: Ints, offset: Floats, lengths: Floats) -> Floats:
    """Returns the no-slip rows of A, (n, m + 2): ``row_i · ẇ = -r sin(α_i) θ̇_i``.

    With ψ the links' headings and d_i = α_i + ψ of unit i's link, row i is ``[cos d_i, sin d_i,
    Σ_{j≥k} ℓ_ij sin(d_i - ψ_j) for each link k]``: the turn of link k carries all links from k on.

    Args:
        w: (m + 2,) state ``[x_p, y_p, ψ_p, φ_1 …]``.
        alpha: (n,) rad, signed helix angles.
        link: (n,) the link of each unit, from 0.
        offset: (n,) m, of each unit along its link: ℓ_ij for j = link of i.
        lengths: (m,) m: ℓ_ij for j before it; 0 beyond.
    """
    psi, j = np.cumsum(w[2:]), np.arange(len(lengths))
    direction = alpha + psi[link]
    arm = np.where(j < link[:, None], lengths, np.where(j == link[:, None], offset[:, None], 0.0))
    levers = arm * np.sin(direction[:, None] - psi)
    turns = np.cumsum(levers[:, ::-1], axis=1)[:, ::-1]
    return np.column_stack([np.cos(direction), np.sin(direction), turns])


def unit_rows(
    shape: Floats, alpha: Floats, link: Ints, offset: Floats, lengths: Floats, scale: float
) -> Floats:
    """Returns the body-twist columns of A at ψ_p = 0, (n, 3), the lever divided by `scale`."""
    w = np.concatenate([np.zeros(3), shape])
    return no_slip_rows(w, alpha, link, offset, lengths)[:, :3] / np.array([1.0, 1.0, scale])
