"""What a study found, as a table, in words and as plain data."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from snakegen.design_search.bound import Bound
from snakegen.design_search.evaluate import Score
from snakegen.design_search.front import FRESH, Design
from snakegen.design_search.grammar import sign
from snakegen.design_search.problem import Problem
from snakegen.design_search.small_steps import SmallStep
from snakegen.design_search.study import Study

UNMOVED = 1e-6  # share of a figure below which a small step has not moved it
UNITS = {"Nm": "N·m", "N": "N", "kg": "kg", "m": "m", "W": "W", "min": "min"}


@dataclass(frozen=True, eq=False)
class StudyResult:
    """What a study found.

    Attributes:
        study: as read.
        seed: of the search.
        front: designs shown, by the first objective, best first.
        given: the robot as given, None where it violates a constraint.
        bound: how good the first objective can get, None if it was not asked for.
        scored: how many designs were scored.
        seconds: that the search took.
        complete: whether the search ended by itself.
        by_choice: of each variable that is a choice, by its value: the best first objective of
            the designs of the search that meet all constraints, None where none does.
        steps: what small steps of the chosen design's ranges do.
    """

    study: Study
    seed: int
    front: tuple[Design, ...]
    given: Design | None
    bound: Bound | None
    scored: int
    seconds: float
    complete: bool
    by_choice: dict[str, dict[str, float | None]]
    steps: tuple[SmallStep, ...] = ()

    @property
    def chosen(self) -> Design:
        """The design of the least loss in its worst objective, over the front's spans."""
        names = list(self.study.objectives)
        rows = np.array([[sign(n) * d.values[n] for n in names] for d in self.front])
        span = np.ptp(rows, axis=0)
        loss = (rows.max(axis=0) - rows) / np.where(span > 0.0, span, 1.0)
        return self.front[int(np.argmin(loss.max(axis=1) + 0.01 * loss.sum(axis=1)))]

    def to_json(self) -> dict[str, Any]:
        """Returns plain data for a program."""
        return {
            "study": self.study.name,
            "seed": self.seed,
            "front": [d.to_json() for d in self.front],
            "given": None if self.given is None else self.given.to_json(),
            "chosen": self.chosen.label,
            "bound": None if self.bound is None else self.bound.to_json(),
            "designs_scored": self.scored,
            "search_s": self.seconds,
            "complete": self.complete,
            "best_by_choice": self.by_choice,
            "sentence": self.sentence(),
            "trades": trades(self.study, self.front),
            "small_steps_of_chosen": [s.to_json() for s in self.steps],
        }

    def step_lines(self) -> list[str]:
        """Returns in words what small steps of the chosen design do."""
        out = []
        for s in self.steps:
            parts = [
                f"{words(n)} {'+' if v > 0 else '−'}{figure(n, abs(v))}"
                for n, v in s.changes.items()
                if abs(v) > UNMOVED * abs(self.chosen.values[n])
            ]
            broken = f" (violates {', '.join(s.broken)})" if s.broken else ""
            name = s.variable.removeprefix("vectoring_apparatus.").removeprefix("chain.")
            size = f"{'+' if s.step > 0 else '−'}{abs(s.step):.2g}"
            out.append(
                f"{self.chosen.label}, {name} {size}: {', '.join(parts) or 'no change'}{broken}"
            )
        return out

    def sentence(self) -> str:
        """Returns what a designer takes away."""
        name = next(iter(self.study.objectives))
        best = self.front[0]
        text = f"Best {words(name)}: {figure(name, best.values[name])} (design {best.label}: "
        text += f"{placed(best.chosen)})"
        if self.given is not None:
            given = self.given.values[name]
            text += f", against {figure(name, given)} of {self.study.robot} as given"
            if given > 0.0 and sign(name) > 0.0:
                text += f", {best.values[name] / given:.2f} times as much"
        text += "."
        for variable, rows in self.by_choice.items():
            fit = [f"{k} reaches {figure(name, v)}" for k, v in rows.items() if v is not None]
            none = [k for k, v in rows.items() if v is None]
            text += f" By {variable}: {', '.join(fit)}"
            text += (
                f"; no design of the search with {', '.join(none)} is feasible." if none else "."
            )
        if self.bound is not None:
            b = self.bound
            text += (
                f" Over the {self.study.postures.search} postures of the search "
                f"{figure(name, b.best)} was found and {figure(name, b.upper)} cannot be passed by "
                f"any design in these ranges: proved within {100.0 * b.gap:.1f} % of the best."
            )
        return text


