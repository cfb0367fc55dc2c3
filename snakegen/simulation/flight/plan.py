"""Plans: what a mission asks for at every tick, sampled before the run starts."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.geometry import Floats, rotation_from_xyzw
from snakegen.base.sample_store import in_pieces, slices
from snakegen.errors import MissionError
from snakegen.scene.solids import Solid

PEAK_RATE = 15.0 / 8.0  # largest slope of the quintic below


@dataclass(frozen=True)
class Failure:
    """Rotors that stop at `time` [s]; the controller learns of it at `detected` [s]."""

    time: float
    detected: float
    rotors: tuple[int, ...]


@dataclass(frozen=True)
class Box:
    """An obstacle: centre and half sizes [m], turned from the world's axes by `roll` about x."""

    name: str
    centre: tuple[float, float, float]
    half: tuple[float, float, float]
    roll: float = 0.0  # rad


@dataclass(frozen=True, eq=False)
class Plan:
    """References over a run of T ticks, and where it starts.

    Attributes:
        time: (T,) s.
        position, velocity, acceleration: (T, 3) of the CoG, world.
        rotation: (T, 3, 3) attitude of the root link, in the world.
        angular: (T, 3) rad/s, its own axes.
        joints: (T, k) rad, of the joints that shape the body.
        start: (nq,) configuration at t = 0.
        on_floor: whether the run starts at rest on the floor, rotors off.
        window: s, from and to, that the metrics judge.
        events: (time, text).
        thresholds: of the verdict, over the defaults; None takes a check out.
        mode: (T,) the mode flown: 1 virtual-single-rotor, 0 dual-rotor; None: the robot's own.
        disturbance: (T, 6) N, N·m, world, on `disturbance_link`; None for none.
        disturbance_link: name; the root link if empty.
        disturbance_at_cog: whether the wrench is about the CoG (carried by the link), not about
            the link's origin.
        wind: (T, 3) m/s, world, in addition to the plant's own; None for none.
        turbulence: m/s, standard deviation of the air's, in addition to the plant's own.
        failures: rotors lost on the way.
        obstacles: solids in the world.
        give_up: m, distance of the CoG from its target at which the run ends.
        tracked: whether the flight is to follow its references undisturbed, and is judged so.
        disturbed: whether it is a hover that its disturbance or wind displaces once, and is judged
            by its linear response (`disturbance_budget`).
        trim: ticks of hover at the start, at times below the mission's 0, in which the integrals
            run faster (`trim.trimmed`).
        facts: what the mission wants in the log, as JSON.
        kind: by which tracking is judged; the mission's name if empty.
        drawn: more of these facts by what the plant drew: thrust factors (n,), and offsets
            (l,) [N·m] of the torques that servos report; None for none.
        settling: s, in which integrals settle along the plan; 0: as the gains have it.
        rate_filter: Hz, low-pass on measured rates where the robot has none of its own; 0: none.
    """

    time: Floats
    position: Floats
    velocity: Floats
    acceleration: Floats
    rotation: Floats
    angular: Floats
    joints: Floats
    start: Floats
    on_floor: bool = False
    window: tuple[float, float] | None = None
    events: tuple[tuple[float, str], ...] = ()
    thresholds: dict[str, dict[str, Any] | None] = field(default_factory=dict)
    mode: Floats | None = None
    disturbance: Floats | None = None
    disturbance_link: str = ""
    disturbance_at_cog: bool = False
    wind: Floats | None = None
    turbulence: float = 0.0
    failures: tuple[Failure, ...] = ()
    obstacles: tuple[Box | Solid, ...] = ()
    give_up: float = float("inf")
    tracked: bool = True
    disturbed: bool = False
    trim: int = 0
    facts: dict[str, Any] = field(default_factory=dict)
    kind: str = ""
    drawn: Callable[[Floats, Floats], dict[str, Any]] | None = None
    settling: float = 0.0
    rate_filter: float = 0.0


def is_constant(rows: Floats) -> bool:
    """Tells whether rows of a plan are one that represents all."""
    return len(rows) > 1 and rows.strides[0] == 0


def farthest(rows: Floats) -> float:
    """Returns the largest difference of any number in rows of a plan from the first row's."""
    if is_constant(rows):
        return 0.0
    found = (np.abs(rows[part] - rows[0]).max(initial=0.0) for part in slices(len(rows)))
    return float(max(found, default=0.0))


