"""Push until tracking is lost: a wrench ramped along the analysis' weakest direction on a link.

The measured limit over the one that `analyze margin` predicts is the run's `ratio`.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.control.controller import Controller, flight_controller
from snakegen.control.gains import Gains
from snakegen.control.servos import give
from snakegen.errors import MissionError
from snakegen.kernels.control.types import VIRTUAL
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.plan import Plan, holding, quintic, ticks
from snakegen.simulation.flight.plant import Imperfections
from snakegen.simulation.flight.postures import (
    PostureOption,
    driven_joints,
    place,
    resting_attitude,
    resting_joints,
)
from snakegen.simulation.push.informed import informed_least_forces, informed_limit
from snakegen.simulation.push.prediction import Forecast, forecast
from snakegen.simulation.recording.recording import Recording


@dataclass(frozen=True)
class Options(PostureOption):
    """Options of mission `push`.

    Attributes:
        kind: force, torque or wrench; dual-rotor mode always takes [f_z; torque]
        link: link that carries the push; the root link by default
        allocator: whose margin is predicted; that of the flight
        until: times the predicted wrench, where the ramp ends
        slow: s, from 0.8 of the prediction to the end
        battery: drain the battery: the ramp takes longer than many hold
        height: m, of the CoG
        force: fly even where the posture is refused as singular
        ideal: judge by both sides of the prediction; that of the flight
    """

    kind: str = "force"
    link: str | None = None
    allocator: str = field(default="paper", metadata={"set_by": "the flight's allocator"})
    until: float = 1.2
    slow: float = 100.0
    battery: bool = False
    height: float = 4.0
    force: bool = False
    ideal: bool = field(default=False, metadata={"set_by": "whether the flight is ideal"})


AGREE = 0.05  # share by which the measured limit may differ from the prediction
FAST = 10.0  # s, from nothing to where the limits begin to matter
RELIEF = 0.008  # 1/s, of the prediction: as fast as a servo at its limit is relieved
SETTLE = 4.0  # s of rest at 0.8, and of hover before the ramp
KNEE = 0.8
LOST_M = 0.02  # beyond the lag behind the ramp; ZN23's Table 6 tracks to 0.017 … 0.038 m
LOST_RAD = 0.02  # and to 0.026 … 0.033 rad
TURNED = 1e-6  # rad, from its limit: a gimbal is at it
LOST_JOINT = 0.01  # rad, beyond what a servo's stiffness explains: it is at its limit, and yields


def applies(robot: Robot) -> bool:
    """A floating base and rotors."""
    return robot.floating and bool(robot.modules.apparatuses)


def gains(given: Gains) -> Gains:
    """Returns gains that hold a lasting wrench: more integral action, no clamp in its way.

    A push of F leaves F / (m K_p) without it (1.7 m for 50 N with Table 5's K_f,i of 0.03).
    K_i stays below a third of K_p K_d, half the bound of a lagless loop.
    """
    return replace(
        given,
        force_i=np.maximum(given.force_i, 0.3 * given.force_p * np.minimum(given.force_d, 2.0)),
        torque_i=np.maximum(given.torque_i, 0.2 * given.torque_p * np.minimum(given.torque_d, 5.0)),
        force_integral_limit=np.full(3, 1e3),
        torque_integral_limit=np.full(3, 1e3),
    )


def plant(given: Imperfections, options: Options) -> Imperfections:
    """Returns a plant without a battery, unless it is asked for.

    The ramp takes 120 s at up to 1.2 times hover's thrust; a battery for three minutes of hover is
    empty before its end, and the limit would be that of the battery.
    """
    return given if options.battery else replace(given, battery_energy=0.0)


def plan(robot: Robot, rate: float, options: Options) -> Plan:
    """Returns the plan: hover, quickly to 0.8 of the predicted wrench, slowly from there.

    Where the pseudo-inverse would meet a limit before that, the constrained allocator relieves
    it with a time constant of 0.5 s, and has 0.02 of a servo's torque to spare for the lag: from
    0.9 of that limit the ramp is slow enough for it.

    The measured limit has to be at least 0.95 of the prediction; without noise at most 1.05 of it
    too, or of what any forces within the limits hold, where a gimbal's limit is what the
    pseudo-inverse meets first: its integrals then ask the other apparatuses for what that one
    misses. With noise the prediction knows the thrust factors that were drawn.
    """
    if not (options.until > KNEE and options.slow > 0):
        raise MissionError(f"until must be above {KNEE:g} and slow above 0 s.")
    joints = resting_joints(robot, options.posture)
    resting_attitude(robot, options.posture, "push", level=True)
    cog = np.array([0.0, 0.0, options.height])
    start = place(robot, joints, cog)
    controller = flight_controller(robot, allocator=options.allocator)
    found = forecast(robot, controller, start, options.kind, options.link)
    limit = found.held if controller.mode == VIRTUAL else found.loaded
    limit = limit if np.isfinite(limit) else found.held
    given = (robot, controller.with_law(constrained=0), start, found.push, found.link)
    least = informed_limit(*given, np.ones(len(robot.rotors.body)))
    easy = float(np.clip(0.9 * least / limit, 0.0, KNEE)) if np.isfinite(least) else 0.0
    corners = np.cumsum([0.0, SETTLE, FAST, (KNEE - easy) / RELIEF, SETTLE, options.slow])
    time = ticks(float(corners[-1]), rate)
    share, _, _ = quintic((time - corners[1]) / FAST)  # a corner would swing the integrals over
    share = easy * share + np.interp(
        time, corners[2:], [0.0, KNEE - easy, KNEE - easy, options.until - easy]
    )
    judged = "ratio" if controller.mode == VIRTUAL else "loaded_ratio"
    beyond = float(np.nanmax([1.0, found.any_forces / found.held]))
    return holding(
        time,
        joints,
        start,
        cog,
        disturbance=share[:, None] * limit * found.push[None],
        disturbance_link=found.link,
        disturbance_at_cog=True,
        give_up=0.8,
        events=(
            (float(corners[1]), "push begins"),
            (float(corners[4]), f"{KNEE:g} of the predicted wrench; slowly from here"),
            (_at(corners, options.until), f"predicted limit: {', '.join(found.stopped)}"),
        ),
        facts={
            "forecast": found.to_json(),
            "slow_from_s": float(corners[4]),
            "joint_give": give(robot, driven_joints(robot)).tolist(),
        },
        drawn=lambda *draw: _informed(robot, controller, start, found, *draw),
        thresholds={
            judged if options.ideal else "informed_ratio": _bounds(options.ideal, beyond),
            **(
                {"limit_ratio": _bounds(True)}
                if options.ideal and options.allocator == "paper"
                else {}
            ),
            # the push goes on until tracking is lost, and what follows is not judged
            **dict.fromkeys(_UNJUDGED),
        },
        tracked=False,
    )


def _bounds(both: bool, beyond: float = 1.0) -> dict[str, float]:
    """Returns how far a ratio may be below 1 and, of `both` sides, above `beyond`."""
    return {"at_least": 1.0 - AGREE} | ({"at_most": (1.0 + AGREE) * beyond} if both else {})


def _informed(
    robot: Robot,
    controller: Controller,
    start: Floats,
    found: Forecast,
    factors: Floats,
    offsets: Floats,
) -> dict[str, Any]:
    """Returns the prediction that knows what was drawn, in multiples of the push.

    The prediction (in dual-rotor mode that of the deflected body), changed by as much as the
    reach along the push changes: of free gimbals, whose limits factors do not move. The constrained
    allocator in virtual-single-rotor mode also reads its servos' torques with their `offsets`.
    """
    given = (robot, controller, start, found.push, found.link)
    limit = found.held
    if controller.mode == VIRTUAL and controller.law.constrained:
        draw = (found.push, found.link, factors, offsets)
        limit = informed_least_forces(robot, start, *draw, found.held)
    else:
        if controller.mode != VIRTUAL and np.isfinite(found.loaded):
            limit = found.loaded
        limit *= informed_limit(*given, factors) / informed_limit(*given, np.ones_like(factors))
    known = {"held_informed": limit if np.isfinite(limit) else None}
    return {"forecast": found.to_json() | known, "thrust_factors": factors.tolist()}


_UNJUDGED = (
    "completed",
    "finite",
    "floor_contact_after_takeoff_s",
    "position_rmse_m",
    "position_max_m",
    "attitude_rmse_rad",
    "saturation_share",
    "joint_torque_use",
    "gimbal_torque_limit_share",
    "min_self_distance_m",
)


def _at(corners: Any, until: float) -> float:
    """Returns when the ramp passes the prediction."""
    return float(np.interp(1.0, [KNEE, max(until, 1.0)], corners[4:]))


def metrics(recording: Recording) -> dict[str, Any]:
    """Returns the push at which tracking was lost, over the predictions.

    Tracking is lost at the last instant at which position, attitude and joints are all within
    2 cm, 0.02 rad and 0.01 rad of how far they lag behind the slow ramp; a joint's lag is
    counted from the deflection of its servo, τ/k. Where it never was, the end of the ramp counts,
    and `tracking_lost` is false.

    `ratio` is over the rigid prediction, `loaded_ratio` over that of the deflected body,
    `informed_ratio` over that which knows the thrust factors drawn; None where there is none.
    `limit_ratio` is the push at the first limit over the prediction that is judged without noise.
    """
    from snakegen.simulation.recording.signals import attitude_error, position_error

    facts = recording.meta["facts"]
    found = facts["forecast"]
    time = recording.times("position")
    push = recording.channel("disturbance").values
    unit = np.asarray(found["push"], float)
    size = push @ unit / (unit @ unit)
    place_error, turn_error = position_error(recording), attitude_error(recording)
    joint_error = recording.channel("joint_command").values
    joint_error = joint_error - recording.channel("joint_angle").values
    give = np.asarray(facts["joint_give"], float)
    joint_error = joint_error - give * recording.channel("joint_torque").values
    ramp = float(facts["slow_from_s"])
    lag = (time > ramp + 2.0) & (time <= ramp + 4.0)
    if time[-1] < ramp + 4.0:  # gone before the lag can be measured
        lag = time < SETTLE
    fine = np.full(len(time), True)
    for error, most in ((place_error, LOST_M), (turn_error, LOST_RAD), (joint_error, LOST_JOINT)):
        fine &= np.abs(error - error[lag].mean(axis=0)).max(axis=1, initial=0.0) < most
    fine = np.flatnonzero(fine)
    last = int(fine[-1]) if fine.size else 0
    lost = last < len(time) - 1
    end = float(size[last])
    judged = found["held"]
    if recording.meta["mode"] == "dual_rotor":
        judged = found["held_loaded"] or judged
    return {
        "predicted_wrench": _wrench(found["held"], unit),
        "lost_wrench": _wrench(end, unit) if lost else None,
        "lost_s": float(time[last]) if lost else None,
        "ratio": end / found["held"],
        "loaded_ratio": _over(end, found["held_loaded"]),
        "informed_ratio": _over(end, found.get("held_informed")),
        "limit_ratio": _first_limit(recording, size / judged),
        "tracking_lost": bool(lost),
    }


def _over(value: float, whole: float | None) -> float | None:
    return value / whole if whole else None


def _first_limit(recording: Recording, share: Any) -> float | None:
    """Returns the share of the prediction at which a rotor, a gimbal or a servo meets its limit.

    For the pseudo-inverse this is what its margin predicts; the loop may hold more.
    """
    limits = recording.meta["limits"]
    asked = recording.channel("thrust_command").values
    most, least = np.asarray(limits["thrust_max"]), np.asarray(limits["thrust_min"])
    slack = 1e-4 * most
    at = np.any((asked >= most - slack) | (asked <= least + slack), axis=1)
    turned = recording.channel("gimbal_command").values
    lower, upper = np.asarray(limits["gimbal_lower"]), np.asarray(limits["gimbal_upper"])
    held = np.abs(np.append(lower, upper)).max(initial=0.0) < np.pi - 1e-6
    if held:  # a gimbal that turns all the way round has no limit to meet
        at |= np.any((turned <= lower + TURNED) | (turned >= upper - TURNED), axis=1)
    torque = np.abs(recording.channel("joint_torque").values)
    at |= np.any(torque >= 0.999 * np.asarray(limits["joint_torque"]), axis=1)
    first = np.flatnonzero(at)
    return float(share[first[0]]) if first.size else None


def _wrench(size: float, unit: Any) -> list[float]:
    return [float(x) for x in size * unit]
