"""Motions: the chain's angles as functions of time, from sines, tables or functions, checked.

ZS24's Table 3 is a set of sines; any other motion is a table of waypoints through which a cubic
spline passes, or functions given to the library.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.geometry import Floats
from snakegen.base.memory import refuse_beyond
from snakegen.errors import AnalysisError, near
from snakegen.robot.robot import Robot

Sampled = tuple[Floats, Floats, Floats]
_CHECKED = 2000  # instants at which limits are looked at, at least
_PER_SAMPLE = 4  # numbers that a joint has at an instant: time, angle, rate, acceleration
_FINE = 1e-3  # s, between the nodes at which a function is sampled


@dataclass(frozen=True, eq=False)
class Motion:
    """Angles of a chain over time.

    Attributes:
        name: what it is called.
        joints: (k,) the joints that it moves, all of the chain's.
        duration: s.
        at: (m,) s → angles, rates, accelerations (m, k) [rad, rad/s, rad/s²].
    """

    name: str
    joints: tuple[str, ...]
    duration: float
    at: Callable[[Floats], Sampled]

    def times(self, rate: float) -> Floats:
        """Returns the instants (m,) [s] of `rate` samples a second, both ends included.

        Raises:
            AnalysisError: a rate that is not positive, or more samples than fit into memory.
        """
        if not rate > 0:
            raise AnalysisError(f"rate = {rate}: samples a second, above 0, are needed.")
        count = self.duration * rate * len(self.joints)
        remedy = "ask for fewer samples a second, or a shorter motion"
        refuse_beyond(
            8.0 * _PER_SAMPLE * count, f"{self.name} at {rate:g} samples a second", remedy
        )
        return np.linspace(0.0, self.duration, max(round(self.duration * rate), 1) + 1)


def sines(
    robot: Robot,
    waves: Mapping[str, Mapping[str, float]],
    duration: float,
    *,
    start: ArrayLike | None = None,
    name: str = "sines",
) -> Motion:
    """Returns ``offset + amplitude sin(2π t / period + phase)`` for each joint named.

    Args:
        robot: whose chain.
        waves: by joint: ``amplitude`` [rad], ``period`` [s], ``phase`` [rad], ``offset`` [rad].
        duration: s.
        start: (k,) rad, where joints without a wave stay; 0 if absent.
        name: of the motion.

    Raises:
        AnalysisError: an unknown joint or key, NaN, a period or duration that is not positive.
    """
    rows = np.zeros((len(robot.chain_joints), 4))  # amplitude, circular rate, phase, offset
    rows[:, 3] = _start(robot, start)
    for joint, wave in waves.items():
        keys = ("amplitude", "period", "phase", "offset")
        if not isinstance(wave, Mapping) or not {"amplitude", "period"} <= set(wave):
            raise AnalysisError(f"sines.{joint}: amplitude [rad] and period [s] are needed.")
        for key in wave:
            if key not in keys:
                raise AnalysisError(f"sines.{joint} has no field '{key}'.{near(str(key), keys)}")
        given = {k: _number(v, f"sines.{joint}.{k}") for k, v in wave.items()}
        if not given["period"] > 0:
            raise AnalysisError(f"sines.{joint}.period = {given['period']:g} s: above 0 is needed.")
        rows[_index(robot, joint)] = (
            given["amplitude"],
            2 * np.pi / given["period"],
            given.get("phase", 0.0),
            given.get("offset", rows[_index(robot, joint), 3]),
        )
    size, omega, phase, offset = rows.T

    def at(time: Floats) -> Sampled:
        turn = np.asarray(time)[:, None] * omega + phase
        wave = size * np.sin(turn)
        return offset + wave, size * omega * np.cos(turn), -(omega**2) * wave

    return checked(robot, Motion(name, robot.chain_joints, _duration(duration), at))


def waypoints(
    robot: Robot,
    time: ArrayLike,
    angles: Mapping[str, ArrayLike],
    *,
    start: ArrayLike | None = None,
    ends: str = "rest",
    name: str = "waypoints",
) -> Motion:
    """Returns the smoothest motion through a table of waypoints: a cubic spline.

    Args:
        robot: whose chain.
        time: (m,) s, rising; counted from its first entry.
        angles: (m,) rad by joint; joints not named stay at `start`.
        start: (k,) rad; 0 if absent.
        ends: ``rest``: at rest at both ends; ``free``: as the table goes (for one that is cut out
            of a motion).
        name: of the motion.

    Raises:
        AnalysisError: fewer than two waypoints, times that do not rise, NaN, an unknown joint,
            angles outside the limits.
    """
    from scipy.interpolate import CubicSpline

    t = _column(time, "time")
    if len(t) < 2 or np.any(np.diff(t) <= 0):
        row = int(np.argmax(np.diff(t) <= 0)) + 2 if len(t) >= 2 else len(t)
        raise AnalysisError(f"{name}: two waypoints or more with rising times (row {row}).")
    if ends not in ("rest", "free"):
        raise AnalysisError(f"ends must be rest or free (got '{ends}').")
    table = np.repeat(_start(robot, start)[None], len(t), axis=0)
    for joint, values in angles.items():
        column = _column(values, joint)
        if len(column) != len(t):
            raise AnalysisError(f"{name}: {len(column)} angles of {joint} for {len(t)} times.")
        table[:, _index(robot, joint)] = column
    few = len(t) < 4
    spline = CubicSpline(
        t - t[0], table, bc_type="clamped" if ends == "rest" or few else "not-a-knot"
    )
    rate, bend = spline.derivative(), spline.derivative(2)

    def at(when: Floats) -> Sampled:
        return np.asarray(spline(when)), np.asarray(rate(when)), np.asarray(bend(when))

    return checked(robot, Motion(name, robot.chain_joints, float(t[-1] - t[0]), at))


def functions(
    robot: Robot,
    angles: Mapping[str, Callable[[Floats], ArrayLike]],
    duration: float,
    *,
    start: ArrayLike | None = None,
    name: str = "functions",
) -> Motion:
    """Returns a motion from functions of time; rates come from a quintic spline through them.

    Args:
        robot: whose chain.
        angles: by joint, (m,) s → (m,) rad, smooth over a millisecond.
        duration: s.
        start: (k,) rad, where joints that are not named stay; 0 if absent.
        name: of the motion.

    Raises:
        AnalysisError: an unknown joint, NaN, a duration that is not positive, broken limits.
    """
    from scipy.interpolate import make_interp_spline

    nodes = np.linspace(0.0, _duration(duration), max(round(duration / _FINE), 6) + 1)
    table = np.repeat(_start(robot, start)[None], len(nodes), axis=0)
    for joint, f in angles.items():
        table[:, _index(robot, joint)] = np.broadcast_to(_column(f(nodes), joint), nodes.shape)
    spline = make_interp_spline(nodes, table, k=5)
    rate, bend = spline.derivative(), spline.derivative(2)

    def at(when: Floats) -> Sampled:
        return np.asarray(spline(when)), np.asarray(rate(when)), np.asarray(bend(when))

    return checked(robot, Motion(name, robot.chain_joints, duration, at))


def checked(robot: Robot, motion: Motion) -> Motion:
    """Returns `motion` if it keeps inside the joints' limits of angle and speed.

    Raises:
        AnalysisError: the joint, the instant, and what the limit is.
    """
    time = motion.times(max(_CHECKED / motion.duration, 100.0))
    angle, rate, _ = motion.at(time)
    low, high, _ = robot.limits(motion.joints)
    over = np.maximum(low - angle, angle - high) - 1e-9
    if np.any(over > 0):
        k, j = np.unravel_index(int(np.argmax(over)), over.shape)
        raise AnalysisError(
            f"{motion.name}: {motion.joints[j]} goes to {angle[k, j]:.4g} rad at {time[k]:.3g} s, "
            f"outside its limits {low[j]:.4g} … {high[j]:.4g}."
        )
    most = speed_limits(robot, motion.joints)
    over = np.abs(rate) - most * (1 + 1e-9)
    if np.any(over > 0):
        k, j = np.unravel_index(int(np.argmax(over)), over.shape)
        times = abs(rate[k, j]) / most[j]
        raise AnalysisError(
            f"{motion.name}: {motion.joints[j]} turns at {abs(rate[k, j]):.4g} rad/s at "
            f"{time[k]:.3g} s; its servo does {most[j]:.4g}: take {times:.3g} times as long."
        )
    return motion


def speed_limits(robot: Robot, names: tuple[str, ...]) -> Floats:
    """Returns the servos' speed limits (k,) [rad/s]."""
    joints = [robot.model.joints[robot.model.getJointId(n)] for n in names]
    found = np.array([float(robot.model.upperVelocityLimit[j.idx_v]) for j in joints])
    return np.where(found > 0.0, found, np.inf)  # 0 is an exporter's way to declare none


