"""The gains that a robot flies: its own sets, and defaults for axes that no gimbal acts on."""

from typing import Any

import numpy as np

from snakegen.control.gains import Floats, Gains, gains_from
from snakegen.errors import SpecError, near
from snakegen.robot.kinematics import forward
from snakegen.robot.robot import Robot

ROOT_AXES_UP_TO = 8  # links; longer bodies fly by the middle link's axes (THEORY A6)
# [1/s², 1/s] of an axis that is moved by tilting the body alone (assumed): Table 5's position loop
# is as fast as its attitude loop, and unstable through it at any motor lag above 15 ms.
TILT_FORCE_P, TILT_FORCE_I, TILT_FORCE_D = 1.5, 0.2, 2.2
# Unequal rotors tilt such a body until the integral has learnt them: within 1 s about the axis
# (assumed; Table 5's 50 s are those of a body whose gimbals take the difference).
TILT_TORQUE_P, TILT_TORQUE_I, TILT_TORQUE_D = 30.0, 30.0, 9.0
FIXED_YAW_I = 5.0  # 1/s³, of a body without gimbals, whose yaw is what its rotors' drag leaves


def gain_set(robot: Robot, gains: str | Gains | None = None) -> Gains:
    """Returns gains by name from the robot's own sets; defaults for what they do not name.

    The default is Table 5, whose k_θ = 0 leaves forward force to the gimbals. Along an axis (x or
    y of the CoG frame) to which no gimbal can turn a thrust the body tilts instead: k_θ or k_φ is
    1, and the axis has a slower position loop and a faster attitude loop, with integrals that learn
    unequal rotors within seconds.

    Raises:
        SpecError: an unknown name.
    """
    if isinstance(gains, Gains):
        return gains
    sets = robot.modules.gain_sets
    name = str(gains or robot.modules.control.get("gains", ""))
    if name not in sets and gains is not None:
        raise SpecError(f"{robot.name} has no gain set '{name}'.{near(name, sets)}")
    return gains_from(_tilting(robot) | dict(sets.get(name, {})))


def _tilting(robot: Robot) -> dict[str, Any]:
    """Returns the gains in which a robot's defaults differ from Table 5."""
    usual, forward_axis, sideways = Gains(), *turned_axes(robot)
    if forward_axis and sideways:
        return {}
    out: dict[str, Any] = {
        f"{what}_{k}": getattr(usual, f"{what}_{k}").copy()
        for what in ("force", "torque")
        for k in "pid"
    }
    for turned, axis, about, gain in (
        (forward_axis, 0, 1, "attitude_pitch"),
        (sideways, 1, 0, "attitude_roll"),
    ):
        if not turned:
            for k, place, turn in (
                ("p", TILT_FORCE_P, TILT_TORQUE_P),
                ("i", TILT_FORCE_I, TILT_TORQUE_I),
                ("d", TILT_FORCE_D, TILT_TORQUE_D),
            ):
                out[f"force_{k}"][axis], out[f"torque_{k}"][about] = place, turn
            out[gain] = 1.0
    if not robot.gimbal_names:
        out["torque_i"][2] = FIXED_YAW_I
    return out


def turned_axes(robot: Robot) -> tuple[bool, bool]:
    """Returns whether a gimbal can turn a thrust along x, and along y, of the CoG frame.

    A gimbal moves an upward thrust across its own axis: along x unless every gimbal axis is along
    x, all joints at 0, and likewise y.
    """
    body, turn = axes_body(robot, str(robot.modules.control.get("axes", "auto")))
    tree = robot.tree
    rotation, _ = forward(tree, np.eye(3), np.zeros(3), np.zeros(len(tree.parent) - 1))
    frame = rotation[body] @ turn
    bodies = [int(b) for b in (*robot.gimbals.roll_body, *robot.gimbals.pitch_body) if b >= 0]
    axes = np.array([frame.T @ rotation[b] @ tree.axis[b] for b in bodies]).reshape(-1, 3)
    x, y = (bool(np.any(np.linalg.norm(np.delete(axes, k, 1), axis=1) > 1e-6)) for k in (0, 1))
    return x, y


def axes_body(robot: Robot, axes: str) -> tuple[int, Floats]:
    """Returns the body whose axes the CoG frame has, and their rotation in it.

    Args:
        robot: any robot.
        axes: "root", "middle" or "auto": the middle link's where there are more than 8 links.
    """
    links = list(robot.modules.lengths)
    if axes == "auto":
        axes = "middle" if len(links) > ROOT_AXES_UP_TO else "root"
    if axes == "root" or not links:
        return 0, np.eye(3)
    body, turn, _ = robot.body_of_link(links[(len(links) - 1) // 2])
    return body, turn
