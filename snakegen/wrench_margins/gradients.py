"""Exact derivatives of margins by what a wrench set is made of: points, forces, limits, load.

A margin is a minimum over directions of support minus load. At the minimising twist d = (v, ω),
scaled so that its work on the margin's direction is 1, and with the forces f_j that reach it held
(envelope theorem, THEORY A9),

    dm = Σ f_j · (ω × dp_j) + Σ (v + ω × p_j + c_j ω) · df_j + Σ ω · f_j dc_j - d · dw0,

df_j from the turning of a held axis or from a thrust limit. Where two directions tie the margin
has a kink: then every optimum is one piece, and any of them a valid (Clarke) subgradient.
"""

from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np
from numpy.typing import NDArray

from snakegen.errors import AnalysisError
from snakegen.kernels.margins.inner_radius import radius, work_space
from snakegen.wrench_margins.saddle_point import ROUNDED, Saddle, force_jacobians, saddle_point
from snakegen.wrench_margins.thrust import ThrustMargins
from snakegen.wrench_margins.vectored import STARTS, set_margins
from snakegen.wrench_margins.vectored_result import VectoredMargins
from snakegen.wrench_margins.wrench_search import fall, start_directions

Floats = NDArray[np.float64]
KINDS = ("wrench", "force", "torque", "attitude_altitude")
TIE = 1e-9  # relative: values this near are one value, and its directions pieces of a kink
FREE = 1e-9  # of the largest product with the normal: a rotor in the facet
FINE = 1e-6  # tolerance of the search, where the first one's twist leads astray
NEARLY = 1.02  # of the least support: a direction from which Newton's method may find a tie
APART = 0.2  # directions nearer than this lead to one optimum
SCATTERED = 24  # starts for other directions
FACETS = 5000  # enumerated for ties
UNIT = {
    "wrench": np.ones(6),
    "force": np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]),
    "torque": np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]),
    "attitude_altitude": np.array([0.0, 0.0, 1.0, 1.0, 1.0, 1.0]),
}


@dataclass(frozen=True)
class Optimum:
    """Where a margin is reached: one piece of it, smooth unless it ties with others.

    Attributes:
        kind: "wrench", "force", "torque" or "attitude_altitude".
        value: the exact margin: 1, N, N·m, 1.
        twist: (6,) d = (v, ω), unit of the margin per N and per N·m, CoG axes.
        points: (n, 3) m, where the n forces act, from the CoG.
        forces: (n, 3) N, which give ``w0 + value · direction``.
        drag: (n,) m.
        by_high, by_low: (n,) unit of the margin per newton of the upper and the lower limit.
        turning: whether the forces turn with what carries them (rotors, fixed axes).
        hover_wrench, scale: (6,) w0 and the scales F0, T0 (6,).
    """

    kind: str
    value: float
    twist: Floats
    points: Floats
    forces: Floats
    drag: Floats
    by_high: Floats
    by_low: Floats
    turning: bool
    hover_wrench: Floats
    scale: Floats

    @property
    def speeds(self) -> Floats:
        """(n, 3) v + ω × p_j + c_j ω: what a newton there adds to the margin."""
        v, w = self.twist[:3], self.twist[3:]
        return np.asarray(v + np.cross(w, self.points) + self.drag[:, None] * w)

    @property
    def by_points(self) -> Floats:
        """(n, 3) derivative by the points, per metre, the CoG held."""
        return np.asarray(np.cross(self.forces, self.twist[3:]))

    @property
    def by_turning(self) -> Floats:
        """(n, 3) derivative by rotation vectors of the forces about their points, per rad."""
        if not self.turning:
            return np.zeros_like(self.forces)
        return np.asarray(np.cross(self.forces, self.speeds))

    @property
    def by_drag(self) -> Floats:
        """(n,) derivative by the drag ratios c_j, per metre."""
        return np.asarray(self.forces @ self.twist[3:])

    @property
    def by_scale(self) -> tuple[float, float]:
        """Derivatives by F0 and T0, which measure the scaled margins alone, per N and N·m."""
        if self.kind in ("force", "torque"):
            return 0.0, 0.0
        square = (self.twist * UNIT[self.kind] * self.scale) ** 2
        parts = -self.value * square / self.scale
        return float(parts[:3].sum()), float(parts[3:].sum())


