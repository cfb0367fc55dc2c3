"""Derivatives of a design's margins by its free ranges, for the last steps of a search.

With the worst direction and the forces of each posture held (THEORY A9) a margin moves with the
design through thrust points, limits and load alone: ``dm = Σ f · (ω × dp) + Σ ‖v + ω × p‖ dL
- d · dw0``, whose dp, dL and dw0 by a variable are central differences of the closed-form arrays.
"""

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.design_search.evaluate import SEARCHED, Score, option
from snakegen.design_search.grammar import MEASURES, VIRTUAL, sign
from snakegen.design_search.posture_margins import Certified, PlacedDesign, certify, place_design
from snakegen.design_search.problem import Problem

STEP = 1e-5  # of a variable's range, in the central differences of arrays
BAND = 0.02  # share of postures round the quantile whose derivatives are averaged


def design_gradients(
    problem: Problem, x: Floats, placed: PlacedDesign, found: Certified, over: str
) -> Floats:
    """Returns (m, d) derivatives of one margin at each posture by the variables; 0 for choices.

    Rows of postures without exact forces are nan.
    """
    topology = problem.topology(x)
    samples = topology.sets[over]
    omega, speed = found.twists[:, None, 3:], found.twists[:, None, :3]
    pull = np.cross(found.forces, omega)
    drag = placed.arrays.shapes.drag[:, None]
    reach = np.linalg.norm(speed + np.cross(omega, placed.points) + drag * omega, axis=2)
    out = np.zeros((len(samples), len(x)))
    for k in np.flatnonzero(~problem.whole):
        h = STEP * (problem.high[k] - problem.low[k])
        ends = []
        for side in (1.0, -1.0):
            moved = x.copy()
            moved[k] += side * h
            ends.append(place_design(problem.arrays(moved), samples, topology.indices))
        a, b = ends
        rise = a.arrays.shapes.high - b.arrays.shapes.high
        out[:, k] = (pull * (a.points - b.points)).sum(axis=(1, 2)) + reach @ rise
        out[:, k] -= (found.twists * (a.hover - b.hover)).sum(axis=1)
        out[:, k] /= 2.0 * h
    out[found.solved == 0] = np.nan
    return out


def ascent_direction(
    problem: Problem, x: Floats, score: Score, names: list[str], weights: Floats
) -> Floats | None:
    """Returns a unit direction (d,), in shares of the ranges, that raises the heaviest margin.

    None where no margin without losses and joint limits is asked for, or none has exact forces.
    """
    margins = [(w, n) for w, n in zip(weights, names, strict=True) if w > 0.0 and n in MEASURES]
    if not margins:
        return None
    _, name = max(margins, key=lambda row: row[0])
    measure, over = MEASURES[name], option(problem, name).over
    if not measure.margin or measure.failed or measure.mode != VIRTUAL:
        return None
    kind, how = measure.quantity, measure.how
    topology = problem.topology(x)
    placed = place_design(problem.arrays(x), topology.sets[over], topology.indices)
    found = certify(placed, (kind,), SEARCHED)[kind]
    by = design_gradients(problem, x, placed, found, over)
    order = np.argsort(found.values)
    share = 0.0 if how == "worst" else option(problem, name).quantile
    first = int(np.ceil(share * len(order))) - 1 if share else 0
    width = max(1, int(BAND * len(order)))
    near = order[max(0, first - width // 2) : first + width // 2 + 1]
    rows = by[near][np.isfinite(by[near]).all(axis=1)]
    way = sign(name) * rows.mean(axis=0) * (problem.high - problem.low) if len(rows) else 0.0 * x
    at_edge = ((x <= problem.low) & (way < 0.0)) | ((x >= problem.high) & (way > 0.0))
    way = np.where(at_edge, 0.0, way)
    size = float(np.linalg.norm(way))
    return way / size if size > 0.0 else None
