"""What thrust and weight do to the joints of a hovering body, for a batch of postures."""

import numpy as np

from snakegen.kernels.allocation.gimbals import mounts
from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.types import Body, Floats, Ints, Mechanism
from snakegen.kernels.dynamics.joint_loads import force_loads_into
from snakegen.kernels.kinematics.chain import forward_into, weigh
from snakegen.kernels.margins.posture_batch import _point_up


@jit
def load_postures(
    mechanism: Mechanism,
    limits: tuple[Floats, Floats],
    joints: Ints,
    samples: Floats,
    gravity: float,
    bounded: Ints,
    rows: Floats,
    bias: Floats,
) -> None:
    """Fills the joint torques' maps at m postures, root link level, every thrust pointed up first.

    Args:
        mechanism: the robot.
        limits: (n-1,) rad each, lower and upper, of all joints.
        joints: (k,) indices into the tree's angles of the joints that are sampled.
        samples: (m, k) rad.
        gravity: m/s².
        bounded: (b,) bodies that the joints move whose torques are asked for.
        rows: (m, b, 3Ñ) filled, N·m per newton of each apparatus' force, root-link axes.
        bias: (m, b) filled, N·m, of the weight.
    """
    tree, rotors, gimbals = mechanism
    low, high = limits
    n = tree.parent.shape[0]
    rotation, position = np.empty((n, 3, 3)), np.empty((n, 3))
    angles, origin, base = np.zeros(n - 1), np.zeros(3), np.eye(3)
    turns = np.zeros((gimbals.limit.shape[0], 2))
    forward_into(tree, base, origin, angles, rotation, position)
    m, _ = mounts(tree, rotors, gimbals, rotation, position, origin, base)
    for s in range(samples.shape[0]):
        angles[:] = 0.0
        for k in range(joints.shape[0]):
            angles[joints[k]] = samples[s, k]
        forward_into(tree, base, origin, angles, rotation, position)
        _point_up(tree, gimbals, low, high, base, rotation, m, angles)
        for j in range(turns.shape[0]):
            first = min(gimbals.roll_body[j], gimbals.pitch_body[j])
            second = max(gimbals.roll_body[j], gimbals.pitch_body[j])
            turns[j, 0] = angles[first - 1] if first >= 0 else 0.0
            turns[j, 1] = angles[second - 1] if second >= 0 else 0.0
        forward_into(tree, base, origin, angles, rotation, position)
        _, cog = weigh(tree, rotation, position)
        here, _ = mounts(tree, rotors, gimbals, rotation, position, cog, base)
        body = Body(rotation, position, cog, base)
        force_loads_into(tree, gimbals, body, here, turns, gravity, bounded, rows[s], bias[s])
