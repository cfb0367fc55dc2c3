"""Bounds of a hover that a known push or wind displaces once: missions `gust` and `ring`."""

from typing import Any

import numpy as np

from snakegen.control.controller import Controller
from snakegen.control.gains import Gains
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.bounds.error_budget import expected_errors
from snakegen.simulation.flight.bounds.flight_bounds import DITHER, FACTORS, RESPONSE
from snakegen.simulation.flight.bounds.linear_response import response
from snakegen.simulation.flight.plan import Plan
from snakegen.simulation.flight.plant import Imperfections

FARTHEST = 0.6  # m, whatever the response
NEAR, SLOWER = 0.05, 0.5  # m from the target that counts as back; s later than the linear response


def disturbed_bounds(
    robot: Robot, controller: Controller, gains: Gains, plan: Plan, mode: str
) -> dict[str, dict[str, Any] | None]:
    """Returns the thresholds of a hover that is disturbed once and comes back.

    Its linear response times `RESPONSE`, and the errors that the default plant leaves a hover
    (`flight_bounds`), added as squares.

    Args:
        robot, controller, gains: what flies.
        plan: with its disturbance, or wind.
        mode: "virtual_single_rotor" or "dual_rotor".
    """
    usual = Imperfections()
    shown = slice(plan.trim, None)
    moved = RESPONSE * response(robot, controller, gains, plan, usual)[shown]
    still = np.sqrt(expected_errors(robot, controller, plan, usual) ** 2 + DITHER**2)
    place, turn, most = FACTORS["", mode]
    usual_place, usual_turn = (np.linalg.norm(x) for x in still.reshape(2, 3))
    swing = np.sqrt(np.mean(moved**2, axis=0))
    far = np.linalg.norm(moved[:, :3], axis=1)
    found = {
        "position_rmse_norm_m": np.hypot(place * usual_place, np.linalg.norm(swing[:3])),
        "attitude_rmse_norm_rad": np.hypot(turn * usual_turn, np.linalg.norm(swing[3:])),
        "position_max_m": np.hypot(most * place * usual_place, far.max()),
    }
    limits = {"position_max_m": FARTHEST}
    if "recovery_s" in plan.thresholds:
        end = float(plan.facts["gust_end_s"])
        time = plan.time[shown]
        out = np.flatnonzero((time > end) & (far > NEAR - usual_place))
        found["recovery_s"] = (float(time[out[-1]]) - end if out.size else 0.0) + SLOWER
        limits["recovery_s"] = float(plan.thresholds["recovery_s"]["at_most"])  # type: ignore[index]
    return {
        name: {"at_most": float(f"{min(value, limits.get(name, np.inf)):.3g}")}
        for name, value in found.items()
    }
