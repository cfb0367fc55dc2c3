"""A log beside what was measured on a real robot: how far the prediction is off."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.base.number_table import ENDINGS, read_number_table
from snakegen.errors import LogError
from snakegen.log.skeleton import skeleton
from snakegen.simulation.recording.recording import Recording

_POSE = {"x": ("position", 0), "y": ("position", 1), "z": ("position", 2)}
_TURN = ("roll", "pitch", "yaw")
MCAP = ".mcap"
_LEAST = 3  # rows within the log's time


@dataclass(frozen=True)
class MeasuredDifference:
    """How one measured column differs from the log.

    Attributes:
        name: of the column.
        unit: m or rad.
        rmse: root mean square of measured − logged.
        bias: its mean.
        largest: its largest absolute value, with sign.
        time: s, when that is.
    """

    name: str
    unit: str
    rmse: float
    bias: float
    largest: float
    time: float


def against(
    recording: Recording, path: str | Path, *, shift: float = 0.0, topics: Sequence[str] = ()
) -> tuple[MeasuredDifference, ...]:
    """Compares a log with measurements.

    Args:
        recording: the log.
        path: CSV, Parquet or YAML with a column ``time`` [s], and any of ``x y z`` (m) and ``roll
            pitch yaw`` (rad) of the CoG frame, the same of the root link with ``base_`` before
            them, and the names of joints (rad); or MCAP, as `read_mcap` reads it.
        shift: s, added to the measurements' times.
        topics: of an MCAP file; all if empty.

    Raises:
        LogError: no column that the log has too, or times that the log does not cover.
    """
    file = Path(path)
    if file.suffix.lower() not in (*ENDINGS, MCAP):
        raise LogError(f"{file}: measurements' file name ends in {', '.join(ENDINGS)} or {MCAP}.")
    if topics and file.suffix.lower() != MCAP:
        raise LogError(f"{file.name} has no topics, an MCAP file has.")
    logged = _logged(recording)
    measured = _mcap(recording, file, topics) if file.suffix.lower() == MCAP else _table(file)
    shared = [name for name in measured if name in logged]
    if not shared:
        known = ", ".join(logged)
        raise LogError(f"{file.name} has none of the log's columns beside time: {known}.")
    out = []
    for name in shared:
        unit, own, values = logged[name]
        time, found = measured[name]()
        time = time + shift
        if len(time) > 1 and np.any(np.diff(time) <= 0):
            raise LogError(f"{file.name}: its times do not increase.")
        inside = (time >= own[0]) & (time <= own[-1])
        if inside.sum() < _LEAST:
            raise LogError(
                f"{file.name}: {int(inside.sum())} of its {len(time)} times lie in the log's "
                f"{own[0]:.2f} … {own[-1]:.2f} s; shift them."
            )
        at = time[inside]
        gap = found[inside] - np.interp(at, own, values)
        if unit == "rad":
            gap = np.arctan2(np.sin(gap), np.cos(gap))
        worst = int(np.argmax(np.abs(gap)))
        rmse = float(np.sqrt(np.mean(gap**2)))
        out.append(
            MeasuredDifference(
                name, unit, rmse, float(gap.mean()), float(gap[worst]), float(at[worst])
            )
        )
    return tuple(out)


def _table(path: Path) -> dict[str, Callable[[], tuple[Floats, Floats]]]:
    """Returns readers of times and values of a table's columns."""
    table = read_number_table(path)
    time = table.column("time")
    return {name: lambda name=name: (time, table.column(name)) for name in table.names}  # type: ignore[misc]


def _mcap(
    recording: Recording, path: Path, topics: Sequence[str]
) -> dict[str, Callable[[], tuple[Floats, Floats]]]:
    """Returns readers of times and values of what an MCAP file holds."""
    from snakegen.log.mcap_file import read_mcap

    urdf = recording.meta.get("urdf")
    found = read_mcap(path, skeleton(urdf).root if urdf else "", topics)
    return {name: lambda c=c: (c.time, c.values) for name, c in found.items()}  # type: ignore[misc]


def _logged(recording: Recording) -> dict[str, tuple[str, Floats, Floats]]:
    """Returns unit, times and values of what may be compared, by column name."""
    out: dict[str, tuple[str, Floats, Floats]] = {}
    for name, (channel, column) in _POSE.items():
        if channel in recording.channels:
            values = recording.channel(channel).values[:, column]
            out[name] = ("m", recording.times(channel), values)
    if "attitude" in recording.channels:
        angles = _angles(recording.channel("attitude").values)
        for k, name in enumerate(_TURN):
            out[name] = ("rad", recording.times("attitude"), angles[:, k])
    if "q" in recording.channels and "qw" in recording.channel("q").labels:
        q = recording.channel("q").values
        for k, name in enumerate("xyz"):
            out[f"base_{name}"] = ("m", recording.times("q"), q[:, k])
        angles = _angles(q[:, 3:7])
        for k, name in enumerate(_TURN):
            out[f"base_{name}"] = ("rad", recording.times("q"), angles[:, k])
    for channel in ("joint_angle", "gimbal_angle"):
        if channel in recording.channels:
            found: Any = recording.channel(channel)
            for k, label in enumerate(found.labels):
                out[label] = ("rad", recording.times(channel), found.values[:, k])
    return out


def _angles(xyzw: Floats) -> Floats:
    """Returns unwrapped roll, pitch, yaw (T, 3) rad of quaternions."""
    from scipy.spatial.transform import Rotation

    turns = Rotation.from_quat(xyzw).as_euler("ZYX")[:, ::-1]
    return np.asarray(np.unwrap(turns, axis=0))
