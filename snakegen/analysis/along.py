"""Margins along a joint trajectory: its weakest instant, certified."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.base.number_table import NumberTable, read_number_table
from snakegen.errors import AnalysisError, near
from snakegen.robot.robot import Robot
from snakegen.sweep.batch import Body, evaluate
from snakegen.sweep.samples import postures_of

COMMAND = "along"
ORDER = 65
REPORT = False  # needs a table
EXAMPLE = "dragon4 --table waypoints.csv --margin torque_margin"


@dataclass(frozen=True)
class Along:
    """Certified margins over a motion; instants are between waypoints too."""

    margin: str
    time: Floats  # (m,) s, or waypoint count where the table has no time
    angles: Floats  # (m, k) rad
    joints: tuple[str, ...]
    values: dict[str, Floats]
    timed: bool

    @property
    def weakest(self) -> int:
        """The row of the weakest instant; an infeasible hover is the weakest of all."""
        v = self.values[self.margin]
        return int(np.argmin(np.where(np.isfinite(v), v, -np.inf)))

    def to_json(self) -> dict[str, Any]:
        """Returns plain data for a program."""
        i = self.weakest
        return {
            "margin": self.margin,
            "weakest_at_s" if self.timed else "weakest_at_waypoint": float(self.time[i]),
            "weakest": float(self.values[self.margin][i]),
            "posture": {n: float(a) for n, a in zip(self.joints, self.angles[i], strict=True)},
            "instants": len(self.time),
            "time": self.time.tolist(),
        } | {k: v.tolist() for k, v in self.values.items()}

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people."""
        i, v = self.weakest, self.values[self.margin]
        where = f"{self.time[i]:.3f} s" if self.timed else f"waypoint {self.time[i] + 1:.2f}"
        posture = ", ".join(
            f"{n} {a:+.3f}" for n, a in zip(self.joints, self.angles[i], strict=True)
        )
        lost = int(np.sum(~np.isfinite(v)))
        least = f"{v[i]:.4g}" if np.isfinite(v[i]) else "undefined (hover out of reach)"
        largest = f", largest {v[np.isfinite(v)].max():.4g}" if lost < len(v) else ""
        rows = [
            (f"weakest {self.margin}", f"{least} at {where}"),
            ("posture there", posture),
            ("instants checked", f"{len(v)}{largest}"),
        ]
        if lost:
            rows.append(("hover out of reach", f"at {lost} of them"))
        hit = int(np.sum(self.values["self_collision"] > 0))
        if hit:
            rows.append(("self-colliding", f"at {hit} of them"))
        return rows


def applies(robot: Robot) -> bool:
    """A robot with gimballed rotors and a free base."""
    return robot.floating and bool(robot.gimbal_names)


def analyze(
    robot: Robot, q: Floats, table: str = "", step: float = 0.02, margin: str = "force_margin"
) -> Along:
    """Returns certified margins along the waypoints of `table`, joints moving straight between.

    Joints without a column, and the attitude, are those of q.

    Options:
        table: CSV, Parquet or YAML of waypoints: a header of joint names, and 'time' if it has
            one
        step: rad, largest joint motion between two instants that are checked
        margin: which margin decides the weakest instant

    Raises:
        AnalysisError: no table, one that cannot be read, times that do not rise, no such margin.
    """
    if not table:
        raise AnalysisError("along: a motion is needed: --table waypoints.csv.")
    if not 0 < step < np.inf:
        raise AnalysisError(f"--step {step:g}: more than 0 rad is needed.")
    given = read_number_table(table)
    names, time = _columns(robot, given)
    low, high, _ = robot.limits(names)
    points = postures_of(given, names, low, high)
    knots, timed = (np.arange(len(points), dtype=float), False) if time is None else (time, True)
    at, rows = _dense(knots, points, step)
    joints = robot.chain_joints
    whole = np.repeat(
        robot.angles(q)[[robot.joint_names.index(n) for n in joints]][None], len(rows), axis=0
    )
    whole[:, [joints.index(n) for n in names]] = rows
    base, _ = robot.base_pose(q)
    found = evaluate(Body.of(robot, joints, base, 1e-3), whole)
    values = {n: np.asarray(found[n], float) for n in found.column_names if n not in joints}
    if margin not in values:
        raise AnalysisError(f"no margin '{margin}'; there are {', '.join(values)}.")
    return Along(margin, at, whole, joints, values, timed)


def _columns(robot: Robot, table: NumberTable) -> tuple[tuple[str, ...], Floats | None]:
    """Returns the joints that the table has, and its times."""
    known = ("time", *robot.chain_joints)
    for column in table.names:
        if column not in known:
            raise AnalysisError(
                f"{table.name}: column '{column}' is no joint that shapes {robot.name}."
                f"{near(column, known)}"
            )
    names = tuple(n for n in robot.chain_joints if n in table.names)
    if not names:
        raise AnalysisError(f"{table.name} names no joint of {robot.name}.")
    if "time" not in table.names:
        return names, None
    time = table.column("time")
    if np.any(np.diff(time) <= 0):
        raise AnalysisError(f"{table.name}: its times do not rise.")
    return names, time


def _dense(knots: Floats, points: Floats, step: float) -> tuple[Floats, Floats]:
    """Returns times (m,) and angles (m, k) so that no joint moves more than `step` at once."""
    times, rows = [knots[:1]], [points[:1]]
    for k in range(len(points) - 1):
        count = max(1, int(np.ceil(np.abs(points[k + 1] - points[k]).max() / step)))
        s = np.arange(1, count + 1)[:, None] / count
        rows.append(points[k] + s * (points[k + 1] - points[k]))
        times.append(knots[k] + s[:, 0] * (knots[k + 1] - knots[k]))
    return np.concatenate(times), np.concatenate(rows)
