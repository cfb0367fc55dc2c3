"""What a robot's servos can do, as the control law takes it."""

from collections.abc import Sequence

import numpy as np

from snakegen.control.gains import Floats
from snakegen.robot.robot import Robot

SERVO_SHARE = 0.98  # of a joint servo's torque that the constrained allocator may plan with


def bounded_joints(robot: Robot) -> list[str]:
    """Returns the driven chain joints whose servos have a torque limit, in the tree's order."""
    driven = {s.joint for s in robot.modules.servos}
    names = [n for n in robot.chain_joints if n in driven]
    return [n for n in names if 0.0 < robot.limits([n])[2][0] < np.inf]


def joint_limits(robot: Robot) -> tuple[list[int], Floats]:
    """Returns the bodies that `bounded_joints` move, and the torque [N·m] to keep to.

    A share of the servo's limit is left to follow the motion itself.
    """
    names = bounded_joints(robot)
    return [robot.body_of_joint(n) for n in names], SERVO_SHARE * robot.limits(names)[2]


def gimbal_limits(robot: Robot) -> tuple[Floats, Floats]:
    """Returns the least and greatest angles (Ñ, 2) [rad] of the gimbals, roll and pitch."""
    n = len(robot.modules.apparatuses)
    lower, upper = np.zeros((n, 2)), np.zeros((n, 2))
    for j, a in enumerate(robot.modules.apparatuses):
        for k, name in enumerate((a.roll, a.pitch)):
            if name is not None:
                low, high, _ = robot.limits([name])
                lower[j, k], upper[j, k] = low[0], high[0]
    return lower, upper


def give(robot: Robot, names: Sequence[str]) -> Floats:
    """Returns (k,) rad/(N·m) compliance of the servos of joints: 1 over their stiffness.

    0 where there is no servo, or none with a stiffness.
    """
    stiff = {s.joint: s.stiffness for s in robot.modules.servos}
    return np.array([1.0 / stiff[n] if stiff.get(n, 0.0) > 0.0 else 0.0 for n in names])


def gimbal_give(robot: Robot) -> Floats:
    """Returns `give` (Ñ, 2) [rad/(N·m)] of the roll and pitch servos; 0 where one is absent."""
    out = np.zeros((len(robot.modules.apparatuses), 2))
    for j, a in enumerate(robot.modules.apparatuses):
        for k, name in enumerate((a.roll, a.pitch)):
            if name is not None:
                out[j, k] = give(robot, [name])[0]
    return out
