"""What thrust and weight do to the joints between links, as rows of an allocation: ZN23 eq 6.

A servo must give ``τ_i = -a_i · Σ (x - r_i) × f`` over the forces f at x on the bodies beyond
joint i (axis a_i through r_i): linear in the thrusts, so its limit is a pair of linear bounds
that an allocator can keep.
"""

from typing import NamedTuple

import numpy as np

from snakegen.kernels.jit import jit
from snakegen.kernels.linear import cross_into, dot, turn_back_into, turn_into
from snakegen.kernels.tree import Floats, Gimbals, Ints, Tree
from snakegen.kernels.vectoring import EXTRA, thrust_line, turned_into


class JointLoads(NamedTuple):
    """Bounds ``|bias + rows @ x| ≤ limit`` on thrusts or forces x."""

    rows: Floats  # (k, n) N m per newton; three columns an apparatus for forces in CoG axes
    bias: Floats  # (k,) N m, of the weight
    limit: Floats  # (k,) N m


@jit
def no_loads(columns: int) -> JointLoads:
    """Returns bounds on nothing."""
    return JointLoads(np.zeros((0, columns)), np.zeros(0), np.zeros(0))


@jit
def beyond(tree: Tree, body: int, joint: int) -> bool:
    """Tells whether `body` is carried by the joint that moves body `joint`."""
    while body > joint:
        body = tree.parent[body]
    return body == joint


@jit
def joint_line(
    tree: Tree, rotation: Floats, position: Floats, cog: Floats, axes: Floats, joint: int
) -> tuple[Floats, Floats]:
    """Returns axis (3,) and origin (3,) [m from the CoG] of a joint, CoG axes."""
    a, r, world, arm = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    turn_into(rotation[joint], tree.axis[joint], world)
    turn_back_into(axes, world, a)
    for k in range(3):
        arm[k] = position[joint, k] - cog[k]
    turn_back_into(axes, arm, r)
    return a, r


@jit
def weight_load(
    tree: Tree,
    rotation: Floats,
    position: Floats,
    cog: Floats,
    axes: Floats,
    gravity: float,
    joint: int,
) -> float:
    """Returns the torque [N m] that the weight beyond a joint asks of its servo."""
    a, r = joint_line(tree, rotation, position, cog, axes, joint)
    world, arm, moment, down = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    total = 0.0
    for b in range(joint, tree.mass.shape[0]):
        if not beyond(tree, b, joint):
            continue
        turn_into(rotation[b], tree.com[b], world)
        for k in range(3):
            world[k] += position[b, k] - cog[k]
            down[k] = -tree.mass[b] * gravity * axes[2, k]
        turn_back_into(axes, world, arm)
        for k in range(3):
            arm[k] -= r[k]
        cross_into(arm, down, moment)
        total -= dot(a, moment)
    return total


@jit
def force_loads(
    tree: Tree,
    gimbals: Gimbals,
    m: Floats,
    angles: Floats,
    rotation: Floats,
    position: Floats,
    cog: Floats,
    axes: Floats,
    gravity: float,
    joints: Ints,
    limit: Floats,
) -> JointLoads:
    """Returns the bounds on apparatus forces (3Ñ,), CoG axes, acting where `angles` put them.

    Args:
        m: (Ñ, 10, 3) from `vectoring.mounts`; angles (Ñ, 2) rad in joint order.
        rotation, position, cog, axes: as for `mounts`.
        joints: (k,) bodies that the bounded joints move.
        limit: (k,) N m.
    """
    count, n = joints.shape[0], m.shape[0]
    rows, bias = np.zeros((count, 3 * n)), np.empty(count)
    u, p, arm, lever = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for i in range(count):
        joint = joints[i]
        a, r = joint_line(tree, rotation, position, cog, axes, joint)
        bias[i] = weight_load(tree, rotation, position, cog, axes, gravity, joint)
        for j in range(n):
            if not beyond(tree, gimbals.link_body[j], joint):
                continue
            thrust_line(m, j, angles[j], u, p)
            for k in range(3):
                arm[k] = p[k] - r[k]
            cross_into(a, arm, lever)
            for k in range(3):
                rows[i, 3 * j + k] = -(lever[k] + m[j, EXTRA, 0] * a[k])
    return JointLoads(rows, bias, limit)


@jit
def rotor_loads(
    tree: Tree,
    gimbals: Gimbals,
    m: Floats,
    rotor: Floats,
    angles: Floats,
    rotation: Floats,
    position: Floats,
    cog: Floats,
    axes: Floats,
    gravity: float,
    joints: Ints,
    limit: Floats,
) -> JointLoads:
    """Returns the bounds on rotor thrusts (n,) at held gimbals; arguments as `force_loads`."""
    count, n = joints.shape[0], rotor.shape[0]
    rows, bias = np.zeros((count, n)), np.empty(count)
    u, p, arm, lever, elbow = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    once, twice = np.empty((3, 3)), np.empty((3, 3))
    for i in range(count):
        joint = joints[i]
        a, r = joint_line(tree, rotation, position, cog, axes, joint)
        bias[i] = weight_load(tree, rotation, position, cog, axes, gravity, joint)
        for c in range(n):
            j = int(rotor[c, 2, 1])
            if not beyond(tree, gimbals.link_body[j], joint):
                continue
            turned_into(m, j, angles[j, 0], angles[j, 1], once, twice, elbow)
            turn_into(twice, rotor[c, 1], u)
            turn_into(twice, rotor[c, 0], p)
            for k in range(3):
                arm[k] = p[k] + elbow[k] - r[k]
            cross_into(a, arm, lever)
            rows[i, c] = -(dot(lever, u) + rotor[c, 2, 0] * dot(a, u))
    return JointLoads(rows, bias, limit)


@jit
def overloaded(loads: JointLoads, x: Floats) -> bool:
    """Tells whether thrusts or forces x (n,) pass a joint's limit."""
    for i in range(loads.limit.shape[0]):
        total = loads.bias[i]
        for c in range(x.shape[0]):
            total += loads.rows[i, c] * x[c]
        if abs(total) > loads.limit[i]:
            return True
    return False
