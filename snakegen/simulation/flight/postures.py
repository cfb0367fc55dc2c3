"""Joint paths for missions, for any chain: bent where a straight body could not fly."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats, quaternion_xyzw
from snakegen.errors import MissionError
from snakegen.kernels.kinematics.chain import centre_of_gravity, forward
from snakegen.robot.posture import bent, driven_joints, hover_gimbals, set_angle, turning_rates
from snakegen.robot.robot import Robot

__all__ = [
    "PostureOption",
    "bent",
    "driven_joints",
    "extent",
    "place",
    "resting_height",
    "resting_joints",
    "slim",
    "turning_rates",
]


@dataclass(frozen=True)
class PostureOption:
    """Option of a mission that holds one posture.

    Attributes:
        posture: posture file; a bent body by default
    """

    posture: Mapping[str, Any] | None = None


def slim(robot: Robot, bend: float = 0.7) -> Floats:
    """Returns joint angles (k,) of the narrowest body that flies.

    Straight in dual-rotor mode; else a zigzag in the vertical plane, since a straight body has
    no torque about itself: pitches b, -2b, 2b, … so that links slope by turns.

    Raises:
        MissionError: virtual-single-rotor mode and no pitch joints.
    """
    names = driven_joints(robot)
    low, high, _ = robot.limits(names)
    out, turns = np.zeros(len(names)), 0
    if robot.modules.control.get("mode") == "dual_rotor":
        return np.clip(out, low, high)
    for i, name in enumerate(names):
        if name.endswith("_pitch"):
            size = bend if turns == 0 else 2.0 * bend
            out[i] = np.clip(size if turns % 2 == 0 else -size, low[i], high[i])
            turns += 1
    if turns < 2:
        raise MissionError(f"{robot.name} has too few pitch joints to fly narrow and bent.")
    return out


def extent(robot: Robot, joints: Floats) -> Floats:
    """Returns (2, 3) m: least and greatest x, y, z of the solid body from its CoG, hovering."""
    import mujoco

    from snakegen.simulation.flight.world import make_world

    world = make_world(robot, floor=False)
    model, data = world.model, mujoco.MjData(world.model)
    world.set_state(data, place(robot, joints, np.zeros(3)))
    mujoco.mj_kinematics(model, data)
    solid = np.flatnonzero(model.geom_contype)
    axes = data.geom_xmat[solid].reshape(-1, 3, 3)
    middle = data.geom_xpos[solid] + np.einsum("gij,gj->gi", axes, model.geom_aabb[solid, :3])
    half = np.einsum("gij,gj->gi", np.abs(axes), model.geom_aabb[solid, 3:])
    return np.array([(middle - half).min(axis=0), (middle + half).max(axis=0)])


def resting_joints(robot: Robot, posture: Mapping[str, Any] | None = None) -> Floats:
    """Returns joint angles (k,) of a posture by joint names; those of `bent` if it names none.

    Raises:
        MissionError: a part that is set by the mission: gimbals, the base's position.
        PostureError: as `Robot.configuration`.
    """
    named = {k: v for k, v in (posture or {}).items() if k != "base_rpy"}
    if not named:
        return bent(robot)
    q = robot.configuration(named)
    driven = driven_joints(robot)
    for name in named:
        if name not in driven:
            raise MissionError(
                f"{name} is set by the mission; its posture may hold base_rpy and joints with a "
                f"servo between links: {', '.join(driven)}."
            )
    angles = dict(zip(robot.joint_names, robot.angles(q), strict=True))
    return np.array([angles[n] for n in driven_joints(robot)])


def resting_attitude(
    robot: Robot, posture: Mapping[str, Any] | None, mission: str, *, level: bool = False
) -> Floats:
    """Returns the root link's attitude (3, 3) of a posture: that of its ``base_rpy``.

    Args:
        robot: that flies.
        posture: of the mission; level and along x where it has no ``base_rpy``.
        mission: its name, for the error.
        level: whether the mission holds nothing but that.

    Raises:
        MissionError: an attitude that the mission, or the robot's mode, does not hold.
    """
    rpy = (posture or {}).get("base_rpy")
    if rpy is None:
        return np.eye(3)
    rotation = robot.configuration({"base_rpy": rpy}).base_rotation
    if level and not np.allclose(rotation, np.eye(3), atol=1e-9):
        raise MissionError(f"mission '{mission}' starts level and along x; leave out base_rpy.")
    if robot.modules.control.get("mode") == "dual_rotor" and rotation[2, 2] < 1.0 - 1e-9:
        raise MissionError(
            f"{robot.name} flies in dual-rotor mode, which holds no tilt in hover; base_rpy may "
            "turn it about z alone."
        )
    return np.array(rotation)


def place(robot: Robot, joints: Floats, cog: Floats, rotation: Floats | None = None) -> Floats:
    """Returns q with the given joints, hover gimbals, level root and CoG at `cog` [m, world].

    `rotation` (3, 3) is the root's attitude, if not level.
    """
    q = np.array(robot.configuration())
    if rotation is not None:
        q[3:7] = quaternion_xyzw(rotation)
    for name, angle in zip(driven_joints(robot), joints, strict=True):
        set_angle(robot, q, name, float(angle))
    q = hover_gimbals(robot, q)
    base, origin = robot.base_pose(q)
    poses = forward(robot.tree, base, origin, robot.angles(q))
    _, now = centre_of_gravity(robot.tree, *poses)
    q[:3] += cog - now
    return q


def resting_height(robot: Robot, q: Floats) -> float:
    """Returns the CoG height [m] at which the lowest part touches the floor in configuration q."""
    import mujoco

    from snakegen.description.mjcf.decorate import lowest_point
    from snakegen.simulation.flight.world import make_world

    world = make_world(robot, floor=False)
    data = mujoco.MjData(world.model)
    world.set_state(data, q)
    mujoco.mj_forward(world.model, data)
    base, origin = robot.base_pose(q)
    _, cog = centre_of_gravity(robot.tree, *forward(robot.tree, base, origin, robot.angles(q)))
    return float(cog[2]) - lowest_point(world.model, data)
