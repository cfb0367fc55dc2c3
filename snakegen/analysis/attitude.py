"""Best attitude: how to tilt the whole body so that its margin is largest."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from snakegen.base.geometry import Floats, rotation_about, rotation_from_rpy, rpy_from_rotation
from snakegen.errors import AnalysisError, SnakegenError, near
from snakegen.robot.posture import hover_gimbals
from snakegen.robot.robot import Robot
from snakegen.sensitivity.margin_gradient import DUAL, VIRTUAL, margin_gradients
from snakegen.sweep.batch import FLAGS, Body
from snakegen.sweep.batch import table as as_table
from snakegen.sweep.steepest import AIM, KINDS
from snakegen.sweep.worker import work

COMMAND = "attitude"
ORDER = 60
REPORT = False  # a search: on request, not on every page
_ROUNDS, _TRIES = 30, 8
_STEPS = 0.05 * 4.0 ** -np.arange(8.0)  # rad
_UNITS = {"force_margin": "N", "torque_margin": "N·m", "self_distance": "m", "closed": ""}


@dataclass(frozen=True)
class BestAttitude:
    """The attitude of the root link that makes `margin` largest; yaw does not matter.

    Attributes:
        margin: a column of a sweep.
        level: value at the posture's own attitude; -inf where hover is out of reach.
        best: largest value evaluated; -inf where hover is out of reach in all.
        rpy: rad, of the root link at `best`, yaw 0.
        worst: least finite value evaluated, the posture's own attitude included; nan if none.
        evaluated: attitudes.
        infeasible: how many of them cannot hover.
    """

    margin: str
    level: float
    best: float
    rpy: tuple[float, float, float]
    worst: float
    evaluated: int
    infeasible: int

    @property
    def unit(self) -> str:
        """The unit of the margin: N, N·m, m, or ``scaled`` by m g and m g · link length."""
        if self.margin.startswith("dual_attitude") or self.margin.endswith("wrench_margin"):
            return "scaled"
        name = self.margin.removeprefix("dual_").removesuffix("_upper")
        return _UNITS.get(name, "scaled")

    def to_json(self) -> dict[str, Any]:
        """Returns plain data for a program; N, N·m or scaled, as the margin is."""
        return {
            "margin": self.margin,
            "unit": self.unit,
            "at_given_attitude": self.level,
            "best": self.best,
            "best_base_rpy_rad": list(self.rpy),
            "least_sampled": self.worst,
            "evaluated": self.evaluated,
            "infeasible": self.infeasible,
        }

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people."""
        roll, pitch, _ = np.rad2deg(self.rpy)
        counted = f"of {self.evaluated} evaluated"
        if np.isneginf(self.best):
            return [(self.margin, f"hover out of reach in every attitude {counted}")]
        level, best, worst = (self._text(x) for x in (self.level, self.best, self.worst))
        tilt = f"root link at roll {roll:+.1f}°, pitch {pitch:+.1f}° (any yaw)"
        if self.infeasible:
            worst = f"hover out of reach in {self.infeasible}; else {worst}"
        return [
            (self.margin, f"{level} as it stands, {best} at best"),
            ("best attitude", tilt if self._matters else "any: the margin is the same"),
            ("worst attitude seen", f"{worst}, {counted}"),
        ]

    @property
    def _matters(self) -> bool:
        """Whether the attitude changes the margin by more than rounding."""
        return bool(self.infeasible or self.best - self.worst > 1e-9 * abs(self.best))

    def _text(self, value: float) -> str:
        """Returns a value with its unit, or that hover is out of reach."""
        return "hover out of reach" if np.isneginf(value) else f"{value:.4g} {self.unit}".rstrip()


def applies(robot: Robot) -> bool:
    """A robot with gimballed rotors and a free base."""
    return robot.floating and bool(robot.gimbal_names)


