"""Screw-drive algebra for n units: constraint matrices, tracking law, chains laid on a path.

HA eqs 1-7. State ``w = [x_p, y_p, ψ_p, φ_1 … φ_{n-1}]``, input
``u = [θ̇_1 … θ̇_n, φ̇_1 … φ̇_{n-1}]``; P is the head, the body extends from P along +ψ_p, φ_i turns
link i + 1 relative to link i.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.errors import AnalysisError
from snakegen.kernels.screw.constraints import follow
from snakegen.screw_drive.ground_paths import Path, path_pieces
from snakegen.screw_drive.kinematics import hara_chain
from snakegen.screw_drive.no_slip import no_slip_rows

Floats = NDArray[np.float64]


def _vector(name: str, value: ArrayLike, size: int | None = None) -> Floats:
    """Returns `value` as a finite float64 vector (of `size`), else raises with its name."""
    array = np.ascontiguousarray(value, dtype=np.float64)
    if array.ndim != 1 or (size is not None and array.size != size):
        wanted = f"({size},)" if size is not None else "(n,)"
        raise AnalysisError(f"{name} has shape {array.shape}, needs {wanted}.")
    if not np.isfinite(array).all():
        raise AnalysisError(f"{name} has an entry that is not finite: {array.tolist()}.")
    return array


def _checked(
    w: ArrayLike, alpha: ArrayLike, r: float, lengths: tuple[float, float, float]
) -> tuple[Floats, Floats]:
    """Returns w and α as vectors of matching size; raises AnalysisError on what cannot be."""
    angles = _vector("alpha", alpha)
    if angles.size < 2:
        raise AnalysisError(f"a screw drive needs at least 2 units; alpha has {angles.size}.")
    if not r > 0 or not np.isfinite([r, *lengths]).all() or min(lengths) < 0:
        raise AnalysisError(
            f"r must be positive and L0, L1, L2 not negative; got r = {r}, L = {lengths}."
        )
    return _vector("w", w, angles.size + 2), angles


def constraint_matrices(
    w: ArrayLike, alpha: ArrayLike, r: float, L0: float, L1: float, L2: float
) -> tuple[Floats, Floats]:
    """Returns A and B of ``A(w) ẇ = B u`` for n units (HA eqs 4-6, THEORY B).

    With ``ℓ_ij = [j=1] L0 + L1 + [j<i] L2`` and ``D_ij = ℓ_ij sin(α_i + ψ_i - ψ_j)``, j ≤ i,
    row i of A's upper block is ``[cos(α_i+ψ_i), sin(α_i+ψ_i), Σ_{j≥1} D_ij, Σ_{j≥2} D_ij, …]``;
    below it stands ``[0 | E_{n-1}]``; ``B = diag(-r sin α_1, …, -r sin α_n, 1, …, 1)``.

    Args:
        w: state (n + 2,) [m, m, rad, rad …].
        alpha: signed helix angles (n,) [rad].
        r: distance from the drum's centre to the ground [m].
        L0: from P to the tip of link 1 [m].
        L1: from each link's tip to its screw [m].
        L2: from the screw to the link's end [m].

    Returns:
        A (2n-1, n+2) and B (2n-1, 2n-1).

    Raises:
        AnalysisError: wrong shapes, values that are not finite, fewer than two units.
    """
    state, angles = _checked(w, alpha, r, (L0, L1, L2))
    n = angles.size
    A = np.zeros((2 * n - 1, n + 2))
    A[:n] = no_slip_rows(state, *hara_chain(tuple(angles), r, L0, L1, L2).arrays)
    A[n:, 3:] = np.eye(n - 1)
    return A, np.diag(np.concatenate([-r * np.sin(angles), np.ones(n - 1)]))


def _gain_times(gain: ArrayLike, error: Floats) -> Floats:
    """Returns K e for a scalar gain, a diagonal (n + 2,) or a matrix (n + 2, n + 2)."""
    K = np.asarray(gain, float)
    if not np.isfinite(K).all():
        raise AnalysisError("the gain has an entry that is not finite.")
    if K.ndim == 0 or K.shape == error.shape:
        return K * error
    if K.shape == (error.size, error.size):
        return K @ error
    raise AnalysisError(
        f"the gain has shape {K.shape}; needs a scalar, ({error.size},) or "
        f"({error.size}, {error.size})."
    )


def wheel_rates(
    w: ArrayLike,
    w_d: ArrayLike,
    w_d_dot: ArrayLike,
    gain: ArrayLike,
    alpha: ArrayLike,
    r: float,
    L0: float,
    L1: float,
    L2: float,
) -> Floats:
    """Returns the input ``u = B⁻¹ A(w) (ẇ_d - K (w - w_d))`` (HA eq 7), (2n - 1,) [rad/s].

    Args:
        w: state (n + 2,).
        w_d: desired state (n + 2,).
        w_d_dot: its rate (n + 2,).
        gain: K [1/s], a scalar, a diagonal (n + 2,) or a matrix (n + 2, n + 2).
        alpha, r, L0, L1, L2: as in `constraint_matrices`.

    Raises:
        AnalysisError: an α of 0 (B is singular: that screw drives nothing), or wrong shapes.
    """
    A, B = constraint_matrices(w, alpha, r, L0, L1, L2)
    drive = np.diag(B)
    flat = np.flatnonzero(np.abs(drive) < 1e-9 * r)
    if flat.size:
        raise AnalysisError(
            f"B is singular: unit {flat[0] + 1} has a helix angle of "
            f"{np.degrees(np.asarray(alpha, float)[flat[0]]):.4g}°, whose screw drives nothing."
        )
    size = A.shape[1]
    state, goal = _vector("w", w, size), _vector("w_d", w_d, size)
    wish = _vector("w_d_dot", w_d_dot, size) - _gain_times(gain, state - goal)
    return A @ wish / drive


def follow_the_leader(path: Path, s: float, links: ArrayLike) -> Floats:
    """Returns the state w_d (n + 2,) of a chain whose every joint lies on the path, P at s.

    Node i + 1 lies on the path behind node i at chord length ``links[i]``, the nearest such point.
    At rest on +x the body trails along -x, so ψ_p = -π there; ψ runs on with the path's heading.

    Args:
        path: list of ``("line", length)`` and ``("arc", angle, radius)`` from the origin along +x,
            left turns positive, extended straight at both ends [m, rad].
        s: arc length of P [m], may lie beyond either end.
        links: the chord lengths (n,) [m], head first.

    Raises:
        AnalysisError: a piece of the path or a chord length that cannot be.
    """
    chords = _vector("links", links)
    if chords.size < 1 or (chords <= 0).any():
        raise AnalysisError(f"links must be positive chord lengths; got {chords.tolist()}.")
    if not np.isfinite(s):
        raise AnalysisError(f"s must be finite; got {s}.")
    return follow(path_pieces(path), float(s), chords)[0]
