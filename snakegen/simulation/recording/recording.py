"""A run as data: the one structure between the stepping loop, the metrics, the verdict, the log.

A `Recording` holds named channels; the names that metrics and pictures know are in `STANDARD`,
with their unit, the plot they share and what they mean. Any other name may be added. A channel
has the run's time axis or one of its own (200 Hz ticks beside 20 Hz margins).
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.base.sample_store import LONG, release_all
from snakegen.errors import LogError, near
from snakegen.simulation.recording.verdict import Verdict

Floats = NDArray[np.float64]


class Standard(NamedTuple):
    """Unit, plot and meaning of a standard channel name."""

    unit: str
    group: str
    meaning: str
    labels: tuple[str, ...] = ()  # empty where the width belongs to the robot


_XYZ = ("x", "y", "z")
_XYZW = ("qx", "qy", "qz", "qw")

STANDARD: dict[str, Standard] = {
    "position": Standard("m", "position", "CoG (drives: the head P), world axes", _XYZ),
    "position_target": Standard("m", "position", "its target", _XYZ),
    "attitude": Standard("1", "attitude", "CoG frame in the world, quaternion xyzw", _XYZW),
    "attitude_target": Standard("1", "attitude", "its target, quaternion xyzw", _XYZW),
    "velocity": Standard("m/s", "velocity", "of the CoG, world axes", _XYZ),
    "angular_velocity": Standard("rad/s", "velocity", "of the CoG frame, its own axes", _XYZ),
    "q": Standard("m, 1, rad", "configuration", "configuration in Pinocchio's order"),
    "thrust": Standard("N", "thrust", "thrust of each rotor"),
    "thrust_command": Standard("N", "thrust command", "commanded thrust of each rotor"),
    "gimbal_angle": Standard("rad", "gimbals", "gimbal joints"),
    "gimbal_command": Standard("rad", "gimbal command", "commanded angle of each gimbal joint"),
    "gimbal_torque": Standard("N·m", "gimbal torque", "torque of each gimbal servo"),
    "joint_angle": Standard("rad", "joints", "joints between links"),
    "joint_command": Standard("rad", "joint command", "commanded angle of each joint"),
    "joint_torque": Standard("N·m", "joint torque", "torque of each joint servo"),
    "joint_rate": Standard("rad/s", "joint rate", "rate of each joint"),
    "servo_deflection": Standard(
        "rad", "servo deflection", "what each joint servo is commanded minus where its joint is"
    ),
    "sigma_min": Standard(
        "1", "scaled margins", "smallest scaled singular value of the allocation"
    ),
    "wrench_margin": Standard("1", "scaled margins", "scaled wrench margin"),
    "force_margin": Standard("N", "margins", "force margin"),
    "torque_margin": Standard("N·m", "margins", "torque margin"),
    "force_margin_upper": Standard("N", "margins", "upper bound of the force margin"),
    "torque_margin_upper": Standard("N·m", "margins", "upper bound of the torque margin"),
    "floor_distance": Standard("m", "clearance", "smallest distance of the robot to the floor"),
    "self_distance": Standard("m", "clearance", "smallest distance between parts that may touch"),
    "obstacle_distance": Standard("m", "clearance", "smallest distance to an obstacle"),
    "floor_contact": Standard("N", "contact", "normal force of the floor on the robot"),
    "disturbance": Standard(
        "N, N·m",
        "disturbance",
        "disturbing [force; torque] at `disturbance_point`, world axes",
        ("fx", "fy", "fz", "tx", "ty", "tz"),
    ),
    "disturbance_point": Standard("m", "disturbance point", "where it acts, world axes", _XYZ),
    "roll_moment": Standard(
        "N·m", "roll moment", "moment of unequal rotors about each φ axis (ZN23: λ1 − λ2)"
    ),
    "elastic_angle": Standard(
        "rad", "elastic angles", "deflection of every spring and every joint servo"
    ),
    "modal_energy": Standard("J", "modal energy", "of the lowest elastic modes, gimbals held"),
    "battery_used": Standard("1", "battery", "share of the battery's energy used"),
    "wind": Standard("m/s", "wind", "velocity of the air, world axes", _XYZ),
    "power": Standard("W", "power", "electric power"),
    "screw_rate": Standard("rad/s", "screws", "rate of each screw"),
    "slip": Standard("m/s", "slip", "residual of each unit's no-side-slip constraint"),
}


@dataclass(frozen=True, repr=False)
class Channel:
    """A named signal: `values` (T, k) with one label a column; NaN where it is undefined."""

    values: Floats
    unit: str
    labels: tuple[str, ...]
    group: str
    meaning: str = ""
    time: Floats | None = None  # (T,) s; None: the recording's own

    def __repr__(self) -> str:
        """Returns size, unit and meaning in one line."""
        rows, columns = self.values.shape
        about = f": {self.meaning}" if self.meaning else ""
        return f"Channel({rows} × {columns}, {self.unit or 'no unit'}{about})"


class Event(NamedTuple):
    """Something that happened: time [s], level (INFO, WARN, ERROR), one line of text."""

    time: float
    level: str
    text: str


def channel(
    name: str,
    values: ArrayLike,
    labels: Iterable[str] | None = None,
    *,
    unit: str | None = None,
    group: str | None = None,
    meaning: str | None = None,
    time: ArrayLike | None = None,
) -> Channel:
    """Returns a `Channel`, with what `STANDARD` says of `name` where nothing else is given.

    Args:
        name: a standard name, or any other one.
        values: (T,) or (T, k).
        labels: k column labels; by default the standard's, else ``name`` or ``name_1 …``.
        unit, group, meaning: override the standard's.
        time: (T,) s, where the channel does not share the recording's time axis.

    Raises:
        LogError: `values` is not an array of numbers with one or two axes, or labels do not fit.
    """
    standard = STANDARD.get(name, Standard("", name, ""))
    array = np.array(values, dtype=np.float64)
    if array.ndim == 1:
        array = array[:, None]
    if array.ndim != 2:
        raise LogError(f"channel '{name}' has shape {array.shape}; it needs (T,) or (T, k)")
    width = array.shape[1]
    given = standard.labels if labels is None else tuple(labels)
    if labels is None and not given:
        given = (name,) if width == 1 else tuple(f"{name}_{i + 1}" for i in range(width))
    return Channel(
        array,
        standard.unit if unit is None else unit,
        given,
        standard.group if group is None else group,
        standard.meaning if meaning is None else meaning,
        None if time is None else np.array(time, dtype=np.float64),
    )


def held_channel(
    name: str, values: Floats, labels: Iterable[str] | None = None, **about: Any
) -> Channel:
    """Returns what `channel` does, of an array (T, k) of float64 that is not copied.

    It may lie on a disk, and must not be changed any more.
    """
    return replace(channel(name, values[:0], labels, **about), values=values)


@dataclass(frozen=True, repr=False)
class Recording:
    """One verification run.

    `meta` is JSON-able: ``robot``, ``mission``, ``seed``, ``version``, ``mode``, ``weight_n``,
    ``urdf`` and ``spec`` (texts), ``rotors`` (list of ``{link, axis}``, in the order of `thrust`),
    ``limits`` (``thrust_min``, ``thrust_max``, ``joint_torque``, ``gimbal_torque``, a number or
    one a column), ``metrics_window_s`` ``[from, to]``. The labels of `q` are, for a floating
    base, x y z qx qy qz qw, then the joint names; a joint with two entries (Pinocchio's
    continuous ones) has ``name:cos`` and ``name:sin``.
    """

    time: Floats  # (T,) s, rising
    channels: dict[str, Channel]
    events: tuple[Event, ...] = ()
    meta: dict[str, Any] = field(default_factory=dict)
    report: str = ""  # markdown
    metrics: dict[str, Any] = field(default_factory=dict)
    verdict: Verdict | None = None

    def __post_init__(self) -> None:
        """Checks shapes, times and that `meta` and `metrics` are JSON."""
        time = np.asarray(self.time, dtype=np.float64)
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "events", tuple(Event(*e) for e in self.events))
        _check_time(time, "the recording")
        for name, c in self.channels.items():
            _check_channel(name, c, time)
        for what, value in (("meta", self.meta), ("metrics", self.metrics)):
            try:
                json.dumps(value)
            except (TypeError, ValueError) as error:
                raise LogError(f"the recording's {what} cannot be JSON: {error}") from None

    def __getitem__(self, name: str) -> Floats:
        """Returns the values (T, k) of the channel `name`; LogError names the near ones."""
        return self.channel(name).values

    def __contains__(self, name: object) -> bool:
        """Tells whether there is a channel `name`."""
        return name in self.channels

    def __iter__(self) -> Iterator[str]:
        """Iterates over the names of the channels."""
        return iter(self.channels)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the channels."""
        return tuple(self.channels)

    def __repr__(self) -> str:
        """Returns the run, its length and its verdict in one line."""
        names = (str(self.meta[k]) for k in ("robot", "mission") if k in self.meta)
        run = [" ".join(names) or "run"]
        run += [f"seed {self.meta['seed']}"] if "seed" in self.meta else []
        seconds = float(self.time[-1] - self.time[0])
        size = f"{len(self.time)} samples in {seconds:.4g} s, {len(self.channels)} signals"
        end = self.verdict.summary() if self.verdict is not None else "not judged"
        return f"{type(self).__name__}({', '.join(run)}: {size}; {end})"

    @property
    def recorded(self) -> frozenset[str]:
        """Names of the channels that have columns: what the verdict can expect numbers of."""
        return frozenset(name for name, c in self.channels.items() if c.values.shape[1])

    def channel(self, name: str) -> Channel:
        """Returns the channel `name`; LogError names the near ones where there is none."""
        if name not in self.channels:
            raise LogError(f"the recording has no channel '{name}'.{near(name, self.channels)}")
        return self.channels[name]

    def times(self, name: str) -> Floats:
        """Returns the (T,) time axis of the channel `name`, s."""
        own = self.channel(name).time
        return self.time if own is None else own

    def release(self) -> None:
        """Gives back the memory of a long run's samples; they are read again when needed."""
        if len(self.time) > LONG:
            release_all()

    def held(self, name: str, time: ArrayLike, part: slice | None = None) -> Floats:
        """Returns `name` at other times (n,), each the last value at or before it: (n, k).

        `part` are the rows of the recording's own axis at which `time` was cut out of it, if so.
        """
        c, own, at = self.channel(name), self.times(name), np.asarray(time, float)
        near = own if part is None else own[part]
        if near is at or np.array_equal(near, at):
            return c.values if part is None else c.values[part]
        index = np.searchsorted(own, at + 1e-9, side="right") - 1
        index = np.clip(index, 0, len(own) - 1)
        out = np.empty((len(index), c.values.shape[1]))
        for j in range(out.shape[1]):  # column by column, as those of long runs lie on the disk
            out[:, j] = c.values[index, j]
            self.release()
        return out

    def judged(self, metrics: Mapping[str, Any], verdict: Verdict) -> Recording:
        """Returns the same run with its metrics and verdict."""
        return replace(self, metrics=dict(metrics), verdict=verdict)


def _check_time(time: Floats, what: str) -> None:
    if time.ndim != 1 or time.size == 0:
        raise LogError(f"the time axis of {what} has shape {time.shape}; it needs (T,), T ≥ 1")
    if not np.all(np.isfinite(time)) or np.any(np.diff(time) <= 0):
        raise LogError(f"the time axis of {what} does not rise, or is not finite")


def _check_channel(name: str, c: Channel, time: Floats) -> None:
    if "/" in name or not name:
        raise LogError(f"a channel cannot be named '{name}'")
    if c.time is not None:
        _check_time(c.time, f"channel '{name}'")
    rows = len(time if c.time is None else c.time)
    if c.values.dtype != np.float64 or c.values.shape != (rows, len(c.labels)):
        raise LogError(
            f"channel '{name}' is {c.values.dtype} {c.values.shape}; "
            f"{rows} times and {len(c.labels)} labels need float64 ({rows}, {len(c.labels)})"
        )
