"""The time series of a log: one entity a channel, one series a column, grouped by meaning."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from snakegen.base.sample_store import in_pieces
from snakegen.log import style
from snakegen.log.scene import last_finite
from snakegen.log.skeleton import angles_of, rotations_from_xyzw
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.recording.signals import tracking_error

Floats = NDArray[np.float64]

HIDDEN = (
    "configuration",
    "disturbance point",
    "attitude",
    "contact point",
    "contact force",
)  # groups that are no curves
LIMIT = "limit"
_COMMANDS = {
    "thrust_command": "thrust",
    "gimbal_command": "gimbals",
    "joint_command": "joints",
    "screw_rate_command": "screws",
}


class Series(NamedTuple):
    """One plotted channel."""

    group: str  # the plot it is drawn in
    name: str
    time: Floats  # (T,) s
    values: Floats  # (T, k)
    labels: tuple[str, ...]
    unit: str

    @property
    def path(self) -> str:
        """The entity that holds it."""
        return f"{folder(self.group)}/{self.name}"

    @property
    def asked(self) -> bool:
        """True where it is a command or target: drawn dimmer than what came of it."""
        return self.name.endswith(("_command", "_target"))


def folder(group: str) -> str:
    """Returns the entity under which a group's series stand."""
    return "plot/" + group.replace(" ", "_")


def series(recording: Recording) -> list[Series]:
    """Returns what is plotted; errors are computed here, a command joins what it commands."""
    out = []
    if {"position", "position_target"} <= recording.channels.keys():
        time, error = recording.times("position"), _kept(recording, "position")
        out.append(Series("position error", "error", time, error, ("x", "y", "z"), "m"))
    if {"attitude", "attitude_target"} <= recording.channels.keys():
        time, error = recording.times("attitude"), _kept(recording, "attitude")
        labels = ("roll", "pitch", "yaw")
        out.append(Series("attitude error", "error", time, error, labels, "rad"))
    out += _angles(recording)
    for name, c in recording.channels.items():
        group = _COMMANDS.get(name, c.group)
        if group not in HIDDEN and c.labels:
            out.append(Series(group, name, recording.times(name), c.values, c.labels, c.unit))
    return out + _limits(recording)


def groups(shown: list[Series]) -> dict[str, str]:
    """Returns the unit of every plot, by group."""
    out: dict[str, str] = {}
    for s in shown:
        out.setdefault(s.group, s.unit)
        if out[s.group] != s.unit and s.unit not in out[s.group]:
            out[s.group] += f", {s.unit}"
    return out


def _angles(recording: Recording) -> list[Series]:
    """Returns attitudes as roll, pitch and yaw: nobody reads quaternions."""
    out = []
    for name in ("attitude", "attitude_target"):
        if name in recording.channels:
            angles = _attitude_angles(recording, name)
            labels = ("roll", "pitch", "yaw")
            out.append(Series("attitude", name, recording.times(name), angles, labels, "rad"))
    return out


def _kept(recording: Recording, name: str) -> Floats:
    """Returns the tracking error (T, 3); that of a long run lies on the disk."""
    error = tracking_error(recording, name)
    return in_pieces(len(error.time), lambda part: (error.rows(part),))[0]


def _attitude_angles(recording: Recording, name: str) -> Floats:
    """Returns roll, pitch, yaw (T, 3) of a channel of quaternions, turns unwrapped."""
    attitude = recording.channel(name).values
    ends: list[Floats] = []  # the last quaternion and the last angles so far

    def rows(part: slice) -> tuple[Floats]:
        values = attitude[part]
        joined = last_finite(np.concatenate([ends[0], values]) if ends else values)
        angles = angles_of(rotations_from_xyzw(joined))
        if ends:  # whole turns that came before
            angles += 2.0 * np.pi * np.round((ends[1] - angles[:1]) / (2.0 * np.pi))
        ends[:] = [joined[-1:], angles[-1:]]
        return (angles[1:] if len(joined) > len(values) else angles,)

    return in_pieces(len(attitude), rows)[0]


def _limits(recording: Recording) -> list[Series]:
    """Returns the largest thrust as a line, where the run states one for all rotors."""
    upper = recording.meta.get("limits", {}).get("thrust_max")
    if upper is None or "thrust" not in recording.channels or np.ptp(upper) > 0:
        return []
    ends = recording.times("thrust")[[0, -1]]
    line = np.full((2, 1), float(np.max(upper)))
    return [Series("thrust", LIMIT, ends, line, (LIMIT,), "N")]


def legend(s: Series, shown: list[Series]) -> list[str]:
    """Returns the names of a channel's curves; with the channel's where another has the same."""
    if s.asked:
        return [f"{label} asked" for label in s.labels]
    others = [t for t in shown if t.group == s.group and t.name != s.name and not t.asked]
    taken = {label for t in others for label in t.labels}
    own = s.name.replace("_", " ")
    return [f"{own} {label}" if label in taken else label for label in s.labels]


def log_plots(rec: Any, shown: list[Series], release: Callable[[], None]) -> None:
    """Writes the time series into the rerun recording `rec`.

    `release` gives back the memory of what was read.
    """
    import rerun as rr

    drawn: dict[str, int] = {}
    stride = style.stride_for(sum(s.values.size for s in shown))
    for s in shown:
        thin = stride if len(s.values) > style.SCREEN else 1
        index, values = style.standing_out(s.values, thin, release)
        width = values.shape[1]
        names = legend(s, shown)
        # A command has the colours of what it commands; other channels go on where one ended.
        first = 0 if s.asked else drawn.get(s.group, 0)
        drawn[s.group] = first + (0 if s.asked else width)
        colors = [style.color(first + i, dim=s.asked) for i in range(width)]
        if s.name == LIMIT:
            colors = [style.LIMIT] * width
        look = rr.SeriesLines(
            colors=colors,
            names=names,
            widths=[1.0 if s.asked else 1.5] * width,
        )
        rec.log(s.path, look, static=True)
        rec.send_columns(
            s.path,
            [rr.TimeColumn(style.TIMELINE, duration=s.time[index])],
            rr.Scalars.columns(scalars=values.ravel()).partition(np.full(len(index), width)),
        )
        release()
