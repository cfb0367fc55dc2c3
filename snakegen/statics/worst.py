"""The posture whose joints are loaded hardest: samples inside the limits, then local search.

What the search finds is a lower bound; `worst_bound` closes the bracket from above.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.geometry import Floats
from snakegen.base.rounding import least
from snakegen.errors import AnalysisError
from snakegen.kernels.dynamics.inverse_dynamics import torques_batch
from snakegen.kernels.dynamics.torque_terms import EXTERNAL, GRAVITY
from snakegen.robot.followers import refuse_followers
from snakegen.robot.posture import angles_by_name, hover_gimbals, set_angle
from snakegen.robot.robot import Robot
from snakegen.statics.joint_torques import (
    DOWN,
    Wrenches,
    armature,
    declared_limits,
    finite,
    link_loads,
    torque_terms,
)
from snakegen.statics.support import Hold, hold_up
from snakegen.statics.worst_bound import use_bound


@dataclass(frozen=True)
class Worst:
    """The hardest posture found.

    Attributes:
        angles: (k,) the searched joints' angles, rad.
        value: the objective there.
        starts: local searches run.
        agreeing: how many of them ended within 0.1 % of it: few means that it may be local.
        evaluations: postures evaluated.
    """

    angles: Floats
    value: float
    starts: int
    agreeing: int
    evaluations: int


def search(
    objective: Callable[[Floats], Floats],
    lower: Floats,
    upper: Floats,
    *,
    samples: int = 1024,
    starts: int = 12,
    seed: int = 0,
    tolerance: float = 1e-5,
) -> Worst:
    """Returns the largest `objective` over a box: Sobol samples, then compass search from the best.

    The largest torque over joints has kinks, so the local search uses no derivative: it tries
    ± a step along each joint, all of them in one batch, moves to the best, and halves the step
    where none is better. It is a lower bound of the true worst.

    Args:
        objective: (m, k) angles to (m,) values.
        lower, upper: (k,) finite limits.
        samples, starts, seed: how many Sobol points, how many of the best are refined.
        tolerance: the step, as a share of the range, at which a search ends.

    Raises:
        AnalysisError: limits that are not finite or upside down.
    """
    from scipy.stats import qmc

    k = len(lower)
    if not (np.all(np.isfinite(lower)) and np.all(np.isfinite(upper)) and np.all(lower <= upper)):
        raise AnalysisError("the worst posture needs finite joint limits, lower ≤ upper.")
    if k == 0:
        return Worst(np.zeros(0), float(objective(np.zeros((1, 0)))[0]), 0, 0, 1)
    size = 2 ** int(np.ceil(np.log2(max(samples, 2))))
    points = lower + qmc.Sobol(k, seed=seed).random(size) * (upper - lower)
    points = np.vstack([points, 0.5 * (lower + upper), np.clip(np.zeros(k), lower, upper)])
    values = objective(points)
    best = np.argsort(values)[::-1][: max(starts, 1)]
    ends, used = [], len(points)
    for i in best:
        x, value, count = _climb(objective, points[i], values[i], lower, upper, tolerance)
        ends.append((value, x))
        used += count
    value, x = max(ends, key=lambda end: end[0])
    agreeing = sum(v >= value - 1e-3 * abs(value) for v, _ in ends)
    return Worst(x, float(value), len(ends), int(agreeing), used)


def _climb(
    objective: Callable[[Floats], Floats],
    x: Floats,
    value: float,
    lower: Floats,
    upper: Floats,
    tolerance: float,
) -> tuple[Floats, float, int]:
    """Returns the end of one compass search, its value and the postures it took."""
    directions = np.vstack([np.eye(len(x)), -np.eye(len(x))])
    step, used = 0.25, 0
    while step > tolerance:
        trial = np.clip(x + step * directions * (upper - lower), lower, upper)
        found = objective(trial)
        used += len(trial)
        i = int(np.argmax(found))
        if found[i] > value + 1e-12 * abs(value):
            # Along a good direction the others often improve too: try them together.
            better = found > value
            pool = np.clip(x + (trial[better] - x).sum(axis=0), lower, upper)
            together = objective(pool[None])[0]
            used += 1
            x, value = (pool, together) if together > found[i] else (trial[i], found[i])
        else:
            step *= 0.5
    return x, float(value), used


def worst_posture(
    robot: Robot,
    q: ArrayLike,
    *,
    wrenches: Wrenches = None,
    gravity: ArrayLike = DOWN,
    hold: Hold = "auto",
    thrust: ArrayLike | None = None,
    samples: int = 1024,
    starts: int = 12,
    seed: int = 0,
    tolerance: float | None = None,
) -> dict[str, Any]:
    """Returns the posture inside the joint limits in which a servo is used hardest, at rest.

    Chain joints move, the others stay as in q; `wrenches` keep their directions in the world.
    Whether the base is held or the robot hovers is decided in q. In hover the gimbals of every
    posture point the thrust up (`hover_gimbals`, from gimbal angles of 0), `support` balances the
    load as it does for a single posture, and postures in which it cannot are left out. `use` is
    found by multi-start search, `agreeing` of `starts` searches ended at it; with the base held
    `use_bound` is what no posture exceeds (`worst_bound`), else null. `posture` has the gimbals'
    angles too: `analyze` gives the same use there.

    Raises:
        AnalysisError: limits that are not finite, no chain joint or none with a declared effort, no
            posture that can hover.
    """
    q = robot.validate_configuration(q)
    names = robot.chain_joints
    refuse_followers(robot.name, robot.followers, "the search of the worst posture")
    if not names:
        raise AnalysisError(f"{robot.name} has no joint that shapes it: every posture is the same.")
    lower, upper, _ = robot.limits(names)
    limit = declared_limits(robot, names)
    if np.all(np.isinf(limit)):
        raise AnalysisError(f"{robot.name}: no joint declares an effort; give one in its <limit>.")
    given: dict[str, Any] = {"wrenches": wrenches, "gravity": gravity}
    kind = hold_up(robot, q, hold=hold, thrust=thrust, **given).kind
    if kind == "base":
        torques = _held_torques(robot, q, names, **given)
    else:
        torques = _hover_torques(robot, q, names, thrust=thrust, **given)
    found = search(
        lambda x: np.nan_to_num(np.max(np.abs(torques(x)) / limit, axis=1), nan=-np.inf),
        lower,
        upper,
        samples=samples if kind == "base" else min(samples, 256),
        starts=starts if kind == "base" else min(starts, 4),
        seed=seed,
        tolerance=tolerance or (1e-5 if kind == "base" else 1e-3),  # hover costs 1 ms a posture
    )
    if not np.isfinite(found.value):
        raise AnalysisError(f"{robot.name}: no posture was found in which it can hover.")
    use = np.abs(torques(found.angles[None])[0]) / limit
    bound = use_bound(robot, q, **given) if kind == "base" else None
    posture = dict(zip(names, found.angles.tolist(), strict=True))
    if kind != "base":
        there = _hover_configuration(robot, q, posture)
        kind = hold_up(robot, there, hold=hold, thrust=thrust, **given).kind
        named = angles_by_name(robot, there)
        posture |= {n: named[n] for n in robot.joint_names if n in robot.gimbal_names}
    return {
        "posture": posture,
        "support": kind,
        "use": found.value,
        "use_bound": bound,
        "joint": names[least(-use)],
        "starts": found.starts,
        "agreeing": found.agreeing,
        "evaluations": found.evaluations,
    }


Torques = Callable[[Floats], Floats]


def _held_torques(
    robot: Robot,
    q: Floats,
    names: Sequence[str],
    wrenches: Wrenches,
    gravity: ArrayLike,
) -> Torques:
    """Returns a function from (m, k) angles of joints `names` to their torques, base held."""
    index = np.array([robot.body_of_joint(n) - 1 for n in names], int)
    loads, g = link_loads(robot, wrenches), finite(gravity, (3,), "gravity")
    base, start = robot.base_pose(q)[0], robot.angles(q)

    def torques(angles: Floats) -> Floats:
        full = np.tile(start, (len(angles), 1))
        full[:, index] = angles
        still = np.zeros((len(angles), 6 + len(start)))
        bases = np.tile(base, (len(angles), 1, 1))
        out = torques_batch(robot.tree, armature(robot), g, bases, full, still, still, loads)
        return np.asarray(out[:, 6 + index])

    return torques


def _hover_configuration(robot: Robot, q: Floats, angles: Mapping[str, float]) -> Floats:
    """Returns q at the chain's `angles`, every thrust pointed up from gimbal angles of 0."""
    there = q.copy()
    for name in robot.gimbal_names:
        low, high, _ = robot.limits([name])
        set_angle(robot, there, name, float(np.clip(0.0, low[0], high[0])))
    for name, angle in angles.items():
        set_angle(robot, there, name, angle)
    return hover_gimbals(robot, there)


def _hover_torques(
    robot: Robot,
    q: Floats,
    names: Sequence[str],
    wrenches: Wrenches,
    gravity: ArrayLike,
    thrust: ArrayLike | None = None,
) -> Torques:
    """Returns the same in hover, or under `thrust`; NaN where no hover within the limits holds."""
    index = np.array([robot.body_of_joint(n) - 1 for n in names], int)
    given: dict[str, Any] = {"wrenches": wrenches, "gravity": gravity}

    def one(angles: Floats) -> Floats:
        there = _hover_configuration(robot, q, dict(zip(names, angles, strict=True)))
        try:
            held = hold_up(robot, there, hold="hover", thrust=thrust, **given)
        except AnalysisError:
            return np.full(len(index), np.nan)
        rows = torque_terms(robot, there, body_wrenches=held.wrenches, **given)
        return np.asarray((rows[GRAVITY] + rows[EXTERNAL])[6 + index])

    def torques(angles: Floats) -> Floats:
        return np.array([one(x) for x in angles])

    return torques
