"""What is refused before take-off: plans out of reach, wind without air, no hover at the start."""

from typing import Any

import mujoco
import numpy as np

from snakegen.control.controller import Controller
from snakegen.control.frame import cog_frame
from snakegen.description.mjcf import lowest_point
from snakegen.errors import MissionError
from snakegen.kernels.control_types import Measured, Target
from snakegen.robot import GRAVITY, Robot
from snakegen.verify.plan import Plan
from snakegen.verify.plant import Imperfections
from snakegen.verify.postures import driven_joints, place
from snakegen.verify.world import make_world


def check_references(robot: Robot, plan: Plan) -> None:
    """Refuses a plan that leads joints beyond their limits or the body into the floor.

    Raises:
        MissionError: the first such joint or instant.
    """
    names = driven_joints(robot)
    low, high, _ = robot.limits(names)
    beyond = np.argwhere((plan.joints < low - 1e-9) | (plan.joints > high + 1e-9))
    if len(beyond):
        k, i = beyond[0]
        raise MissionError(
            f"the mission leads {names[i]} to {plan.joints[k, i]:.3f} rad at {plan.time[k]:.2f} s; "
            f"its limits are {low[i]:g} … {high[i]:g}."
        )
    if plan.on_floor:
        return
    world = make_world(robot, floor=False)
    data = mujoco.MjData(world.model)
    for k in np.unique(np.linspace(0, len(plan.time) - 1, 40).astype(int)):
        world.set_state(data, place(robot, plan.joints[k], plan.position[k], plan.rotation[k]))
        mujoco.mj_kinematics(world.model, data)
        lowest = lowest_point(world.model, data)
        if lowest < 0.0:
            raise MissionError(
                f"the mission leads the body {-lowest:.2f} m into the floor at "
                f"{plan.time[k]:.2f} s: CoG at {plan.position[k, 2]:.2f} m; fly higher."
            )


def check_air(plan: Plan, imperfections: Imperfections) -> None:
    """Refuses wind where there is no air.

    Raises:
        MissionError: the plan's wind or turbulence would do nothing.
    """
    blows = plan.turbulence > 0.0 or (plan.wind is not None and bool(np.any(plan.wind)))
    if blows and imperfections.air_density == 0.0:
        raise MissionError(
            "the mission's wind does nothing without air: leave out --ideal, set plant.air_density "
            "above 0, or give the gust as a force."
        )


def check_start(robot: Robot, controller: Controller, plan: Plan, *, force: bool = False) -> None:
    """Refuses a start that cannot hover; `force` lets a singular posture pass.

    Raises:
        MissionError: too heavy, no hover within limits, or σ_min below the controller's threshold.
    """
    most = float(robot.rotors.thrust_max.sum())
    weight = robot.mass * GRAVITY
    if most <= weight:
        raise MissionError(
            f"{robot.name} is too heavy to fly: {weight:.1f} N of weight, {most:.1f} N of thrust "
            f"at most (thrust to weight {most / weight:.2f})."
        )
    base, origin = robot.base_pose(plan.start)
    angles = robot.angles(plan.start)
    frame = cog_frame(controller, angles, base, origin)
    sigma, unmet, thrust, limit = _first_allocation(robot, controller, plan, frame)
    if sigma < controller.law.sigma_min and controller.mode == 1 and not force:
        raise MissionError(
            f"{robot.name} starts in a singular posture: scaled σ_min {sigma:.2g} is below "
            f"{controller.law.sigma_min:g}; bend the body, or lower control.sigma_min."
        )
    if force:
        return
    if unmet > 1e-3 or np.any(thrust > limit * (1 + 1e-9)) or np.any(thrust < -1e-9):
        raise MissionError(
            f"{robot.name} cannot hover in the mission's first posture: thrusts "
            f"{np.round(thrust, 2).tolist()} N for limits {np.round(limit, 2).tolist()} N, "
            f"{100 * unmet:.2g} % of the weight unbalanced."
        )


def _first_allocation(
    robot: Robot, controller: Controller, plan: Plan, frame: Any
) -> tuple[float, float, Any, Any]:
    """Returns σ_min, share of the weight unmet, thrusts and limits of the first tick."""
    base, origin = robot.base_pose(plan.start)
    angles = robot.angles(plan.start)
    still = np.zeros(3)
    measured = Measured(base, origin, still, still, angles, np.zeros_like(angles))
    target = Target(frame.cog, still, still, frame.axes, still)
    turns = np.zeros((controller.apparatuses, 2))
    for j in range(controller.apparatuses):
        for k, body in enumerate((robot.gimbals.roll_body[j], robot.gimbals.pitch_body[j])):
            turns[j, k] = angles[body - 1] if body >= 0 else 0.0
    _, command = controller.tick(measured, target, controller.start(turns), 1e-9)
    gap = frame.scale * (command.given - frame.hover_wrench)
    if controller.mode == 0:
        gap = gap[2:]
    return (
        float(command.sigma_min),
        float(np.linalg.norm(gap)),
        command.thrust,
        robot.rotors.thrust_max,
    )
