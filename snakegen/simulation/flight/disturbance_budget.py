"""Linear response of a hover to a known disturbance: the scale of the bounds of `gust` and `ring`.

A disturbance a (acceleration of the CoG, or of the attitude) displaces a loop by
``E/A = X/N``: N is the characteristic polynomial of the closed loop, and X what is left of its
``s²`` term (`control.poles.compliances`). Gains, lag, delay and low-pass are those of the
controller; saturation and the air's damping are not in it.
"""

from typing import Any

import numpy as np
from scipy.signal import lfilter

from snakegen.analysis.allocation import allocation
from snakegen.base.geometry import Floats
from snakegen.control.controller import Controller
from snakegen.control.gains import Gains
from snakegen.control.gimbal_reach import vectoring_share
from snakegen.control.poles import NDComplex, compliances
from snakegen.kernels.control.types import DUAL
from snakegen.robot.configuration import Configuration
from snakegen.robot.robot import GRAVITY, Robot
from snakegen.simulation.flight.error_budget import expected_errors
from snakegen.simulation.flight.flight_bounds import DITHER, FACTORS
from snakegen.simulation.flight.plan import Plan
from snakegen.simulation.flight.plant import Imperfections
from snakegen.simulation.flight.wind_force import wind_wrench
from snakegen.simulation.flight.world import World, make_world

RESPONSE = 1.5  # times the linear response that a flight may be displaced
FARTHEST = 0.6  # m, whatever the response
NEAR, SLOWER = 0.05, 0.5  # m from the target that counts as back; s later than the linear response


def response(
    robot: Robot, controller: Controller, gains: Gains, plan: Plan, what: Imperfections
) -> Floats:
    """Returns the displacement (T, 6) [m, rad] that a plan's push and wind leave, world axes.

    In dual-rotor mode a body that is turned is carried sideways by its thrust, and leans to come
    back: both are in it.
    """
    push = accelerations(robot, plan, what)
    lag = max((r.lag for a in robot.modules.apparatuses for r in a.rotors), default=0.0)
    loops = compliances(controller, gains, controller.mode, lag=lag, delay=what.delay)
    dt = float(plan.time[1] - plan.time[0])
    out = np.zeros_like(push)
    for i in (3, 4, 5):
        out[:, i] = _driven(loops[i], push[:, i], dt)
    if controller.mode == DUAL:
        push[:, 0] += GRAVITY * out[:, 4]
        push[:, 1] -= GRAVITY * out[:, 3]
    for i in (0, 1, 2):
        out[:, i] = _driven(loops[i], push[:, i], dt)
    if controller.mode == DUAL:
        asked = np.gradient(np.gradient(out[:, :2], dt, axis=0), dt, axis=0) - push[:, :2]
        roll, pitch = leaning_share(controller, gains)
        out[:, 3] -= roll * asked[:, 1] / GRAVITY
        out[:, 4] += pitch * asked[:, 0] / GRAVITY
    return out


def leaning_share(controller: Controller, gains: Gains) -> tuple[float, float]:
    """Returns the shares of a horizontal force that roll and pitch give; gimbals give the rest."""
    left, ahead = vectoring_share(controller)
    both = ((gains.attitude_roll, float(left)), (gains.attitude_pitch, float(ahead)))
    roll, pitch = (k / (k + v) if k + v > 0.0 else 0.0 for k, v in both)
    return float(roll), float(pitch)


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


def accelerations(robot: Robot, plan: Plan, what: Imperfections) -> Floats:
    """Returns what push and wind accelerate, (T, 6) m/s² and rad/s², world axes, level hover."""
    q, count = plan.start, len(plan.time)
    a, (base, origin) = allocation(robot, q), robot.base_pose(q)
    cog = origin + base @ a.cog
    wrench = np.zeros((count, 6))
    if plan.disturbance is not None:
        wrench += plan.disturbance
        if not plan.disturbance_at_cog:
            at = Configuration(robot, q).link_pose(plan.disturbance_link or robot.root_link)[1]
            wrench[:, 3:] += np.cross(at - cog, plan.disturbance[:, :3])
    if plan.wind is not None and what.air_density > 0.0:
        wrench += _blown(make_world(robot, floor=False), q, plan.wind, what)
    turn = np.linalg.inv(base @ a.inertia @ base.T)
    return np.hstack([wrench[:, :3] / a.mass, wrench[:, 3:] @ turn.T])


def _blown(world: World, q: Floats, wind: Floats, what: Imperfections) -> Floats:
    """Returns the wrench (T, 6) of wind (T, 3) along one line, from a table of its speeds."""
    peak = wind[int(np.argmax(np.linalg.norm(wind, axis=1)))]
    top = float(np.linalg.norm(peak))
    if top == 0.0:
        return np.zeros((len(wind), 6))
    along = wind @ peak / top
    table = np.linspace(-top, top, 9)
    found = np.array([wind_wrench(world, q, v / top * peak, what) for v in table])
    return np.array([np.interp(along, table, column) for column in found.T]).T


def _driven(loop: tuple[NDComplex, NDComplex] | None, push: Floats, dt: float) -> Floats:
    """Returns the displacement of one axis under accelerations (T,), held over each tick."""
    if loop is None:
        return np.zeros_like(push)
    poles, parts = loop
    out = np.zeros(len(push), complex)
    for p, r in zip(poles, parts, strict=True):
        grown = np.exp(p * dt)
        out += lfilter([0.0, r * (grown - 1.0) / p], [1.0, -grown], push)
    return np.asarray(out.real)
