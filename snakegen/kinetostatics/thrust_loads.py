"""Joint torques as linear maps of thrust and disturbance: ``τ = bias + M λ + D d`` (THEORY A5).

What the joint-limited margins take (`margins.joint_limited`, `margins.rays`), from the same law
as every other joint torque: minus the twist matrix times the wrenches beyond each joint.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from snakegen.geometry import Floats, move_wrench
from snakegen.kernels.chain import centre_of_gravity, forward
from snakegen.kinetostatics.law import joint_torques, twist_matrix
from snakegen.robot import Robot


@dataclass(frozen=True, eq=False)
class ThrustLoads:
    """Torques of the k driven joints between links, static.

    Attributes:
        joints: (k,) names.
        bias: (k,) N m, rotors off.
        rotor: (k, n) N m per newton of each rotor's thrust.
        force: (k, Ñ, 3) N m per newton of each apparatus' force, root-link axes.
        wrench: (k, 6) N m per unit of a disturbance [force; torque] about the CoG, root-link axes,
            that acts on `link`.
        limit: (k,) N m, the servos'.
        link: where the disturbance acts.
    """

    joints: tuple[str, ...]
    bias: Floats
    rotor: Floats
    force: Floats
    wrench: Floats
    limit: Floats
    link: str


def thrust_loads(robot: Robot, q: ArrayLike, link: str | None = None) -> ThrustLoads:
    """Returns the maps from thrust and disturbance to joint torque at a posture.

    Args:
        robot: floating, with apparatuses.
        q: (nq,) posture, gimbals as they are.
        link: on which the disturbance acts; the root link (which loads no joint) if not given.

    Raises:
        DescriptionError: a link that does not exist; the near ones are named.
        PostureError: q has the wrong size or holds NaN.
    """
    q = robot.check_q(q)
    name = link or robot.root_link
    carrier, _, _ = robot.body_of_link(name)
    driven = {s.joint for s in robot.modules.servos}
    joints = tuple(n for n in robot.chain_joints if n in driven)
    bodies = [robot.body_of_joint(n) for n in joints]
    base, _ = robot.base_pose(q)
    rotation, position = forward(robot.tree, base, np.zeros(3), robot.angles(q))
    columns = twist_matrix(robot, q)[:, [b - 1 for b in bodies]]
    _, cog = centre_of_gravity(robot.tree, rotation, position)
    rotors, gimbals = robot.rotors, robot.gimbals
    by_rotor = np.zeros((len(joints), len(rotors.body)))
    for r, body in enumerate(rotors.body):
        axis = rotation[body] @ rotors.axis[r]
        pull = np.concatenate([axis, rotors.torque_ratio[r] * axis])
        at = position[body] + rotation[body] @ rotors.position[r]
        by_rotor[:, r] = -_felt(robot, columns, bodies, int(body)) @ move_wrench(pull, at)
    by_force = np.zeros((len(joints), len(gimbals.link_body), 3))
    for j, body in enumerate(gimbals.thrust_body):
        at = position[body] + rotation[body] @ gimbals.thrust_point[j]
        felt = _felt(robot, columns, bodies, int(body))
        for c in range(3):
            pull = np.concatenate([base[:, c], np.zeros(3)])
            by_force[:, j, c] = -felt @ move_wrench(pull, at)
    felt = _felt(robot, columns, bodies, carrier)
    turn = np.kron(np.eye(2), base)
    by_wrench = np.array([-felt @ move_wrench(turn[:, c], cog) for c in range(6)]).T
    bias = joint_torques(robot, q, terms="static")[6:][[b - 1 for b in bodies]]
    limit = robot.limits(joints)[2]
    return ThrustLoads(
        joints, bias, by_rotor, by_force, by_wrench.reshape(len(joints), 6), limit, name
    )


def _felt(robot: Robot, columns: Floats, bodies: list[int], body: int) -> Floats:
    """Returns the rows (k, 6) of the twist matrix' transpose, 0 for joints not before `body`."""
    before = set()
    at = body
    while at > 0:
        before.add(at)
        at = int(robot.tree.parent[at])
    out = np.array(columns.T)
    for i, joint in enumerate(bodies):
        if joint not in before:
            out[i] = 0.0
    return out
