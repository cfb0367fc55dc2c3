"""An upper bound of the hardest posture's load, certified: no posture loads a servo more.

At rest joint i carries ``τ_i = S_i · (g × e_i)``: S_i the first moment of the loads beyond it, in
its body's frame, which later joints alone change; g the loads' common direction in that frame,
which it and earlier joints alone change. So the maximum over all postures falls into steps of one
joint each: support functions of the S_i from the tips inwards, then the use of servos as a
function of g from the tips to the base. Both are sublinear, and `kernels.sublinear` keeps upper
bounds of such functions. A branch over the box of n joints, which grows as 2ⁿ, is not needed.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.geometry import Floats
from snakegen.kernels.margins.sublinear import grid, highest, turned_table, twisting_table
from snakegen.robot.kinematics import forward
from snakegen.robot.robot import Robot
from snakegen.statics.joint_torques import DOWN, Wrenches, declared_limits, finite, link_loads

SPACING = 48  # cells along an edge of the cube
STEP = np.radians(2.0)  # between corners about a joint's arc: together 0.1 % at 12 joints
_ROUNDING = 1e-9  # relative, what floating point may lose


@dataclass(frozen=True)
class _Part:
    """A joint that is searched, and what it carries: in its body's frame, other joints held."""

    parent: int  # index of the part that carries it, -1 for the base
    mount: Floats  # (3, 3) joint frame in the parent part's frame
    place: Floats  # (3,) m
    axis: Floats  # (3,)
    weight: float  # N, of the loads on it along the common direction
    moment: Floats  # (3,) N·m, their first moment
    aside: tuple[tuple[float, float], ...]  # (N, m): loads in other directions and their levers
    couple: float  # N·m, of couples on it


def use_bound(
    robot: Robot,
    q: Floats,
    *,
    wrenches: Wrenches = None,
    gravity: ArrayLike = DOWN,
    spacing: int = SPACING,
    step: float = STEP,
) -> float | None:
    """Returns an upper bound of |torque| / limit over joints and postures within the limits.

    The base is held, chain joints move, the others stay as in q; wrenches keep their directions in
    the world. Loads along gravity are treated together; what other loads add is bounded by their
    levers. None where a chain joint slides: the bound is made for joints that turn.
    """
    names = robot.chain_joints
    bodies = [robot.body_of_joint(n) for n in names]
    if any(robot.tree.prismatic[b] for b in bodies):
        return None
    (lower, upper, _), limit = robot.limits(names), declared_limits(robot, names)
    direction, parts = _parts(robot, q, bodies, wrenches, finite(gravity, (3,), "gravity"))
    points = grid(spacing)
    most = [np.zeros(points.shape[:-1]) for _ in parts]  # of S beyond each joint, then of the use
    moment = [points @ part.moment for part in parts]
    weight = np.array([part.weight for part in parts])
    loads = [list(part.aside) for part in parts]
    couple = np.array([part.couple for part in parts])
    first = []
    for i in reversed(range(len(parts))):
        part = parts[i]
        aside = couple[i] + sum(force * lever for force, lever in loads[i])
        most[i] = twisting_table(moment[i], part.axis, 1.0 / limit[i], aside, most[i])
        turn = (part.mount, part.axis, lower[i], upper[i])
        above = part.parent
        if above < 0:
            first.append(highest(most[i], direction, *turn, step))
            continue
        most[above] = np.maximum(most[above], turned_table(most[i], *turn, step))
        moment[above] += turned_table(moment[i], *turn, step) + weight[i] * (points @ part.place)
        weight[above] += weight[i]
        far = float(np.linalg.norm(part.place))
        loads[above] += [(force, lever + far) for force, lever in loads[i]]
        couple[above] += couple[i]
    return float(max(first, default=0.0)) * (1.0 + _ROUNDING)


def _parts(
    robot: Robot, q: Floats, bodies: list[int], wrenches: Wrenches, gravity: Floats
) -> tuple[Floats, list[_Part]]:
    """Returns the loads' common direction in base axes, and the searched joints, base outwards."""
    tree, angles = robot.tree, robot.angles(q)
    angles[[b - 1 for b in bodies]] = 0.0
    rotation, position = forward(tree, np.eye(3), np.zeros(3), angles)
    carrier = np.full(len(tree.parent), -1)
    for b in range(1, len(tree.parent)):
        carrier[b] = bodies.index(b) if b in bodies else carrier[tree.parent[b]]
    loads = link_loads(robot, wrenches)
    size = float(np.linalg.norm(gravity))
    along = gravity / size if size > 0 else _along(loads[2])
    weights, moments = np.zeros(len(bodies)), np.zeros((len(bodies), 3))
    aside: list[list[tuple[float, float]]] = [[] for _ in bodies]
    couple = np.zeros(len(bodies))

    def put(body: int, point: Floats, force: float) -> Floats:
        i = carrier[body]
        own = bodies[i]
        at = rotation[own].T @ (position[body] + rotation[body] @ point - position[own])
        weights[i] += force
        moments[i] += force * at
        return np.asarray(at)

    for heavy in np.flatnonzero(carrier >= 0):
        put(int(heavy), tree.com[heavy], float(tree.mass[heavy]) * size)
    for body, point, wrench in zip(*loads, strict=True):
        if carrier[body] < 0:
            continue
        share = float(wrench[:3] @ along)
        at = put(body, point, share)
        across = float(np.linalg.norm(wrench[:3] - share * along))
        aside[carrier[body]].append((across, float(np.linalg.norm(at))))
        couple[carrier[body]] += float(np.linalg.norm(wrench[3:]))
    parts = []
    for i, b in enumerate(bodies):
        above = carrier[tree.parent[b]]
        own = bodies[above] if above >= 0 else 0
        mount = rotation[own].T @ rotation[b]
        place = rotation[own].T @ (position[b] - position[own])
        load = float(weights[i]), moments[i], tuple(aside[i]), float(couple[i])
        parts.append(_Part(int(above), mount, place, tree.axis[b].copy(), *load))
    return robot.base_pose(q)[0].T @ along, parts


def _along(forces: Floats) -> Floats:
    """Returns the direction of the largest force, z where there is none."""
    if not len(forces) or not np.any(forces[:, :3]):
        return np.array([0.0, 0.0, 1.0])
    sizes = np.linalg.norm(forces[:, :3], axis=1)
    k = int(np.argmax(sizes))
    return np.asarray(forces[k, :3] / sizes[k])
