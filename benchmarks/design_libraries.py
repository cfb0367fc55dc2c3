"""Which library searches designs best at equal cost: SciPy, pymoo, cma, plain sampling.

    python benchmarks/design_libraries.py [EVALUATIONS] [SEEDS]

The study `placement` (four ranges, two objectives, 128 postures). Each search gets the same number
of scored designs; judged by the hypervolume of its front over the robot as given (area that both
objectives gain at once, N²·m²) and by the best first objective. pymoo and cma are left out where
they are not installed (pip install 'snakegen[bench]').
"""

import sys
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np
from scipy.stats import qmc

from snakegen.design_search.evaluate import Score, evaluate
from snakegen.design_search.executor import Scorer
from snakegen.design_search.problem import Problem, prepare
from snakegen.design_search.search import nondominated, search
from snakegen.design_search.study import read_study
from snakegen.spec.loading import templates_folder

NAMES = ["torque_margin_quantile_Nm", "torque_margin_worst_Nm"]
Known = dict[tuple[float, ...], Score]


def problem_of(evaluations: int) -> Problem:
    """Returns the study, small."""
    study = read_study(templates_folder() / "studies" / "placement.yaml")
    return prepare(
        study.model_copy(
            update={
                "postures": study.postures.model_copy(update={"search": 128}),
                "search": study.search.model_copy(update={"evaluations": evaluations}),
            }
        ),
        templates_folder(),
    )


def by_scipy(problem: Problem, evaluations: int, seed: int) -> Known:
    """snakegen's own: differential evolution a trade, then ascent along derivatives."""
    scorer = Scorer(problem, None, None, lambda _: None)
    search(scorer, seed)
    return dict(list(scorer.known.items())[:evaluations])


def by_sampling(problem: Problem, evaluations: int, seed: int) -> Known:
    """Latin hypercube."""
    unit = qmc.LatinHypercube(len(problem.names), rng=seed).random(evaluations)
    rows = qmc.scale(unit, problem.low, problem.high)
    return {tuple(x): evaluate(problem, x) for x in rows}


def by_pymoo(problem: Problem, evaluations: int, seed: int) -> Known:
    """pymoo's NSGA-II, constraint as violation."""
    from pymoo.algorithms.moo.nsga2 import NSGA2
    from pymoo.core.problem import ElementwiseProblem
    from pymoo.optimize import minimize

    known: Known = {}

    class Task(ElementwiseProblem):
        def __init__(self) -> None:
            super().__init__(
                n_var=len(problem.names), n_obj=2, n_ieq_constr=1, xl=problem.low, xu=problem.high
            )

        def _evaluate(self, x: Any, out: dict[str, Any], *_: Any, **__: Any) -> None:
            score = known[tuple(x)] = evaluate(problem, x)
            values = [-score.values.get(n, 0.0) for n in NAMES]
            out["F"] = values if score.feasible else [0.0, 0.0]
            out["G"] = [sum(score.violated.values())]

    minimize(Task(), NSGA2(pop_size=40), ("n_eval", evaluations), seed=seed, verbose=False)
    return known


def by_cma(problem: Problem, evaluations: int, seed: int) -> Known:
    """CMA-ES on five Chebyshev trades of equal cost."""
    import cma

    known: Known = {}
    ranges = problem.high - problem.low
    for k, weight in enumerate((1.0, 0.0, 0.5, 0.25, 0.75)):
        good = [s for s in known.values() if s.feasible]
        ideal = [max((s.values[n] for s in good), default=5.0) for n in NAMES]

        def scalar(u: Any, w: float = weight, ideal: list[float] = ideal) -> float:
            x = problem.low + np.clip(u, 0.0, 1.0) * ranges
            score = known[tuple(x)] = evaluate(problem, x)
            if not score.feasible:
                return 100.0 + sum(score.violated.values())
            short = [a - score.values[n] for a, n in zip(ideal, NAMES, strict=True)]
            return max(w * short[0], (1.0 - w) * short[1]) + 0.02 * sum(short)

        options = {
            "bounds": [0, 1], "maxfevals": evaluations // 5, "seed": seed * 10 + k + 1,
            "verbose": -9,
        }  # fmt: skip
        cma.fmin2(scalar, np.full(len(ranges), 0.5), 0.3, options)
    return known


def judged(problem: Problem, known: Known, given: Score) -> tuple[float, float]:
    """Returns the hypervolume over the given design and the best first objective."""
    front = nondominated(known, NAMES)
    points = np.array([[known[x].values[n] - given.values[n] for n in NAMES] for x in front])
    area, seen = 0.0, 0.0
    for first, second in points:  # the first objective falls, the second rises
        if first > 0.0 and second > seen:
            area += first * (second - seen)
            seen = second
    return area, float(points[0, 0] + given.values[NAMES[0]])


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 600
    seeds = int(sys.argv[2]) if len(sys.argv) > 2 else 3
    task = problem_of(count)
    start = evaluate(task, np.full(4, 0.5))
    ways: dict[str, Callable[[Problem, int, int], Known]] = {
        "scipy": by_scipy,
        "sampling": by_sampling,
    }
    ways |= {"pymoo": by_pymoo} if find_spec("pymoo") else {}
    ways |= {"cma": by_cma} if find_spec("cma") else {}
    for name, way in ways.items():
        rows = [judged(task, way(task, count, seed), start) for seed in range(seeds)]
        areas, bests = np.array(rows).T
        print(
            f"{name:9} {count} designs, {seeds} seeds: hypervolume median {np.median(areas):.3f} "
            f"(least {areas.min():.3f}), best quantile median {np.median(bests):.3f} "
            f"(least {bests.min():.3f}) N·m",
            flush=True,
        )
