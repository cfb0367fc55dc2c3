"""Gimbals along the forces that relieve an arm: their weight and thrust points turn with them.

An apparatus' force turns its gimbals, whose weight then loads the joints otherwise, which asks for
another force. Both are solved in turns; the share of servo torque that is given is that of the
posture in which they end. Bounds hold for every angle of the gimbals: `free_gimbals`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.robot.allocation_maps import mean_drag
from snakegen.robot.kinematics import forward, tip_jacobian
from snakegen.robot.posture import aim_gimbals
from snakegen.robot.robot import Robot
from snakegen.statics.thrust_relief import (
    Relieved,
    ThrustMap,
    force_along,
    least_use,
    thrust_map,
    tip_force,
)

LoadAt = Callable[[Floats], Floats]
AIMED = 1e-3  # rad, that an apparatus may point off its force
_ROUNDS = 10
_TIP_ROUNDS = 3
_GAINED = 0.01  # of a force, that another round must promise
_SHARES = (0.9, 0.7, 0.4, 0.0)
_CLOSE = 1e-3  # of a thrust limit, by which a force may leave its ball in those rounds
_STILL = 1e-6  # of a thrust limit, by which forces move in the last round
_PUSHING = 1e-3  # of a thrust limit: apparatuses with less force need not be aimed


@dataclass(frozen=True, eq=False)
class RelievedPosture:
    """An arm with its gimbals along the forces that relieve it.

    Attributes:
        q: (nq,) posture, gimbals aimed.
        load: (k,) N·m of the chain's joints without thrust, there.
        thrust: limits, and the map from forces to joints, there.
        relieved: forces and the highest share of servo torque that they leave, there.
        off: (m,) rad, by which gimbals end from their force; 0 of those that do not push.
    """

    q: Floats
    load: Floats
    thrust: ThrustMap
    relieved: Relieved
    off: Floats

    @property
    def torque(self) -> Floats:
        """Joint torques (k,) [N·m] that are left to the servos."""
        return np.asarray(self.load - self.thrust.relief @ self.relieved.forces.ravel())


def relieved_posture(robot: Robot, q: Floats, gravity: Floats, load_at: LoadAt) -> RelievedPosture:
    """Returns the arm with the forces that make the highest share of servo torque least.

    Args:
        robot: with vectoring apparatuses on gimbals, its base fixed.
        q: (nq,) posture; its gimbal angles are where the search begins.
        gravity: (3,) m/s², world.
        load_at: the chain's joint torques (k,) [N·m] without thrust in a posture.
    """
    q, forces, off = _settled(robot, q, load_at, _ROUNDS)
    reach, load = thrust_map(robot, q), load_at(q)
    free = free_gimbals(robot, q, gravity)
    bound = least_use(free.thrust, load + free.shift, free.swing).bound
    value = _share(reach, load, forces)
    return RelievedPosture(q, load, reach, Relieved(value, bound, forces), off)


def _settled(
    robot: Robot, q: Floats, load_at: LoadAt, rounds: int
) -> tuple[Floats, Floats, Floats]:
    """Returns q, the forces (m, 3) [N] along which its gimbals are, and by how much they are off.

    Each round relieves the posture in which the last one ended, until forces move no more; the
    round that leaves the least share of a servo's torque is the answer.
    """
    forces = np.full((len(robot.modules.apparatuses), 3), np.inf)
    best: tuple[float, Floats, Floats, Floats] | None = None
    for _ in range(rounds):
        reach, last = thrust_map(robot, q), forces
        forces = least_use(reach, load_at(q)).forces
        q, off = along_forces(robot, q, forces)
        share = _share(thrust_map(robot, q), load_at(q), forces)
        if best is None or share < best[0]:
            best = share, q, forces, off
        if np.abs(forces - last).max() <= _STILL * reach.limit.max():
            break
    return (q, forces, forces[:, 0]) if best is None else best[1:]


def _share(thrust: ThrustMap, load: Floats, forces: Floats) -> float:
    """Returns the highest share of a servo's torque that forces (m, 3) leave."""
    return float(np.max(np.abs(load - thrust.relief @ forces.ravel()) / thrust.effort))


