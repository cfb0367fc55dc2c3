"""Statics of a rigid body whose gimbals turn: wrench and joint torques by thrusts and angles.

Chain joints stand still. Turning a gimbal moves its thrust line, and the mass that it carries: the
centre of gravity and the joints' torques against gravity go with it. Many settings of thrusts and
gimbals are computed at once, so that derivatives are differences of one call.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.geometry import Floats
from snakegen.kernels.core.types import Ints
from snakegen.robot.allocation_maps import mean_drag
from snakegen.robot.kinematics import forward, twist_columns
from snakegen.robot.robot import GRAVITY, Robot


@dataclass(frozen=True, eq=False)
class VectoredBody:
    """A floating body in one posture, carrying a push on one link.

    Settings x are ``[λ | gimbal angles]``: Ñ apparatus thrusts [N], then m angles [rad].

    Attributes:
        robot: floating, with apparatuses.
        angles: (n-1,) of every joint; those of gimbals are where x starts.
        base: (3, 3) attitude of the root link.
        moved: (m,) which of `angles` are gimbals.
        lower, upper: (Ñ + m,) limits of x.
        push: (6,) unit of the push, N and N·m about the CoG, world axes.
        joints: names of the driven chain joints that have a torque limit.
        least, most: (k,) the torques that they may take, N·m.
        twists: (6, k) twist of each of them about the base origin.
        above: (k, bodies) 1 where the joint carries the body.
        pushed: (k,) the same of the body that is pushed.
        gain: (Ñ,) thrust of each apparatus over its command λ.
        points: (Ñ, 3) m, where its thrust acts, in the axes of the body that its gimbals turn.
        drag: (Ñ,) m, torque along its thrust per newton.
    """

    robot: Robot
    angles: Floats
    base: Floats
    moved: Ints
    lower: Floats
    upper: Floats
    push: Floats
    joints: tuple[str, ...]
    least: Floats
    most: Floats
    twists: Floats
    above: Floats
    pushed: Floats
    gain: Floats
    points: Floats
    drag: Floats

    @property
    def apparatuses(self) -> int:
        """Returns Ñ."""
        return len(self.robot.gimbals.limit)

    def start(self) -> Floats:
        """Returns x with the weight shared equally, gimbals as in the posture."""
        share = self.robot.force_scale / self.apparatuses
        x = np.append(np.full(self.apparatuses, share), self.angles[self.moved])
        return np.clip(x, self.lower, self.upper)

    def balance(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Returns what thrusts make of settings x (…, Ñ + m), world axes.

        Returns:
            (…, 6) wrench about the CoG, less weight; (…, k) joint torques without the push; and
            (…, k) joint torque per unit of the push.
        """
        tree, gimbals, n = self.robot.tree, self.robot.gimbals, self.apparatuses
        angles = np.broadcast_to(self.angles, (*x.shape[:-1], len(self.angles))).copy()
        angles[..., self.moved] = x[..., n:]
        rotation, position = forward(tree, self.base, np.zeros(3), angles)
        centres = position + np.einsum("...ijk,ik->...ij", rotation, tree.com)
        cog = np.einsum("i,...ij->...j", tree.mass, centres) / tree.mass.sum()
        weight = np.zeros_like(centres)
        weight[..., 2] = -GRAVITY * tree.mass
        hung = np.concatenate([weight, np.cross(centres, weight)], axis=-1)
        bodies = gimbals.thrust_body
        axes = np.einsum("...ijk,ik->...ij", rotation[..., bodies, :, :], gimbals.thrust_axis)
        points = np.einsum("...ijk,ik->...ij", rotation[..., bodies, :, :], self.points)
        points = points + position[..., bodies, :]
        forces = (self.gain * x[..., :n])[..., None] * axes
        turned = self.drag[:, None] * forces
        thrust = np.concatenate([forces, np.cross(points, forces) + turned], axis=-1)
        whole = hung.sum(axis=-2) + thrust.sum(axis=-2)
        whole[..., 3:] -= np.cross(cog, whole[..., :3])
        about = np.broadcast_to(self.push, (*x.shape[:-1], 6)).copy()
        about[..., 3:] += np.cross(cog, self.push[:3])
        borne = np.einsum("kb,...bc->...kc", self.above, hung)
        borne = borne + np.einsum("kj,...jc->...kc", self.above[:, bodies], thrust)
        torque = -np.einsum("ck,...kc->...k", self.twists, borne)
        return whole, torque, -self.pushed * (about @ self.twists)

    def slopes(self, x: Floats, step: float = 1e-6) -> tuple[Floats, Floats]:
        """Returns derivatives (6, Ñ + m) and (k, Ñ + m) of wrench and joint torques by x."""
        width = np.where(np.arange(len(x)) < self.apparatuses, self.robot.force_scale, 1.0) * step
        ends = x + np.concatenate([np.diag(width), -np.diag(width)])
        wrench, torque, _ = self.balance(ends)
        half = len(x)
        return (
            ((wrench[:half] - wrench[half:]) / (2.0 * width[:, None])).T,
            ((torque[:half] - torque[half:]) / (2.0 * width[:, None])).T,
        )

    def limits_met(self, x: Floats, t: float, share: float = 1e-4) -> tuple[str, ...]:
        """Returns names of apparatuses at full thrust, and of joints at their limit."""
        n = self.apparatuses
        full = np.flatnonzero(x[:n] >= (1.0 - share) * self.upper[:n])
        _, torque, pushed = self.balance(x)
        whole = torque + t * pushed
        room = np.minimum(self.most - whole, whole - self.least)
        bent = np.flatnonzero(room <= share * self.most)
        return (
            *(self.robot.apparatus_names[i] for i in full),
            *(self.joints[i] for i in bent),
        )


