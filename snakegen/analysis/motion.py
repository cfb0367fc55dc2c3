"""Motion: joint torques along a motion, their peaks, RMS and power, and which servo is too weak.

ZS24 section 4: Table 3's sines give Table 5's peaks; waypoints and other sines come from files.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.atomic_io import require_suffix
from snakegen.base.geometry import Floats
from snakegen.base.number_table import ENDINGS, write_number_table
from snakegen.base.rounding import significant
from snakegen.errors import AnalysisError
from snakegen.inverse_kinematics.friction import Friction, friction_of
from snakegen.inverse_kinematics.motion import Motion, speed_limits
from snakegen.inverse_kinematics.motion_files import motion_of, seconds
from snakegen.inverse_kinematics.torques_along import Along, torques_along
from snakegen.kernels.dynamics.torque_terms import DEPTHS, TERMS
from snakegen.robot.robot import Robot
from snakegen.statics.joint_torques import DOWN, Depth, Wrenches, declared_limits

COMMAND = "motion"
ORDER = 65
EXAMPLE = "arm6 --motion table3 --friction 0.1,0.06 --table torques.csv"


@dataclass(frozen=True, eq=False)
class MotionResult:
    """Joint torques along a motion.

    Attributes:
        name: of the motion.
        along: the instants, and every term of the law at each.
        terms: depth that `torque` has.
        gravity: (3,) m/s².
        friction: of every joint; part of `torque`.
        torque: (m, k) N·m that the servos give.
        limit: (k,) N·m, servo limits.
        speed_limit: (k,) rad/s.
        depth_peaks: (k,) N·m by depth, without friction.
        share: by term, its part of the sum over joints, instants and terms of |torque|.
        table: the file written, "" if none.
        assumed: no motion was asked for; the paper's stands in.
    """

    name: str
    along: Along
    terms: Depth
    gravity: Floats
    friction: Friction
    torque: Floats
    limit: Floats
    speed_limit: Floats
    depth_peaks: dict[str, Floats]
    share: dict[str, float]
    table: str
    assumed: bool = False

    @property
    def peak(self) -> Floats:
        """Largest |torque| of each joint (k,) N·m."""
        return np.asarray(np.abs(self.torque).max(axis=0))

    @property
    def peak_time(self) -> Floats:
        """When each joint's largest |torque| comes first (k,) s."""
        return np.asarray(self.along.time[np.abs(self.torque).argmax(axis=0)])

    @property
    def rms(self) -> Floats:
        """Root mean square torque (k,) N·m, over time."""
        return np.sqrt(_mean(self.along.time, self.torque**2))

    @property
    def power(self) -> Floats:
        """Mechanical power τ q̇ (m, k) W; negative where a joint brakes."""
        return self.torque * self.along.rates

    @property
    def supply(self) -> Floats:
        """Power that the supply gives (m,) W where no joint feeds back: Σ max(τ q̇, 0)."""
        return np.asarray(np.maximum(self.power, 0.0).sum(axis=1))

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people: the whole, then joint by joint."""
        g = float(np.linalg.norm(self.gravity))
        what = "weightless" if g == 0 else f"gravity {g:.4g} m/s²"
        if self.friction.present:
            static, sliding = self.friction.highest
            what += f", friction {static:g} N·m static, {sliding:g}"
        span = self.along.time[-1]
        name = f"{self.name} (assumed: none was given)" if self.assumed else self.name
        out = [("motion", f"{name}, {span:.4g} s, {what}; torques {self.terms}")]
        shares = [
            f"{k.replace('_', ' ')} {100 * x:.3g} %" for k, x in self.share.items() if x > 0.0005
        ]
        out.append(("consists of", ", ".join(shares) or "nothing: no load"))
        part = self.depth_peaks["quasi_static"].max() / max(self.depth_peaks["full"].max(), 1e-300)
        if self.terms == "full" and np.any(self.depth_peaks["full"]):
            out.append(("the paper's eq 24", f"gives {100 * part:.3g} % of the highest peak"))
        time, total = self.along.time, self.power.sum(axis=1)
        work, net = np.trapezoid(self.supply, time), np.trapezoid(total, time)
        out.append(("power", f"{self.supply.max():.3g} W at most, {work:.3g} J, all joints"))
        fed = f"{total.max():.3g} W at most, {net:.3g} J, if braking joints feed the others"
        out.append(("", fed))
        weak = [
            n for n, p, m in zip(self.along.joints, self.peak, self.limit, strict=True) if p > m
        ]
        if weak:
            out.append(("overloaded", ", ".join(weak)))
        unknown = [n for n, m in zip(self.along.joints, self.limit, strict=True) if np.isinf(m)]
        if unknown:
            out.append(("no declared effort", ", ".join(unknown)))
        if self.table:
            out.append(("table", self.table))
        return out + self._joint_rows()

    def _share(self, i: int) -> str:
        """Returns the share of a joint's servo at its peak; "" without a declared effort."""
        if np.isinf(self.limit[i]):
            return ""
        return f"{100 * self.peak[i] / self.limit[i]:.3g} % of its servo, "

    def _joint_rows(self) -> list[tuple[str, str]]:
        """Returns a row a joint, the hardest of many."""
        out = []
        power = np.abs(self.power).max(axis=0)
        for i in _hardest(self.peak / self.limit):
            out.append(
                (
                    self.along.joints[i],
                    f"{self.peak[i]:.4g} N·m at most ({self._share(i)}"
                    f"at {self.peak_time[i]:.3g} s), {self.rms[i]:.4g} RMS, "
                    f"{power[i]:.3g} W",
                )
            )
        hidden = len(self.limit) - len(out)
        if hidden > 0:
            out.append(("", f"and {hidden} joints with less"))
        return out

    def to_json(self) -> dict[str, Any]:
        """Returns plain data; keys carry units; the series are in the table."""
        joints = self.along.joints
        total = self.power.sum(axis=1)
        fastest = np.abs(self.along.rates).max(axis=0)

        def by_joint(values: Floats) -> dict[str, float]:
            return dict(zip(joints, values.tolist(), strict=True))

        return {
            "motion": self.name,
            "motion_assumed": self.assumed,
            "duration_s": float(self.along.time[-1]),
            "samples": len(self.along.time),
            "terms": self.terms,
            "gravity_m_s2": self.gravity.tolist(),
            "friction_Nm": dict(zip(("static", "sliding"), self.friction.highest, strict=True)),
            "peak_Nm": by_joint(self.peak),
            "peak_time_s": by_joint(self.peak_time),
            "rms_Nm": by_joint(self.rms),
            "limit_Nm": by_joint(self.limit),  # infinite: none declared
            "use": by_joint(self.peak / self.limit),
            "peak_power_W": by_joint(np.abs(self.power).max(axis=0)),
            "peak_rate_rad_s": by_joint(fastest),
            "rate_use": by_joint(fastest / self.speed_limit),
            "power_max_W": float(np.abs(total).max()),
            "power_supply_max_W": float(self.supply.max()),
            "work_supply_J": float(np.trapezoid(self.supply, self.along.time)),
            "work_net_J": float(np.trapezoid(total, self.along.time)),
            "work_absolute_J": float(np.trapezoid(np.abs(self.power).sum(axis=1), self.along.time)),
            "depth_peaks_Nm": {k: by_joint(v) for k, v in self.depth_peaks.items()},
            "share": self.share,
            "table": self.table or None,
        }


