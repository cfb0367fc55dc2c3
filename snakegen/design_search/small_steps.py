"""What a small step of each free range does to a design's figures."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.design_search.evaluate import Score
from snakegen.design_search.problem import Problem

STEP = 0.01  # of a variable's range


@dataclass(frozen=True)
class SmallStep:
    """A step of one variable.

    Attributes:
        variable: its field.
        step: by which it moves, in its unit; negative downward.
        changes: of each objective, over the certifying postures.
        broken: constraints that the step violates.
    """

    variable: str
    step: float
    changes: dict[str, float]
    broken: tuple[str, ...]

    def to_json(self) -> dict[str, object]:
        """Returns plain data for a program."""
        return {
            "variable": self.variable, "step": self.step, "changes": self.changes,
            "violates": list(self.broken),
        }  # fmt: skip


def small_steps(
    problem: Problem,
    x: tuple[float, ...],
    values: dict[str, float],
    score_all: Callable[[Floats], list[Score]],
) -> tuple[SmallStep, ...]:
    """Returns what 1 % of each range up and down does; a step ends at the range's end.

    Args:
        problem: the study.
        x: (d,) the design.
        values: its figures over the certifying postures.
        score_all: scores design vectors (m, d) over the certifying postures.
    """
    moves, rows = [], []
    for k in np.flatnonzero(~problem.whole):
        for side in (1.0, -1.0):
            row = np.array(x, float)
            wanted = row[k] + side * STEP * (problem.high[k] - problem.low[k])
            row[k] = np.clip(wanted, problem.low[k], problem.high[k])
            if abs(row[k] - x[k]) > 1e-12:
                moves.append((problem.names[k], float(row[k] - x[k])))
                rows.append(row)
    if not rows:
        return ()
    names = [n for n in problem.study.objectives if np.isfinite(values[n])]
    out = []
    for (variable, step), s in zip(moves, score_all(np.array(rows)), strict=True):
        changes = {
            n: s.values[n] - values[n] for n in names if np.isfinite(s.values.get(n, np.nan))
        }
        out.append(SmallStep(variable, step, changes, tuple(s.violated)))
    return tuple(out)