def vectored_body(robot: Robot, q: ArrayLike, push: Floats, link: str) -> VectoredBody:
    """Returns the statics of a body at q under `push` (6,), root-link axes, about its CoG.

    Args:
        robot: floating, with apparatuses.
        q: (nq,) posture; gimbals as they hover.
        push: N and N·m.
        link: that carries it.

    Raises:
        PostureError: q has the wrong size or holds NaN.
        DescriptionError: no such link.
    """
    q = robot.validate_configuration(q)
    base, angles = robot.base_pose(q)[0], robot.angles(q)
    driven = {s.joint for s in robot.modules.servos}
    names = [n for n in robot.chain_joints if n in driven or not driven]
    high = robot.limits(names)[2]
    kept = [i for i, most in enumerate(high) if np.isfinite(most) and most > 0.0]
    bodies = np.array([robot.body_of_joint(names[i]) for i in kept], np.int64)
    gimbals, rotors = robot.gimbals, robot.rotors
    turned = sorted({int(b) for b in [*gimbals.roll_body, *gimbals.pitch_body] if b >= 0})
    moved = np.array(turned, np.int64) - 1
    low, up, _ = robot.limits([robot.joint_names[i] for i in moved])
    least = np.bincount(rotors.apparatus, rotors.thrust_min, len(gimbals.limit))
    above = carried(robot, bodies)
    return VectoredBody(
        robot,
        angles,
        base,
        moved,
        np.concatenate([least, low]),
        np.concatenate([gimbals.limit, up]),
        np.concatenate([base @ push[:3], base @ push[3:]]),
        tuple(names[i] for i in kept),
        -high[kept],
        high[kept],
        twist_columns(robot.tree, base, angles)[:, bodies - 1],
        above,
        above[:, robot.body_of_link(link)[0]],
        np.ones(len(gimbals.limit)),
        gimbals.thrust_point,
        mean_drag(rotors, len(gimbals.limit)),
    )


def with_draw(body: VectoredBody, factors: Floats, offsets: Floats) -> VectoredBody:
    """Returns the body with the thrusts of one run's rotors, and the torques that it can use.

    Rotors of an apparatus share its command. A controller that reads a servo's torque with an
    offset o keeps ``|τ + o| ≤ L``; the servo itself keeps ``|τ| ≤ L``.

    Args:
        body: nominal.
        factors: (n,) thrust of each rotor over its command; above its largest thrust none gives.
        offsets: (k,) N·m, of the torques that servos report; none if empty.
    """
    rotors, n = body.robot.rotors, body.apparatuses
    owner, count = rotors.apparatus, np.bincount(rotors.apparatus, minlength=n)
    whole = np.bincount(owner, factors, n)
    parts = factors / whole[owner]
    points = np.array([np.bincount(owner, parts * p, n) for p in rotors.position.T]).T
    ceiling = np.bincount(owner, np.minimum(factors, 1.0) * rotors.thrust_max, n)
    upper = body.upper.copy()
    upper[:n] = np.minimum(upper[:n], ceiling * count / whole)
    off = offsets if len(offsets) else np.zeros(len(body.most))
    return replace(
        body,
        gain=whole / count,
        points=points,
        drag=np.asarray(np.bincount(owner, parts * rotors.torque_ratio, n), float),
        upper=upper,
        least=np.maximum(body.least, body.least - off),
        most=np.minimum(body.most, body.most - off),
    )


def carried(robot: Robot, bodies: Ints) -> Floats:
    """Returns (k, n) 1 where the joint that moves each of `bodies` carries a body, else 0."""
    parent = robot.tree.parent
    out = np.zeros((len(bodies), len(parent)))
    for row, body in zip(out, bodies, strict=True):
        row[body] = 1.0
        for b in range(int(body) + 1, len(parent)):
            row[b] = row[parent[b]]
    return out
