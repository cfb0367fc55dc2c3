"""Limit of a push on a body whose rotors' thrust factors are known: the plant's draw.

A rotor gives f times the thrust it is commanded, up to its ceiling. Within an apparatus unequal
factors move the centre of thrust; the allocator does not know them, its integrals do. Masses,
servos and sensors are nominal here.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from snakegen.analysis.allocation import Allocation, allocation
from snakegen.analysis.push_margins import servo_bounds
from snakegen.base.geometry import skew
from snakegen.control.controller import Controller
from snakegen.control.servos import bounded_joints
from snakegen.kernels.control.types import VIRTUAL
from snakegen.robot.robot import Robot
from snakegen.statics.joint_loads import joint_loads
from snakegen.statics.largest_push import largest_push
from snakegen.statics.vectored_body import vectored_body, with_draw
from snakegen.wrench_margins.inputs import force_map
from snakegen.wrench_margins.rays import Bounds, inverse_ray, thrust_ray, vectored_ray

Floats = NDArray[np.float64]


def informed_limit(
    robot: Robot, controller: Controller, q: Floats, push: Floats, link: str, factors: Floats
) -> float:
    """Returns the multiple of `push` at which a limit is met, thrust factors known.

    Args:
        robot, controller: the allocator and the mode are the controller's.
        q: (nq,) hover posture, level.
        push: (6,) on the robot, N and N·m about the CoG, root-link axes.
        link: that carries it.
        factors: (n,) thrust of each rotor over its command; 1 for a nominal rotor.

    Returns:
        t; nan where hover itself is beyond a limit.
    """
    a, constrained = allocation(robot, q), bool(controller.law.constrained)
    if controller.mode == VIRTUAL:
        return _virtual(robot, q, a, push, link, factors, constrained)
    return _dual(robot, q, a, push, link, factors, constrained)


def _virtual(
    robot: Robot, q: Floats, a: Allocation, push: Floats, link: str, factors: Floats,
    constrained: bool,
) -> float:  # fmt: skip
    """Returns the limit in virtual-single-rotor mode, whose rotors share a command."""
    rotors, limit = robot.rotors, robot.gimbals.limit
    owner, count = rotors.apparatus, np.bincount(rotors.apparatus)
    gain = np.bincount(owner, factors) / count
    points, drag = true_points(robot, a, factors)
    moved, true = points - a.thrust_points, force_map(points, drag)
    bounds = _moved_bounds(robot, q, link, moved)
    if constrained:
        ceiling = np.bincount(owner, np.minimum(factors, 1.0) * rotors.thrust_max)
        return vectored_ray(true, ceiling, a.hover_wrench, push, bounds).t
    weights = np.repeat(limit, 3)
    nominal = weights[:, None] * np.linalg.pinv(force_map(a.thrust_points, a.drag) * weights)
    given = np.repeat(gain, 3)[:, None] * nominal
    inverse = given @ np.linalg.pinv(true @ given)
    ceiling = np.bincount(owner, rotors.thrust_max)
    return inverse_ray(inverse, a.hover_wrench, push, 0.0, ceiling, bounds, balls=True).t


def informed_least_forces(
    robot: Robot,
    q: Floats,
    push: Floats,
    link: str,
    factors: Floats,
    offsets: Floats,
    expected: float,
) -> float:
    """Returns the multiple of `push` that least forces within limits hold, the draw known.

    Args:
        robot: in virtual-single-rotor mode, with the constrained allocator.
        q, push, link, factors: as `informed_limit`.
        offsets: (k,) N·m, of the torques that the bounded joints' servos report; none if empty.
        expected: multiple to expect, the prediction of the nominal body.
    """
    body = vectored_body(robot, q, push, link)
    known = dict(zip(bounded_joints(robot), offsets, strict=False))
    off = np.array([known.get(name, 0.0) for name in body.joints])
    return largest_push(with_draw(body, factors, off), expected).t


def true_points(robot: Robot, a: Allocation, factors: Floats) -> tuple[Floats, Floats]:
    """Returns the centres of thrust (Ñ, 3) [m] and drags (Ñ,) [m] of rotors of these factors."""
    rotors, owner = robot.rotors, robot.rotors.apparatus
    shares = factors / np.bincount(owner, factors)[owner]
    points = [np.bincount(owner, shares * x) for x in a.rotor_positions.T]
    return np.array(points, float).T, np.asarray(np.bincount(owner, shares * rotors.torque_ratio))


def _moved_bounds(robot: Robot, q: Floats, link: str, moved: Floats) -> Bounds:
    """Returns the servo limits at q with thrust points displaced by `moved` (Ñ, 3)."""
    bounds, names = servo_bounds(robot, q, link, True)
    rows = bounds.rows.copy()
    for j, apparatus in enumerate(robot.modules.apparatuses):
        body = joint_loads(robot, q, apparatus.rotors[0].link)
        kept = [body.names.index(n) for n in names]
        rows[:, 3 * j : 3 * j + 3] += body.disturbance[kept, 3:] @ skew(moved[j])
    return Bounds(rows, bounds.bias, bounds.wrench, bounds.limit)


def _dual(
    robot: Robot, q: Floats, a: Allocation, push: Floats, link: str, factors: Floats,
    constrained: bool,
) -> float:  # fmt: skip
    """Returns the limit in dual-rotor mode, over [f_z; τ]."""
    rotors, (bounds, _) = robot.rotors, servo_bounds(robot, q, link, False)
    part, high = slice(2, 6), rotors.thrust_max
    if constrained:
        limits = (factors * rotors.thrust_min, np.minimum(factors, 1.0) * high)
        return thrust_ray(a.dual, *limits, a.hover_wrench, push, bounds, part=part).t
    true: Any = a.dual[part]
    given = factors[:, None] * (high[:, None] * np.linalg.pinv(true * high))
    inverse = given @ np.linalg.pinv(true @ given)
    limits = (rotors.thrust_min, high)
    hover = a.hover_wrench[part]
    return inverse_ray(inverse, hover, push[part], *limits, bounds, joint_push=push).t
