"""The designs that are shown: certified over other postures, rebuilt through the templates."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.stats import binom

from snakegen.base.geometry import Floats
from snakegen.design_search.body_arrays import BodyArrays
from snakegen.design_search.evaluate import (
    Score,
    best_posture,
    by_posture,
    option,
    score,
)
from snakegen.design_search.grammar import MEASURES, sign
from snakegen.design_search.posture_margins import place_design
from snakegen.design_search.problem import Problem, Topology, read_topology, robot_source
from snakegen.design_search.search import Found
from snakegen.design_search.study import StudyError
from snakegen.pipeline.build import build
from snakegen.robot.robot import load
from snakegen.spec.loading import load_spec

SHOWN = 12  # designs of a front at most
ScoreAll = Callable[[Floats], list[Score]]
Each = Callable[[Callable[..., "Design"], list[tuple[Any, ...]]], list["Design"]]
AGREED = 1e-9  # between closed form and templates, relative
FRESH = 1000  # postures that try a claim
DOUBT = 1e-3  # chance that a true claim is called false


@dataclass(frozen=True, eq=False)
class Design:
    """A design that is shown.

    Attributes:
        label: "A", "B" … along the front; the study's robot is "given".
        x: its design vector; empty for the robot as given.
        chosen: values of the variables.
        spec: its spec as plain data, which builds.
        values: objectives and constraints, over the certifying postures.
        rebuilt: largest relative difference to the same figures of the URDF's arrays.
        tries: by objective over the range, how many of `FRESH` random postures are worse than the
            claim, and whether the claim stands.
        best: by figure that some posture reaches, that posture: rad by joint, and "heading".
        equivalence: largest difference of MuJoCo and Pinocchio, of the built design.
    """

    label: str
    x: tuple[float, ...]
    chosen: dict[str, Any]
    spec: dict[str, Any]
    values: dict[str, float]
    rebuilt: float
    tries: dict[str, tuple[int, bool]]
    best: dict[str, dict[str, float]]
    equivalence: float

    def to_json(self) -> dict[str, Any]:
        """Returns plain data: objectives by name, and the spec."""
        return self.values | {
            "label": self.label,
            "spec": self.spec,
            "variables": self.chosen,
            "rebuilt_relative_error": self.rebuilt,
            "fresh_postures": {
                name: {"worse": worse, "of": FRESH, "claim_stands": fine}
                for name, (worse, fine) in self.tries.items()
            },
            "best_postures_rad": self.best,
            "equivalence_error": self.equivalence,
        }


def shown_designs(problem: Problem, found: Found, score_all: ScoreAll, each: Each) -> list[Design]:
    """Returns the designs of a front, certified and rebuilt, by the first objective, best first.

    The designs next to the search's front are certified too: over other postures they may stand
    before it.

    Args:
        problem: the study.
        found: by the search.
        score_all: scores design vectors (m, d) over the certifying postures, or the first of them.
        each: calls a function of the problem and each task.

    Raises:
        StudyError: a rebuilt design differs from its closed form by more than 1e-9.
    """
    names = list(problem.study.objectives)
    found_rows = list(zip(found.front, score_all(np.array(found.front)), strict=False))
    fit = [(x, s) for x, s in found_rows if s.feasible] or found_rows
    best = [row for row in fit if not any(_dominates(other, row[1], names) for _, other in fit)]
    best.sort(key=lambda row: tuple(-sign(n) * row[1].values[n] for n in names))
    rows = np.array([[s.values[n] for n in names] for _, s in best])
    best = [best[i] for i in spread_out(rows, SHOWN)]
    return each(_design, [(x, s, chr(ord("A") + k)) for k, (x, s) in enumerate(best)])


def spread_out(rows: Floats, count: int) -> list[int]:
    """Returns which of the rows (m, k) to show: the best of each column, then the farthest apart.

    In the order of the rows; distances are shares of the columns' spans.
    """
    span = np.ptp(rows, axis=0)
    scaled = rows / np.where(span > 0.0, span, 1.0)
    kept = sorted({*np.argmax(rows, axis=0).tolist(), *np.argmin(rows, axis=0).tolist()})
    far = np.linalg.norm(scaled[:, None] - scaled[kept], axis=2).min(axis=1)
    while len(kept) < min(count, len(rows)):
        k = int(np.argmax(far))
        kept.append(k)
        far = np.minimum(far, np.linalg.norm(scaled - scaled[k], axis=1))
        far[kept] = -1.0
    return sorted(kept[:count])


def _dominates(a: Score, b: Score, names: list[str]) -> bool:
    gain = [sign(n) * (a.values[n] - b.values[n]) for n in names]
    return min(gain) >= 0.0 and max(gain) > 0.0


def _design(problem: Problem, x: tuple[float, ...], s: Score, label: str) -> Design:
    at = np.array(x)
    data, topology = problem.spec_data(at), problem.topology(at)
    robot = load(load_spec(data))
    resolved, price = problem.resolved(at)
    arrays = BodyArrays.of(robot)
    again = score(problem, arrays, topology.indices, topology.sets, resolved, price, final=True)
    error = max(
        abs(again.values[n] - v) / max(abs(v), 1e-9) for n, v in s.values.items() if np.isfinite(v)
    )
    if error > AGREED:
        raise StudyError(
            f"{problem.study.name}: design {label} rebuilt through the templates differs by "
            f"{error:.1e} from its closed form; {AGREED:g} is allowed."
        )
    tries = _tries(problem, arrays, topology, s.values)
    best = _best_postures(problem, arrays, topology)
    same = _equivalence(data)
    return Design(label, x, problem.chosen(at), data, s.values, error, tries, best, same)


def _equivalence(data: dict[str, Any]) -> float:
    """Builds a design in a folder that is removed again; returns the error of its check.

    Raises:
        GateError: URDF and MJCF disagree.
    """
    with TemporaryDirectory() as folder:
        made = build(load_spec(data), Path(folder) / "built", picture=False)
        return float(made.equivalence.worst)


def given_design(problem: Problem, folder: Path) -> Design | None:
    """Returns the study's robot as it is given; None where it violates a constraint."""
    study = problem.study
    topology = read_topology(study, robot_source(study, folder), study.fixed)
    arrays = topology.skeleton.arrays
    s = score(problem, arrays, topology.indices, topology.sets, topology.resolved, 0.0, final=True)
    if not s.feasible or "price" in s.values:
        return None
    tries = _tries(problem, arrays, topology, s.values)
    best, same = _best_postures(problem, arrays, topology), _equivalence(topology.data)
    return Design("given", (), {}, topology.data, s.values, 0.0, tries, best, same)


