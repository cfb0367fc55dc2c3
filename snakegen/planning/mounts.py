"""Where apparatuses are mounted, and how far their gimbals move thrust points and mass."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.robot.robot import Robot

STEEP = 0.3  # cosine of a link's slope below which the roll of its hovering gimbal is not relied on


@dataclass(frozen=True, eq=False)
class Mounts:
    """The n apparatuses, each on the body that carries its roll axis.

    Attributes:
        joint: (n,) Pinocchio joint of that body.
        pivot: (n, 3) m, point of the roll axis where the pitch axis is nearest, body axes.
        axis: (n, 3) roll axis, body axes.
        lever: (n,) m, of the thrust point across the axis, along the thrust at angles of 0.
        moment: (n,) kg m, of what the gimbals carry, likewise.
        loose: (n,) m, of the thrust point, beside `lever`, that no angle of roll explains.
        spill: (n,) kg m, likewise of the moment.
    """

    joint: tuple[int, ...]
    pivot: Floats
    axis: Floats
    lever: Floats
    moment: Floats
    loose: Floats
    spill: Floats


def zero_thrust(robot: Robot, j: int) -> Floats:
    """Returns apparatus j's thrust at gimbal angles of 0, in the axes of the link's body."""
    g = robot.gimbals
    turn = np.eye(3)
    body = int(g.thrust_body[j])
    axis = np.array(g.thrust_axis[j])
    while body != int(g.link_body[j]):
        turn = robot.tree.rotation[body] @ turn
        body = int(robot.tree.parent[body])
    return np.asarray(turn @ axis)


def mounts_of(robot: Robot) -> Mounts:
    """Returns the mounts of `robot`; see `Mounts`."""
    g, tree = robot.gimbals, robot.tree
    first = 2 if robot.floating else 1
    rows = []
    for j in range(len(g.link_body)):
        link, pair = int(g.link_body[j]), sorted((int(g.roll_body[j]), int(g.pitch_body[j])))
        inner, outer = pair
        turn = tree.rotation[inner]
        axis = turn @ tree.axis[inner]
        origin = np.array(tree.translation[inner])
        far = turn @ tree.translation[outer]
        pivot = origin + axis * (axis @ far)
        thrust = zero_thrust(robot, j)
        across = far - axis * (axis @ far)
        lever = float(across @ thrust)
        beside = float(np.linalg.norm(across - lever * thrust))
        loose = 2.0 * (beside + float(np.linalg.norm(g.thrust_point[j])))
        moment, spill = 0.0, 0.0
        for body in range(len(tree.parent)):
            if not _hangs(tree.parent, body, inner):
                continue
            mass = float(tree.mass[body])
            com = np.array(tree.com[body])
            if not _hangs(tree.parent, body, outer):
                com -= tree.axis[inner] * (tree.axis[inner] @ com)
                spill += 2.0 * mass * float(np.linalg.norm(com))
                continue
            way = [tree.translation[k] for k in _way(tree.parent, body, outer)]
            reach = sum(float(np.linalg.norm(x)) for x in [com, *way])
            moment += mass * lever
            spill += 2.0 * mass * (reach + beside)
        rows.append((link + first - 1, pivot, axis, lever, moment, loose, spill))
    joint, pivots, axes, levers, moments, looses, spills = zip(*rows, strict=True)
    return Mounts(
        tuple(int(j) for j in joint),
        np.array(pivots),
        np.array(axes),
        np.array(levers),
        np.array(moments),
        np.array(looses),
        np.array(spills),
    )


def _hangs(parent: Any, body: int, other: int) -> bool:
    """Tells whether `body` is `other` or hangs on it."""
    while body > other:
        body = int(parent[body])
    return body == other


def _way(parent: Any, body: int, other: int) -> list[int]:
    """Returns the bodies from `body` up to `other`, that one left out."""
    out = []
    while body != other:
        out.append(body)
        body = int(parent[body])
    return out
