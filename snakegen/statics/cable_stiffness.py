"""Stiffness of a posture that cables hold: elasticity of cables, their tension, weight and loads.

``K = ∂²V/∂θ² = Σ k_c a_c a_cᵀ + Σ t_c ∂²l_c/∂θ² - Σ f·∂²x/∂θ²`` with a_c = -∂l_c/∂θ: what the
joints' torques gain when they are bent by dθ, winches at rest. A posture whose tensions balance its
loads is held where every eigenvalue of K is above 0, and only there; tension itself may buckle it.
"""

from dataclasses import dataclass

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.kernels.cables.cables import Holes
from snakegen.kernels.core.types import Ints
from snakegen.robot.kinematics import forward
from snakegen.robot.robot import Robot


@dataclass(frozen=True)
class PointLoad:
    """A load that keeps its direction in the world.

    Attributes:
        body: that it acts on.
        point: (3,) m, in the body's frame.
        force: (3,) N.
        moment: (3,) N·m.
    """

    body: int
    point: Floats
    force: Floats
    moment: Floats


@dataclass(frozen=True)
class Chain:
    """Joints of a robot in a posture, in the world.

    Attributes:
        rotation, position: (b, 3, 3), (b, 3) m, of the bodies.
        axis: (n, 3) of the joints.
        revolute: (n,) whether a joint turns; else it slides.
        moves: (b, n) whether joint j moves body b.
        before: (n, n) whether joint i comes before j on one branch, or is j.
    """

    rotation: Floats
    position: Floats
    axis: Floats
    revolute: Floats
    moves: Floats
    before: Floats

    def place(self, body: Ints, point: Floats) -> Floats:
        """Returns points (h, 3) [m] of bodies (h,) given in their frames (h, 3)."""
        return self.position[body] + np.einsum("hij,hj->hi", self.rotation[body], point)

    def jacobian(self, body: Ints, place: Floats) -> Floats:
        """Returns ∂x/∂θ (h, n, 3) [m/rad] of points at `place` (h, 3) m on bodies (h,)."""
        arm = place[:, None, :] - self.position[None, 1:, :]
        turned = np.cross(self.axis[None], arm)
        rows = np.where(self.revolute[None, :, None] > 0, turned, self.axis[None])
        return np.asarray(rows * self.moves[body][:, :, None])

    def bend(self, body: Ints, jacobian: Floats, weight: Floats) -> Floats:
        """Returns ``Σ_h w_h·∂²x_h/∂θ²`` (n, n); weight (h, 3).

        ``∂²x/∂θ_i∂θ_j = e_i × ∂x/∂θ_j`` where joint i turns and comes before j, or is j.
        """
        turned = np.cross(weight[:, None, :], self.axis[None]) * self.moves[body][:, :, None]
        turned *= self.revolute[None, :, None]
        upper = np.einsum("hik,hjk->ij", turned, jacobian) * self.before
        return np.asarray(upper + np.triu(upper.T, 1) + np.tril(upper.T, -1))


def chain_of(robot: Robot, q: Floats) -> Chain:
    """Returns the joints of a robot in posture q (nq,)."""
    tree = robot.tree
    base, _ = robot.base_pose(q)
    rotation, position = forward(tree, base, np.zeros(3), robot.angles(q))
    count = len(tree.parent)
    moves = np.zeros((count, count - 1))
    for b in range(1, count):  # parents come before children
        moves[b] = moves[tree.parent[b]]
        moves[b, b - 1] = 1.0
    axis = np.einsum("bij,bj->bi", rotation, tree.axis)[1:]
    return Chain(
        rotation, position, axis, 1.0 - np.asarray(tree.prismatic[1:], float), moves, moves[1:].T
    )


