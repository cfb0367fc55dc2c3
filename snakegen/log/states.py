"""State timeline of a log: mode flown, actuators at their limits, the floor, and the verdict.

A lane is one entity of `rerun.StateChange`; a state lasts until the next change of its lane.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from snakegen.log import style
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.recording.signals import (
    Signal,
    at_limit,
    gimbals_at_limit,
    held_limit,
    stored,
)

PAUSE = 0.1  # s, shorter gaps between two stretches at a limit are closed: an eye sees none
MOST = 2000  # changes of a lane
FULL = 0.99  # of a servo's torque that counts as its limit
_FREE = "free"


class Lane(NamedTuple):
    """States of one thing: each from its time [s] on."""

    name: str
    times: tuple[float, ...]
    states: tuple[str, ...]

    @property
    def path(self) -> str:
        """The entity that holds it."""
        return "state/" + self.name.replace(" ", "_")


def lanes(recording: Recording) -> list[Lane]:
    """Returns the lanes of a run; those of actuators that never reach a limit say so."""
    out = [_mode(recording)]
    for name, signal, labels in _limits(recording):
        out.append(_at_limits(recording, name, signal, labels))
    if "floor_contact" in recording.channels:
        touching = stored(recording, "floor_contact")

        def pressed(part: slice) -> NDArray[np.float64]:
            total = np.nansum(touching.rows(part), axis=1, keepdims=True)
            return np.asarray(total > 0.0, float)

        signal = touching._replace(rows=pressed)
        out.append(_at_limits(recording, "floor", signal, ("touched",), free="clear"))
    out += _checks(recording)
    return [lane for lane in out if lane.times]


def _mode(recording: Recording) -> Lane:
    """Returns what mode was flown when."""
    start = float(recording.time[0])
    changes = recording.meta.get("mode_changes") or []
    mode = str(recording.meta.get("mode", "")).replace("_", " ")
    listed = [(start, mode)] if mode else []
    listed += [(float(t), str(name).replace("_", " ")) for t, name in changes]
    stopped = recording.meta.get("stopped")
    if stopped:
        listed.append((float(recording.time[-1]), str(stopped)))
    return Lane("mode", tuple(t for t, _ in listed), tuple(s for _, s in listed))


def _limits(recording: Recording) -> list[tuple[str, Signal, tuple[str, ...]]]:
    """Returns the signals (T, k), 0 or 1, of what is at a limit, with the names of the columns."""
    out = []
    thrust, turned = at_limit(recording), gimbals_at_limit(recording)
    if thrust is not None:
        out.append(("rotor thrust", thrust, recording.channel("thrust").labels))
    if turned is not None:
        out.append(("gimbal angle", turned, recording.channel("gimbal_command").labels))
    for name in ("gimbal_torque", "joint_torque", "screw_torque"):
        if name not in recording.channels or not recording.channel(name).labels:
            continue
        labels = recording.channel(name).labels
        limit = held_limit(recording, name, len(labels))
        if limit is not None:
            out.append((name.replace("_", " "), _beyond(recording, name, limit), labels))
    return out


def _beyond(recording: Recording, name: str, limit: NDArray[np.float64]) -> Signal:
    """Returns whether each servo gives its limit, (T, k) 0 or 1."""
    given, most = stored(recording, name), np.where(limit > 0.0, limit, np.inf)
    rows: Callable[[slice], NDArray[np.float64]] = lambda part: np.asarray(  # noqa: E731
        np.abs(given.rows(part)) >= FULL * most, float
    )
    return given._replace(rows=rows)


def _at_limits(
    recording: Recording, name: str, signal: Signal, labels: tuple[str, ...], free: str = _FREE
) -> Lane:
    """Returns the lane of a signal of 0 and 1: the columns that are at their limit, by name."""
    changes: list[tuple[int, str]] = []
    row, before = 0, np.full(len(labels), -1.0)
    for _, values in signal.pieces():
        joined = np.vstack([before[None], values])
        for k in np.flatnonzero(np.any(joined[1:] != joined[:-1], axis=1)):
            full = [label for label, at in zip(labels, values[k], strict=True) if at > 0.0]
            changes.append((row + int(k), ", ".join(full) or free))
        row, before = row + len(values), values[-1]
    times = [float(signal.time[k]) for k, _ in changes]
    return _calmed(name, times, [state for _, state in changes], free)


def _calmed(name: str, times: list[float], states: list[str], free: str) -> Lane:
    """Returns a lane without free stretches shorter than a pause, longer where there are many."""
    pause = PAUSE
    while True:
        kept: list[tuple[float, str]] = []
        for k, (time, state) in enumerate(zip(times, states, strict=True)):
            short = k + 1 < len(times) and times[k + 1] - time < pause
            if state == free and short and kept:
                continue
            if not kept or kept[-1][1] != state:
                kept.append((time, state))
        if len(kept) <= MOST:
            return Lane(name, tuple(t for t, _ in kept), tuple(s for _, s in kept))
        if pause > 1e6:  # nothing is free: only every n-th change is shown
            kept = kept[:: -(-len(kept) // MOST)]
            return Lane(name, tuple(t for t, _ in kept), tuple(s for _, s in kept))
        pause *= 2.0


def _checks(recording: Recording) -> list[Lane]:
    """Returns the verdict from the end on, and where each failed check is beyond its bound."""
    judged = recording.verdict
    if judged is None:
        return []
    start, end = float(recording.time[0]), float(recording.time[-1])
    out = []
    for check in judged.failed:
        at = check.worst
        if at is None or at.from_s > at.to_s:
            continue
        marks = [(start, "ok")] if at.from_s > start else []
        marks.append((at.from_s, f"beyond its bound{f': {at.part}' if at.part else ''}"))
        marks += [(at.to_s, "ok")] if at.from_s < at.to_s < end else []
        out.append(Lane(check.metric, tuple(t for t, _ in marks), tuple(s for _, s in marks)))
    window = recording.meta.get("metrics_window_s") or [start, end]
    verdict = "passed" if judged.passed else "failed"
    times = (start, float(window[0]), float(window[1]))
    marks = list(zip(times, ("not judged", "judged", verdict), strict=True))
    kept = [m for k, m in enumerate(marks) if k == 2 or m[0] < marks[k + 1][0]]
    return [Lane("verdict", tuple(t for t, _ in kept), tuple(s for _, s in kept)), *out]


def log_states(rec: Any, shown: list[Lane]) -> None:
    """Writes the lanes into the rerun recording `rec`."""
    import rerun as rr

    calm = {_FREE, "clear", "ok", "passed", "judged"}
    for lane in shown:
        values = list(dict.fromkeys(lane.states))
        if lane.name != "mode":
            colors = [style.CALM if v in calm else style.LIMIT for v in values]
            colors = [
                style.BARE_LINK if v == "not judged" else c
                for v, c in zip(values, colors, strict=True)
            ]
            rec.log(lane.path, rr.StateConfiguration(values=values, colors=colors), static=True)
        rec.send_columns(
            lane.path,
            [rr.TimeColumn(style.TIMELINE, duration=list(lane.times))],
            rr.StateChange.columns(state=list(lane.states)),
        )
