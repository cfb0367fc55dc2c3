"""What thrust and weight do to the joints between links, as rows of an allocation: ZN23 eq 6.

A servo must give ``τ_i = -a_i · Σ (x - r_i) × f`` over the forces f at x on the bodies beyond
joint i (axis a_i through r_i): linear in the thrusts, so its limit is a pair of linear bounds
that an allocator can keep.
"""

from typing import NamedTuple

import numpy as np

from snakegen.kernels.allocation.gimbals import EXTRA, thrust_line, turned_into
from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.mat3 import cross_into, dot, turn_back_into, turn_into
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.stack_arrays import scratch
from snakegen.kernels.core.types import Body, Floats, Gimbals, Ints, Tree


class JointLoads(NamedTuple):
    """Bounds ``|bias + rows @ x| ≤ limit`` on thrusts or forces x."""

    rows: Floats  # (k, n) N·m per newton; three columns an apparatus for forces in CoG axes
    bias: Floats  # (k,) N·m, of the weight
    limit: Floats  # (k,) N·m


@jit
def no_loads(columns: int) -> JointLoads:
    """Returns bounds on nothing."""
    return JointLoads(np.zeros((0, columns)), np.zeros(0), np.zeros(0))


@bare
def beyond(tree: Tree, body: int, joint: int) -> bool:
    """Tells whether `body` is carried by the joint that moves body `joint`."""
    while body > joint:
        body = tree.parent[body]
    return body == joint


@bare(no_cpython_wrapper=True)
def weights_into(tree: Tree, body: Body, hung: Floats) -> None:
    """Writes the mass [kg] and its first moment [kg m] from the CoG of what hangs on each body.

    Args:
        hung: (n, 4), CoG axes; a body counts itself.
    """
    world, arm = scratch(3), scratch(3)
    for b in range(tree.mass.shape[0]):
        turn_into(body.rotation[b], tree.com[b], world)
        for k in range(3):
            world[k] += body.position[b, k] - body.cog[k]
        turn_back_into(body.axes, world, arm)
        hung[b, 0] = tree.mass[b]
        for k in range(3):
            hung[b, 1 + k] = tree.mass[b] * arm[k]
    for b in range(tree.mass.shape[0] - 1, 0, -1):
        for k in range(4):
            hung[tree.parent[b], k] += hung[b, k]


@bare(no_cpython_wrapper=True)
def joint_line_into(tree: Tree, body: Body, joint: int, a: Floats, r: Floats) -> None:
    """Writes axis (3,) and origin (3,) [m from the CoG] of a joint, CoG axes."""
    world = scratch(3)
    turn_into(body.rotation[joint], tree.axis[joint], world)
    turn_back_into(body.axes, world, a)
    for k in range(3):
        world[k] = body.position[joint, k] - body.cog[k]
    turn_back_into(body.axes, world, r)


@bare
def weight_load(hung: Floats, a: Floats, r: Floats, axes: Floats, gravity: float) -> float:
    """Returns the torque [N·m] that what hangs on a joint, a row (4,), asks of its servo."""
    arm, down, moment = scratch(3), scratch(3), scratch(3)
    for k in range(3):
        arm[k], down[k] = hung[1 + k] - hung[0] * r[k], -gravity * axes[2, k]
    cross_into(arm, down, moment)
    return -dot(a, moment)


@bare(no_cpython_wrapper=True)
def force_loads_into(
    tree: Tree,
    gimbals: Gimbals,
    body: Body,
    m: Floats,
    angles: Floats,
    gravity: float,
    joints: Ints,
    rows: Floats,
    bias: Floats,
) -> None:
    """Writes rows (k, 3Ñ) and bias (k,) of `force_loads`."""
    n = m.shape[0]
    u, points, hung = scratch(3), scratch((n, 3)), scratch((tree.mass.shape[0], 4))
    a, r, arm, lever = scratch(3), scratch(3), scratch(3), scratch(3)
    for j in range(n):
        thrust_line(m, j, angles[j], u, points[j])
    weights_into(tree, body, hung)
    for i in range(joints.shape[0]):
        joint_line_into(tree, body, joints[i], a, r)
        bias[i] = weight_load(hung[joints[i]], a, r, body.axes, gravity)
        for j in range(n):
            carried = beyond(tree, gimbals.link_body[j], joints[i])
            for k in range(3):
                arm[k] = points[j, k] - r[k]
            cross_into(a, arm, lever)
            for k in range(3):
                load = -(lever[k] + m[j, EXTRA, 0] * a[k])
                rows[i, 3 * j + k] = load if carried else 0.0


@jit
def force_loads(
    tree: Tree,
    gimbals: Gimbals,
    body: Body,
    m: Floats,
    angles: Floats,
    gravity: float,
    joints: Ints,
    limit: Floats,
) -> JointLoads:
    """Returns the bounds on apparatus forces (3Ñ,), CoG axes, acting where `angles` put them.

    Args:
        body: where the robot is.
        m: (Ñ, 10, 3) from `mounts`; angles (Ñ, 2) rad in joint order.
        joints: (k,) bodies that the bounded joints move.
        limit: (k,) N·m.
    """
    rows, bias = np.empty((joints.shape[0], 3 * m.shape[0])), np.empty(joints.shape[0])
    force_loads_into(tree, gimbals, body, m, angles, gravity, joints, rows, bias)
    return JointLoads(rows, bias, limit)


@bare(no_cpython_wrapper=True)
def rotor_loads_into(
    tree: Tree,
    gimbals: Gimbals,
    body: Body,
    m: Floats,
    rotor: Floats,
    angles: Floats,
    gravity: float,
    joints: Ints,
    rows: Floats,
    bias: Floats,
) -> None:
    """Writes rows (k, n) and bias (k,) of the bounds on rotor thrusts (n,) at held gimbals."""
    count = rotor.shape[0]
    points, along, hung = scratch((count, 3)), scratch((count, 3)), scratch((tree.mass.shape[0], 4))
    a, r, arm, lever, elbow = scratch(3), scratch(3), scratch(3), scratch(3), scratch(3)
    once, twice = scratch((3, 3)), scratch((3, 3))
    for c in range(count):
        j = int(rotor[c, 2, 1])
        turned_into(m, j, angles[j, 0], angles[j, 1], once, twice, elbow)
        turn_into(twice, rotor[c, 1], along[c])
        turn_into(twice, rotor[c, 0], points[c])
        for k in range(3):
            points[c, k] += elbow[k]
    weights_into(tree, body, hung)
    for i in range(joints.shape[0]):
        joint_line_into(tree, body, joints[i], a, r)
        bias[i] = weight_load(hung[joints[i]], a, r, body.axes, gravity)
        for c in range(count):
            carried = beyond(tree, gimbals.link_body[int(rotor[c, 2, 1])], joints[i])
            for k in range(3):
                arm[k] = points[c, k] - r[k]
            cross_into(a, arm, lever)
            load = -(dot(lever, along[c]) + rotor[c, 2, 0] * dot(a, along[c]))
            rows[i, c] = load if carried else 0.0


@bare
def overloaded(loads: JointLoads, x: Floats) -> bool:
    """Tells whether thrusts or forces x (n,) pass a joint's limit."""
    for i in range(loads.limit.shape[0]):
        total = loads.bias[i]
        for c in range(x.shape[0]):
            total += loads.rows[i, c] * x[c]
        if abs(total) > loads.limit[i]:
            return True
    return False
