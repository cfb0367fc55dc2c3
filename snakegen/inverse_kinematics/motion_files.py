"""Motion files: CSV tables of waypoints, and YAML with sines or waypoints."""

import csv
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base import yaml_file
from snakegen.errors import AnalysisError, near
from snakegen.inverse_kinematics import motion as motions
from snakegen.inverse_kinematics.motion import Motion
from snakegen.inverse_kinematics.zs24_table3 import table3_within
from snakegen.robot.robot import Robot

_FORMS = "'table3', a CSV (time,joint1_pitch,…) or a YAML file (sines: or time:)"
_YAML_KEYS = ("sines", "duration", "time", "angles")


def motion_of(
    robot: Robot,
    source: Motion | str | Path,
    *,
    duration: float | None = None,
    start: ArrayLike | None = None,
    ends: str = "rest",
) -> Motion:
    """Returns the motion that `source` names.

    Args:
        robot: whose chain.
        source: a motion, ``table3``, a CSV file whose header is ``time`` and joint names (s, rad),
            or a YAML file: ``sines: {joint1_yaw: {amplitude: 0.2, period: 2}}`` with ``duration``,
            or ``time: [...]`` with ``angles: {joint1_yaw: [...]}``.
        duration: s, instead of the motion's own; sines alone.
        start: (k,) rad, where joints that are not named stay.
        ends: as in `waypoints`.

    Raises:
        AnalysisError: a file that cannot be read, with the line; limits that are broken.
    """
    if isinstance(source, Motion):
        return source
    name = str(source)
    if name == "table3":
        return table3_within(robot, duration=duration)
    suffix = Path(name).suffix.lower()
    if suffix == ".csv":
        if duration is not None:
            raise AnalysisError(f"{name}: a table has its own times; duration is for sines.")
        time, angles = _read_csv(Path(name))
        return motions.waypoints(robot, time, angles, start=start, ends=ends, name=Path(name).name)
    if suffix in (".yaml", ".yml"):
        return _from_yaml(robot, Path(name), duration, start, ends)
    raise AnalysisError(f"motion '{name}' is not known; write {_FORMS}.")


def _from_yaml(
    robot: Robot, path: Path, duration: float | None, start: ArrayLike | None, ends: str
) -> Motion:
    data = yaml_file.read(path)
    if not isinstance(data, dict):
        raise AnalysisError(f"{path.name}: a motion is a mapping with 'sines' or 'time'.")
    for key in data:
        if key not in _YAML_KEYS:
            raise AnalysisError(f"{path.name} has no field '{key}'.{near(key, _YAML_KEYS)}")
    if isinstance(data.get("sines"), dict):
        lasts = data.get("duration") if duration is None else duration
        if lasts is None:
            raise AnalysisError(f"{path.name}: sines need a 'duration' [s].")
        return motions.sines(robot, data["sines"], lasts, start=start, name=path.name)
    if "time" in data and isinstance(data.get("angles"), dict):
        table = data["angles"]
        return motions.waypoints(robot, data["time"], table, start=start, ends=ends, name=path.name)
    raise AnalysisError(f"{path.name}: 'sines', or 'time' and 'angles', are needed.")


def _read_csv(path: Path) -> tuple[Any, dict[str, Any]]:
    """Returns times and angles by joint from a table whose first column is ``time``."""
    try:
        rows = list(csv.reader(path.read_text(encoding="utf-8-sig").splitlines()))
    except FileNotFoundError:
        raise AnalysisError(f"{path}: no such file.") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise AnalysisError(f"{path}: cannot be read ({error}).") from None
    numbered = [
        (i + 1, [c.strip() for c in r]) for i, r in enumerate(rows) if any(map(str.strip, r))
    ]
    if not numbered or numbered[0][1][0] not in ("time", "t"):
        raise AnalysisError(f"{path.name}: its first line must be time,joint1_pitch,… (s, rad).")
    head = numbered[0][1]
    if len(set(head)) != len(head) or len(head) < 2:
        raise AnalysisError(f"{path.name}: one column a joint beside time, each name once.")
    values = np.empty((len(numbered) - 1, len(head)))
    for k, (line, cells) in enumerate(numbered[1:]):
        if len(cells) != len(head):
            raise AnalysisError(
                f"{path.name}, line {line}: {len(cells)} entries for {len(head)} columns."
            )
        for j, cell in enumerate(cells):
            try:
                values[k, j] = float(cell)
            except ValueError:
                values[k, j] = np.nan
            if not np.isfinite(values[k, j]):
                raise AnalysisError(
                    f"{path.name}, line {line}: {head[j]} is '{cell}', not a finite number."
                )
    return values[:, 0], dict(zip(head[1:], values[:, 1:].T, strict=True))


def seconds(value: float | str | None) -> float | None:
    """Returns a duration that may come as text from the command line."""
    if value is None:
        return None
    try:
        return float(value)
    except ValueError:
        raise AnalysisError(f"duration: '{value}' is no number of seconds.") from None
