"""What the log of an arm's run holds: the tip, the joints, and torques by servo and by model."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.geometry import Floats
from snakegen.inverse_kinematics.torques_along import Along
from snakegen.kernels.dynamics.inverse_dynamics import NO_LOADS, torques_batch
from snakegen.kernels.kinematics.jacobians import tip_jacobian
from snakegen.robot.posture import configuration_labels
from snakegen.robot.robot import Robot
from snakegen.simulation.arm.loop import Moved
from snakegen.simulation.flight.world import World
from snakegen.simulation.recording.recording import Channel, channel
from snakegen.statics.joint_torques import armature
from snakegen.statics.tip import Tip


def achieved_torques(world: World, moved: Moved, gravity: ArrayLike) -> Floats:
    """Returns the law's torques (T, k) [N·m] of the motion that the servos made."""
    robot, m, n = world.robot, moved.ticks, len(world.robot.joint_names)
    v, a = np.zeros((2, m, 6 + n))
    v[:, 6 + world.chain], a[:, 6 + world.chain] = moved.rates, moved.accelerations
    base = np.repeat(np.eye(3)[None], m, axis=0)
    angles = np.ascontiguousarray(moved.qpos[:, world.qpos])
    out = torques_batch(
        robot.tree, armature(robot), np.asarray(gravity, float), base, angles, v, a, NO_LOADS
    )
    return np.asarray(out[:, 6 + world.chain])


def arm_channels(
    world: World,
    along: Along,
    moved: Moved,
    made: Floats,
    tip: Tip,
    tip_target: Callable[[Floats], Floats] | None,
    rows: Any,
) -> dict[str, Channel]:
    """Returns what is logged, every `LOGGED`-th step."""
    names, robot = list(along.joints), world.robot
    angles = moved.qpos[:, world.qpos]
    asked = angles.copy()
    asked[:, world.chain] = along.angles[: moved.ticks]
    law = along.torque()[: moved.ticks]
    goal = tip_target(along.time[rows]) if tip_target else tip_positions(robot, asked[rows], tip)

    def per_joint(name: str, values: Floats, **more: Any) -> Channel:
        return channel(name, values[rows], names, **more)

    def torque(name: str, values: Floats, group: str, meaning: str) -> Channel:
        return per_joint(name, values, unit="N·m", group=group, meaning=meaning)

    watt = {"unit": "W", "group": "joint power", "meaning": "mechanical power of each servo"}
    by_law = "joint torque by the law"
    return {
        "position": channel("position", tip_positions(robot, angles[rows], tip), meaning="the tip"),
        "position_target": channel("position_target", goal, meaning="where the tip should be"),
        "q": channel("q", world.configurations(moved.qpos[rows]), configuration_labels(robot)),
        "joint_angle": per_joint("joint_angle", angles[:, world.chain]),
        "joint_command": per_joint("joint_command", along.angles[: moved.ticks]),
        "joint_rate": per_joint("joint_rate", moved.rates),
        "servo_deflection": per_joint("servo_deflection", moved.deflection),
        "joint_torque": per_joint("joint_torque", moved.torque),
        "joint_torque_law": torque(
            "joint_torque_law", law, by_law, "the law's, of the motion asked for"
        ),
        "joint_torque_gap": torque(
            "joint_torque_gap", moved.torque - law, "joint torque gap", "servos less law"
        ),
        "joint_torque_inverse": torque(
            "joint_torque_inverse", moved.inverse, "inverse dynamics", "MuJoCo's, of the same"
        ),
        "joint_torque_made": torque(
            "joint_torque_made", made, "law of the motion made", "the law's, of the motion made"
        ),
        "joint_friction": torque("joint_friction", moved.friction, "joint friction", "dry"),
        "joint_power": per_joint("joint_power", moved.torque * moved.rates, **watt),
    }


def tip_positions(robot: Robot, angles: Floats, tip: Tip) -> Floats:
    """Returns the tip's places (T, 3) [m] from the base origin."""
    flat = np.ascontiguousarray(angles)
    return np.array(
        [tip_jacobian(robot.tree, np.eye(3), row, tip.body, tip.point)[0] for row in flat]
    )
