"""How good a design can get at best: an upper bound over the whole box, by branch and bound.

At one posture any twist d bounds the margin from above, ``m(x) ≤ Σ L_j ‖v + ω × p_j(x)‖ - d·w0``,
d scaled as the margin asks. Where thrust points move affinely with the design and mass stays, this
is convex in x, so that its largest value over a box is that of a corner: no Lipschitz constant is
estimated. A box's bound is the objective of the postures' least such bounds, over the worst twists
of its own centre and of its parents'. The posture set is fixed; so the bound is one of the
objective over that set. Constraints are left out, which can only raise it.
"""

import heapq
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.design_search.evaluate import SEARCHED, evaluate, option
from snakegen.design_search.grammar import MEASURES, VIRTUAL, Measure
from snakegen.design_search.posture_margins import PlacedDesign, certify, place_design
from snakegen.design_search.problem import Problem
from snakegen.design_search.study import StudyError

MOST = 4  # variables
AFFINE = 1e-9  # m, N: how far thrust points may be from moving straight


@dataclass(frozen=True)
class Bound:
    """A proof of how good the best design can be.

    Attributes:
        objective: of which.
        best: the largest value found of a design that meets the constraints, and
        design: (d,) where.
        upper: no design of the box has more.
        boxes: that were looked at.
        closed: whether the gap that was asked for was reached.
    """

    objective: str
    best: float
    design: tuple[float, ...]
    upper: float
    boxes: int
    closed: bool

    @property
    def gap(self) -> float:
        """(upper - best)/upper."""
        return (self.upper - self.best) / self.upper if self.upper > 0.0 else 0.0

    def to_json(self) -> dict[str, object]:
        """Returns plain data for a program."""
        return {
            "objective": self.objective, "best": self.best, "upper": self.upper,
            "relative_gap": self.gap, "boxes": self.boxes, "closed": self.closed,
            "design": list(self.design),
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Geometry:
    """Thrust points as affine functions of the design, at the posture set.

    Attributes:
        points: (m, n, 3) m at x = 0, and by (d, m, n, 3) a unit of each variable.
        hover: (m, 6).
        limit: (n,) N at x = 0, and strength: (d, n) by a unit of each.
        drag: (n,) m.
    """

    points: Floats
    by: Floats
    hover: Floats
    limit: Floats
    strength: Floats
    drag: Floats


def prove(
    problem: Problem,
    start: Floats,
    deadline: float,
    progress: Callable[[float, float], None],
) -> Bound:
    """Bounds the first objective over all designs from above.

    Args:
        problem: a study of at most four ranges, no choices.
        start: (d,) a good design, as the search found it.
        deadline: `time.monotonic` at which to stop with what is proved.
        progress: called with the best and the upper bound.

    Raises:
        StudyError: choices, more variables, an objective that is no margin without failures, or
            variables with which mass or thrust points do not move affinely.
    """
    study, measure = problem.study, provable(problem)
    name, kind, how = next(iter(study.objectives)), measure.quantity, measure.how
    ask = option(problem, name)
    topology = next(iter(problem.topologies.values()))
    samples = topology.sets[ask.over]

    def at(x: Floats) -> PlacedDesign:
        return place_design(problem.arrays(x), samples, topology.indices)

    def objective(margin: Floats) -> float:
        if how == "worst":
            return float(margin.min())
        return float(np.quantile(margin, ask.quantile, method="inverted_cdf"))

    geometry = _affine(problem, at)
    corners = np.array(list(product((-1.0, 1.0), repeat=len(problem.names))))

    def centre(x: Floats) -> tuple[float, Floats]:
        found = certify(at(x), (kind,), SEARCHED)[kind]
        return objective(found.values), found.twists

    def above(low: Floats, high: Floats, twists: list[Floats]) -> float:
        xs = 0.5 * (low + high) + 0.5 * corners * (high - low)
        least = np.min([_largest(geometry, xs, d) for d in twists], axis=0)
        return objective(least)

    best, twists = centre(start)
    design = start
    value, own = centre(0.5 * (problem.low + problem.high))
    if value > best and evaluate(problem, 0.5 * (problem.low + problem.high)).feasible:
        best, design = value, 0.5 * (problem.low + problem.high)
    family = [own, twists]
    first = above(problem.low, problem.high, family)
    heap = [(-first, 0, problem.low, problem.high, family)]
    boxes, gap = 1, study.search.gap
    while heap and time.monotonic() < deadline:
        upper = -heap[0][0]
        progress(best, upper)
        if upper - best <= gap * upper:
            break
        _, _, low, high, family = heapq.heappop(heap)
        k = int(np.argmax((high - low) / (problem.high - problem.low)))
        for side in (0, 1):
            a, b = low.copy(), high.copy()
            (b if side == 0 else a)[k] = 0.5 * (low[k] + high[k])
            value, own = centre(0.5 * (a + b))
            boxes += 1
            if value > best and evaluate(problem, 0.5 * (a + b)).feasible:
                best, design = value, 0.5 * (a + b)
            mine = [own, family[0]]
            bound = min(above(a, b, mine), upper)
            if bound > best * (1.0 + 1e-12):
                heapq.heappush(heap, (-bound, boxes, a, b, mine))
    upper = max(-heap[0][0] if heap else best, best)
    closed = upper - best <= gap * upper
    return Bound(name, best, tuple(float(v) for v in design), upper, boxes, closed)


def provable(problem: Problem) -> Measure:
    """Returns the first objective, of which a bound can be proved.

    Raises:
        StudyError: choices, more than four variables, or another objective.
    """
    study, name = problem.study, next(iter(problem.study.objectives))
    if problem.whole.any() or len(problem.names) > MOST:
        raise StudyError(f"{study.name}: a proof takes at most {MOST} ranges and no choices.")
    measure = MEASURES.get(name)
    if measure is None or not measure.margin or measure.mode != VIRTUAL or measure.failed:
        raise StudyError(
            f"{study.name}: '{name}' has no proof; force and torque margins without losses and "
            "joint limits have: leave out search.bound."
        )
    return measure


def _affine(problem: Problem, at: Callable[[Floats], PlacedDesign]) -> _Geometry:
    """Returns the affine geometry, after trying it at corners of the box."""
    low, high = problem.low, problem.high
    base, d = at(low), len(low)
    by, strength = np.empty((d, *base.points.shape)), np.empty((d, base.points.shape[1]))
    for k in range(d):
        x = low.copy()
        x[k] = high[k]
        end = at(x)
        by[k] = (end.points - base.points) / (high[k] - low[k])
        strength[k] = (end.arrays.shapes.high - base.arrays.shapes.high) / (high[k] - low[k])
    points = base.points - np.tensordot(low, by, axes=1)
    limit = base.arrays.shapes.high - low @ strength
    shapes = base.arrays.shapes
    for x in (high, 0.3 * low + 0.7 * high, np.where(np.arange(d) % 2, low, high)):
        other = at(x)
        off = np.abs(points + np.tensordot(x, by, axes=1) - other.points).max()
        off = max(off, float(np.abs(limit + x @ strength - other.arrays.shapes.high).max()))
        if off > AFFINE or abs(other.arrays.mass - base.arrays.mass) > AFFINE:
            raise StudyError(
                f"{problem.study.name}: a proof needs variables that move thrust points straight "
                "and leave the mass as it is: places, separations, offsets, lengths, limits."
            )
    if not shapes.balls.all():
        raise StudyError(f"{problem.study.name}: a proof needs gimbals without limits.")
    return _Geometry(points, by, base.hover, limit, strength, shapes.drag)


def _largest(g: _Geometry, xs: Floats, twists: Floats) -> Floats:
    """Returns (m,) the largest bound over corners xs (c, d) that each posture's twist gives."""
    v, omega = twists[:, None, :3], twists[:, None, 3:]
    speed = v + np.cross(omega, g.points) + g.drag[:, None] * omega
    by = np.cross(omega[None], g.by)
    at = speed + np.tensordot(xs, by, axes=1)
    reach = np.linalg.norm(at, axis=3)
    limits = g.limit + xs @ g.strength
    total = (reach * limits[:, None, :]).sum(axis=2).max(axis=0) - (twists * g.hover).sum(axis=1)
    return np.asarray(np.where(np.isfinite(total), total, np.inf))
