"""What a pseudo-inverse allocator reaches before it saturates (THEORY A4, `controller`)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.margins import inputs

Floats = NDArray[np.float64]
SLICES = {"wrench": slice(0, 6), "force": slice(0, 3), "torque": slice(3, 6)}
LOST = 1e-9  # the allocator misses more than this share of a direction: it cannot hold it


@dataclass(frozen=True)
class ControllerMargins:
    """Largest disturbance that the allocator answers without saturation, in every direction.

    Attributes:
        wrench, force, torque: scaled, N, N·m; 0 where a direction is out of the map's range, nan
            where the allocator's own hover is beyond a limit.
        limiting: for each of them the rotor (apparatus) that saturates first, -1 where none does.
        hover: thrusts (n,), or forces (n, 3), that the allocator commands at hover, N.
    """

    wrench: float
    force: float
    torque: float
    limiting: tuple[int, int, int]
    hover: Floats


def ball_reach(start: ArrayLike, gain: ArrayLike, limit: float) -> float:
    """Returns the largest r with ``‖f0 + K d‖ ≤ L`` for all ‖d‖ ≤ r.

    The farthest d solves ``(μ - KᵀK) d = Kᵀ f0`` with μ ≥ σ₁²; ‖f0 + K d‖ falls as μ grows, so
    the μ at which it equals L is bracketed and bisected (with the hard case, f0 without a part
    along the first singular vector, apart).

    Args:
        start: f0, (k,), N.
        gain: K, (k, l): N per unit of d.
        limit: L, N.

    Returns:
        r; inf where K = 0, nan where ‖f0‖ > L.
    """
    f0, k = np.atleast_1d(np.asarray(start, float)), np.atleast_2d(np.asarray(gain, float))
    if np.linalg.norm(f0) > limit:
        return float("nan")
    u, sigma, _ = np.linalg.svd(k, full_matrices=False)
    if sigma[0] <= 1e-14:
        return float("inf")
    part, square = u.T @ f0, sigma**2
    outside = max(f0 @ f0 - part @ part, 0.0)
    top = square >= square[0] * (1.0 - 1e-12)

    def size(mu: float) -> float:
        return outside + float(np.sum((part * mu / (mu - square)) ** 2))

    rest = part[~top] * square[0] / (square[0] - square[~top])
    known = outside + float(rest @ rest)
    if np.linalg.norm(part[top]) <= 1e-13 * limit and known <= limit**2:
        along = (limit**2 - known) / square[0]
        other = sigma[~top] * part[~top] / (square[0] - square[~top])
        return float(np.sqrt(other @ other + along))
    low, high = 0.0, 1.0  # of μ - σ₁², in units of σ₁²
    while size(square[0] * (1.0 + high)) > limit**2 and high < 1e18:
        low, high = high, 4.0 * high
    for _ in range(200):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        if size(square[0] * (1.0 + middle)) > limit**2:
            low = middle
        else:
            high = middle
    d = sigma * part / (square[0] * (1.0 + high) - square)
    return float(np.linalg.norm(d))


def _collect(reach: Floats, ranges: Floats, scale: Floats, hover: Floats) -> ControllerMargins:
    """Takes the least of `reach` (3, n) per slice; 0 where `ranges` (3,) shows a lost direction."""
    values, limiting = [], []
    for k, unit in enumerate((1.0, scale[0], scale[3])):
        if np.isnan(reach[k]).any():
            values.append(float("nan"))
            limiting.append(int(np.argmax(np.isnan(reach[k]))))
        elif ranges[k] > LOST:
            values.append(0.0)
            limiting.append(-1)
        else:
            values.append(float(reach[k].min() * unit))
            limiting.append(int(np.argmin(reach[k])))
    return ControllerMargins(
        values[0], values[1], values[2], (limiting[0], limiting[1], limiting[2]), hover
    )


def _missed(scaled: Floats, inverse: Floats) -> Floats:
    """Returns (3,): how much of the unit directions of each slice the allocator fails to make."""
    miss = scaled @ inverse - np.eye(6)
    return np.array([np.linalg.norm(miss[:, part], 2) for part in SLICES.values()])


def thrust_controller(
    allocation: ArrayLike,
    lower: ArrayLike,
    upper: ArrayLike,
    hover_wrench: ArrayLike,
    *,
    force_scale: float,
    torque_scale: float,
    weights: ArrayLike | None = None,
) -> ControllerMargins:
    """Returns the margins of ``λ = D (Q D)^# w``, D = diag(weights) (ZN23 eq 22).

    Args:
        allocation: Q, (6, n).
        lower, upper: thrust limits, N, one number or (n,).
        hover_wrench: (6,), N and N·m.
        force_scale, torque_scale: F0, N, and T0, N·m.
        weights: D, (n,); by default the upper limits.

    Raises:
        AnalysisError: as `thrust_margins`.
    """
    q = inputs.array("Q", allocation, (6, None))
    low, high = inputs.limits(lower, upper, q.shape[1])
    hover, scale = inputs.hover(hover_wrench, None), inputs.scale(force_scale, torque_scale)
    d = high if weights is None else inputs.per_unit("weights", weights, q.shape[1])
    scaled = q / scale[:, None]
    inverse = d[:, None] * np.linalg.pinv(scaled * d, rcond=1e-6)
    thrust = inverse @ (hover / scale)
    room = np.minimum(high - thrust, thrust - low)
    room = np.where(room < -1e-12 * max(high.max(initial=0.0), 1e-300), np.nan, room.clip(0.0))
    gains = np.array([np.linalg.norm(inverse[:, part], axis=1) for part in SLICES.values()])
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(gains > 1e-14, room / gains, np.where(np.isnan(room), np.nan, np.inf))
    return _collect(reach, _missed(scaled, inverse), scale, thrust)


def vectored_controller(
    points: ArrayLike,
    limits: ArrayLike,
    hover_wrench: ArrayLike,
    *,
    force_scale: float,
    torque_scale: float,
    weights: ArrayLike | None = None,
    drag: ArrayLike = 0.0,
) -> ControllerMargins:
    """Returns the margins of ``F = D (Q_force D)^# w`` under ‖f_j‖ ≤ L_j (ZN23 eq 36).

    Args:
        points: p, (n, 3), m from the CoG.
        limits: L, N, one number or (n,).
        hover_wrench: (6,), N and N·m.
        force_scale, torque_scale: F0, N, and T0, N·m.
        weights: D, one number an apparatus, (n,); by default 1, the paper's plain pseudo-inverse.
        drag: c, m, one number or (n,), as `vectored_margins`.

    Raises:
        AnalysisError: as `vectored_margins`.
    """
    p = inputs.array("points", points, (None, 3))
    limit = inputs.per_unit("limits", limits, len(p))
    hover, scale = inputs.hover(hover_wrench, None), inputs.scale(force_scale, torque_scale)
    shares = inputs.per_unit("weights", 1.0 if weights is None else weights, len(p))
    d = np.repeat(shares * (limit > 0.0), 3)
    scaled = inputs.force_map(p, inputs.drags(drag, len(p))) / scale[:, None]
    inverse = d[:, None] * np.linalg.pinv(scaled * d, rcond=1e-6)
    forces = (inverse @ (hover / scale)).reshape(-1, 3)
    blocks = inverse.reshape(-1, 3, 6)
    reach = np.array(
        [
            [
                ball_reach(f, k[:, part], bound)
                for f, k, bound in zip(forces, blocks, limit, strict=True)
            ]
            for part in SLICES.values()
        ]
    )
    return _collect(reach, _missed(scaled, inverse), scale, forces)
