"""A log beside what was measured on a real robot: how far the prediction is off."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.base.number_table import read_number_table
from snakegen.errors import LogError
from snakegen.simulation.recording.recording import Recording

_POSE = {"x": ("position", 0), "y": ("position", 1), "z": ("position", 2)}
_TURN = ("roll", "pitch", "yaw")
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
    recording: Recording, path: str | Path, *, shift: float = 0.0
) -> tuple[MeasuredDifference, ...]:
    """Compares a log with a table of measurements.

    Args:
        recording: the log.
        path: CSV, Parquet or YAML with a column ``time`` [s], and any of ``x y z`` (CoG, m, world),
            ``roll pitch yaw`` (root link, rad) and the names of joints (rad).
        shift: s, added to the table's times.

    Raises:
        LogError: no column that the log has too, or times that the log does not cover.
    """
    table = read_number_table(path)
    time = table.column("time") + shift
    if len(time) > 1 and np.any(np.diff(time) <= 0):
        raise LogError(f"{table.name}: its times do not increase.")
    logged = _logged(recording)
    shared = [name for name in table.names if name in logged]
    if not shared:
        known = ", ".join(logged)
        raise LogError(f"{table.name} has none of the log's columns beside time: {known}.")
    out = []
    for name in shared:
        unit, own, values = logged[name]
        inside = (time >= own[0]) & (time <= own[-1])
        if inside.sum() < _LEAST:
            raise LogError(
                f"{table.name}: {int(inside.sum())} of its {len(time)} times lie in the log's "
                f"{own[0]:.2f} … {own[-1]:.2f} s; shift them."
            )
        at = time[inside]
        gap = table.column(name)[inside] - np.interp(at, own, values)
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