def _start(robot: Robot, start: ArrayLike | None) -> Floats:
    count = len(robot.chain_joints)
    if count == 0:
        raise AnalysisError(f"{robot.name} has no joint to move.")
    out = np.zeros(count) if start is None else np.array(start, float)
    if out.shape != (count,) or not np.all(np.isfinite(out)):
        raise AnalysisError(f"start: {count} finite angles are needed.")
    return out


def _index(robot: Robot, joint: str) -> int:
    if joint not in robot.chain_joints:
        raise AnalysisError(
            f"{robot.name} has no joint '{joint}' to move.{near(joint, robot.chain_joints)}"
        )
    return robot.chain_joints.index(joint)


def _duration(value: Any) -> float:
    number = _number(value, "duration")
    if not number > 0:
        raise AnalysisError(f"duration {number:g} s: more than 0 is needed.")
    return number


def _number(value: Any, what: str) -> float:
    good = isinstance(value, int | float | np.floating) and not isinstance(value, bool)
    if not good or not np.isfinite(value):
        raise AnalysisError(f"{what}: {value!r} is no finite number.")
    return float(value)


def _column(values: ArrayLike, what: str) -> Floats:
    try:
        out = np.atleast_1d(np.array(values, float))
    except (TypeError, ValueError):
        raise AnalysisError(f"{what}: numbers are needed.") from None
    if out.ndim != 1:
        raise AnalysisError(f"{what}: one column of numbers is needed, not shape {out.shape}.")
    bad = np.flatnonzero(~np.isfinite(out))
    if len(bad):
        raise AnalysisError(f"{what}: row {bad[0] + 1} holds NaN or infinity.")
    return out
