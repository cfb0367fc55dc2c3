"""The worst posture: local search from the worst rows of a sweep, certified at the end."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from snakegen.errors import AnalysisError
from snakegen.geometry import Floats
from snakegen.sweep.batch import Body, evaluate
from snakegen.sweep.store import row_groups

STARTS = 8
_ROUNDS = 40


@dataclass(frozen=True)
class Worst:
    """The posture with the least margin found, and its certified bounds."""

    column: str
    joints: tuple[str, ...]
    angles: Floats
    lower: float
    upper: float
    closed: bool  # whether these bounds agree to the sweep's tolerance
    sampled: float  # the least value among the samples
    postures: int  # evaluated by the search


def refine(body: Body, table: pa.Table, column: str) -> Worst:
    """Returns the local minimum of `column` reached from the worst rows of `table`.

    A pattern search: from each of the worst rows, random directions with a step that halves when
    nothing improves; all candidates of a round are evaluated in one batch. Where a margin did not
    close its upper bound counts: a lower bound that was not worked out must not look like the
    worst posture. What it returns is a certified margin of a real posture, not a proof that no
    posture is worse.

    Raises:
        AnalysisError: no such column, or no finite value in it.
    """
    if column not in table.column_names or column in body.joints:
        known = [c for c in table.column_names if c not in body.joints]
        raise AnalysisError(f"no margin '{column}' in the sweep; there are {', '.join(known)}.")
    values = _score(table, column, body.tolerance)
    if not np.isfinite(values).any():
        raise AnalysisError(f"'{column}' is finite at no posture of the sweep.")
    low, high, _ = body.robot.limits(body.joints)
    order = np.argsort(values, kind="stable")[:STARTS]
    at = np.stack([np.asarray(table[n], float)[order] for n in body.joints], axis=1)
    best, step = values[order], np.full(len(order), 0.1)
    rng, count = np.random.default_rng(0), 0
    k = at.shape[1]
    for _ in range(_ROUNDS):
        moves = rng.normal(size=(len(at), 2 * k, k))
        moves /= np.linalg.norm(moves, axis=2, keepdims=True)
        tried = np.clip(at[:, None] + step[:, None, None] * moves * (high - low), low, high)
        found = evaluate(body, tried.reshape(-1, k))
        count += tried.shape[0] * tried.shape[1]
        score = _score(found, column, body.tolerance).reshape(len(at), -1)
        pick = score.argmin(axis=1)
        rows = np.arange(len(at))
        better = score[rows, pick] < best
        at[better] = tried[rows, pick][better]
        best = np.where(better, score[rows, pick], best)
        step = np.where(better, step, 0.5 * step)
        if np.all(step < 1e-5):
            break
    i = int(np.argmin(best))
    sure = evaluate(body, at[i : i + 1])
    lower = float(sure[column][0].as_py())
    upper = float(sure[f"{column}_upper"][0].as_py()) if _bracketed(sure, column) else lower
    return Worst(
        column,
        body.joints,
        at[i],
        lower,
        upper,
        upper - lower <= body.tolerance * upper,
        float(values.min()),
        count,
    )


def worst_rows(body: Body, path: Path, column: str) -> pa.Table:
    """Returns the rows of a sweep's file from which `refine` starts, found part by part."""
    names = (*body.joints, column)
    if f"{column}_upper" in pq.read_schema(path).names:
        names = (*names, f"{column}_upper")
    kept = None
    for table in row_groups(path, names):
        both = table if kept is None else pa.concat_tables([kept, table])
        order = np.argsort(_score(both, column, body.tolerance), kind="stable")
        kept = both.take(order[:STARTS])
    assert kept is not None  # a sweep has rows
    return kept


def _bracketed(table: pa.Table, column: str) -> bool:
    return f"{column}_upper" in table.column_names


def _score(table: pa.Table, column: str, tolerance: float) -> Floats:
    """Returns what to minimise: the certified value, the upper bound where it did not close."""
    values = np.asarray(table[column], float)
    if _bracketed(table, column):
        upper = np.asarray(table[f"{column}_upper"], float)
        values = np.where(upper - values <= tolerance * upper, values, upper)
    return np.where(np.isfinite(values), values, np.inf)
