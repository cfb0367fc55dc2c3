"""Bounds of a flight's tracking, for any body: by mission, by mode, and by what it is built like.

A bound is a requirement, not a forecast of the plant that is flown: it says how well this body
tracks with these gains when its hardware is no worse than the default plant (3 % thrust mismatch,
an IMU within 1°, joints within 0.1°). `error_budget.expected_errors` gives that figure, one
standard deviation over draws, `stream_budget` what rotors in streams add, and `linear_response`
what the air leaves behind a body that moves through it; a plant that declares
worse hardware, or a model that is wrong, is judged by the same bound and fails. Where ZN23 prints a
figure, the smaller of the two holds, unless it is below two standard deviations: then it is of a
platform unlike this one.

- ``position_rmse_norm_m``, ``attitude_rmse_norm_rad``: the norm over the axes, at most `FACTORS`
  times the expected norm. Norms of many draws scatter little, so that good flights do not fail by
  luck and the bound is still below three medians (`benchmarks/mission_bounds.py`).
- ``position_rmse_m``, ``attitude_rmse_rad``: axis by axis, at most three standard deviations.
- ``position_max_m``: the largest error on the way.
- ``trim_sigmas``: what the integrals hold when trimming ends, in standard deviations of what the
  default plant asks for: a rotor that turns the wrong way is trimmed out, but not unseen.
- ``hover_sigmas``: the same of the torque that the law asks for on average while a flight stays.
"""

from typing import Any

import numpy as np

from snakegen.analysis.allocation import allocation
from snakegen.base.geometry import Floats
from snakegen.control.controller import Controller
from snakegen.control.frame import cog_frame
from snakegen.control.gain_sets import gain_set
from snakegen.control.gains import Gains
from snakegen.kernels.control.types import DUAL
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.bounds.error_budget import expected_errors, position_peak, sources
from snakegen.simulation.flight.bounds.linear_response import drag_errors
from snakegen.simulation.flight.bounds.stream_budget import stream_errors
from snakegen.simulation.flight.plan import Plan, farthest
from snakegen.simulation.flight.plant import Imperfections

DITHER = np.array([0.003] * 3 + [0.003] * 3)  # m, rad: of noise within a run, at the least
# Position norm and attitude norm in expected norms, and the largest position error in position
# norms, by mission and mode: of ten seeds of the presets, so that good flights pass and a bound
# stays below three medians (benchmarks/mission_bounds.py).
FACTORS: dict[tuple[str, str], tuple[float, float, float]] = {
    ("", "virtual_single_rotor"): (2.0, 2.0, 1.6),
    ("", "dual_rotor"): (1.7, 2.0, 2.0),
    ("transform", "dual_rotor"): (1.25, 1.6, 2.0),
    ("squeeze", "dual_rotor"): (2.0, 2.5, 2.5),
}
AXIS = 3.0  # standard deviations of one axis
RESPONSE = 1.5  # times the linear response to a known disturbance
PAPER = 2.0  # standard deviations that a printed figure must allow this body
MOST = {"position_rmse_m": 0.2, "position_max_m": 0.5, "attitude_rmse_rad": 0.2}
"""m, rad: whatever a body is expected to do, beyond this it is not where it should be."""
TRIM = 4.0  # standard deviations held by the integrals
LEAST = 1.0  # s of hover that tell what the law asks for on average
# Tracking errors that ZN23 prints: position x y z [m], attitude roll pitch yaw [rad].
TABLES: dict[tuple[str, str], tuple[str, tuple[float, ...]]] = {
    ("transform", "virtual_single_rotor"): (
        "Table 6",
        (0.036, 0.038, 0.017, 0.026, 0.033, 0.033),
    ),
    ("plan", "virtual_single_rotor"): ("Table 6", (0.036, 0.038, 0.017, 0.026, 0.033, 0.033)),
    ("transform", "dual_rotor"): ("Table 4", (0.076, 0.180, 0.060, 0.033, 0.063, 0.062)),
    ("ascend", "dual_rotor"): ("5.2.1, ascent to 3 m", (0.099, 0.035, 0.058)),
}


