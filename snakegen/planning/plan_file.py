"""Plans on disk: mission files with a spline of poses, their scene and what was proved of them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from snakegen.base import yaml_file
from snakegen.base.atomic_io import write_atomically
from snakegen.base.geometry import Floats
from snakegen.errors import PlanError, near
from snakegen.planning.trajectory import Trajectory
from snakegen.scene.solids import Solid, from_json

KEYS = (
    "interpolation",
    "robot",
    "heading",
    "rate_filter",
    "settling",
    "joints",
    "waypoints",
    "scene",
    "certificate",
    "tracking",
    "demands",
)
RATE_FILTER = 4.0  # Hz
"""Gimbals of steep links turn far for a small torque, and a turning gimbal pushes its light link
back: the gyro closes that circle, and roll gimbals swing, at 45 Hz without a low-pass, at 6 Hz
with one of 10 Hz and six links. Table 5's K_d needs the rate up to 1 Hz."""
SETTLING = 2.0  # s
"""Unequal thrusts leave other torques in every posture, and Table 5's integral takes 50 s to
follow: a plan's integrals settle as fast along the motion as in the trim before it."""
_POINT = ("time", "position", "rotation_vector", "joints")


@dataclass(frozen=True, eq=False)
class PlanFile:
    """A plan as a mission file holds it.

    Attributes:
        robot: name of the robot it was made for.
        names: joints of the poses, in order.
        path: the motion.
        solids: of the scene.
        certificate: `Certificate.to_json`, None if the plan has none.
        demands: by name.
        rate_filter: Hz, low-pass on measured rates that the plan is flown with; 0: none.
        settling: s, in which the integrals of position and attitude settle; 0: as the gains say.
        tracking: `Cover.to_json`, None if unknown.
    """

    robot: str
    names: tuple[str, ...]
    path: Trajectory
    solids: tuple[Solid, ...]
    certificate: dict[str, Any] | None
    demands: dict[str, float]
    rate_filter: float = RATE_FILTER
    settling: float = SETTLING
    tracking: dict[str, Any] | None = None

    def to_text(self) -> str:
        """Returns the file's text."""
        poses = np.round(self.path.poses, 6)
        listed = [
            {
                "time": float(t),
                "position": [float(x) for x in pose[:3]],
                "rotation_vector": [float(x) for x in pose[3:6]],
                "joints": [float(x) for x in pose[6:]],
            }
            for t, pose in zip(self.path.times, poses, strict=True)
        ]
        data = {
            "interpolation": "spline",
            "robot": self.robot,
            "heading": float(self.path.heading),
            "rate_filter": float(self.rate_filter),
            "settling": float(self.settling),
            "joints": list(self.names),
            "demands": self.demands,
            "certificate": self.certificate,
            "tracking": self.tracking,
            "scene": [s.to_json() for s in self.solids],
            "waypoints": listed,
        }
        head = (
            "# A motion for `snakegen analyze flight ROBOT --mission THIS_FILE`.\n"
            "# CoG [m], attitude exp(rotation_vector) Rz(heading) of the root link [rad], joints\n"
            "# [rad]; a cubic spline runs through the waypoints, at rest at both ends.\n"
        )
        return head + yaml_file.dump(data)

    def write(self, path: Path) -> None:
        """Writes the file, whole or not at all."""
        write_atomically(path, self.to_text())


def is_plan(data: Any) -> bool:
    """Tells whether a mission file's content is a plan."""
    return isinstance(data, dict) and "interpolation" in data


def read_plan(data: dict[str, Any], where: str) -> PlanFile:
    """Returns the plan of a mission file's content.

    Raises:
        PlanError: what is missing or wrong, with the place.
    """
    for key in data:
        if key not in KEYS:
            raise PlanError(f"{where} has no field '{key}'.{near(str(key), KEYS)}")
    if data.get("interpolation") != "spline":
        raise PlanError(
            f"{where}: interpolation: {data.get('interpolation')!r}; 'spline' is known."
        )
    names = data.get("joints")
    if not isinstance(names, list) or not all(isinstance(n, str) for n in names):
        raise PlanError(f"{where}: joints: a list of names is needed.")
    listed = data.get("waypoints")
    if not isinstance(listed, list) or len(listed) < 2:
        raise PlanError(f"{where}: waypoints: two at least.")
    heading = _number(data, "heading", where, "an angle in radians")
    cutoff = _number(data, "rate_filter", where, "a frequency in Hz, 0 for none")
    settling = _number(data, "settling", where, "a time in seconds, 0 for the gains' own")
    for key, value in (("rate_filter", cutoff), ("settling", settling)):
        if value < 0.0:
            raise PlanError(f"{where}: {key}: {value:g}: 0 or more is needed.")
    rows = [_row(item, len(names), f"{where}: waypoint {i}") for i, item in enumerate(listed, 1)]
    table = np.array(rows)
    if np.any(np.diff(table[:, 0]) <= 0.0):
        k = int(np.argmin(np.diff(table[:, 0])))
        raise PlanError(f"{where}: waypoint {k + 2}: times must rise.")
    try:
        solids = tuple(from_json(s) for s in data.get("scene") or [])
    except (KeyError, TypeError, ValueError) as error:
        raise PlanError(f"{where}: scene: an obstacle cannot be read ({error}).") from None
    return PlanFile(
        str(data.get("robot", "")),
        tuple(names),
        Trajectory(table[:, 0], table[:, 1:], heading),
        solids,
        data.get("certificate"),
        data.get("demands") or {},
        cutoff,
        settling,
        data.get("tracking"),
    )


def _number(data: dict[str, Any], key: str, where: str, what: str) -> float:
    value = data.get(key, 0.0)
    if not isinstance(value, int | float) or isinstance(value, bool) or not abs(value) <= 1e3:
        raise PlanError(f"{where}: {key}: {value!r} is not {what}.")
    return float(value)


def _row(item: Any, count: int, where: str) -> Floats:
    if not isinstance(item, dict):
        raise PlanError(f"{where} is no mapping of {', '.join(_POINT)}.")
    for key in item:
        if key not in _POINT:
            raise PlanError(f"{where} has no field '{key}'.{near(str(key), _POINT)}")
    row: list[float] = []
    for key, size in zip(_POINT, (1, 3, 3, count), strict=True):
        value = item.get(key)
        given = value if isinstance(value, list) else [value]
        plain = all(isinstance(x, int | float) and not isinstance(x, bool) for x in given)
        if not plain or len(given) != size or not np.all(np.abs(np.array(given, float)) < 1e9):
            raise PlanError(f"{where}: {key}: {size} finite numbers are needed.")
        row += np.array(given, float).tolist()
    return np.array(row)
