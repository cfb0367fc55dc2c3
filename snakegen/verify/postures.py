"""Joint paths for missions, for any chain: bent where a straight body could not fly."""

import numpy as np

from snakegen.geometry import Floats
from snakegen.kernels.chain import centre_of_gravity, forward
from snakegen.posture import hover_gimbals, set_angle
from snakegen.robot import Robot

BEND = 1.0  # rad, of the yaw joints of a body at rest in the air


def driven_joints(robot: Robot) -> list[str]:
    """Returns the joints that shape the body and have a servo, in the tree's order."""
    servos = {s.joint for s in robot.modules.servos}
    return [n for n in robot.chain_joints if n in servos]


def bent(robot: Robot, bend: float = BEND) -> Floats:
    """Returns joint angles (k,) of a planar arc or zigzag: every yaw bent, within limits.

    Up to four links bend one way; longer bodies change side every two joints, so that they
    neither close on themselves nor become straight.
    """
    names = driven_joints(robot)
    low, high, _ = robot.limits(names)
    out, yaws = np.zeros(len(names)), 0
    for i, name in enumerate(names):
        if name.endswith("_yaw"):
            side = 1.0 if (yaws // 2) % 2 == 0 or len(robot.modules.lengths) <= 4 else -1.0
            out[i] = np.clip(side * bend, low[i], high[i])
            yaws += 1
    return out


def place(robot: Robot, joints: Floats, cog: Floats, rotation: Floats | None = None) -> Floats:
    """Returns q with the given joints, hover gimbals, level root and the CoG at `cog` (m, world)."""
    q = np.array(robot.configuration())
    for name, angle in zip(driven_joints(robot), joints, strict=True):
        set_angle(robot, q, name, float(angle))
    q = hover_gimbals(robot, q)
    base, origin = robot.base_pose(q)
    poses = forward(robot.tree, base, origin, robot.angles(q))
    _, now = centre_of_gravity(robot.tree, *poses)
    q[:3] += cog - now
    return q
