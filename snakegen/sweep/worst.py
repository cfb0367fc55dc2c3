"""The worst posture: local search from the worst rows of a sweep, each step certified."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError
from snakegen.sweep.batch import Body, evaluate
from snakegen.sweep.steepest import steps_down
from snakegen.sweep.store import row_groups

STARTS, POLISH = 8, 20
ROUNDING = 1e-6  # of the scale: a margin below it is 0


@dataclass(frozen=True)
class Worst:
    """The posture with the least margin found, and its certified bounds.

    Attributes:
        column: the margin.
        joints, angles: the posture, rad.
        lower, upper: certified bounds, N, N·m, m or scaled as the margin is; nan out of reach.
        closed: whether they agree to the sweep's tolerance, or to 1e-6 of `scale`.
        sampled: the least value among the samples whose hover is in reach; nan where none is.
        feasible: whether hover is in reach of this mode in this posture.
        wrench: the mode's signed wrench margin there, scaled: below 0 by the part of hover that is
            out of reach.
        scale: what the margin is measured by: m g, m g times the link length, or 1.
        postures: evaluated by the search.
    """

    column: str
    joints: tuple[str, ...]
    angles: Floats
    lower: float
    upper: float
    closed: bool
    sampled: float
    feasible: bool
    wrench: float
    scale: float
    postures: int

    @property
    def zero(self) -> bool:
        """Whether the margin is 0: below 1e-6 of the scale."""
        return self.feasible and abs(self.upper) <= ROUNDING * self.scale


def refine(body: Body, table: pa.Table, column: str, rounds: int = 40) -> Worst:
    """Returns the local minimum of `column` reached from the worst rows of `table`.

    A pattern search: from each of the worst rows, random directions with a step that halves when
    nothing improves; all candidates of a round are evaluated in one batch. The best goes on down
    its margin's exact derivative, as long as certified margins fall. A posture whose hover is out
    of reach is worse than any margin, by how far it is out of reach. Where a margin did not
    close its upper bound counts: a lower bound that was not computed must not look like the
    worst posture. What it returns is a certified margin of a real posture, not a proof that no
    posture is worse.

    Raises:
        AnalysisError: no such column, or no finite value in it.
    """
    if column not in table.column_names or column in body.joints:
        known = [c for c in table.column_names if c not in body.joints]
        raise AnalysisError(f"no margin '{column}' in the sweep; there are {', '.join(known)}.")
    values = _score(body, table, column)
    if not np.isfinite(values).any():
        raise AnalysisError(f"'{column}' is finite at no posture of the sweep.")
    scale = _scale(body, column)
    low, high, _ = body.robot.limits(body.joints)
    order = np.argsort(values, kind="stable")[:STARTS]
    at = np.stack([np.asarray(table[n], float)[order] for n in body.joints], axis=1)
    best, step = values[order], np.full(len(order), 0.1)
    rng, count = np.random.default_rng(0), 0
    k = at.shape[1]
    for _ in range(rounds):
        moves = rng.normal(size=(len(at), 2 * k, k))
        moves /= np.linalg.norm(moves, axis=2, keepdims=True)
        tried = np.clip(at[:, None] + step[:, None, None] * moves * (high - low), low, high)
        found = evaluate(body, tried.reshape(-1, k))
        count += tried.shape[0] * tried.shape[1]
        score = _score(body, found, column).reshape(len(at), -1)
        pick = score.argmin(axis=1)
        rows = np.arange(len(at))
        better = score[rows, pick] < best
        at[better] = tried[rows, pick][better]
        best = np.where(better, score[rows, pick], best)
        step = np.where(better, step, 0.5 * step)
        if np.all(step < 1e-5) or 0.0 <= best.min() <= ROUNDING * scale:
            break
    i = int(np.argmin(best))
    for _ in range(POLISH):
        lower_ones = steps_down(body, column, at[i])
        if lower_ones is None or 0.0 <= best[i] <= ROUNDING * scale:
            break
        score = _score(body, evaluate(body, lower_ones), column)
        score[score < 0.0] = np.inf  # hover out of reach, or not proved to be in it: not of a slope
        count, k = count + len(lower_ones), int(score.argmin())
        if not score[k] < best[i]:
            break
        at[i], best[i] = lower_ones[k], score[k]
    sure = evaluate(body, at[i : i + 1])
    lower = float(sure[column][0].as_py())
    upper = float(sure[f"{column}_upper"][0].as_py()) if _bracketed(sure, column) else lower
    return Worst(
        column,
        body.joints,
        at[i],
        lower,
        upper,
        upper - lower <= body.tolerance * abs(upper) + ROUNDING * scale,
        float(min(values[np.isfinite(np.asarray(table[column], float))], default=np.nan)),
        bool(np.isfinite(lower)),
        float(sure[_wrench(column)][0].as_py()),
        scale,
        count,
    )


def worst_rows(body: Body, path: Path, column: str) -> pa.Table:
    """Returns the rows of a sweep's file from which `refine` starts, found part by part."""
    names = tuple(dict.fromkeys((*body.joints, column, _wrench(column))))
    if f"{column}_upper" in pq.read_schema(path).names:
        names = (*names, f"{column}_upper")
    kept = None
    for table in row_groups(path, names):
        both = table if kept is None else pa.concat_tables([kept, table])
        order = np.argsort(_score(body, both, column), kind="stable")
        kept = both.take(order[:STARTS])
    if kept is None:
        raise AnalysisError(f"{path}: a sweep without rows.")
    return kept


def _bracketed(table: pa.Table, column: str) -> bool:
    return f"{column}_upper" in table.column_names


def _wrench(column: str) -> str:
    """Returns the signed wrench margin of the mode that a column belongs to."""
    return "dual_wrench_margin" if column.startswith("dual_") else "wrench_margin"


def _scale(body: Body, column: str) -> float:
    """Returns what a margin is measured by: m g [N], m g times the link length [N·m], or 1."""
    kind = column.removeprefix("dual_").removesuffix("_upper")
    robot = body.robot
    scales = {"force_margin": robot.force_scale, "torque_margin": robot.torque_scale}
    return scales.get(kind, 1.0)


def _score(body: Body, table: pa.Table, column: str) -> Floats:
    """Returns what to minimise: the certified value, the upper bound where it did not close.

    Negative where hover is out of reach: the signed wrench margin times the margin's scale.
    """
    values = np.asarray(table[column], float)
    scale = _scale(body, column)
    if _bracketed(table, column):
        upper = np.asarray(table[f"{column}_upper"], float)
        near = upper - values <= body.tolerance * upper + ROUNDING * scale
        values = np.where(near, values, upper)
    wrench = np.asarray(table[_wrench(column)], float)
    values = np.where(np.isnan(values) & (wrench < 0.0), scale * wrench, values)
    return np.where(np.isfinite(values), values, np.inf)
