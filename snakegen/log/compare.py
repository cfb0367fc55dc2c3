"""Metrics computed again from a log alone, and two runs side by side."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from snakegen.errors import LogError, SnakegenError
from snakegen.log.read import read
from snakegen.simulation.recording.metrics import metrics
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.recording.verdict import Verdict
from snakegen.simulation.recording.worst_place import judged_verdict


@dataclass(frozen=True)
class Inspection:
    """What a log says, and what its samples say."""

    recording: Recording
    metrics: dict[str, Any]  # computed from the samples in the log
    verdict: Verdict | None  # of these metrics, by the thresholds in the log
    differing: tuple[str, ...]  # metrics that the log states otherwise: none in an honest log


@dataclass(frozen=True)
class Row:
    """One metric of two runs."""

    metric: str
    a: Any
    b: Any
    difference: Any  # b − a where both are numbers, else None


@dataclass(frozen=True)
class Head:
    """Which run a column of a comparison is, and how it ended; None: the log does not say."""

    file: str
    robot: Any
    mission: Any
    seed: Any
    mode: Any
    gains: Any
    allocator: Any
    ideal: Any  # whether sensors and rotors are perfect
    options: Any  # of the mission, as given
    verdict: str | None


@dataclass(frozen=True)
class Comparison:
    """Two runs side by side."""

    a: Head
    b: Head
    rows: tuple[Row, ...]

    @property
    def differing(self) -> tuple[str, ...]:
        """Which of robot and mission differ: metrics of such runs say little side by side."""
        return tuple(k for k in ("robot", "mission") if getattr(self.a, k) != getattr(self.b, k))


def inspect(path: str | Path) -> Inspection:
    """Reads a log and works its metrics and verdict out again from its samples.

    Raises:
        LogError: as `read`.
    """
    recording = read(path)
    try:
        return _inspection(recording)
    # a header from elsewhere may name channels and limits that do not fit one another
    except (
        KeyError, IndexError, TypeError, ValueError, AttributeError, ArithmeticError, SnakegenError,
    ) as error:  # fmt: skip
        reason = " ".join(str(error).split())[:200]
        raise LogError(
            f"{path}: its channels give no metrics ({type(error).__name__}: {reason})"
        ) from None


_ROUND_OFF = 1e-9  # relative: a flight works its metrics out piece by piece, in another order


def _same(stated: Any, again: Any) -> bool:
    """Tells whether two values of a metric are equal to round-off."""
    if isinstance(stated, bool | str) or isinstance(again, bool | str):
        return bool(stated == again)
    try:
        a, b = np.asarray(stated, float), np.asarray(again, float)
    except (TypeError, ValueError):
        return bool(stated == again)
    if a.shape != b.shape:
        return False
    size = float(np.max(np.abs(b), initial=0.0, where=np.isfinite(b)))
    return bool(np.allclose(a, b, rtol=_ROUND_OFF, atol=_ROUND_OFF * size, equal_nan=True))


def _inspection(recording: Recording) -> Inspection:
    again = metrics(recording)
    stated = recording.metrics
    # A loop may state more than the samples can show (a ratio to a prediction): these stay.
    differing = tuple(k for k in again if k in stated and not _same(stated[k], again[k]))
    merged = {**stated, **again}
    judged = recording.verdict
    again_judged = (
        None if judged is None else judged_verdict(recording, merged, judged.thresholds())
    )
    return Inspection(recording, merged, again_judged, differing)


def compare(path_a: str | Path, path_b: str | Path) -> tuple[Row, ...]:
    """Returns the metrics of two logs side by side, computed from their samples.

    Raises:
        LogError: as `read`.
    """
    return comparison(path_a, path_b).rows


def comparison(path_a: str | Path, path_b: str | Path) -> Comparison:
    """Returns what `compare` does, with which runs they are.

    Raises:
        LogError: as `read`.
    """
    left, right = inspect(path_a), inspect(path_b)
    a, b = left.metrics, right.metrics
    names = [*a, *(name for name in b if name not in a)]
    rows = tuple(Row(n, a.get(n), b.get(n), _difference(a.get(n), b.get(n))) for n in names)
    return Comparison(_head(path_a, left), _head(path_b, right), rows)


def _head(path: str | Path, found: Inspection) -> Head:
    meta = found.recording.meta
    options = ", ".join(f"{k}={v}" for k, v in (meta.get("options") or {}).items())
    return Head(
        file=str(path),
        robot=meta.get("robot"),
        mission=meta.get("mission"),
        seed=meta.get("seed"),
        mode=meta.get("mode"),
        gains=meta.get("gains"),
        allocator=meta.get("allocator"),
        ideal=meta.get("ideal"),
        options=options or None,
        verdict=_brief(found.verdict),
    )


def _brief(judged: Verdict | None) -> str | None:
    """Returns a verdict as short as a column: the metrics below say which checks failed."""
    if judged is None:
        return None
    if judged.passed:
        return judged.summary()
    return f"failed {len(judged.failed)} of {len(judged.checks)} checks"


def _difference(a: Any, b: Any) -> Any:
    if isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        return [_difference(x, y) for x, y in zip(a, b, strict=True)]
    numbers = all(isinstance(x, int | float) and not isinstance(x, bool) for x in (a, b))
    return b - a if numbers else None
