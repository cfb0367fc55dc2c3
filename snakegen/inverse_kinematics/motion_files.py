"""Motion files: tables of waypoints (CSV, Parquet, YAML), and YAML with sines or waypoints."""

from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from snakegen.base import yaml_file
from snakegen.base.geometry import Floats
from snakegen.base.number_table import ENDINGS, NumberTable, read_number_table
from snakegen.errors import AnalysisError, near
from snakegen.inverse_kinematics import motion as motions
from snakegen.inverse_kinematics.motion import Motion
from snakegen.inverse_kinematics.zs24_table3 import table3_within
from snakegen.robot.robot import Robot

_FORMS = "'table3', a table (CSV, Parquet, YAML; time,joint1_pitch,…) or a YAML file of sines"
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
        source: a motion, ``table3``, a table whose header is ``time`` and joint names (s, rad), or
            a YAML file: ``sines: {joint1_yaw: {amplitude: 0.2, period: 2}}`` with ``duration``,
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
    if suffix in (".yaml", ".yml"):
        data = yaml_file.read(Path(name))
        if not _is_table(data):
            return _from_yaml(robot, Path(name), data, duration, start, ends)
    if suffix in ENDINGS:
        if duration is not None:
            raise AnalysisError(f"{name}: a table has its own times; duration is for sines.")
        time, angles = _waypoints(read_number_table(name))
        return motions.waypoints(robot, time, angles, start=start, ends=ends, name=Path(name).name)
    raise AnalysisError(f"motion '{name}' is not known; write {_FORMS}.")


def _is_table(data: Any) -> bool:
    """Tells whether a YAML file is a table: rows, or columns of which one is ``time``."""
    if isinstance(data, list):
        return bool(data) and all(isinstance(row, dict) for row in data)
    columns = isinstance(data, dict) and not {"sines", "angles"} & data.keys()
    return columns and isinstance(data.get("time"), list)


def _from_yaml(
    robot: Robot,
    path: Path,
    data: Any,
    duration: float | None,
    start: ArrayLike | None,
    ends: str,
) -> Motion:
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


def _waypoints(table: NumberTable) -> tuple[Floats, dict[str, Floats]]:
    """Returns times and angles by joint from a table with a column ``time``."""
    first = table.names[0] if table.names else ""
    if first not in ("time", "t") or len(table.names) < 2:
        raise AnalysisError(f"{table.name}: its first line must be time,joint1_pitch,… (s, rad).")
    return table.column(first), {name: table.column(name) for name in table.names[1:]}


def seconds(value: float | str | None) -> float | None:
    """Returns a duration that may come as text from the command line."""
    if value is None:
        return None
    try:
        return float(value)
    except ValueError:
        raise AnalysisError(f"duration: '{value}' is no number of seconds.") from None
