"""Signals behind each metric of a run, one column a part: what `worst_place` looks at."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.recording.servo_strength import joint_strength, screw_strength
from snakegen.simulation.recording.signals import (
    MAY_BE_UNDEFINED,
    Signal,
    at_limit,
    gimbals_at_limit,
    held_limit,
    is_finite,
    stored,
    tracking_error,
)

_AXES = ("x", "y", "z")
_TURNS = ("roll", "pitch", "yaw")


class Trace(NamedTuple):
    """Signals behind a metric, read a column at a time: k names, `mean` or peak of one decides."""

    time: Floats  # (T,) s
    column: Callable[[int], Floats]  # the (T,) values of a part
    parts: tuple[str, ...]
    mean: bool = False


def _columns(values: Floats) -> Callable[[int], Floats]:
    """Returns the reader of the columns of (T, k)."""
    return lambda j: values[:, j]


def _parts(signal: Signal, parts: tuple[str, ...], *, mean: bool, size: bool = False) -> Trace:
    """Returns a signal, or its magnitude, as a trace."""

    def column(j: int) -> Floats:
        found = [values[:, j] for _, values in signal.pieces()]
        return np.abs(np.concatenate(found)) if size else np.concatenate(found)

    return Trace(signal.time, column, parts, mean)


def find_trace(recording: Recording, metric: str) -> Trace | None:
    """Returns the signals behind a metric of any run, else those that its mission names."""
    for name, make in _TRACES.items():
        if metric == name:
            return make(recording)
    for ending, channel, share in _SERVOS:
        if metric == f"{channel}_{ending}":
            return _use(recording, channel, share=share)
    least = metric.removeprefix("min_").removesuffix("_m")
    if metric.startswith("min_") and least in recording.channels:
        return _plain(recording, least)
    return None


def _plain(recording: Recording, name: str, *, size: bool = False) -> Trace | None:
    if name not in recording.channels:
        return None
    c = recording.channel(name)
    parts = tuple("" if label == name else label for label in c.labels)
    return _parts(stored(recording, name), parts, mean=False, size=size)


def _use(recording: Recording, name: str, *, share: bool) -> Trace | None:
    """Returns |τ| over its limit, or whether it is at the limit, by servo."""
    if name not in recording.channels:
        return None
    c = recording.channel(name)
    limit = held_limit(recording, name, c.values.shape[1])
    if limit is None:
        return None
    most = np.where(limit > 0, limit, np.inf)

    def column(j: int) -> Floats:
        use = np.abs(c.values[:, j]) / most[j]
        return (use >= 0.99).astype(float) if share else use

    return Trace(recording.times(name), column, tuple(c.labels), mean=share)


def _error(which: str, *, mean: bool) -> Callable[[Recording], Trace | None]:
    """Returns the reader of |position| or |attitude| errors by axis."""

    def read(recording: Recording) -> Trace | None:
        if not {which, f"{which}_target"} <= recording.channels.keys():
            return None
        parts = _AXES if which == "position" else _TURNS
        return _parts(tracking_error(recording, which), parts, mean=mean, size=True)

    return read


def _saturation(recording: Recording) -> Trace | None:
    found = at_limit(recording)
    if found is None:
        return None
    name = "thrust_command" if "thrust_command" in recording.channels else "thrust"
    return _parts(found, tuple(recording.channel(name).labels), mean=True)


def _gimbal_limit(recording: Recording) -> Trace | None:
    found = gimbals_at_limit(recording)
    if found is None:
        return None
    return _parts(found, tuple(recording.channel("gimbal_command").labels), mean=True)


def _trim(recording: Recording) -> Trace | None:
    """Returns what each integral holds when trimming ends."""
    held = recording.meta.get("trim", {}).get("sigmas")
    if held is None:
        return None
    start = recording.meta.get("metrics_window_s", [0.0])[0]
    return Trace(np.array([start]), _columns(np.array([held], float)), _AXES + _TURNS)


def _hover(recording: Recording) -> Trace | None:
    """Returns what the law demands in addition to hover, over the second half of the run."""
    asked = recording.meta.get("hover_sigmas")
    if asked is None:
        return None
    time = recording.time[len(recording.time) // 2 :]
    return Trace(time, lambda j: np.full(len(time), float(asked[j])), _TURNS)


def _strength(
    name: str, read: Callable[[Recording], Floats | None]
) -> Callable[[Recording], Trace | None]:
    """Returns the reader of what each servo shows of its declared gain, over a whole run."""

    def trace(recording: Recording) -> Trace | None:
        share = read(recording)
        if share is None:
            return None
        parts = tuple(recording.channel(name).labels)
        return Trace(recording.time[:1], _columns(share[None]), parts)

    return trace


def _floor(recording: Recording) -> Trace | None:
    """Returns the floor's force, else how far the robot is below 0.1 mm."""
    if "floor_contact" in recording.channels:
        c = recording.channel("floor_contact")
        names = ("floor",) * c.values.shape[1]
        return Trace(recording.times("floor_contact"), _columns(c.values), names)
    return _plain(recording, "floor_distance")


def _finite(recording: Recording) -> Trace | None:
    """Returns the first channel that holds something that is no number, as 0 and 1."""
    for name, c in recording.channels.items():
        if name not in MAY_BE_UNDEFINED and not is_finite(recording, name):
            parts = tuple(p if p == name else f"{name} {p}" for p in c.labels)
            return Trace(recording.times(name), _undefined(c.values), parts)
    return None


