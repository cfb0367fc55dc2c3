"""Means, extremes and integrals over rows of a recording, some of which come in pieces."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snakegen.base.geometry import Floats
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.recording.signals import Signal


def inside(time: Floats, start: float, end: float) -> NDArray[np.bool_]:
    """Tells which times [s] lie from `start` to `end`."""
    return (time >= start) & (time <= end)


def cut(recording: Recording, name: str, start: float, end: float) -> Floats:
    """Returns the rows (n, k) of a channel from `start` to `end` [s]."""
    return recording.channel(name).values[inside(recording.times(name), start, end)]


def rows_where(signal: Signal, holds: Callable[[Floats], NDArray[np.bool_]]) -> NDArray[np.int64]:
    """Returns the indices of the rows of a signal for which `holds`."""
    found, first = [], 0
    for _, values in signal.pieces():
        found.append(first + np.flatnonzero(holds(values)))
        first += len(values)
    return np.concatenate(found) if found else np.empty(0, np.int64)


def held_integral(time: Floats, rows: NDArray[np.int64]) -> float:
    """Returns the seconds of some samples (indices), each counted until the next one."""
    last = rows == time.size - 1
    steps = time[np.minimum(rows + 1, time.size - 1)] - time[rows]
    steps[last] = time[-1] - time[-2] if time.size > 1 else 0.0
    return float(np.sum(steps))


class RunningMean:
    """The mean over rows that come in pieces."""

    def __init__(self) -> None:
        self.total: Any = 0.0
        self.count = 0

    def add(self, values: NDArray[Any]) -> None:
        """Adds rows (n, …)."""
        self.total = self.total + np.sum(values, axis=0)
        self.count += len(values)

    def value(self) -> Any:
        """Returns the mean; None without rows."""
        return self.total / self.count if self.count else None

    def root(self) -> Any:
        """Returns the root of the mean; None without rows."""
        return np.sqrt(self.total / self.count) if self.count else None


def peak(pieces: Iterable[tuple[Floats, Floats]], pick: Callable[..., Any]) -> float | None:
    """Returns the largest or smallest of all values; None where there is none."""
    return extreme(np.array([pick(values) for _, values in pieces if values.size]), pick)


def largest_mean(pieces: Iterable[tuple[Floats, Floats]]) -> float | None:
    """Returns the largest mean of a column; None where there is none."""
    mean = RunningMean()
    for _, values in pieces:
        mean.add(values)
    found = mean.value()
    return None if found is None else extreme(found, np.max)


def extreme(values: Floats, pick: Callable[[Floats], Any]) -> float | None:
    """Returns what `pick` (np.min, np.max) finds in values; None where there are none."""
    return float(pick(values)) if values.size else None