def _best_postures(
    problem: Problem, arrays: BodyArrays, topology: Topology
) -> dict[str, dict[str, float]]:
    """Returns the postures that prove reach and clearance."""
    out = {}
    for name in (*problem.study.objectives, *problem.study.constraints):
        measure = MEASURES.get(name)
        if measure is None or measure.how != "best":
            continue
        over: str = option(problem, name).over
        samples = topology.sets["certify" if over == "range" else over]
        found = best_posture(problem, measure, place_design(arrays, samples, topology.indices))
        if np.isfinite(found.value):
            angles = dict(zip(topology.skeleton.chain_joints, found.angles.tolist(), strict=True))
            out[name] = angles | {"heading": found.heading}
    return out


def _tries(
    problem: Problem, arrays: BodyArrays, topology: Topology, values: dict[str, float]
) -> dict[str, tuple[int, bool]]:
    """Tries each figure over the range on random postures that none was taken of."""
    out = {}
    fresh = _fresh(topology.sets["certify"], problem)
    placed = place_design(arrays, fresh, topology.indices)
    for name in problem.study.objectives:
        measure, ask = MEASURES.get(name), option(problem, name)
        if measure is None or measure.how == "best" or ask.over != "range":
            continue
        found = by_posture(measure, placed, 1e-3)
        worse = int((found < values[name] if measure.large else found > values[name]).sum())
        share = ask.quantile if measure.how == "quantile" else 1.0 / len(fresh)
        out[name] = worse, worse <= int(binom.ppf(1.0 - DOUBT, FRESH, share))
    return out


def _fresh(known: Floats, problem: Problem) -> Floats:
    """Returns random postures (FRESH, k) in the box of the known ones, as far from straight."""
    rng = np.random.default_rng(987_654_321)
    low, high = known.min(axis=0), known.max(axis=0)
    rows = rng.uniform(low, high, (20 * FRESH, len(low)))
    return rows[np.linalg.norm(rows, axis=1) >= problem.study.postures.away][:FRESH]
