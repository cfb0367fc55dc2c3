"""CoG motion and allocation maps along a whole run, and which rows of it are drawn."""

import numpy as np

from snakegen.kernels.allocation.wrench_map import dual_map, rotor_frames, thrust_points
from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.mat3 import turn_into
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.types import Floats, Gimbals, Ints, Rotors, Tree
from snakegen.kernels.kinematics.chain import body_twists, centre_of_gravity, forward

HUGE = 1e200  # beyond it a sample counts as not finite


@bare
def rotation_of_quaternion(q: Floats, out: Floats) -> None:
    """Writes the rotation (3, 3) of a unit quaternion [w, x, y, z]."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    out[0, 0], out[1, 1] = 1 - 2 * (y * y + z * z), 1 - 2 * (x * x + z * z)
    out[2, 2] = 1 - 2 * (x * x + y * y)
    out[0, 1], out[1, 0] = 2 * (x * y - w * z), 2 * (x * y + w * z)
    out[0, 2], out[2, 0] = 2 * (x * z + w * y), 2 * (x * z - w * y)
    out[1, 2], out[2, 1] = 2 * (y * z - w * x), 2 * (y * z + w * x)


@jit
def rotations_of(wxyz: Floats) -> Floats:
    """Returns rotations (T, 3, 3) of unit quaternions (T, 4) [w, x, y, z]."""
    out = np.empty((wxyz.shape[0], 3, 3))
    for k in range(wxyz.shape[0]):
        rotation_of_quaternion(wxyz[k], out[k])
    return out


@jit
def quaternions(rotations: Floats) -> Floats:
    """Returns unit quaternions (T, 4) [x, y, z, w], w ≥ 0, of rotations (T, 3, 3) (Shepperd)."""
    out = np.empty((rotations.shape[0], 4))
    for t in range(rotations.shape[0]):
        r, q = rotations[t], out[t]
        trace, i = r[0, 0] + r[1, 1] + r[2, 2], 3
        most = trace
        for a in range(3):
            if r[a, a] > most:
                most, i = r[a, a], a
        if i == 3:
            q[3] = 1.0 + trace
            q[0], q[1], q[2] = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
        else:
            j, k = (i + 1) % 3, (i + 2) % 3
            q[i] = 1.0 + r[i, i] - r[j, j] - r[k, k]
            q[j], q[k], q[3] = r[j, i] + r[i, j], r[k, i] + r[i, k], r[k, j] - r[j, k]
        size = np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        size = -size if q[3] < 0.0 else size
        for a in range(4):
            q[a] /= size
    return out


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


@jit
def maps_history(
    tree: Tree,
    rotors: Rotors,
    gimbals: Gimbals,
    rotations: Floats,
    positions: Floats,
    angles: Floats,
) -> tuple[Floats, Floats]:
    """Returns thrust points (m, Ñ, 3) [m] and maps Q_dual (m, 6, r), gimbals as they are.

    About the CoG, in the root link's axes; arguments as in `cog_history`, m rows.
    """
    count = positions.shape[0]
    points = np.empty((count, gimbals.link_body.shape[0], 3))
    dual = np.empty((count, 6, rotors.body.shape[0]))
    for k in range(count):
        rotation, position = forward(tree, rotations[k], positions[k], angles[k])
        _, cog = centre_of_gravity(tree, rotation, position)
        points[k] = thrust_points(gimbals, rotation, position, cog, rotations[k])
        at, along = rotor_frames(rotors, rotation, position, cog, rotations[k])
        dual[k] = dual_map(rotors, at, along)
    return points, dual


@jit
def farthest_rows(values: Floats, stride: int) -> Ints:
    """Returns, of each whole run of `stride` rows of (T, k), the row farthest from the run's mean.

    The first of them where several are; an entry that is not finite is farther than any that is.
    """
    width = values.shape[1]
    out = np.empty(values.shape[0] // stride, np.int64)
    mean = np.empty(width)
    for block in range(out.shape[0]):
        first, most = block * stride, -1.0
        mean[:] = 0.0
        for k in range(first, first + stride):
            for i in range(width):
                if abs(values[k, i]) < HUGE:
                    mean[i] += values[k, i] / stride
        out[block] = first
        for k in range(first, first + stride):
            away = 0.0
            for i in range(width):
                if not abs(values[k, i]) < HUGE:
                    away = np.inf
                else:
                    away = max(away, abs(values[k, i] - mean[i]))
            if away > most:
                most = away
                out[block] = k
    return out