def best_by_choice(
    problem: Problem, known: Mapping[tuple[float, ...], Score]
) -> dict[str, dict[str, float | None]]:
    """Returns, by variable and value of a choice, the best first objective that was found."""
    name = next(iter(problem.study.objectives))
    out: dict[str, dict[str, float | None]] = {}
    for i in np.flatnonzero(problem.whole):
        v = problem.study.variables[problem.names[i]]
        values = v.choices or [part.name for part in v.catalogue or []]
        rows = out[problem.names[i]] = dict[str, float | None]()
        for k, value in enumerate(values):
            fit = [s.values[name] for x, s in known.items() if round(x[i]) == k and s.feasible]
            rows[str(value)] = max(fit, key=lambda f: sign(name) * f) if fit else None
    return out


def words(name: str) -> str:
    """Returns an objective's name in words, without its unit."""
    head, _, unit = name.rpartition("_")
    text = head if unit in UNITS else name
    return text.replace("margin_failed", "margin after any one loss,").replace("_", " ")


def figure(name: str, value: float) -> str:
    """Returns a value with its unit."""
    unit = UNITS.get(name.rpartition("_")[2], "")
    return f"{value:.4g} {unit}".rstrip()


def placed(chosen: dict[str, Any]) -> str:
    """Returns the values of the variables, short."""
    parts = []
    for path, value in chosen.items():
        short = path.removeprefix("vectoring_apparatus.").removeprefix("chain.")
        parts.append(f"{short} {value:.3g}" if isinstance(value, float) else f"{short} {value}")
    return ", ".join(parts)


def table(result: StudyResult) -> list[list[str]]:
    """Returns the rows of the front's table, the head first."""
    names = list(result.study.objectives)
    more = [n for n in result.study.constraints if n not in names]
    variables = list(result.study.variables)
    rows = [["design", *names, *more, *variables, "fresh postures"]]
    shown: Sequence[Design] = [*result.front, *([result.given] if result.given else [])]
    for d in shown:
        tried = "; ".join(
            f"{worse} of {FRESH} worse{'' if fine else ': CLAIM FAILS'}"
            for worse, fine in d.tries.values()
        )
        values = [f"{d.values[n]:.4g}" for n in (*names, *more)]
        own = [d.chosen.get(v, "–") for v in variables]
        rows.append(
            [
                d.label,
                *values,
                *(f"{v:.3g}" if isinstance(v, float) else str(v) for v in own),
                tried,
            ]
        )
    return rows


def trades(study: Study, front: Sequence[Design]) -> list[str]:
    """Returns in words what each step along the front buys and costs."""
    names, out = list(study.objectives), []
    for a, b in pairwise(front):
        gains: list[str] = []
        costs: list[str] = []
        for n in names:
            step = b.values[n] - a.values[n]
            if abs(step) > 1e-9 * max(abs(a.values[n]), 1e-9):
                text = f"{words(n)} {'+' if step > 0 else '−'}{figure(n, abs(step))}"
                (gains if sign(n) * step > 0 else costs).append(text)
        moved = [
            f"{p.removeprefix('vectoring_apparatus.')} {_text(a.chosen[p])} → {_text(v)}"
            for p, v in b.chosen.items()
            if _text(a.chosen[p]) != _text(v)
        ]
        out.append(
            f"{a.label} → {b.label}: buys {' and '.join(gains) or 'nothing'} for "
            f"{' and '.join(costs) or 'nothing'} ({', '.join(moved)})"
        )
    return out


def _text(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)
