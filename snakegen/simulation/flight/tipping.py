"""What unequal rotors tip over before the integrals hold them: refused before take-off."""

from typing import Any

import numpy as np

from snakegen.analysis.allocation import allocation
from snakegen.control.controller import Controller
from snakegen.errors import MissionError
from snakegen.kernels.control.types import DUAL
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.bounds.error_budget import sources
from snakegen.simulation.flight.plan import Plan
from snakegen.simulation.flight.plant import Imperfections
from snakegen.simulation.flight.postures import place
from snakegen.wrench_margins.vectored import set_margins

TIPS = 0.75  # rad, one standard deviation, of a body without gimbals
COVERED = 1.5  # standard deviations of tilt that limited gimbals have the side force for


def check_levers(
    robot: Robot, controller: Controller, plan: Plan, imperfections: Imperfections
) -> None:
    """Refuses a body that unequal rotors tip over before the integrals hold them.

    A constant angular acceleration α leaves ``α / K_p`` until the integral has learned it. Where
    one standard deviation of it tilts a body without gimbals by more than `TIPS`, thrust no longer
    bears the weight of the unlucky ones: of hexarotors and quadrotors with a radius of gyration of
    35 mm, all of ten draws pass below .7 rad, nine at .8, eight at 1.0, none above 1.4.

    Limited gimbals have to hold the body level against that tilt with a side force of weight times
    tilt. Refused is a force margin of less than `COVERED` of them: of a quadrotor whose four arms
    turn about themselves and of dragon4, 2 of eight draws pass at 1.1, 5 to 6 at 1.7 … 1.9, 7 at
    2.1 … 2.7.

    Raises:
        MissionError: names acceleration, tilt and what would fly.
    """
    if controller.mode != DUAL:
        _check_side_force(robot, controller, plan, imperfections)
        return
    turned, tilt = _tilt(robot, controller, plan, imperfections)
    if tilt <= TIPS:
        return
    q = place(robot, plan.joints[0], np.array([0.0, 0.0, 2.0]))
    frame = allocation(robot, q)
    gyration = float(np.sqrt(np.min(np.diag(frame.inertia)[:2]) / frame.mass))
    lever = float(np.linalg.norm(frame.rotor_positions[:, :2], axis=1).max())
    raise MissionError(
        f"{robot.name} tips over before its integrals hold unequal rotors: they turn it by "
        f"{turned:.3g} rad/s² (one standard deviation), which tilts it by {tilt:.2f} rad at its "
        f"gain; up to {TIPS:g} rad are flown. Its radius of gyration is {1e3 * gyration:.3g} mm, "
        f"its rotors are up to {lever:.3g} m off: give it the inertia that arms and motors have, "
        f"a smaller plant.thrust_mismatch (now {imperfections.thrust_mismatch:g}), or fly the "
        "ideal plant."
    )


def _tilt(
    robot: Robot, controller: Controller, plan: Plan, imperfections: Imperfections
) -> tuple[float, float]:
    """Returns one standard deviation of angular acceleration [rad/s²] and the tilt [rad] it leaves.

    Of roll and pitch the worse, in the plan's first posture.
    """
    found = sources(robot, controller, plan.joints[0], imperfections).acceleration
    turned = float(np.linalg.norm(found[3:5], axis=1).max())
    return turned, turned / float(np.min(controller.law.torque[0][:2]))


def _check_side_force(
    robot: Robot, controller: Controller, plan: Plan, imperfections: Imperfections
) -> None:
    """Refuses limited gimbals that cannot hold the body level while unequal rotors tilt it."""
    low, high, _ = robot.limits(sorted(robot.gimbal_names))
    if not np.any(high - low < 2.0 * np.pi - 1e-6):
        return
    turned, tilt = _tilt(robot, controller, plan, imperfections)
    scale: dict[str, Any] = {"force_scale": robot.force_scale, "torque_scale": robot.torque_scale}
    wanted = allocation(robot, plan.start).hover_wrench
    found = set_margins(robot.force_sets(plan.start), wanted, wrench_starts=0, **scale)
    margin, side = float(found.force_bounds[0]), robot.force_scale * tilt
    if not 0.0 <= margin < COVERED * side:  # nan: hover itself is out of reach, said elsewhere
        return
    raise MissionError(
        f"{robot.name} cannot hold itself level with its limited gimbals: unequal rotors turn it "
        f"by {turned:.3g} rad/s², which tilts it by {tilt:.2f} rad at its gain (one standard "
        f"deviation), and {COVERED:g} of these take {COVERED * side:.3g} N across; its force "
        f"margin is {margin:.3g} N. Give it wider gimbal limits, control.mode=dual_rotor (it then "
        "tilts to move), a smaller plant.thrust_mismatch (now "
        f"{imperfections.thrust_mismatch:g}), or fly the ideal plant."
    )
