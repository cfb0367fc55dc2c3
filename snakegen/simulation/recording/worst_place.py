"""Worst place of a check: the joint, gimbal, rotor or axis that decides it, and from when to when.

Worked out from a recording alone. A metric is read back as the signals from which it is computed,
one column a part; the part whose column decides the metric is named, with its worst instant and
the stretch of time over which it is beyond the bound (of a check that passes: within 10 % of its
worst).
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snakegen.base.geometry import Floats
from snakegen.simulation.drive.metrics import STARTED
from snakegen.simulation.recording.metric_traces import WHOLE_RUN, find_trace
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.recording.signals import PIECE
from snakegen.simulation.recording.verdict import Check, Place, Verdict, verdict

SETTLED = 10.0  # s, from which settled errors are measured
NEAR = 0.9  # share of the worst value that still counts as its stretch


def judged_verdict(
    recording: Recording,
    metrics: Mapping[str, Any],
    thresholds: Mapping[str, Mapping[str, Any] | None],
) -> Verdict:
    """Returns the verdict of `metrics`, each check with its worst place in `recording`.

    Args:
        recording: the run.
        metrics: its numbers.
        thresholds: as `verdict` takes them; None leaves a check out.

    Raises:
        MissionError: as `verdict`.
    """
    kept = {k: v for k, v in thresholds.items() if v is not None}
    found = verdict(metrics, kept, recording.recorded)

    def located(c: Check) -> Check:
        at = worst_place(recording, c.metric, c.value, c.bound, least=c.kind == "at_least")
        return replace(c, worst=at)

    return Verdict(tuple(located(c) for c in found.checks))


def worst_place(
    recording: Recording, metric: str, value: Any, bound: Any, *, least: bool = False
) -> Place | None:
    """Returns where `metric` is at its worst; None where no signal of the recording shows it.

    Args:
        recording: the run.
        metric: its name.
        value: its value, a number or one a column.
        bound: of the check; None, a number, or one a column.
        least: whether small values are the bad ones.
    """
    trace = find_trace(recording, metric)
    if trace is None or not trace.parts or not len(trace.time):
        return None
    start, end = recording.meta.get("metrics_window_s") or (trace.time[0], trace.time[-1])
    inside = (trace.time >= start) & (trace.time <= end)
    if "_settled_" in metric:
        inside &= trace.time > SETTLED
    if metric == "screw_torque_use":
        inside &= trace.time > STARTED
    if metric in WHOLE_RUN or not inside.any():
        inside = np.ones(len(trace.time), bool)
    time, none = trace.time[inside], np.inf if least else -np.inf

    def usable(j: int) -> Floats:
        values = np.array(trace.column(j)[inside])
        values[~np.isfinite(values)] = none
        recording.release()
        return values

    peaks, scores = [], []
    for j in range(len(trace.parts)):
        values = usable(j)
        peaks.append(float(values.min() if least else values.max()))
        scores.append(_mean_square(values) if trace.mean else peaks[-1])
        del values  # a long run's are large
    if not np.isfinite(peaks).any():
        return Place(trace.parts[0], float(time[0]), float(time[0]), float(time[-1]))
    if not least and not max(peaks) > 0.0:
        return None  # nothing of it happened
    j = _column(np.array(scores), value, bound, least)
    return _stretch(time, usable(j), trace.parts[j], bound, j, least, trace.mean)


def _mean_square(values: Floats) -> float:
    """Returns the mean square of what is finite, the rest counted as 0."""
    total = 0.0
    for first in range(0, len(values), PIECE):
        part = values[first : first + PIECE]
        total += float(np.sum(np.square(part[np.isfinite(part)])))
    return total / len(values)


def _column(scores: Floats, value: Any, bound: Any, least: bool) -> int:
    """Returns the column that decides the metric."""
    if isinstance(value, list | tuple) and len(value) == len(scores):
        sizes = np.array([np.inf if v is None else abs(v) for v in value], float)
        if isinstance(bound, list | tuple) and len(bound) == len(sizes):
            sizes = sizes / np.maximum(np.asarray(bound, float), 1e-300)
        return int(np.argmax(sizes))
    return int(np.argmin(scores) if least else np.argmax(scores))


def _stretch(
    time: Floats, signal: Floats, part: str, bound: Any, column: int, least: bool, mean: bool
) -> Place:
    """Returns the stretch about the worst instant of one signal."""
    worst = int(np.argmin(signal) if least else np.argmax(signal))
    peak = float(signal[worst])
    if isinstance(bound, list | tuple):
        bound = bound[column] if column < len(bound) else None
    fails = isinstance(bound, int | float) and not isinstance(bound, bool)
    fails = fails and (peak < bound if least else peak > bound)
    if fails and not (mean and bool(np.all((signal == 0.0) | (signal == 1.0)))):
        beyond = signal < bound if least else signal > bound
    elif least:
        beyond = signal <= peak + (1.0 - NEAR) * abs(peak)
    else:
        beyond = signal >= NEAR * peak
    first, last = _run(beyond, worst, longest=mean)
    if not first <= worst <= last:
        inside = signal[first : last + 1]
        worst = first + int(np.argmin(inside) if least else np.argmax(inside))
    return Place(part, float(time[worst]), float(time[first]), float(time[last]))


def _run(holds: NDArray[np.bool_], at: int, *, longest: bool) -> tuple[int, int]:
    """Returns first and last index of the run of True that has index `at`, or of the longest."""
    padded = np.concatenate([[False], holds, [False]])
    edges = np.flatnonzero(padded[1:] != padded[:-1])
    first, last = edges[::2], edges[1::2] - 1
    if not len(first):
        return at, at
    k = int(np.argmax(last - first) if longest else np.searchsorted(first, at, side="right") - 1)
    return int(first[k]), int(last[k])
