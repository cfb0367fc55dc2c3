"""What thrust, gravity and a disturbance make of each joint: the linear maps of ZN23 eq 6.

``τ = bias + M λ + D w_d`` for the joints that shape the body: the law of `law.joint_torques` (a
test holds them together), split for joint-limited margins.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from snakegen.geometry import Floats, skew
from snakegen.kernels.chain import centre_of_gravity, forward
from snakegen.kinetostatics.law import joint_torques
from snakegen.robot import Robot


@dataclass(frozen=True, eq=False)
class JointLoads:
    """Joint torque maps of a posture; k joints, n rotors, Ñ apparatuses.

    Attributes:
        names: (k,) joints.
        limit: (k,) N m, servo limits.
        bias: (k,) N m, torque that holds the body against gravity alone.
        rotors: (k, n) m, torque per newton of each rotor, gimbals as in q.
        forces: (k, Ñ, 3) m, torque per newton of each apparatus' force, root-link axes.
        disturbance: (k, 6) torque per unit of a wrench about the CoG, root-link axes, that acts
            on the chosen link.
    """

    names: tuple[str, ...]
    limit: Floats
    bias: Floats
    rotors: Floats
    forces: Floats
    disturbance: Floats


def joint_loads(robot: Robot, q: ArrayLike, link: str | None = None) -> JointLoads:
    """Returns the joint torque maps at q for a disturbance on `link` (the root by default).

    Raises:
        PostureError: q has the wrong size or holds NaN.
        DescriptionError: no such link.
    """
    q = robot.check_q(q)
    names = robot.chain_joints
    tree, rotors, gimbals = robot.tree, robot.rotors, robot.gimbals
    base, origin = robot.base_pose(q)
    rotation, position = forward(tree, base, origin, robot.angles(q))
    _, cog = centre_of_gravity(tree, rotation, position)
    bodies = np.array([robot.body_of_joint(n) for n in names], int)
    index = [robot.model.joints[robot.model.getJointId(n)].idx_v for n in names]
    axes = np.einsum("iab,ib->ia", rotation[bodies], tree.axis[bodies])

    def carried(body: int) -> Floats:
        """Returns (k,) 1 where the joint carries `body`."""
        above = set()
        while body > 0:
            above.add(body)
            body = int(tree.parent[body])
        return np.array([float(b in above) for b in bodies])

    def of_wrench(body: int, point: Floats) -> Floats:
        """Returns (k, 6): joint torque per unit of a wrench at `point` on `body`, base axes."""
        out = np.zeros((len(names), 6))
        for i, share in enumerate(carried(body)):
            if share:
                lever = skew(point - position[bodies[i]])
                out[i, :3] = -(axes[i] @ lever) @ base
                out[i, 3:] = -axes[i] @ base
        return out

    forces = np.stack(
        [
            of_wrench(b, position[b] + rotation[b] @ p)[:, :3]
            for b, p in zip(gimbals.thrust_body, gimbals.thrust_point, strict=True)
        ],
        axis=1,
    )
    columns = []
    for r, b in enumerate(rotors.body):
        place = position[b] + rotation[b] @ rotors.position[r]
        along = base.T @ (rotation[b] @ rotors.axis[r])
        wrench = np.concatenate([along, rotors.torque_ratio[r] * along])
        columns.append(of_wrench(int(b), place) @ wrench)
    body = robot.body_of_link(link or robot.root_link)[0]
    return JointLoads(
        names,
        robot.limits(names)[2],
        joint_torques(robot, q, terms="static")[index],
        np.stack(columns, axis=1),
        forces,
        of_wrench(body, cog),
    )
