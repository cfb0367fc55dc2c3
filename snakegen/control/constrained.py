"""Allocation within limits on plain arrays: what reaches the exact margins (THEORY A4, A7).

A pseudo-inverse ignores limits and loses wrench once one thrust saturates. These give the same
least-norm answer while nothing is at a limit, any reachable wrench, and the nearest reachable one
(in the scaled norm) beyond.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.control.gains import Floats
from snakegen.errors import AnalysisError
from snakegen.kernels.allocation.ball_allocation import ball_allocation
from snakegen.kernels.dynamics.joint_loads import no_loads
from snakegen.robot.box_allocation import box_allocation


@dataclass(frozen=True, eq=False)
class Bounded:
    """An answer within limits.

    Attributes:
        thrust: (n,) N in dual-rotor mode; (Ñ, 3) N, forces, in vectored mode.
        given: the wrench it makes.
        shortfall: ‖S (wanted - given)‖, 0 (to about 1e-7) when the wrench is reachable.
        at_limit: which rotors or apparatuses are at a limit.
    """

    thrust: Floats
    given: Floats
    shortfall: float
    at_limit: Any


def bounded_thrusts(matrix: Any, wrench: Any, lower: Any, upper: Any, scale: Any = None) -> Bounded:
    """Returns thrusts inside [lower, upper] with ``matrix @ thrust = wrench``, or nearest to it.

    ``min Σ (thrust / upper)²`` subject to the wrench; beyond reach, ``min ‖S (wrench - Q x)‖``.

    Args:
        matrix: (m, n) allocation map, e.g. `allocation(...).dual` or its rows [f_z; τ].
        wrench: (m,) wanted.
        lower, upper: (n,) N, or one number for all.
        scale: (m,) S; 1 if not given.

    Raises:
        AnalysisError: shapes that do not fit, NaN, lower > upper, or an upper limit of 0.
    """
    q, w = _finite(matrix, "matrix", 2), _finite(wrench, "wrench", 1)
    rows = np.ones(w.size) if scale is None else _finite(scale, "scale", 1)
    if q.shape[0] != w.size or rows.size != w.size:
        raise AnalysisError(
            f"matrix {q.shape}, wrench ({w.size},) and scale ({rows.size},) do not fit together."
        )
    low = np.broadcast_to(_finite(lower, "lower"), q.shape[1]).copy()
    high = np.broadcast_to(_finite(upper, "upper"), q.shape[1]).copy()
    if np.any(low > high) or np.any(high <= 0):
        raise AnalysisError("thrust limits: lower ≤ upper and upper > 0 are needed for each rotor.")
    thrust = box_allocation(q, w, rows, high, low, high)
    given = q @ thrust
    edge = (thrust <= low) | (thrust >= high)
    return Bounded(thrust, given, float(np.linalg.norm(rows * (w - given))), edge)


def bounded_forces(points: Any, limits: Any, wrench: Any, scale: Any = None) -> Bounded:
    """Returns forces, ``‖f_j‖ ≤ limit_j`` at `points`, whose sum is `wrench`, or nearest to it.

    Args:
        points: (Ñ, 3) m, from the CoG.
        limits: (Ñ,) N.
        wrench: (6,) wanted.
        scale: (6,) S; 1 if not given.

    Raises:
        AnalysisError: shapes that do not fit, NaN, or a limit of 0 or less.
    """
    p, w = _finite(points, "points", 2), _finite(wrench, "wrench", 1)
    limit = np.broadcast_to(_finite(limits, "limits"), p.shape[0]).copy()
    rows = np.ones(6) if scale is None else _finite(scale, "scale", 1)
    if p.shape[1] != 3 or w.size != 6 or rows.size != 6 or np.any(limit <= 0):
        raise AnalysisError("points (Ñ, 3), wrench (6,), scale (6,) and limits > 0 are needed.")
    q = np.zeros((6, 3 * limit.size))
    for j, point in enumerate(p):
        q[:3, 3 * j : 3 * j + 3] = np.eye(3)
        q[3:, 3 * j : 3 * j + 3] = np.cross(point, np.eye(3)).T
    flat = ball_allocation(q, w, rows, limit, no_loads(q.shape[1]))
    given, forces = q @ flat, flat.reshape(-1, 3)
    edge = np.linalg.norm(forces, axis=1) >= limit * (1 - 1e-9)
    return Bounded(forces, given, float(np.linalg.norm(rows * (w - given))), edge)


def _finite(value: Any, name: str, ndim: int | None = None) -> Floats:
    out = np.array(value, dtype=float)
    if ndim is not None and out.ndim != ndim:
        raise AnalysisError(f"{name}: {ndim} dimensions are needed, {out.ndim} were given.")
    if not np.all(np.isfinite(out)):
        raise AnalysisError(f"{name} holds NaN or infinity.")
    return out
