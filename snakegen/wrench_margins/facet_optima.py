"""Optima of dual-rotor margins: the facets of the thrusts' zonotope that are nearest to hover.

``dm`` needs no derivative of a null space: it is that of `gradients.Optimum`, d the facet's normal
and the thrusts those at the touching point (THEORY A9).
"""

from itertools import combinations
from math import comb

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from snakegen.errors import AnalysisError
from snakegen.wrench_margins.gradients import KINDS, TIE, UNIT, Optimum, feasible
from snakegen.wrench_margins.thrust import ThrustMargins

Floats = NDArray[np.float64]
FREE = 1e-9  # of the largest product with the normal: a rotor in the facet
FACETS = 5000  # enumerated for ties


def thrust_optima(
    m: ThrustMargins, kind: str, points: Floats, drag: Floats, ties: bool = True
) -> tuple[Optimum, ...]:
    """Returns the optima of a dual-rotor margin of one posture: the least first, then its ties.

    Empty where the margin is 0 because a direction is lost.

    Args:
        m: of one posture; the columns of its Q are ``[u; p × u + c u]``.
        kind: "wrench", "force", "torque" or "attitude_altitude".
        points: (n, 3) m, p of the rotors, from the CoG.
        drag: (n,) m, their c.
        ties: look for other facets at the same value too.

    Raises:
        AnalysisError: hover out of reach, or no such margin.
    """
    if kind not in KINDS:
        raise AnalysisError(f"there is no margin '{kind}'; there are {', '.join(KINDS)}.")
    if m.allocation.ndim == 3:
        raise AnalysisError("derivatives are of one posture: index the batch first.")
    value = float(getattr(m, kind))
    feasible(np.isfinite(value), kind)
    if value == 0.0:
        return ()
    normals = [m.normals[KINDS.index(kind)]]
    if ties and value > 0.0 and m.rank == 6 and comb(len(m.lower), 5) <= FACETS:
        normals += _tied_normals(m, kind, value)
    pieces: list[Optimum] = []
    for normal in normals:
        d = normal / np.sqrt((normal**2 * UNIT[kind]).sum())
        size = {"force": m.scale[0], "torque": m.scale[3]}.get(kind, 1.0)
        twist = d * size / m.scale
        if all(np.abs((twist - o.twist) * m.scale).max() > 1e-6 * size for o in pieces):
            pieces.append(_touching(m, kind, value, twist, points, drag))
    return tuple(pieces)


def _tied_normals(m: ThrustMargins, kind: str, value: float) -> list[Floats]:
    """Returns the scaled facet normals at which a margin of full rank is reached too."""
    a = m.allocation * (m.upper - m.lower) / m.scale[:, None]
    sub = np.array(list(combinations(range(a.shape[1]), 5)))
    u, s, _ = np.linalg.svd(a[:, sub].transpose(1, 0, 2))
    normal = u[:, :, 5][s[:, 4] > 1e-9 * s[:, 0]]
    if kind == "attitude_altitude":
        return []
    y = (m.hover_wrench - m.allocation @ (0.5 * (m.lower + m.upper))) / m.scale
    normal = np.vstack([normal, -normal])
    slack = 0.5 * np.abs(normal @ a).sum(axis=1) - normal @ y
    length = np.sqrt((normal**2 * UNIT[kind]).sum(axis=1))
    size = {"force": m.scale[0], "torque": m.scale[3]}.get(kind, 1.0)
    tied = slack * size <= value * (1.0 + TIE) * length
    return list(normal[tied & (length > 1e-9)])


def _touching(
    m: ThrustMargins, kind: str, value: float, twist: Floats, points: Floats, drag: Floats
) -> Optimum:
    """Returns the optimum of a facet: thrusts at limits, and in the facet what balances."""

    product = twist @ m.allocation
    size = np.abs(product * (m.upper - m.lower)).max(initial=0.0)
    free = np.abs(product * (m.upper - m.lower)) <= FREE * size
    thrust = np.where(product > 0.0, m.upper, m.lower)
    direction = UNIT[kind] * (twist * m.scale) * m.scale
    if kind in ("force", "torque"):
        direction = UNIT[kind] * twist
    if free.any():
        rest = m.hover_wrench + value * direction - m.allocation[:, ~free] @ thrust[~free]
        rows = np.flatnonzero(UNIT[kind]) if kind == "attitude_altitude" else np.arange(6)
        a = (m.allocation[:, free] / m.scale[:, None])[rows]
        b = (rest / m.scale)[rows]
        thrust[free] = np.linalg.lstsq(a, b, rcond=1e-12)[0]
        out = (thrust < m.lower - 1e-9 * m.upper.max()) | (thrust > m.upper + 1e-9 * m.upper.max())
        if (out & free).any():  # more rotors in the facet than it takes: any feasible share
            thrust[free] = lsq_linear(a, b, (m.lower[free], m.upper[free]), tol=1e-14).x
    q = m.allocation
    return Optimum(
        kind, value, twist, points, (thrust * q[:3]).T, drag,
        np.maximum(product, 0.0), np.minimum(product, 0.0), True, m.hover_wrench, m.scale,
    )  # fmt: skip