def quintic(s: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Returns value, slope and curvature of ``10 s³ − 15 s⁴ + 6 s⁵`` on 0…1, held outside."""
    inside = np.clip(np.asarray(s, float), 0.0, 1.0)
    moving = (inside > 0.0) & (inside < 1.0)
    value = inside**3 * (10.0 + inside * (6.0 * inside - 15.0))
    slope = np.where(moving, 30.0 * inside**2 * (1.0 - inside) ** 2, 0.0)
    curve = np.where(moving, 60.0 * inside * (1.0 - inside) * (1.0 - 2.0 * inside), 0.0)
    return value, slope, curve


def through(time: Floats, knots: ArrayLike, points: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Returns value, rate and acceleration (T, k) of a path that rests at each point.

    Between two points a quintic runs; its largest rate is 15/8 of the mean rate.

    Args:
        time: (T,) s.
        knots: (m,) s, rising.
        points: (m, k).

    Raises:
        MissionError: knots that do not rise, or of another count than the points.
    """
    at, goal = np.asarray(knots, float), np.asarray(points, float)
    if at.ndim != 1 or len(at) != len(goal) or np.any(np.diff(at) <= 0):
        raise MissionError(f"waypoint times {at.tolist()} must rise, one for each waypoint.")

    def rows(part: slice) -> tuple[Floats, Floats, Floats]:
        now = time[part]
        value = np.repeat(goal[:1], len(now), axis=0)
        rate, bend = np.zeros_like(value), np.zeros_like(value)
        for k in range(len(at) - 1):
            span = at[k + 1] - at[k]
            if at[k] > now[-1]:
                break
            f, df, ddf = quintic((now - at[k]) / span)
            step = goal[k + 1] - goal[k]
            value += f[:, None] * step
            rate += df[:, None] * step / span
            bend += ddf[:, None] * step / span**2
        return value, rate, bend

    value, rate, bend = in_pieces(len(time), rows)
    return value, rate, bend


def gradient(values: Floats, time: Floats, part: slice) -> Floats:
    """Returns the derivatives of some rows (n, k) of values (T, k) at times (T,) [s]."""
    around = slice(max(part.start - 1, 0), part.stop + 1)
    found = np.gradient(values[around], time[around], axis=0)
    return np.asarray(found[part.start - around.start :][: part.stop - part.start])


def knots_for(points: ArrayLike, rate: float, *, start: float = 0.0, least: float = 1.0) -> Floats:
    """Returns times (m,) for joint waypoints (m, k) so that no joint is faster than `rate`.

    Args:
        points: rad.
        rate: rad/s, the largest.
        start: s, of the first waypoint.
        least: s, between two waypoints.
    """
    goal = np.asarray(points, float)
    span = PEAK_RATE * np.abs(np.diff(goal, axis=0)).max(axis=1, initial=0.0) / rate
    return start + np.concatenate([[0.0], np.cumsum(np.maximum(span, least))])


def frame_targets(plan: Plan, axes: Floats) -> tuple[Floats, Floats]:
    """Returns attitude (T, 3, 3) and angular velocity (T, 3) [rad/s, own axes] of the CoG frame.

    Args:
        plan: whose attitudes are the root link's; or a part of one.
        axes: (3, 3) of the CoG frame in the root link, where the whole plan starts: it keeps its
            place there.
    """
    return plan.rotation @ axes, plan.angular @ axes


def level(count: int) -> tuple[Floats, Floats]:
    """Returns attitude (T, 3, 3) and angular velocity (T, 3) of a CoG frame held level.

    Both are read-only: one row that represents all.
    """
    return np.broadcast_to(np.eye(3), (count, 3, 3)), np.broadcast_to(0.0, (count, 3))


def ticks(duration: float, rate: float) -> Floats:
    """Returns the times (T,) of a run [s].

    Raises:
        MissionError: a duration that is not positive.
    """
    if not duration > 0:
        raise MissionError(f"duration {duration:g} s: more than 0 is needed.")
    return np.arange(max(round(duration * rate), 1)) / rate


def holding(time: Floats, joints: ArrayLike, start: Floats, cog: ArrayLike, **more: Any) -> Plan:
    """Returns a plan that holds one pose and posture; `more` are further fields of `Plan`.

    The attitude held is that of `start`; `joints` are (k,), or (T, k) where they move. What stays
    is one row that represents all.
    """
    count, still = len(time), np.broadcast_to(0.0, (len(time), 3))
    rotation = np.broadcast_to(rotation_from_xyzw(start[3:7]), (count, 3, 3))
    angles = np.atleast_2d(np.asarray(joints, float))
    if len(angles) != count:
        angles = np.broadcast_to(angles, (count, angles.shape[1]))
    fields = {
        "position": np.broadcast_to(np.asarray(cog, float), (count, 3)),
        "velocity": still,
        "acceleration": still,
        "rotation": rotation,
        "angular": still,
        "joints": angles,
        "start": start,
    }
    return Plan(time, **(fields | more))
