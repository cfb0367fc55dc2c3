"""Times of waypoints, so that no rate is beyond its limit."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.planning.body import PlannedBody
from snakegen.planning.trajectory import Trajectory
from snakegen.robot.posture import turning_rates
from snakegen.scene.schema import Demands

TURN_RATE = 0.3  # rad/s, of the root link
TURN_ACCELERATION = 0.3  # rad/s²
JOINT_ACCELERATION = 0.3  # rad/s²
_RAMP = (4.0, 2.5, 1.8, 1.4, 1.2)  # longer intervals at the ends, where the body speeds up
_SAMPLES = 12  # instants of each interval that are looked at
_ROUNDS = 40
_STEP = 1.3  # by which an interval changes in a round at most
_SLOWER = 8  # rounds of lengthening for gimbals and thrusts


@dataclass(frozen=True, eq=False)
class Rates:
    """Limits of a pose's rates and accelerations.

    Attributes:
        speed: m/s, turn: rad/s, joints: (k,) rad/s.
        acceleration: m/s², rad/s², and rad/s² of each joint.
    """

    speed: float
    turn: float
    joints: Floats
    acceleration: tuple[float, float, float]


def rates_of(body: PlannedBody, demands: Demands) -> Rates:
    """Returns the limits that demands and servos set."""
    servos = turning_rates(body.robot, body.names)
    return Rates(
        demands.cog_speed,
        TURN_RATE,
        np.minimum(servos, demands.joint_rate),
        (demands.cog_acceleration, TURN_ACCELERATION, JOINT_ACCELERATION),
    )


def smoothed(poses: Floats, rounds: int = 4) -> Floats:
    """Returns poses after rounds of the mean ¼, ½, ¼ over neighbours; both ends stay."""
    out = poses.copy()
    for _ in range(rounds):
        out[1:-1] = 0.25 * out[:-2] + 0.5 * out[1:-1] + 0.25 * out[2:]
    return out


def paced(poses: Floats, rates: Rates) -> Floats:
    """Returns times (m,) [s] at which poses could be, from differences alone; see `timed`."""
    spans = 1.3 * _use(np.diff(poses, axis=0)[:, None], rates, 1.0)[:, 0]
    return np.concatenate([[0.0], np.cumsum(spans)])


def timed(poses: Floats, rates: Rates, heading: float = 0.0, digits: int = 6) -> Trajectory:
    """Returns the trajectory through poses, as fast as limits of rate and acceleration allow.

    Times come from differences first, then `_refined`. Poses and times are rounded, so that what is
    written to a file is the same trajectory.
    """
    poses = np.round(poses, digits)
    poses = poses[np.concatenate([[True], np.any(np.diff(poses, axis=0) != 0.0, axis=1)])]
    steps = np.diff(poses, axis=0)
    spans = np.maximum(_use(steps[:, None], rates, 1.0)[:, 0], 0.02)
    for k, ramp in enumerate(_RAMP[: len(spans) // 2]):
        spans[k] *= ramp
        spans[-1 - k] *= ramp
    return _refined(poses, _even(spans), rates, heading)


def slowed(path: Trajectory, rates: Rates, use: Callable[[Trajectory], Floats]) -> Trajectory:
    """Returns a path slowed down until what it asks of other actuators is within their limits.

    Args:
        path: from `timed`.
        rates: its limits.
        use: returns the largest share (m,) of a limit that each interval takes, at the path's pace.
    """
    for _ in range(_SLOWER):
        more = np.maximum(1.0, use(path))
        if more.max() <= 1.0:
            break
        more = np.maximum.reduce([more, *(np.roll(more, k) for k in (-1, 1))])
        spans = _even(np.diff(path.times) * np.minimum(1.05 * more, 3.0))
        path = _refined(path.poses, spans, rates, path.heading, shorter=False)
    return path


def _refined(
    poses: Floats, spans: Floats, rates: Rates, heading: float, shorter: bool = True
) -> Trajectory:
    """Returns the quickest trajectory found whose rates and accelerations keep their limits.

    Intervals take on the root of what they use of a limit, with their neighbours', round by round;
    of each round what remains beyond a limit would slow the whole path down, and the quickest is
    kept.

    Args:
        poses: (m, 6 + k).
        spans: (m - 1,) s, where to begin.
        rates: limits.
        heading: of the poses.
        shorter: whether intervals may become shorter, too.
    """
    best, least = spans, np.inf
    bends = _bends(rates, len(rates.joints))
    for _ in range(_ROUNDS):
        path = _of(poses, spans, heading)
        t = path.times[:-1, None] + np.linspace(0.0, 1.0, _SAMPLES) * np.diff(path.times)[:, None]
        fast = _use(path.at(t, 1), rates, 1.0).max(axis=1)
        more = np.maximum(fast, np.sqrt(_use(path.at(t, 2), bends, 1.0).max(axis=1)))
        worst = max(1.0, float(more.max()))
        if worst * spans.sum() < least:
            best, least = worst * spans, worst * float(spans.sum())
        if worst == 1.0 and not shorter:
            break
        more = np.maximum.reduce([more, *(np.roll(more, k) for k in (-1, 1))])
        change = np.clip(np.sqrt(more), 1.0 / _STEP if shorter else 1.0, _STEP)
        spans = _even(spans * change)
    return _of(poses, 1.001 * best, heading)


def _of(poses: Floats, spans: Floats, heading: float) -> Trajectory:
    return Trajectory(np.round(np.concatenate([[0.0], np.cumsum(spans)]), 4), poses, heading)


def _bends(rates: Rates, count: int) -> Rates:
    a, b, c = rates.acceleration
    return replace(rates, speed=a, turn=b, joints=np.full(count, c))


def _use(values: Floats, rates: Rates, over: float) -> Floats:
    """Returns the largest share (m, n) of a limit that rates (m, n, 6 + k) take, times `over`."""
    shares = np.concatenate(
        [
            np.linalg.norm(values[..., :3], axis=-1)[..., None] / rates.speed,
            np.linalg.norm(values[..., 3:6], axis=-1)[..., None] / rates.turn,
            np.abs(values[..., 6:]) / rates.joints,
        ],
        axis=-1,
    )
    return np.asarray(over * shares.max(axis=-1))


def _even(spans: Floats) -> Floats:
    """Returns intervals no shorter than given, and no shorter than ⅔ of their neighbours."""
    out = spans.copy()
    for _ in range(3):
        out = np.maximum.reduce([out, np.roll(out, 1) / 1.5, np.roll(out, -1) / 1.5])
    return out
