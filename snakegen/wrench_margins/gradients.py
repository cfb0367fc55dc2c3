"""Exact derivatives of margins by what a wrench set is made of: points, forces, limits, load.

A margin is a minimum over directions of support minus load. At the minimising twist d = (v, ω),
scaled so that its work on the margin's direction is 1, and with the forces f_j that reach it held
(envelope theorem, THEORY A9),

    dm = Σ f_j · (ω × dp_j) + Σ (v + ω × p_j + c_j ω) · df_j + Σ ω · f_j dc_j - d · dw0,

df_j from the turning of a held axis or from a thrust limit. Where two directions tie the margin
has a kink: then every optimum is one piece, and any of them a valid (Clarke) subgradient.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from snakegen.errors import AnalysisError
from snakegen.wrench_margins.saddle_point import ROUNDED, Saddle, force_jacobians, saddle_point
from snakegen.wrench_margins.set_optima import angles_of, set_saddle
from snakegen.wrench_margins.tie_search import other_starts
from snakegen.wrench_margins.vectored import set_margins
from snakegen.wrench_margins.vectored_result import VectoredMargins

Floats = NDArray[np.float64]
KINDS = ("wrench", "force", "torque", "attitude_altitude")
TIE = 1e-9  # relative: values this near are one value, and its directions pieces of a kink
FINE = 1e-6  # tolerance of the search, where the first one's twist leads astray
LOOSE = 1e-6  # share of an upper bound by which an optimum may pass the bounds
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


def vectored_optima(m: VectoredMargins, kind: str, others: bool = True) -> tuple[Optimum, ...]:
    """Returns the optima of a vectored margin of one posture: the least first, then its ties.

    Empty where the margin is 0 because a direction is lost: then 0 is a subgradient, the margin
    being 0 there and nowhere less. Without `others` sets that are not convex are searched from the
    known direction alone.

    Raises:
        AnalysisError: hover out of reach, no such margin, or an optimum that was not found.
    """
    if kind not in KINDS[:3]:
        raise AnalysisError(f"vectored margins are wrench, force and torque, not '{kind}'.")
    if m.sets.points.ndim == 3:
        raise AnalysisError("derivatives are of one posture: index the batch first.")
    at = KINDS.index(kind)
    within = m.bounds[0, 0] if m.hull else m.bounds[0, 1]
    feasible(bool(within >= 0.0) or (kind == "wrench" and not m.hull), kind)
    if m.bounds[at, 1] == 0.0:
        return ()
    scale, unit = m.scale, UNIT[kind]
    placed = m.sets.stacked(scale)[0][0]
    spans = m.sets.frames @ m.sets.spans
    problem = (placed, spans, m.sets.low / scale[0], m.sets.high / scale[0], m.hover_wrench / scale)
    starts = [m.twists[at]]
    if m.bounds[at, 1] > 0.0 and (others or not m.hull):
        starts += other_starts(m, kind, UNIT[kind], problem)
    size = (1.0, scale[0], scale[3])[at]
    limit = m.bounds[at, 1] / size
    if m.hull:
        least = m.bounds[at, 0] / size
        return _limited(m, kind, starts, (least, limit), size)

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


def _limited(
    m: VectoredMargins, kind: str, starts: list[Floats], bounds: tuple[float, float], size: float
) -> tuple[Optimum, ...]:
    """Returns the optima of a margin of sets that are not convex: the least first, then its ties.

    Those between the margin's bounds: what lies below is no margin, since the bound is certain.
    """
    fit: list[Saddle] = []
    for d in starts:
        s = set_saddle(m.sets, m.scale, m.hover_wrench / m.scale, UNIT[kind], d)
        loose = LOOSE * abs(bounds[1])
        if s.solved and bounds[0] - loose <= s.value <= bounds[1] + loose:
            fit.append(s)
    if not fit:
        raise AnalysisError(
            f"the {kind} margin's optimum was not found between its bounds, "
            f"{bounds[0] * size:.4g} … {bounds[1] * size:.4g}: limited gimbals or least thrusts "
            "cut into what is in reach there; a posture nearby, or mode dual_rotor, may have a "
            "derivative."
        )
    least = min(s.value for s in fit)
    pieces = _distinct(
        [s for s in sorted(fit, key=lambda s: s.value) if s.value <= least + TIE * abs(least)]
    )
    return tuple(_limited_optimum(m, kind, s, size) for s in pieces)


def _limited_optimum(m: VectoredMargins, kind: str, s: Saddle, size: float) -> Optimum:
    sets = m.sets
    thrust = angles_of(sets, s.forces * m.scale[0])[0]
    speed = force_jacobians(sets.stacked(m.scale)[0][0]) @ s.twist * size / m.scale[0]
    along = np.einsum("ja,ja->j", speed, s.forces * m.scale[0])
    along = np.divide(along, thrust, out=np.zeros_like(along), where=thrust != 0.0)
    near = 1e-9 * sets.strengths
    by_high = np.where(thrust >= sets.high - near, np.maximum(along, 0.0), 0.0)
    by_low = np.where(thrust <= sets.low + near, np.minimum(along, 0.0), 0.0)
    return Optimum(
        kind, s.value * size, s.twist * size / m.scale, sets.points, s.forces * m.scale[0],
        sets.drag, by_high, by_low, True, m.hover_wrench, m.scale,
    )  # fmt: skip


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


def _distinct(found: list[Saddle]) -> list[Saddle]:
    out: list[Saddle] = []
    for s in found:
        if all(np.abs(s.twist - o.twist).max() > 1e-6 for o in out):
            out.append(s)
    return out


def feasible(yes: bool, kind: str) -> None:
    if not yes:
        raise AnalysisError(
            f"the {kind} margin is undefined: hover is out of reach; the wrench margin's "
            "derivative shows what brings it nearer."
        )
