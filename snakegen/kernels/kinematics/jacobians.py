"""Twist matrix and tip Jacobian of any tree (ZS24 eqs 3, 12, 13 and 20)."""

import numpy as np

from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.mat3 import cross_into, turn_into
from snakegen.kernels.core.types import Floats, Tree
from snakegen.kernels.kinematics.chain import forward_into


@jit
def twist_columns(tree: Tree, base_rotation: Floats, angles: Floats) -> Floats:
    """Returns the twist matrix S (6, n-1) at the base origin, world axes (ZS24 eqs 13 and 20).

    Column i is ``[r_i × e_i; e_i]``, ``[e_i; 0]`` where the joint slides: the order is
    [linear; angular], the paper's is the other way round.
    """
    n = tree.parent.shape[0]
    R, p, e = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty(3)
    forward_into(tree, base_rotation, np.zeros(3), angles, R, p)
    S = np.zeros((6, n - 1))
    for i in range(1, n):
        turn_into(R[i], tree.axis[i], e)
        if tree.prismatic[i]:
            S[:3, i - 1] = e
        else:
            cross_into(p[i], e, S[:3, i - 1])
            S[3:, i - 1] = e
    return S


@jit
def tip_jacobian(
    tree: Tree, base_rotation: Floats, angles: Floats, body: int, point: Floats
) -> tuple[Floats, Floats, Floats]:
    """Returns a point's place, its body's attitude and their Jacobian by the joints.

    ``[ṗ; ω] = J θ̇``: the columns of the twist matrix between base and `body`, moved to the point
    (ZS24 eq 3: there the point is the base origin); zero for joints off that path.

    Args:
        tree: the robot's n bodies.
        base_rotation: (3, 3) attitude of body 0 in the world.
        angles: (n-1,) rad (m where the joint slides).
        body: index of the body that carries the point.
        point: (3,) m, in that body's frame.

    Returns:
        position (3,) m from the base origin, world axes; rotation (3, 3); J (6, n-1).
    """
    n = tree.parent.shape[0]
    parent, prismatic, axes = tree.parent, tree.prismatic, tree.axis
    R, p, e, arm = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty(3), np.empty(3)
    forward_into(tree, base_rotation, np.zeros(3), angles, R, p)
    J, tip = np.zeros((6, n - 1)), np.empty(3)
    turn_into(R[body], point, tip)
    for k in range(3):
        tip[k] += p[body, k]
    i = body
    while i > 0:
        turn_into(R[i], axes[i], e)
        if prismatic[i]:
            J[:3, i - 1] = e
        else:
            for k in range(3):
                arm[k] = tip[k] - p[i, k]
            cross_into(e, arm, J[:3, i - 1])
            J[3:, i - 1] = e
        i = parent[i]
    return tip, R[body].copy(), J