@dataclass(frozen=True)
class CableGeometry:
    """Cables as straight pieces between holes, in a posture.

    Attributes:
        chain: the joints.
        body, jacobian: (h,), (h, n, 3) of the holes.
        piece: (p,) index of each piece's first hole; the next hole ends it.
        cable: (p,) whose piece it is.
        direction: (p, 3) unit, towards the tip.
        size: (p,) m.
        share: (p,) tension over that at the winch: 1 without friction.
        joints: (k,) indices of the joints that count.
    """

    chain: Chain
    body: Ints
    jacobian: Floats
    piece: Ints
    cable: Ints
    direction: Floats
    size: Floats
    share: Floats
    joints: Ints

    @property
    def count(self) -> int:
        """Number of cables."""
        return int(self.cable.max(initial=-1)) + 1

    def arms(self, share: Floats | None = None) -> Floats:
        """Returns moment arms (k, c) [m] at the winch's tension: ``-Σ share ∂l/∂θ``."""
        weight = self.share if share is None else share
        stretch = self.jacobian[self.piece + 1] - self.jacobian[self.piece]
        rates = np.einsum("pnk,pk->pn", stretch, self.direction)[:, self.joints]
        out = np.zeros((self.count, len(self.joints)))
        np.add.at(out, self.cable, -weight[:, None] * rates)
        return out.T

    def tension_stiffness(self) -> Floats:
        """Returns ``∂²l/∂θ²`` of each cable (c, k, k) [m], pieces weighted by their share."""
        out = np.zeros((self.count, len(self.joints), len(self.joints)))
        stretch = self.jacobian[self.piece + 1] - self.jacobian[self.piece]
        along = np.einsum("pnk,pk->pn", stretch, self.direction)
        across = stretch - along[:, :, None] * self.direction[:, None, :]
        select = np.ix_(self.joints, self.joints)
        for c in range(self.count):
            rows = np.flatnonzero(self.cable == c)
            scale = self.share[rows] / self.size[rows]
            flat = np.einsum("p,pik,pjk->ij", scale, across[rows], across[rows])
            ends = np.concatenate([self.piece[rows] + 1, self.piece[rows]])
            pull = self.share[rows, None] * self.direction[rows]
            weight = np.concatenate([pull, -pull])
            flat += self.chain.bend(self.body[ends], self.jacobian[ends], weight)
            out[c] = flat[select]
        return out


def cable_geometry(
    robot: Robot, q: Floats, holes: Holes, joints: Ints, friction: float = 0.0
) -> CableGeometry:
    """Returns the pieces of cables in posture q (nq,).

    Args:
        robot: whose joints.
        q: (nq,) posture.
        holes: the routing.
        joints: (k,) indices of the joints that count.
        friction: coefficient of cable on hole. Behind a hole that turns the cable by φ its tension
            is ``e^(-μ φ)`` of that before it (capstan): that of cables which are being wound in.
    """
    chain = chain_of(robot, q)
    place = chain.place(holes.body, holes.point)
    jacobian = chain.jacobian(holes.body, place)
    last = holes.first[1:] - 1
    piece = np.setdiff1d(np.arange(len(place)), last)
    cable = np.searchsorted(holes.first, piece, side="right") - 1
    step = place[piece + 1] - place[piece]
    size = np.linalg.norm(step, axis=1)
    size = np.where(size > 0, size, 1e-300)
    direction = step / size[:, None]
    share = np.ones(len(piece))
    if friction > 0:
        for k in range(1, len(piece)):
            if cable[k] == cable[k - 1]:
                turn = np.arctan2(
                    np.linalg.norm(np.cross(direction[k - 1], direction[k])),
                    direction[k - 1] @ direction[k],
                )
                share[k] = share[k - 1] * np.exp(-friction * turn)
    return CableGeometry(chain, holes.body, jacobian, piece, cable, direction, size, share, joints)


def load_stiffness(
    robot: Robot, chain: Chain, gravity: Floats, loads: tuple[PointLoad, ...], joints: Ints
) -> Floats:
    """Returns what weight and loads add to the stiffness (k, k) [N·m/rad], its symmetric part.

    Args:
        robot: whose bodies weigh.
        chain: its joints in the posture.
        gravity: (3,) m/s².
        loads: that keep their direction.
        joints: (k,) indices of the joints that count.
    """
    tree = robot.tree
    body = np.concatenate(
        [np.arange(1, len(tree.parent)), np.array([x.body for x in loads], np.int64)]
    ).astype(np.int64)
    points = np.vstack([tree.com[1:], *(x.point for x in loads)])
    forces = np.vstack([tree.mass[1:, None] * gravity, *(x.force for x in loads)])
    jacobian = chain.jacobian(body, chain.place(body, points))
    total = -chain.bend(body, jacobian, forces)
    for load in loads:
        if np.any(load.moment):
            turned = np.cross(chain.axis[None, :], chain.axis[:, None])  # [i, j] = e_j × e_i
            strictly = chain.before.T - np.eye(len(chain.axis))  # joint j before i
            both = (
                chain.revolute[:, None] * chain.revolute * np.outer(*[chain.moves[load.body]] * 2)
            )
            total -= strictly * both * (turned @ load.moment)
    total = 0.5 * (total + total.T)
    return np.asarray(total[np.ix_(joints, joints)])