def tracking_bounds(
    robot: Robot,
    controller: Controller,
    plan: Plan,
    mission: str,
    mode: str,
    gains: Gains | None = None,
) -> dict[str, dict[str, Any] | None]:
    """Returns the thresholds of a flight that follows its references undisturbed.

    Args:
        robot, controller: what flies.
        plan: its references.
        mission: name.
        mode: "virtual_single_rotor" or "dual_rotor".
        gains: of the controller; the robot's own if absent.
    """
    usual = Imperfections()
    parts = (
        expected_errors(robot, controller, plan, usual),
        stream_errors(robot, controller, plan, usual),
        DITHER,
    )
    expected = np.sqrt(np.sum(np.square(parts), axis=0))
    chosen = gain_set(robot) if gains is None else gains
    drag = RESPONSE * drag_errors(robot, controller, chosen, plan, usual)
    axis = np.hypot(AXIS * expected, drag)
    paper = np.array(TABLES.get((mission, mode), ("", ()))[1])
    known = slice(len(paper))
    axis[known] = np.minimum(axis[known], np.maximum(paper, PAPER * expected[known]))
    factors = FACTORS.get((mission, mode), FACTORS["", mode])
    norms = factors[:2] * np.linalg.norm(expected.reshape(2, 3), axis=1)
    position, attitude = np.hypot(norms, np.linalg.norm(drag.reshape(2, 3), axis=1))
    peak = position_peak(robot, controller, plan, usual)
    place, turn = MOST["position_rmse_m"], MOST["attitude_rmse_rad"]
    bounds = {
        "position_rmse_m": _rounded(np.minimum(axis[:3], place)),
        "position_rmse_norm_m": _rounded(min(position, place)),
        "position_max_m": _rounded(min(factors[2] * peak * position, MOST["position_max_m"])),
        "attitude_rmse_rad": _rounded(np.minimum(axis[3:], turn)),
        "attitude_rmse_norm_rad": _rounded(min(attitude, turn)),
    }
    if plan.trim:
        bounds["trim_sigmas"] = TRIM
    if stays(plan):
        bounds["hover_sigmas"] = TRIM
    return {name: {"at_most": bound} for name, bound in bounds.items()}


def leaves_at_start(robot: Robot, controller: Controller, plan: Plan) -> bool:
    """Tells whether the default plant carries an untrimmed body further off than bounds allow.

    A body that is light for its rotors' levers (a small radius of gyration) is turned quickly by
    unequal thrusts, and without gimbals it moves where it tilts.

    Args:
        robot, controller, plan: of the flight.
    """
    expected = expected_errors(robot, controller, plan, Imperfections())
    factors = FACTORS["", "dual_rotor" if controller.mode == DUAL else "virtual_single_rotor"]
    most = np.array([MOST["position_rmse_m"], MOST["attitude_rmse_rad"]])
    sizes = np.linalg.norm(expected.reshape(2, 3), axis=1)
    return bool(np.any(np.array(factors[:2]) * sizes > most))


def usual_accelerations(robot: Robot, controller: Controller, plan: Plan) -> Floats:
    """Returns what default imperfections ask for in a plan's first posture, (6,) m/s² and rad/s².

    One standard deviation over draws.
    """
    usual = sources(robot, controller, plan.joints[0], Imperfections()).acceleration
    return np.asarray(np.linalg.norm(usual, axis=1))


def trim_sigmas(held: dict[str, Any], spread: Floats) -> list[float]:
    """Returns what each integral holds after the trim, (6,) standard deviations; 0 where none.

    Args:
        held: `trim.found`.
        spread: `usual_accelerations`.
    """
    values = np.abs([*held["force_integral_m_s2"], *held["torque_integral_rad_s2"]])
    return [float(v / s) if s > 1e-9 else 0.0 for v, s in zip(values, spread, strict=True)]


def stays(plan: Plan) -> bool:
    """Tells whether a plan is a hover in one pose and posture, of a second or more."""
    moves = farthest(plan.position) + farthest(plan.joints)
    lasts = float(plan.time[-1] - plan.time[0])
    return bool(moves < 1e-9 and not plan.on_floor and lasts >= LEAST)


def hover_sigmas(
    robot: Robot, controller: Controller, plan: Plan, wanted: Floats, spread: Floats
) -> list[float] | None:
    """Returns the torque that a flight which stays asks for, (3,) standard deviations.

    The mean over the second half of the run: what is wrong with the body, however an IMU is tilted.
    None for a plan that moves, or a run of less than a second.

    Args:
        robot, controller, plan: of the flight.
        wanted: (T, 3) N·m, torque of the control law, CoG axes.
        spread: `usual_accelerations`.
    """
    if not stays(plan) or len(wanted) * float(plan.time[1] - plan.time[0]) < LEAST:
        return None
    base, origin = robot.base_pose(plan.start)
    frame = cog_frame(controller, robot.angles(plan.start), base, origin)
    a = allocation(robot, plan.start)
    into = frame.axes.T @ base
    torque = np.linalg.solve(into @ a.inertia @ into.T, wanted[len(wanted) // 2 :].mean(axis=0))
    pairs = zip(np.abs(torque), spread[3:], strict=True)
    return [float(v / s) if s > 1e-9 else 0.0 for v, s in pairs]


def _rounded(value: Floats | float) -> Any:
    """Returns numbers to three digits, as people read them."""
    shown = [float(f"{v:.3g}") for v in np.atleast_1d(value)]
    return shown if np.ndim(value) else shown[0]