def vectored_optima(m: VectoredMargins, kind: str) -> tuple[Optimum, ...]:
    """Returns the optima of a vectored margin of one posture: the least first, then its ties.

    Empty where the margin is 0 because a direction is lost: then 0 is a subgradient, the margin
    being 0 there and nowhere less.

    Raises:
        AnalysisError: hover out of reach, no such margin, sets whose forces have no closed
            projection (limited gimbals, least thrusts), or an optimum that was not found.
    """
    if kind not in KINDS[:3]:
        raise AnalysisError(f"vectored margins are wrench, force and torque, not '{kind}'.")
    if m.sets.points.ndim == 3:
        raise AnalysisError("derivatives are of one posture: index the batch first.")
    if m.hull:
        raise AnalysisError(
            "derivatives of vectored margins need convex force sets: free gimbals, one tilt axis "
            "or fixed rotors without a least thrust; use mode dual_rotor for limited gimbals."
        )
    at = KINDS.index(kind)
    _feasible(bool(m.bounds[0, 1] >= 0.0) or kind == "wrench", kind)
    if m.bounds[at, 1] == 0.0:
        return ()
    scale, unit = m.scale, UNIT[kind]
    placed = m.sets.stacked(scale)[0][0]
    spans = m.sets.frames @ m.sets.spans
    problem = (placed, spans, m.sets.low / scale[0], m.sets.high / scale[0], m.hover_wrench / scale)
    starts = [m.twists[at]]
    if m.bounds[at, 1] > 0.0:
        starts += _other_starts(m, kind, problem)
    size = (1.0, scale[0], scale[3])[at]
    limit = m.bounds[at, 1] / size

    def near(d: Floats) -> list[Saddle]:
        for rounded in ROUNDED:
            s = saddle_point(*problem, unit, d, rounded)
            if s.solved and s.value <= limit + TIE * abs(limit):
                return [s]
        return []

    fit = [s for d in starts for s in near(d)]
    if not fit and m.tolerance > FINE:
        return vectored_optima(_finer(m), kind)
    if not fit:
        raise AnalysisError(f"the {kind} margin's optimum was not found: the set is too thin.")
    least = min(s.value for s in fit)
    pieces = _distinct(
        [s for s in sorted(fit, key=lambda s: s.value) if s.value <= least + TIE * abs(least)]
    )
    return tuple(_vectored(m, kind, s, size) for s in pieces)


def _finer(m: VectoredMargins) -> VectoredMargins:
    """Returns the margins from a search so fine that Newton's method cannot miss."""
    return set_margins(
        m.sets, m.hover_wrench, force_scale=m.scale[0], torque_scale=m.scale[3], tolerance=FINE,
        wrench_starts=0,
    )  # fmt: skip


def _vectored(m: VectoredMargins, kind: str, s: Saddle, size: float) -> Optimum:
    placed = m.sets.stacked(m.scale)[0][0]
    speed = force_jacobians(placed) @ s.twist
    forces, sets = s.forces, m.sets
    twist = s.twist * size / m.scale
    inside = np.einsum("jak,ja->jk", sets.frames @ sets.spans, speed) * size / m.scale[0]
    length = np.linalg.norm(inside, axis=1)
    line = (sets.spans**2).sum(axis=(1, 2)) < 1.5
    by_high = np.where(line, np.maximum(inside[:, 0], 0.0), length)
    by_low = np.where(line, np.minimum(inside[:, 0], 0.0), 0.0)
    turning = not bool(sets.balls.all())
    return Optimum(
        kind, s.value * size, twist, sets.points, forces * m.scale[0], sets.drag, by_high, by_low,
        turning, m.hover_wrench, m.scale,
    )  # fmt: skip


def _other_starts(m: VectoredMargins, kind: str, problem: tuple[Floats, ...]) -> list[Floats]:
    """Returns twists (6,) near every other direction that may tie with the known one.

    A certified search cannot close before it has asked for the support near each of them: those
    are the directions it asked for whose support is nearly the least. Of wrench margins and of
    balls the falls of `wrench_search` are taken, of other sets scattered twists.
    """
    twist, unit = m.twists[KINDS.index(kind)], UNIT[kind]
    if not m.sets.balls.all():
        scattered = np.random.default_rng(0).standard_normal((SCATTERED, 6))
        scattered /= np.sqrt((scattered**2 * unit).sum(axis=1, keepdims=True))
        return list(np.where(unit > 0.0, scattered, twist / np.sqrt(twist**2 @ unit)))
    placed, _, _, limit, hover = problem
    if kind == "wrench":
        return _falls(m, placed, limit, hover)
    work, torque = work_space(), kind == "torque"
    _, above, used = radius(torque, placed, limit, hover, np.eye(3), 1e-3, work, np.empty(6))
    order = [work[2], work[1]] if torque else [work[1], work[2]]
    twists = np.hstack([x[:used] for x in order])
    speed = np.einsum("jck,ik->ijc", force_jacobians(placed), twists)
    support = np.linalg.norm(speed, axis=2) @ limit - twists @ hover
    out: list[Floats] = []
    for i in np.argsort(support):
        if support[i] > above * NEARLY:
            break
        if all(np.abs((twists[i] - d) * unit).max() > APART for d in out):
            out.append(twists[i])
    return out


def _falls(m: VectoredMargins, p: Floats, limit: Floats, hover: Floats) -> list[Floats]:
    """Returns where falls of the wrench bound end, the deepest ones."""
    ends: list[tuple[float, Floats]] = []
    for start in start_directions(STARTS, m.twists):
        bounds, twists = np.full((3, 2), np.inf), np.empty((3, 6))
        fall(start, p, limit, hover, bounds, twists)
        if all(np.abs(twists[0] - d).max() > 0.1 * APART for _, d in ends):
            ends.append((float(bounds[0, 1]), twists[0]))
    least = min((value for value, _ in ends), default=0.0)
    return [d for value, d in ends if value <= least * NEARLY]


def _distinct(found: list[Saddle]) -> list[Saddle]:
    out: list[Saddle] = []
    for s in found:
        if all(np.abs(s.twist - o.twist).max() > 1e-6 for o in out):
            out.append(s)
    return out


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
    _feasible(np.isfinite(value), kind)
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
    from scipy.optimize import lsq_linear

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


def _feasible(yes: bool, kind: str) -> None:
    if not yes:
        raise AnalysisError(
            f"the {kind} margin is undefined: hover is out of reach; the wrench margin's "
            "derivative shows what brings it nearer."
        )