def borne_at_tip(robot: Robot, q: Floats, load_at: LoadAt, pull: Floats) -> Relieved:
    """Returns a force at the tip that is borne with gimbals along the forces that hold it.

    The best of a few rounds, each checked in its own posture, or else the largest of some shares of
    what they suppose that a relieving posture can hold; nan where none holds any.

    Args:
        robot, q, load_at: as of `relieved_posture`.
        pull: (k,) N·m per newton at the tip.
    """
    first = found = tip_force(thrust_map(robot, q), load_at(q), pull, _CLOSE)
    if not np.isfinite(first.value):
        return first
    best = Relieved(np.nan, np.inf, 0.0 * first.forces)
    for _ in range(_TIP_ROUNDS):
        q, off = along_forces(robot, q, found.forces)
        value, forces = force_along(thrust_map(robot, q), load_at(q), pull, found.forces)
        if (off <= AIMED).all() and not best.value >= value:
            best = Relieved(value, np.inf, forces)
        found = tip_force(thrust_map(robot, q), load_at(q), pull, _CLOSE)
        if not np.isfinite(found.value) or found.value <= (1.0 + _GAINED) * best.value:
            break
    if np.isfinite(best.value):
        return best
    for share in _SHARES:
        size = share * first.value
        with_force = _with_force(load_at, size * pull)
        q, forces, off = _settled(robot, q, with_force, _TIP_ROUNDS)
        if _share(thrust_map(robot, q), with_force(q), forces) <= 1.0 and (off <= AIMED).all():
            return Relieved(size, np.inf, forces)
    return best


def _with_force(load_at: LoadAt, torque: Floats) -> LoadAt:
    """Returns the loads of postures less what a force adds (k,) [N·m] to all of them."""
    return lambda q: load_at(q) - torque


def along_forces(robot: Robot, q: Floats, forces: Floats) -> tuple[Floats, Floats]:
    """Returns q with gimbals along forces (m, 3) [N], and by how much (m,) [rad] each is off.

    Those without a force point up.
    """
    size = np.linalg.norm(forces, axis=1, keepdims=True)
    ways = np.where(size > 1e-9, forces / np.maximum(size, 1e-9), [0.0, 0.0, 1.0])
    aimed, off = aim_gimbals(robot, q, ways)
    return np.asarray(aimed), np.where(size[:, 0] > _PUSHING * robot.gimbals.limit, off, 0.0)


@dataclass(frozen=True, eq=False)
class FreeGimbals:
    """What gimbals can do to the loads of the chain's joints, whatever they turn to.

    Attributes:
        thrust: limits, and the map of forces at the gimbals' pivots.
        shift: (k,) N·m, to a posture's load: all weight of gimbals at their pivots.
        swing: (k,) N·m, from that at most: ``Σ m ρ |e × g|``, ρ the distance of a body's centre of
            mass from the pivot, and thrust limits times what their line passes it by.
    """

    thrust: ThrustMap
    shift: Floats
    swing: Floats


def free_gimbals(robot: Robot, q: Floats, gravity: Floats) -> FreeGimbals:
    """Returns what gimbals can do to the joints' loads.

    Args:
        robot: with apparatuses on gimbals.
        q: (nq,) posture.
        gravity: (3,) m/s², world.
    """
    tree, gimbals, angles = robot.tree, robot.gimbals, robot.angles(q)
    base = robot.base_pose(q)[0]
    rotation, place = forward(tree, base, np.zeros(3), angles)
    index = [robot.joint_names.index(n) for n in robot.chain_joints]
    axes = np.array([rotation[k + 1] @ tree.axis[k + 1] for k in index])
    sway = np.linalg.norm(np.cross(axes, gravity), axis=1)
    shift, swing = np.zeros((2, len(index)))
    drag, columns = mean_drag(robot.rotors, gimbals.link_body.size), []

    def jacobian(body: int, point: Floats) -> Floats:
        return np.asarray(tip_jacobian(tree, base, angles, body, point)[2][:, index])

    for j in range(gimbals.link_body.size):
        first = min(b for b in (gimbals.roll_body[j], gimbals.pitch_body[j]) if b >= 0)
        reach = {first: 0.0}  # m from the pivot to each turning body's origin, at most
        pivot = jacobian(first, np.zeros(3))
        columns.append((pivot[:3] + drag[j] * pivot[3:]).T)
        turned = np.abs(pivot[3:]).max(axis=0) > 0.0  # by these joints
        for body in range(first + 1, len(tree.mass)):
            if tree.parent[body] in reach:
                step = np.linalg.norm(place[body] - place[tree.parent[body]])
                reach[body] = reach[tree.parent[body]] + float(step)
        for body, far in reach.items():
            point = tree.com[body]
            weight = tree.mass[body] * gravity
            shift += (jacobian(body, point) - pivot)[:3].T @ weight
            swing += tree.mass[body] * (far + np.linalg.norm(point)) * sway * turned
        line = gimbals.thrust_point[j], gimbals.thrust_axis[j]
        aside = reach[int(gimbals.thrust_body[j])] + float(np.linalg.norm(np.cross(*line)))
        swing += gimbals.limit[j] * aside * turned
    return FreeGimbals(replace(thrust_map(robot, q), relief=np.hstack(columns)), shift, swing)
