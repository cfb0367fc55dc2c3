"""The search for a front: differential evolution a trade, then ascent along exact derivatives.

Each trade between the objectives is one scalar (Chebyshev's, towards the best seen), which SciPy's
differential evolution makes small over ranges and choices alike; its best design then climbs along
the margin's derivatives. All designs that were scored take part in the front.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import differential_evolution
from scipy.stats import qmc

from snakegen.base.geometry import Floats
from snakegen.design_search.ascent import ascent_direction
from snakegen.design_search.evaluate import Score
from snakegen.design_search.executor import OutOfTimeError, Scorer
from snakegen.design_search.grammar import sign
from snakegen.design_search.study import StudyError

INFEASIBLE = 1e3  # added to the scalar of a design that violates a constraint
PLAIN_SUM = 0.02  # of the objectives, so that ties are settled by the others
POPULATION = 6  # designs a variable
KEPT = 40  # designs for the certifying postures, or a front if it has more
POLLED = 0.35  # of a trade's designs, for its last steps
FIRST_STEP, LAST_STEP = 0.08, 1e-3  # of the ranges


@dataclass(frozen=True)
class Found:
    """What a search found.

    Attributes:
        front: design vectors that no other dominates, by the first objective, best first; then
            those that only these dominate, and so on, up to `KEPT`.
        scored: how many designs were scored.
        complete: whether the search ended by itself, not at the deadline.
    """

    front: tuple[tuple[float, ...], ...]
    scored: int
    complete: bool


def search(scorer: Scorer, seed: int) -> Found:
    """Searches a study; the same seed gives the same front on one machine.

    Raises:
        StudyError: no design meets the constraints; names the two that exclude each other, or the
            nearest design.
    """
    problem = scorer.problem
    names, ask = list(problem.study.objectives), problem.study.search
    complete = True
    try:
        runs = _trades(len(names), ask.weights)
        for k, weights in enumerate(runs):
            _one_trade(scorer, names, weights, k, seed, ask.evaluations // len(runs))
    except OutOfTimeError:
        complete = False
    left, front = dict(scorer.known), list[tuple[float, ...]]()
    while len(front) < KEPT:
        layer = nondominated(left, names)
        if not layer:
            break
        front += layer
        for x in layer:
            del left[x]
    if not front:
        raise StudyError(_why_empty(scorer))
    return Found(tuple(front), len(scorer.known), complete)


def _trades(objectives: int, count: int) -> list[Floats]:
    """Returns the weights of each run: each objective alone, then mixtures spread evenly."""
    out = [np.eye(objectives)[k] for k in range(objectives)]
    if objectives > 1 and count > objectives:
        inner = qmc.Halton(objectives - 1, scramble=False).random(count - objectives + 1)[1:]
        for row in np.sort(inner, axis=1):
            out.append(np.diff(np.concatenate([[0.0], row, [1.0]])))
    return out


def _one_trade(
    scorer: Scorer, names: list[str], weights: Floats, run: int, seed: int, budget: int
) -> None:
    problem = scorer.problem
    rng = np.random.default_rng([seed, run])
    d = len(problem.names)
    size = max(12, POPULATION * d)
    scalar = _scalar(scorer, names, weights)

    def many(columns: Floats) -> Floats:
        rows = np.atleast_2d(columns.T)
        rows = np.where(problem.whole, np.round(rows), rows)
        return np.array([scalar(s) for s in scorer.many(rows)])

    start = qmc.scale(
        qmc.LatinHypercube(d, rng=rng).random(size),
        np.where(problem.whole, problem.low - 0.499, problem.low),
        np.where(problem.whole, problem.high + 0.499, problem.high),
    )
    start = np.where(problem.whole, np.round(start), start)
    known = sorted(scorer.known, key=lambda x: scalar(scorer.known[x]))[: size // 3]
    start[: len(known)] = np.array(known).reshape(-1, d)
    result = differential_evolution(
        many,
        [
            (a, b)
            for a, b in zip(problem.low, np.maximum(problem.high, problem.low + 1e-9), strict=True)
        ],
        integrality=problem.whole,
        init=np.clip(start, problem.low, problem.high),
        maxiter=max(1, int((1.0 - POLLED) * budget) // size - 2),
        tol=0.0,
        polish=False,
        updating="deferred",
        vectorized=True,
        rng=rng,
    )
    best = np.where(problem.whole, np.round(result.x), result.x)
    _climb(scorer, best, names, weights, scalar, int(POLLED * budget))


def _scalar(scorer: Scorer, names: list[str], weights: Floats) -> Callable[[Score], float]:
    """Returns the scalar of a score that a run makes small."""
    signs = np.array([sign(n) for n in names])
    rows = [[s.values[n] for n in names] for s in scorer.known.values() if s.feasible]
    seen = signs * np.array(rows).reshape(-1, len(names))
    ideal = seen.max(axis=0) if len(seen) else np.zeros(len(names))
    front = seen[[not (seen > row).all(axis=1).any() for row in seen]] if len(seen) else seen
    span = np.ptp(front, axis=0) if len(front) > 1 else np.ones(len(names))
    span = np.where(span > 1e-9, span, 1.0)

    def scalar(score: Score) -> float:
        if not score.feasible:
            return INFEASIBLE * (1.0 + sum(score.violated.values()))
        short = (ideal - signs * np.array([score.values[n] for n in names])) / span
        return float((weights * short).max() + PLAIN_SUM * short.sum())

    return scalar


def _climb(
    scorer: Scorer,
    x: Floats,
    names: list[str],
    weights: Floats,
    scalar: Callable[[Score], float],
    budget: int,
) -> None:
    """Steps along the derivatives of the trade's objective, else along single variables.

    A margin's worst postures change from step to step, so that a derivative may point along a
    ridge that is lost at once; polls of all variables find the way then, and halve the step where
    there is none.
    """
    problem = scorer.problem
    ranges = np.where(problem.whole, 0.0, problem.high - problem.low)
    axes = np.eye(len(x))[~problem.whole]
    step, now, asked = FIRST_STEP, scorer.many(x[None])[0], 0
    while asked < budget and step >= LAST_STEP and len(axes):
        way = ascent_direction(problem, x, now, names, weights) if now.feasible else None
        ways = [*([] if way is None else [way, 0.3 * way]), *axes, *-axes]
        trials = np.clip(x + step * ranges * np.array(ways), problem.low, problem.high)
        scores = scorer.many(trials)
        asked += len(trials)
        k = min(range(len(trials)), key=lambda i: scalar(scores[i]))
        if scalar(scores[k]) < scalar(now):
            x, now = trials[k], scores[k]
        else:
            step *= 0.5


def nondominated(
    known: dict[tuple[float, ...], Score], names: list[str]
) -> list[tuple[float, ...]]:
    """Returns the feasible designs that no other dominates, by the first objective."""
    signs = np.array([sign(n) for n in names])
    rows = [
        (x, signs * np.array([s.values[n] for n in names])) for x, s in known.items() if s.feasible
    ]
    rows.sort(key=lambda row: tuple(-row[1]))
    kept: list[tuple[tuple[float, ...], Floats]] = []
    for x, value in rows:
        if not any((other >= value).all() for _, other in kept):
            kept.append((x, value))
    return [x for x, _ in kept]


def _why_empty(scorer: Scorer) -> str:
    """Returns why no design is feasible: two constraints that conflict, or the nearest design."""
    name, scores = scorer.problem.study.name, list(scorer.known.values())
    if not scores:
        return f"{name}: the time was over before a design was scored; give it more minutes."
    asked = sorted({n for s in scores for n in s.violated})
    alone = [n for n in asked if any(n not in s.violated for s in scores)]
    for i, a in enumerate(alone):
        for b in alone[:i]:
            if all(a in s.violated or b in s.violated for s in scores):
                return (
                    f"{name}: of {len(scores)} designs none meets both '{b}' and '{a}', though "
                    "each alone is met."
                )
    x, best = min(scorer.known.items(), key=lambda row: sum(row[1].violated.values()))
    chosen = scorer.problem.chosen(np.array(x))
    missed = ", ".join(
        f"{n} {best.values[n]:.4g}" if n in best.values else n for n in best.violated
    )
    at = ", ".join(
        f"{k}={v:.4g}" if isinstance(v, float) else f"{k}={v}" for k, v in chosen.items()
    )
    return f"{name}: no design meets the constraints; the nearest ({at}) misses {missed}."
