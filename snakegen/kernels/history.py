"""CoG motion along a whole run, from rows of states."""

import numpy as np

from snakegen.kernels.chain import body_twists, centre_of_gravity, forward
from snakegen.kernels.jit import jit
from snakegen.kernels.linear import turn_into
from snakegen.kernels.tree import Floats, Tree


@jit
def cog_history(
    tree: Tree,
    body: int,
    turn: Floats,
    rotations: Floats,
    positions: Floats,
    linear: Floats,
    angular: Floats,
    angles: Floats,
    rates: Floats,
) -> tuple[Floats, Floats, Floats, Floats]:
    """Returns CoG position and velocity (T, 3), attitude (T, 3, 3) and rate (T, 3) of its frame.

    Args:
        tree: the robot.
        body: whose axes the CoG frame has.
        turn: (3, 3) CoG axes in that body's.
        rotations, positions: (T, 3, 3), (T, 3) m, base pose.
        linear, angular: (T, 3) m/s, rad/s, base velocity, world axes.
        angles, rates: (T, n-1) rad, rad/s.
    """
    count, n = positions.shape[0], tree.parent.shape[0]
    cogs, speeds = np.empty((count, 3)), np.zeros((count, 3))
    frames, spins = np.empty((count, 3, 3)), np.empty((count, 3))
    arm = np.empty(3)
    for k in range(count):
        rotation, position = forward(tree, rotations[k], positions[k], angles[k])
        mass, cog = centre_of_gravity(tree, rotation, position)
        v, w = body_twists(tree, rotation, position, linear[k], angular[k], rates[k])
        for i in range(n):
            turn_into(rotation[i], tree.com[i], arm)
            share = tree.mass[i] / mass
            speeds[k, 0] += share * (v[i, 0] + w[i, 1] * arm[2] - w[i, 2] * arm[1])
            speeds[k, 1] += share * (v[i, 1] + w[i, 2] * arm[0] - w[i, 0] * arm[2])
            speeds[k, 2] += share * (v[i, 2] + w[i, 0] * arm[1] - w[i, 1] * arm[0])
        cogs[k] = cog
        frames[k] = rotation[body] @ turn
        spins[k] = frames[k].T @ w[body]
    return cogs, speeds, frames, spins