def analyze(
    robot: Robot, q: Floats, margin: str = "torque_margin", samples: int = 200
) -> BestAttitude:
    """Returns the attitude with the largest certified margin for the joints of q.

    Gravity's direction in the body is searched: `samples` directions spread over the sphere
    (Fibonacci) and its own, then a pattern search from the best four. From the best and from the
    worst one seen the search follows the exact derivative as long as certified margins do.
    Gimbals point up in each.

    Options:
        margin: which margin: a column of a sweep, as in force_margin
        samples: directions of gravity that the search starts from

    Raises:
        AnalysisError: no such margin, or too few samples.
    """
    if samples < 4:
        raise AnalysisError(f"samples = {samples}: at least 4 directions are needed.")
    if margin in FLAGS:
        raise AnalysisError(f"margin: '{margin}' is true or false; no attitude makes it largest.")
    joints = robot.chain_joints
    low, high, _ = robot.limits(robot.joint_names)
    chosen = np.array([robot.joint_names.index(n) for n in joints], int)
    row = np.clip(robot.angles(q)[chosen], low[chosen], high[chosen])[None]
    task = Body.of(robot, joints, np.eye(3), 1e-3).task  # all but the attitude
    seen: list[float] = []
    ups_seen: list[Floats] = []

    def value(up: Floats) -> float:
        table = as_table(joints, row, work(replace(task, base=_attitude(up)), row))
        if margin not in table.column_names or margin in joints:
            raise AnalysisError(f"no margin '{margin}'.{near(margin, table.column_names)}")
        found = float(table[margin][0].as_py())
        seen.append(-np.inf if np.isnan(found) else found)
        ups_seen.append(np.array(up))
        return seen[-1]

    base, _ = robot.base_pose(q)
    ups = np.vstack([base[2], _sphere(samples)])
    values = np.array([value(u) for u in ups])
    level = float(values[0])
    best, best_up = level, np.array(base[2])
    rng = np.random.default_rng(0)
    for start in np.argsort(values)[-4:]:
        up, here, step = ups[start], values[start], 0.2
        for _ in range(_ROUNDS):
            tries = up + step * rng.normal(size=(_TRIES, 3))
            tries /= np.linalg.norm(tries, axis=1, keepdims=True)
            found = np.array([value(t) for t in tries])
            k = int(np.argmax(found))
            if found[k] > here:
                up, here = tries[k], found[k]
            else:
                step *= 0.5
            if step < 1e-3:
                break
        if here > best:
            best, best_up = float(here), up
    best, best_up = _followed(robot, q, margin, value, best, best_up, 1.0)
    finite = np.where(np.isfinite(seen), seen, np.inf)
    if np.isfinite(finite).any():  # down from the worst one seen, which `seen` keeps
        at = int(np.argmin(finite))
        _followed(robot, q, margin, value, float(finite[at]), ups_seen[at], -1.0)
    roll, pitch, yaw = (float(x) for x in rpy_from_rotation(_attitude(best_up)))
    feasible = [x for x in seen if np.isfinite(x)]
    least, lost = min(feasible, default=np.nan), seen.count(-np.inf)
    return BestAttitude(margin, level, best, (roll, pitch, yaw), least, len(seen), lost)


def _followed(
    robot: Robot,
    q: Floats,
    margin: str,
    value: Callable[[Floats], float],
    here: float,
    up: Floats,
    sign: float,
) -> tuple[float, Floats]:
    """Returns the value and the up (3,) reached along the derivative, or against it: `sign`."""
    for _ in range(_ROUNDS if np.isfinite(here) else 0):
        way = _steepest(robot, q, _attitude(up), margin)
        if way is None:
            break
        tries = up + sign * _STEPS[:, None] * way
        tries /= np.linalg.norm(tries, axis=1, keepdims=True)
        found = np.array([value(t) for t in tries])
        k = int(np.argmax(np.where(np.isfinite(found), sign * found, -np.inf)))
        if not sign * found[k] > sign * here:
            break
        here, up = float(found[k]), tries[k]
    return here, up


def _steepest(robot: Robot, q: Floats, base: Floats, margin: str) -> Floats | None:
    """Returns the unit way (3,) of the world's up in which a margin rises most, None if none.

    Turning the body by ω takes up (in its axes) by ``u × ω``, and ``dm = g · ω``: the way is
    ``u × g``, across u. Gimbals follow: g has what their motion does.
    """
    name = margin.removeprefix("dual_").removesuffix("_upper").removesuffix("_margin")
    if name not in KINDS:
        return None
    mode = DUAL if margin.startswith("dual_") else VIRTUAL

    def aimed(turn: Floats) -> Floats:
        level = np.array(q)
        level[3:7] = (Rotation.from_matrix(base) * Rotation.from_rotvec(turn)).as_quat()
        return np.array(hover_gimbals(robot, level))

    try:
        found = margin_gradients(robot, aimed(np.zeros(3)), name, mode, ties=False, close=False)
    except SnakegenError:
        return None
    joints, by = found.by("joints"), np.array(found.by("attitude"))
    for i, turn in enumerate(AIM * np.eye(3)):
        follow = (robot.angles(aimed(turn)) - robot.angles(aimed(-turn))) / (2.0 * AIM)
        by[i] += joints @ np.where(np.abs(follow) < 1.0 / AIM, follow, 0.0)
    way = np.cross(base[2], by)
    size = float(np.linalg.norm(way))
    return way / size if np.isfinite(size) and size > 0.0 else None


def _sphere(count: int) -> Floats:
    """Returns `count` unit vectors spread evenly over the sphere (Fibonacci)."""
    i = np.arange(count) + 0.5
    z = 1.0 - 2.0 * i / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * i
    flat = np.sqrt(1.0 - z**2)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)


def _attitude(up: Floats) -> Floats:
    """Returns the yaw-free rotation (3, 3) whose body sees the world's up along `up`."""
    axis = np.cross(up, [0.0, 0.0, 1.0])
    sine = float(np.linalg.norm(axis))
    if sine < 1e-12:
        return np.eye(3) if up[2] > 0 else np.diag([1.0, -1.0, -1.0])
    turned = rotation_about(axis / sine, float(np.arctan2(sine, up[2])))
    roll, pitch, _ = rpy_from_rotation(turned)
    return rotation_from_rpy((roll, pitch, 0.0))