def applies(robot: Robot) -> bool:
    """An arm: a chain on a fixed base, no joint of which follows another (mimic)."""
    return not robot.floating and len(robot.chain_joints) > 0 and not robot.followers


def analyze(
    robot: Robot,
    q: ArrayLike,
    *,
    motion: Motion | str | Path | None = None,
    duration: float | str | None = None,
    rate: float = 1000.0,
    terms: Depth = "full",
    gravity: ArrayLike | None = None,
    wrenches: Wrenches = None,
    friction: Friction | ArrayLike | None = None,
    ends: str = "rest",
    table: str | Path | None = None,
) -> MotionResult:
    """Returns the joint torques along a motion.

    Args:
        robot: an arm.
        q: (nq,) posture, where joints that the motion does not name stay.

    Options:
        motion: table3, a table (CSV, Parquet, YAML; header time,joint1_pitch,… in s and rad) or
            YAML of sines; table3 if absent
        duration: s, instead of the motion's own; sines alone
        rate: instants a second
        terms: depth: static, quasi_static (the paper's eq 24) or full
        gravity: m/s², world; none for table3 (the paper's is weightless), else 0,0,-9.81
        wrenches: loads, as in "link4=0,0,-5,0,0,0": [force; torque] at a link, world axes
        friction: static,sliding of every joint in N·m, as in 0.1,0.06; else the servos' own
        ends: of a table: rest, or free for one that is cut out of a motion
        table: CSV, Parquet or YAML table to write: time, angles, torques, power

    Raises:
        SnakegenError: not an arm, a motion outside the limits, NaN, more than fits into memory.
    """
    if not applies(robot):
        raise AnalysisError(f"{robot.name} is no arm on a fixed base: its motions are flights.")
    if terms not in DEPTHS:
        raise AnalysisError(f"terms must be one of {', '.join(DEPTHS)} (got '{terms}').")
    if table is not None:
        require_suffix(table, *ENDINGS)
    q = robot.validate_configuration(q)
    names = robot.chain_joints
    start = robot.angles(q)[[robot.joint_names.index(n) for n in names]]
    lasts = seconds(duration)
    wanted: Motion | str | Path = "table3" if motion is None else motion
    moved = motion_of(robot, wanted, duration=lasts, start=start, ends=ends)
    if gravity is None:
        gravity = np.zeros(3) if moved.name.startswith("table3") else DOWN
    rub = friction_of(friction, robot, moved.joints)
    along = torques_along(
        robot, q, moved, moved.times(rate), wrenches=wrenches, gravity=_vector(gravity)
    )
    summed = {TERMS[k]: float(np.abs(along.terms[k]).sum()) for k in DEPTHS[terms]}
    whole = sum(summed.values())
    result = MotionResult(
        moved.name,
        along,
        terms,
        _vector(gravity),
        rub,
        along.torque(terms) + rub.torque(along.rates),
        declared_limits(robot, names),
        speed_limits(robot, names),
        {depth: np.abs(along.torque(depth)).max(axis=0) for depth in DEPTHS},
        {k: x / whole if whole > 0 else 0.0 for k, x in summed.items()},
        "" if table is None else str(table),
        motion is None,
    )
    if table is not None:
        write_table(result, Path(table))
    return result


def write_table(result: MotionResult, path: Path) -> None:
    """Writes time, angle, torque and power of each joint as a table: s, rad, N·m, W."""
    columns = {"time_s": result.along.time}
    for unit, values in (("rad", result.along.angles), ("Nm", result.torque), ("W", result.power)):
        columns |= {f"{n}_{unit}": values[:, k] for k, n in enumerate(result.along.joints)}
    write_number_table(path, columns)


_SHOWN = 12  # joints in a table; a longer robot shows its hardest


def _hardest(use: Floats) -> list[int]:
    """Returns all joints in chain order, or the hardest of many, hardest first."""
    if len(use) <= _SHOWN:
        return list(range(len(use)))
    return [int(i) for i in np.argsort(-significant(use), kind="stable")[:_SHOWN]]


def _mean(time: Floats, values: Floats) -> Floats:
    return np.asarray(np.trapezoid(values, time, axis=0) / (time[-1] - time[0]))


def _vector(value: ArrayLike) -> Floats:
    from snakegen.statics.joint_torques import finite

    return finite(value, (3,), "gravity")