def _undefined(values: Floats) -> Callable[[int], Floats]:
    """Returns the reader of where a column is no number, as 0 and 1."""
    return lambda j: (~np.isfinite(values[:, j])).astype(float)


def _end(recording: Recording) -> Trace | None:
    """Returns the run's end, where it was cut short."""
    if not recording.meta.get("stopped"):
        return None
    ends = np.zeros((len(recording.time), 1))
    ends[-1] = 1.0
    return Trace(recording.time, _columns(ends), ("",))


def _state_error(first: int, last: int | None, *, mean: bool) -> Callable[..., Trace | None]:
    """Returns the reader of a drive's state errors, some of its columns."""

    def read(recording: Recording) -> Trace | None:
        found = _plain(recording, "state_error", size=True)
        if found is None:
            return None
        parts = found.parts[first:last]
        return Trace(found.time, lambda j: found.column(first + j), parts, mean=mean)

    return read


def _last(read: Callable[..., Trace | None]) -> Callable[[Recording], Trace | None]:
    """Returns the reader of the last sample alone."""

    def last(recording: Recording) -> Trace | None:
        found = read(recording)
        return (
            None
            if found is None
            else found._replace(time=found.time[-1:], column=lambda j: found.column(j)[-1:])
        )

    return last


def _mean(name: str) -> Callable[[Recording], Trace | None]:
    def read(recording: Recording) -> Trace | None:
        found = _plain(recording, name, size=True)
        return None if found is None else found._replace(mean=True)

    return read


def _screw_rate(recording: Recording) -> Trace | None:
    found = _plain(recording, "screw_rate_command", size=True)
    limit = recording.meta.get("limits", {}).get("screw_rate")
    if found is None or not limit:
        return None
    most = np.broadcast_to(np.asarray(limit, float), (len(found.parts),))
    return found._replace(column=lambda j: found.column(j) / most[j])


def _tilt(recording: Recording) -> Trace | None:
    if "attitude" not in recording.channels:
        return None
    x, y = recording.channel("attitude").values[:, :2].T
    tilt = np.arccos(np.clip(1 - 2 * (x * x + y * y), -1, 1))
    return Trace(recording.times("attitude"), lambda _: tilt, ("tilt",))


def _torque_gap(channel: str, *, of_limit: bool = False) -> Callable[[Recording], Trace | None]:
    """Returns the reader of how far two torques of an arm's joints are apart, over their peaks."""

    def read(recording: Recording) -> Trace | None:
        if not {"joint_torque_law", channel, "joint_torque"} <= recording.channels.keys():
            return None
        law = recording.channel("joint_torque_law")
        peak = np.abs(law.values).max(axis=0)
        peak = np.where(peak > 1e-9 * max(peak.max(), 1e-300), peak, np.inf)
        if of_limit:
            limit = held_limit(recording, "joint_torque", law.values.shape[1])
            peak = peak if limit is None else np.maximum(limit, 1e-12)
        other = recording.channel(channel).values
        given = (
            recording.channel("joint_torque").values + recording.channel("joint_friction").values
        )
        gap = np.abs((other - law.values) if channel == "joint_torque_inverse" else given - other)
        time = recording.times("joint_torque_law")
        return Trace(time, _columns(gap / peak), tuple(law.labels))

    return read


_SERVOS = tuple(
    (ending, channel, share)
    for channel in ("joint_torque", "gimbal_torque", "roll_moment", "screw_torque")
    for ending, share in (("use", False), ("limit_share", True))
)
WHOLE_RUN = {"finite", "completed", "took_off", "floor_contact_after_takeoff_s"}
_TRACES: dict[str, Callable[[Recording], Trace | None]] = {
    "finite": _finite,
    "completed": _end,
    "took_off": lambda r: _plain(r, "floor_distance"),
    "floor_contact_after_takeoff_s": _floor,
    "position_rmse_m": _error("position", mean=True),
    "position_max_m": _error("position", mean=False),
    "position_rmse_norm_m": _error("position", mean=True),
    "attitude_rmse_norm_rad": _error("attitude", mean=True),
    "trim_sigmas": _trim,
    "hover_sigmas": _hover,
    "attitude_rmse_rad": _error("attitude", mean=True),
    "attitude_max_rad": _error("attitude", mean=False),
    "saturation_share": _saturation,
    "gimbal_angle_limit_share": _gimbal_limit,
    "distance_rmse_m": _state_error(0, 2, mean=True),
    "distance_rmse_settled_m": _state_error(0, 2, mean=True),
    "distance_end_m": _last(_state_error(0, 2, mean=False)),
    "distance_excess_m": _state_error(0, 2, mean=False),
    "shape_rmse_rad": _state_error(3, None, mean=True),
    "shape_rmse_settled_rad": _state_error(3, None, mean=True),
    "heading_rmse_rad": _state_error(2, 3, mean=True),
    "slip_mean_m_s": _mean("slip"),
    "joint_servo_strength": _strength("joint_torque", joint_strength),
    "screw_servo_strength": _strength("screw_torque", screw_strength),
    "cone_use_mean": _mean("cone_use"),
    "screw_rate_use": _screw_rate,
    "tilt_max_rad": _tilt,
    "torque_gap_share": _torque_gap("joint_torque_law"),
    "made_gap_share": _torque_gap("joint_torque_made"),
    "made_gap_use": _torque_gap("joint_torque_made", of_limit=True),
    "inverse_gap_share": _torque_gap("joint_torque_inverse"),
}
