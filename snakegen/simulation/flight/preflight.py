"""What is refused before take-off: plans out of reach, wind without air, no hover at the start."""

from dataclasses import replace

import mujoco
import numpy as np

from snakegen.analysis.allocation import allocation
from snakegen.base.sample_store import slices
from snakegen.control.controller import MODES, Controller
from snakegen.control.frame import CogFrame, cog_frame
from snakegen.control.lost_motion import frame_loss
from snakegen.control.switch import check_mode, force_sigma_min, out_of_grip
from snakegen.description.mjcf.decorate import lowest_point
from snakegen.errors import MissionError
from snakegen.kernels.allocation.gimbals import joint_order
from snakegen.kernels.allocation.mode_blending import DUAL_SIGMA_MIN
from snakegen.kernels.allocation.underactuated import level_axes, rotor_map
from snakegen.kernels.control.types import DUAL, VIRTUAL, Command, Measured, Target
from snakegen.robot.robot import GRAVITY, Robot
from snakegen.simulation.flight.plan import Plan, is_constant
from snakegen.simulation.flight.plant import Imperfections
from snakegen.simulation.flight.postures import driven_joints, place, turning_rates
from snakegen.simulation.flight.world import make_world


def check_references(robot: Robot, plan: Plan) -> None:
    """Refuses a plan that leads joints beyond their limits of angle and speed, or into the floor.

    Raises:
        MissionError: the first such joint or instant.
    """
    names = driven_joints(robot)
    low, high, _ = robot.limits(names)
    count = 1 if is_constant(plan.joints) else len(plan.joints)
    for part in slices(count):
        joints = plan.joints[part]
        beyond = np.argwhere((joints < low - 1e-9) | (joints > high + 1e-9))
        if not len(beyond):
            continue
        k, i = part.start + beyond[0][0], beyond[0][1]
        raise MissionError(
            f"the mission leads {names[i]} to {plan.joints[k, i]:.3f} rad at {plan.time[k]:.2f} s; "
            f"its limits are {low[i]:g} … {high[i]:g}."
        )
    _check_rates(robot, plan, names)
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


