"""What thrust, gravity and a disturbance make of each joint: the linear maps of ZN23 eq 6.

``τ = bias + M λ + D w_d`` for the driven joints that shape the body: the law's twist matrix times
the wrenches, split for joint-limited margins.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.geometry import Floats, move_wrench
from snakegen.robot.allocation_maps import mean_drag
from snakegen.robot.kinematics import centre_of_gravity, forward
from snakegen.robot.robot import Robot
from snakegen.statics.joint_torques import joint_torques, twist_matrix


@dataclass(frozen=True, eq=False)
class JointLoads:
    """Joint torque maps of a posture; k joints, n rotors, Ñ apparatuses.

    Attributes:
        names: (k,) joints.
        limit: (k,) N·m, servo limits.
        bias: (k,) N·m, torque that holds the body against gravity alone.
        rotors: (k, n) m, torque per newton of each rotor, gimbals as in q.
        forces: (k, Ñ, 3) m, torque per newton of each apparatus' force and of the drag along it,
            root-link axes.
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

    Args:
        robot: floating, with apparatuses.
        q: (nq,) posture, gimbals as they are.
        link: on which the disturbance acts; the root link loads no joint.

    Raises:
        PostureError: q has the wrong size or holds NaN.
        DescriptionError: no such link.
    """
    q = robot.validate_configuration(q)
    known = {s.joint for s in robot.modules.servos}
    names = tuple(n for n in robot.chain_joints if n in known or not known)
    bodies = [robot.body_of_joint(n) for n in names]
    base = robot.base_pose(q)[0]
    rotation, position = forward(robot.tree, base, np.zeros(3), robot.angles(q))
    cog = centre_of_gravity(robot.tree, rotation, position)[1]
    twists = twist_matrix(robot, q)[:, [b - 1 for b in bodies]]
    rotors, gimbals = robot.rotors, robot.gimbals
    drag = mean_drag(rotors, gimbals.limit.size)
    turn = np.kron(np.eye(2), base)  # root-link axes to world

    def of_wrench(body: int, point: Floats) -> Floats:
        """Returns (k, 6): joint torque per unit of a wrench at `point` on `body`, base axes.

        ``τ_i = -S_iᵀ w`` for the joints that carry the body, w about the base origin.
        """
        about = np.array([move_wrench(turn[:, c], point) for c in range(6)]).T
        return -_carriers(robot, bodies, body)[:, None] * (twists.T @ about)

    forces = [
        of_wrench(int(b), position[b] + rotation[b] @ p) @ np.vstack([np.eye(3), c * np.eye(3)])
        for b, p, c in zip(gimbals.thrust_body, gimbals.thrust_point, drag, strict=True)
    ]
    columns = []
    for r, b in enumerate(rotors.body):
        along = base.T @ (rotation[b] @ rotors.axis[r])
        wrench = np.concatenate([along, rotors.torque_ratio[r] * along])
        columns.append(of_wrench(int(b), position[b] + rotation[b] @ rotors.position[r]) @ wrench)
    k = len(names)
    return JointLoads(
        names,
        robot.limits(names)[2],
        joint_torques(robot, q, terms="static")[6:][[b - 1 for b in bodies]],
        np.array(columns).reshape(len(columns), k).T,
        np.array(forces).reshape(len(forces), k, 3).transpose(1, 0, 2),
        of_wrench(robot.body_of_link(link or robot.root_link)[0], cog),
    )


def _carriers(robot: Robot, bodies: list[int], body: int) -> Floats:
    """Returns (k,) 1 where the joint that moves each of `bodies` carries `body`, else 0."""
    above = set()
    while body > 0:
        above.add(body)
        body = int(robot.tree.parent[body])
    return np.array([float(b in above) for b in bodies])
