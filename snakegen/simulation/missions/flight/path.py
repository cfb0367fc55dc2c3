"""A path of one's own: a YAML file of waypoints of CoG pose and joints, flown with rests between.

A waypoint is ``{time: 4.0, position: [0, 0, 1.5], rpy: [0, 0, 0.3], joints: {joint1_yaw: 0.5}}``;
what it does not name stays as before. The robot starts at the first one. A plan of `snakegen plan`
is such a file too: its spline is flown without rests, past the obstacles of its scene.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from snakegen.base import yaml_file
from snakegen.base.geometry import Floats, rotation_from_rpy
from snakegen.base.sample_store import in_pieces
from snakegen.errors import MissionError, near
from snakegen.planning.plan_file import is_plan
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.memory_check import refuse_too_long
from snakegen.simulation.flight.plan import Plan, holding, through, ticks
from snakegen.simulation.flight.planned import planned_flight
from snakegen.simulation.flight.postures import driven_joints, place, resting_joints
from snakegen.simulation.flight.trim import TrimOption


@dataclass(frozen=True)
class Options(TrimOption):
    """Options of mission `path`.

    Attributes:
        file: mission file (YAML)
        duration: s; two seconds after the last waypoint by default
    """

    file: str | None = None
    duration: float | None = None


_MOST = 1e9  # of any unit: beyond it is a slip of the pen
_KEYS = ("time", "position", "rpy", "joints")


def applies(robot: Robot) -> bool:
    """A floating base and rotors."""
    return robot.floating and bool(robot.modules.apparatuses)


def plan(robot: Robot, rate: float, options: Options) -> Plan:
    """Returns the plan through the file's waypoints.

    Raises:
        MissionError: no file, an unknown field, times that do not rise, angles beyond limits.
    """
    if options.file is None:
        raise MissionError("mission 'path' needs a file: --mission my.yaml.")
    path = Path(str(options.file))
    data = yaml_file.read(path)
    if is_plan(data):
        return planned_flight(robot, data, path.name, rate, options.duration)
    knots, points = waypoints(robot, path, data)
    seconds = float(knots[-1]) + 2.0 if options.duration is None else options.duration
    refuse_too_long(robot, seconds)
    time = ticks(seconds, rate)
    value, speed, bend = through(time, knots, points)
    rotation, angular = in_pieces(len(time), lambda part: _turning(value, part, rate))
    return holding(
        time,
        value[:, 6:],
        place(robot, points[0, 6:], points[0, :3], rotation_from_rpy(points[0, 3:6])),
        points[0, :3],
        position=value[:, :3],
        velocity=speed[:, :3],
        acceleration=bend[:, :3],
        rotation=rotation,
        angular=angular,
        events=tuple((float(t), f"waypoint {i + 1}") for i, t in enumerate(knots)),
    )


def waypoints(robot: Robot, path: Path, data: Any = None) -> tuple[Floats, Floats]:
    """Returns times (m,) and rows (m, 6 + k): CoG [m], roll pitch yaw, joints [rad]."""
    data = yaml_file.read(path) if data is None else data
    listed = data.get("waypoints") if isinstance(data, dict) else None
    if not isinstance(listed, list) or not listed:
        raise MissionError(f"{path.name}: a mission is a mapping with a list of 'waypoints'.")
    for key in data:
        if key != "waypoints":
            raise MissionError(f"{path.name} has no field '{key}'; it holds 'waypoints' alone.")
    names = driven_joints(robot)
    now = np.concatenate([[0.0, 0.0, 1.5], np.zeros(3), resting_joints(robot)])
    times, rows = [], []
    for i, item in enumerate(listed):
        where = f"{path.name}: waypoint {i + 1}"
        if not isinstance(item, dict):
            raise MissionError(f"{where} is no mapping of {', '.join(_KEYS)}.")
        for key in item:
            if key not in _KEYS:
                raise MissionError(f"{where} has no field '{key}'.{near(str(key), _KEYS)}")
        times.append(_numbers(item.get("time", 5.0 * i), 1, f"{where}: time")[0])
        for key, first in (("position", 0), ("rpy", 3)):
            if key in item:
                now[first : first + 3] = _numbers(item[key], 3, f"{where}: {key}")
        for name, angle in _joints(item, where).items():
            if name not in names:
                raise MissionError(f"{where}: no driven joint '{name}'.{near(str(name), names)}")
            now[6 + names.index(name)] = _numbers(angle, 1, f"{where}: {name}")[0]
        rows.append(now.copy())
    if times[0] < 0.0:
        raise MissionError(f"{path.name}: waypoint 1: time {times[0]:g} s; a mission begins at 0.")
    return np.array(times), np.array(rows)


def _joints(item: dict[str, Any], where: str) -> dict[str, Any]:
    given = item.get("joints")
    if given is not None and not isinstance(given, dict):
        raise MissionError(
            f"{where}: joints: {given!r} is no mapping of names to angles, as in joint1_yaw: 0.5."
        )
    return given or {}


def _numbers(value: Any, count: int, where: str) -> Floats:
    listed = value if isinstance(value, list) else [value]
    plain = all(isinstance(x, int | float) and not isinstance(x, bool) for x in listed)
    if not plain or len(listed) != count or not all(abs(x) < _MOST for x in listed):
        wanted = "a finite number" if count == 1 else f"a list of {count} finite numbers"
        raise MissionError(f"{where}: {value!r} is not {wanted}.")
    return np.array(listed, float)


def _turning(value: Floats, part: slice, rate: float) -> tuple[Floats, Floats]:
    """Returns attitudes (n, 3, 3) and angular velocities (n, 3) [rad/s], own axes, of some rows.

    Args:
        value: (T, 6 + k), roll, pitch and yaw [rad] after the place.
        part: rows.
        rate: rows a second.
    """
    angles = value[part.start : part.stop + 1, 3:6]
    rotation = np.ascontiguousarray(rotation_from_rpy(angles))
    s = np.einsum("tji,tjk->tik", rotation[:-1], rotation[1:])
    skew = [s[:, 2, 1] - s[:, 1, 2], s[:, 0, 2] - s[:, 2, 0], s[:, 1, 0] - s[:, 0, 1]]
    turned = 0.5 * rate * np.stack(skew, axis=1)
    count = part.stop - part.start
    still = np.zeros((count - len(turned), 3))  # the last row of all
    return rotation[:count], np.vstack([turned, still])
