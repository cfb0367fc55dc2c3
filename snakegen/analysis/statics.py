"""Statics: joint torques of a posture, what they consist of, and what the tip can bear.

THEORY C and A5: ZS24 eqs 11-25 mended and completed, ZN23 eq 6; the law is in `statics`.
"""

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from snakegen.analysis.statics_result import StaticsResult
from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError
from snakegen.kernels.dynamics.torque_terms import DEPTHS, EXTERNAL, TERMS
from snakegen.robot.followers import coupling
from snakegen.robot.robot import Robot
from snakegen.statics.joint_torques import (
    Depth,
    Wrenches,
    declared_limits,
    joint_torques,
    torque_terms,
    twist_matrix,
)
from snakegen.statics.support import hold_up
from snakegen.statics.tip import find_tip, tip_load, tip_pose
from snakegen.statics.worst import worst_posture

__all__ = ["StaticsResult", "analyze", "applies", "joint_torques", "twist_matrix", "worst_posture"]

COMMAND = "statics"
ORDER = 60
EXAMPLE = 'arm6 --joint joint1_pitch=-0.4 --wrenches "link7=0,0,-5,0,0,0"'


def applies(robot: Robot) -> bool:
    """A robot with a joint."""
    return len(robot.joint_names) > 0


def analyze(
    robot: Robot,
    q: ArrayLike,
    *,
    v: ArrayLike | None = None,
    a: ArrayLike | None = None,
    wrenches: Wrenches = None,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
    terms: Depth = "full",
    hold: Literal["auto", "base", "hover"] = "auto",
    thrust: ArrayLike | None = None,
    tip: str | None = None,
    tip_point: ArrayLike | None = None,
    direction: ArrayLike = (0.0, 0.0, -1.0),
    worst: bool = False,
    seed: int = 0,
) -> StaticsResult:
    """Returns the joint torques of a posture, their terms, and what the tip can bear.

    Args:
        robot: any robot with a joint.
        q: as in `joint_torques`.
        seed: of that search.

    Options:
        terms: depth: static, quasi_static or full (the three agree at rest)
        wrenches: loads, as in "link4=0,0,-5,0,0,0": [force; torque] at a link, world axes
        gravity: m/s², world; 0,0,0 for none
        hold: what carries the weight: base, hover or auto
        thrust: N per rotor, comma-separated, instead of the hover's
        v: joint (and base) velocities, comma-separated
        a: joint (and base) accelerations, comma-separated
        tip: link that carries the tip; the last one if absent
        tip_point: x,y,z of the tip on that link, m
        direction: direction in which the payload pulls
        worst: search the posture, at rest, that loads a servo hardest

    Raises:
        SnakegenError: wrong shapes, NaN, names that do not exist, a hover that cannot be.
    """
    if not applies(robot):
        raise AnalysisError(f"{robot.name} has no joint: there is no torque to analyse.")
    if terms not in DEPTHS:
        raise AnalysisError(f"terms must be one of {', '.join(DEPTHS)} (got '{terms}').")
    q = robot.validate_configuration(q)
    given: dict[str, Any] = {"wrenches": wrenches, "gravity": gravity}
    held = hold_up(robot, q, hold=hold, thrust=thrust, **given)
    rows = torque_terms(robot, q, v, a, **given)
    push = torque_terms(robot, q, body_wrenches=held.wrenches, gravity=np.zeros(3))[EXTERNAL]
    first = 6 if robot.floating else 0
    if robot.followers:  # their loads go to their leaders
        through = coupling(robot.joint_names, robot.followers)
        rows[:, first:] = rows[:, first:] @ through
        push[first:] = push[first:] @ through
    depths = {k: rows[list(d)].sum(axis=0) + push for k, d in DEPTHS.items()}
    by_term = {TERMS[k]: rows[k, first:] for k in DEPTHS[terms]}
    if held.kind != "base":
        by_term["thrust"] = push[first:]
    total = depths[terms]
    limit = declared_limits(robot, robot.joint_names)
    limit[[robot.joint_names.index(n) for n in robot.followers]] = np.inf
    S = twist_matrix(robot, q)
    sigma = np.asarray(np.linalg.svd(S, compute_uv=False), float)
    end = find_tip(robot, tip, tip_point)
    load = None
    rolls = robot.floating and bool(robot.modules.screws)
    if end.body > 0 and not (rolls and held.kind == "base"):
        load = tip_load(robot, q, end, total[first:], limit, direction=direction)
    return StaticsResult(
        robot.joint_names,
        terms,
        held.kind,
        total[first:],
        limit,
        _use(total[first:], limit),
        by_term,
        _shares(by_term),
        {k: d[first:] for k, d in depths.items()},
        total[:6] if robot.floating else np.zeros(6),
        S,
        sigma,
        int(np.sum(sigma > 1e-9 * sigma[0])),
        (end.link, tip_pose(robot, q, end).position),
        load,
        worst_posture(robot, q, hold=hold, thrust=thrust, seed=seed, **given) if worst else None,
        robot.floating and bool(robot.modules.apparatuses),
        robot.gimbal_names,
        rolls,
        _free(robot, limit) | robot.followers.keys(),
        {name: leader for name, (leader, _, _) in robot.followers.items()},
    )


def _free(robot: Robot, limit: Floats) -> frozenset[str]:
    """Returns the names of the joints on drums and rotor shafts that declare no effort."""
    turning = robot.rolling_names | {robot.joint_names[b - 1] for b in robot.spinners}
    names = zip(robot.joint_names, limit, strict=True)
    return frozenset(n for n, most in names if n in turning and np.isinf(most))


def _use(torque: Floats, limit: Floats) -> Floats:
    """Returns |torque| / limit: inf for a torque against a limit of 0, 0 for none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(np.abs(torque) > 0, np.abs(torque) / limit, 0.0)


def _shares(by_term: Mapping[str, Floats]) -> dict[str, float]:
    """Returns each term's part of the sum over joints and terms of |torque|."""
    sizes = {k: float(np.sum(np.abs(v))) for k, v in by_term.items()}
    whole = sum(sizes.values())
    return {k: (x / whole if whole > 0 else 0.0) for k, x in sizes.items()}