def _check_rates(robot: Robot, plan: Plan, names: list[str]) -> None:
    """Refuses a plan that turns a joint faster than its servo.

    Raises:
        MissionError: the fastest turn of the first such joint.
    """
    if is_constant(plan.joints):
        return
    most = turning_rates(robot, names)
    fastest, when = np.zeros(len(names)), np.zeros(len(names), int)
    beyond: list[int] = []  # the joints, in order of time
    for part in slices(len(plan.time) - 1):
        rows = slice(part.start, part.stop + 1)
        turned = np.abs(np.diff(plan.joints[rows], axis=0)) / np.diff(plan.time[rows])[:, None]
        beyond += np.argwhere(turned > most * (1.0 + 1e-6))[:1, 1].tolist()
        peak = turned.max(axis=0)
        when = np.where(peak > fastest, part.start + turned.argmax(axis=0), when)
        fastest = np.maximum(fastest, peak)
    if not beyond:
        return
    i = beyond[0]
    raise MissionError(
        f"the mission turns {names[i]} at {fastest[i]:.3g} rad/s at {plan.time[when[i]]:.2f} s; "
        f"its servo turns at {most[i]:g} at most: leave the motion more time."
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
        MissionError: too heavy, no hover within limits, or σ_min below the mode's threshold.
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
    if force:
        return
    frame = cog_frame(controller, angles, base, origin)
    command = _first_command(robot, controller, plan, frame)
    _check_rank(robot, controller, frame, command)
    unmet, limit = _unmet(controller, frame, command), robot.rotors.thrust_max
    thrust, least = command.thrust, np.minimum(robot.rotors.thrust_min, 0.0)
    beyond = np.any(thrust > limit * (1 + 1e-9)) or np.any(thrust < least * (1 + 1e-9) - 1e-9)
    if unmet > 1e-3 or beyond:
        raise MissionError(
            f"{robot.name} cannot hover in the mission's first posture: thrusts "
            f"{np.round(thrust, 2).tolist()} N for limits {np.round(limit, 2).tolist()} N, "
            f"{100 * unmet:.2g} % of the weight unbalanced. What would hover: "
            f"{_remedy(robot, controller, plan, frame)}."
        )


def _way_out(robot: Robot, frame: CogFrame) -> str:
    """Returns what a body whose free gimbals do not reach all six axes can do."""
    other = "bend the body, or lower control.sigma_min"
    if len(robot.chain_joints) > len(robot.gimbal_names):
        return other
    q = robot.configuration(gimbals="hover")
    rank = np.linalg.matrix_rank(allocation(robot, q).dual, tol=1e-6)
    if rank < 4:
        return "its rotors cannot hold a level hover"
    return (
        "with free gimbals it lacks an axis; control: {mode: dual_rotor} in the modules file flies "
        "it by unequal thrusts"
    )


def _check_rank(robot: Robot, controller: Controller, frame: CogFrame, command: Command) -> None:
    """Refuses a start whose wrench map has lost an axis.

    Raises:
        MissionError: σ_min of J_w or Q_force (virtual) or of Q_trunc (dual) below its threshold.
    """
    sigma, least = float(command.sigma_min), controller.law.sigma_min
    if controller.mode == DUAL:
        if sigma < DUAL_SIGMA_MIN:
            turns = joint_order(frame.mounts, command.gimbals)
            full = rotor_map(frame.mounts, frame.rotors, turns)
            why = frame_loss(full, controller.rotors, frame.scale, level_axes(frame.axes))
            raise MissionError(
                f"{robot.name} starts in a singular posture: scaled σ_min(Q_trunc) "
                f"{round(sigma, 9):.2g} is below {DUAL_SIGMA_MIN:g}; {why or 'bend the body'}."
            )
        return
    if sigma < least and controller.apparatuses > 2:  # fewer never get there, however bent
        raise MissionError(
            f"{robot.name} starts in a singular posture: scaled σ_min {sigma:.2g} is below "
            f"{least:g}; {_way_out(robot, frame)}."
        )
    reach = force_sigma_min(controller, frame, command.gimbals)
    if reach < least:
        raise MissionError(
            f"{robot.name} starts where virtual-single-rotor mode is singular: "
            f"{out_of_grip(controller, frame, command.gimbals)}"
        )


def _remedy(robot: Robot, controller: Controller, plan: Plan, frame: CogFrame) -> str:
    """Returns what would hover where the controller does not, as far as that is known."""
    works = []
    if not controller.law.constrained:
        other = controller.with_law(constrained=1)
        command = _first_command(robot, other, plan, frame)
        if _unmet(other, frame, command) <= 1e-3:
            works.append("--allocator constrained")
    mode = VIRTUAL if controller.mode == DUAL else DUAL
    if robot.gimbal_names:
        base, _ = robot.base_pose(plan.start)
        if check_mode(controller, mode, robot.angles(plan.start), base).allowed:
            name = next(k for k, v in MODES.items() if v == mode)
            works.append(f"control.mode={name}")
    works += _wider(robot, controller, plan, frame)
    stronger = _stronger(robot, controller, plan, frame)
    if stronger is not None:
        works.append(f"{stronger:.2f} times the thrust (vectoring_apparatus.thrust_max)")
    works.append("a posture whose CoG is amid the apparatuses (--option posture=FILE)")
    return "; ".join(works)


def _wider(robot: Robot, controller: Controller, plan: Plan, frame: CogFrame) -> list[str]:
    """Returns which limits alone keep the body from hovering: least thrusts, ranges of gimbals."""
    idle = replace(
        controller,
        rotors=controller.rotors._replace(thrust_min=np.minimum(controller.rotors.thrust_min, 0.0)),
    )
    lower, upper = controller.law.gimbal_lower, controller.law.gimbal_upper
    round_ = {"gimbal_lower": lower - 2.0 * np.pi, "gimbal_upper": upper + 2.0 * np.pi}
    out, gap = [], _unmet(controller, frame, _first_command(robot, controller, plan, frame))
    for turns, free in ((False, idle), (True, controller.with_law(**round_))):
        command = _first_command(robot, free, plan, frame)
        if not _unmet(free, frame, command) <= min(1e-3, 0.5 * gap):
            continue
        if not turns:
            out.append("less thrust_min")
            continue
        beyond = (command.gimbals < lower - 1e-6) | (command.gimbals > upper + 1e-6)
        names = [
            f"{name} {command.gimbals[j, k]:+.3f}"
            for j, a in enumerate(robot.modules.apparatuses)
            for k, name in enumerate((a.roll, a.pitch))
            if name and beyond[j, k]
        ]
        out.append(f"gimbals that reach {', '.join(names)} rad")
    return out


def _stronger(robot: Robot, controller: Controller, plan: Plan, frame: CogFrame) -> float | None:
    """Returns by what all thrust limits must be multiplied to hover; None if nothing helps."""
    ample, rotors, gimbals = 64.0, controller.rotors, controller.gimbals
    strong = replace(
        controller,
        rotors=rotors._replace(thrust_max=ample * rotors.thrust_max),
        gimbals=gimbals._replace(limit=ample * gimbals.limit),
    )
    command = _first_command(robot, strong, plan, frame)
    if _unmet(strong, frame, command) > 1e-3:
        return None
    return float(np.ceil(100.0 * np.max(command.thrust / rotors.thrust_max)) / 100.0)


def _unmet(controller: Controller, frame: CogFrame, command: Command) -> float:
    """Returns the share of the weight that a command leaves unbalanced."""
    gap = frame.scale * (command.given - frame.hover_wrench)
    return float(np.linalg.norm(gap[2:] if controller.mode == DUAL else gap))


def _first_command(robot: Robot, controller: Controller, plan: Plan, frame: CogFrame) -> Command:
    """Returns what the first tick asks of the actuators."""
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
    return command
