"""ZS24 Table 3's motion, for any chain."""

import numpy as np

from snakegen.inverse_kinematics.motion import Motion, sines, speed_limits
from snakegen.robot.robot import Robot

TABLE_3 = {"amplitude": 0.2, "period": 2.0}  # rad, s: 0.2 sin πt on every joint


def table3(
    robot: Robot,
    *,
    amplitude: float = TABLE_3["amplitude"],
    period: float = TABLE_3["period"],
    duration: float = 6.0,
) -> Motion:
    """Returns ZS24 Table 3's motion: 0.2 sin πt on every joint, for 6 s, signs + - + - …

    The paper prints no signs; these are the ones that give its Table 5 (THEORY C).
    """
    joints = robot.chain_joints
    waves = {
        n: {"amplitude": amplitude * (-1.0) ** i, "period": period} for i, n in enumerate(joints)
    }
    return sines(robot, waves, duration, name="table3")


def table3_within(robot: Robot, *, duration: float | None = None) -> Motion:
    """Returns `table3`, made smaller, slower or off-centre where a robot's limits ask for it.

    Its name tells: ``table3``, or with what it became.
    """
    low, high, _ = robot.limits(robot.chain_joints)
    room = 0.95 * np.minimum(high, -low)
    middle = np.where(room >= 0.05, 0.0, 0.5 * (low + high))
    half = np.where(room >= 0.05, room, 0.475 * (high - low))
    amplitude = float(min(TABLE_3["amplitude"], half.min(initial=np.inf)))
    speed = 0.95 * float(speed_limits(robot, robot.chain_joints).min(initial=np.inf))
    period = max(TABLE_3["period"], 2 * np.pi * amplitude / speed)
    lasts = 3.0 * period if duration is None else duration
    if amplitude == TABLE_3["amplitude"] and period == TABLE_3["period"] and not middle.any():
        return table3(robot, duration=lasts)
    waves = {
        n: {"amplitude": amplitude * (-1.0) ** i, "period": period, "offset": float(middle[i])}
        for i, n in enumerate(robot.chain_joints)
    }
    name = f"table3 within this robot's limits ({amplitude:.3g} rad, {period:.3g} s)"
    return sines(robot, waves, lasts, name=name)
