"""Push until tracking is lost: a wrench ramped along the analysis' weakest direction on a link.

What the flight bears over what the analysis predicts for its allocator is the run's `ratio`.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from snakegen.control.controller import flight_controller
from snakegen.control.gains import Gains
from snakegen.control.servos import give
from snakegen.errors import MissionError
from snakegen.robot import Robot
from snakegen.verify.forecast import forecast
from snakegen.verify.plan import Plan, holding, quintic, ticks
from snakegen.verify.postures import driven_joints, place, resting_joints
from snakegen.verify.recording import Recording

OPTIONS = {
    "kind": ["force", "force, torque or wrench; dual-rotor mode always takes [f_z; torque]"],
    "link": [None, "link that carries the push; the root link by default"],
    "allocator": ["paper", "whose margin is predicted; that of the flight"],
    "until": [1.2, "times the predicted wrench, where the ramp ends"],
    "slow": [100.0, "s, from 0.8 of the prediction to the end"],
    "height": [4.0, "m, of the CoG"],
    "posture": [None, "posture file; a bent body by default"],
    "force": [False, "fly even where the posture is refused as singular"],
    "ideal": [False, "judge the paper's allocator by both sides of its margin; --ideal sets it"],
}
AGREE = 0.05  # share by which the paper's allocator may differ from its own margin, either way
FAST = 10.0  # s, from nothing to 0.8 of the prediction
SETTLE = 4.0  # s of rest at 0.8, and of hover before the ramp
KNEE = 0.8
LOST_M = 0.02  # beyond the lag behind the ramp; ZN23's Table 6 tracks to 0.017 … 0.038 m
LOST_RAD = 0.02  # and to 0.026 … 0.033 rad
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


def plan(
    robot: Robot,
    rate: float,
    *,
    kind: str = "force",
    link: str | None = None,
    allocator: str = "paper",
    until: float = 1.2,
    slow: float = 100.0,
    height: float = 4.0,
    posture: dict[str, Any] | None = None,
    force: bool = False,
    ideal: bool = False,
) -> Plan:
    """Returns the plan: hover, quickly to 0.8 of the predicted wrench, slowly beyond it.

    The constrained allocator has to hold 0.95 of its prediction, and may hold more. The paper's
    has to agree with its `controller` margin, 5 % either way, where no noise blurs it: tracking is
    lost there, and the first limit met.
    """
    if not (until > KNEE and slow > 0):
        raise MissionError(f"until must be above {KNEE:g} and slow above 0 s.")
    joints = resting_joints(robot, posture)
    cog = np.array([0.0, 0.0, height])
    start = place(robot, joints, cog)
    controller = flight_controller(robot, allocator=allocator)
    found = forecast(robot, controller, start, kind, link)
    corners = np.cumsum([0.0, SETTLE, FAST, SETTLE, slow])
    time = ticks(float(corners[-1]), rate)
    share, _, _ = quintic((time - corners[1]) / FAST)  # a corner would swing the integrals over
    share = KNEE * share + (until - KNEE) * np.clip((time - corners[3]) / slow, 0.0, 1.0)
    return holding(
        time,
        joints,
        start,
        cog,
        disturbance=share[:, None] * found.held * found.push[None],
        disturbance_link=found.link,
        disturbance_at_cog=True,
        give_up=0.8,
        events=(
            (float(corners[1]), "push begins"),
            (float(corners[3]), f"{KNEE:g} of the predicted wrench; slowly from here"),
            (_at(corners, until), f"predicted end: {', '.join(found.stopped)} at its limit"),
        ),
        facts={
            "forecast": found.to_json(),
            "slow_from_s": float(corners[3]),
            "joint_give": give(robot, driven_joints(robot)).tolist(),
        },
        thresholds={
            "ratio": {"at_least": 1.0 - AGREE},
            **(_BOTH_SIDES if ideal and allocator == "paper" else {}),
            # the push goes on until tracking is lost, and what follows is not judged
            **dict.fromkeys(_UNJUDGED),
        },
    )


_BOTH_SIDES = {
    key: {"at_least": 1.0 - AGREE, "at_most": 1.0 + AGREE} for key in ("ratio", "limit_ratio")
}
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
    return float(np.interp(1.0, [KNEE, max(until, 1.0)], corners[3:]))


def metrics(recording: Recording) -> dict[str, Any]:
    """Returns the push at which tracking was lost, over the prediction: `ratio`.

    Tracking is lost at the last instant at which position, attitude and joints are all within
    2 cm, 0.02 rad and 0.01 rad of how far they lag behind the slow ramp; a joint's lag is beside
    the give of its servo, τ/k. Where it never was,
    `ratio` is the end of the ramp over the prediction, and `tracking_lost` is false.
    """
    from snakegen.verify.signals import attitude_error, position_error

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
    if time[-1] < ramp + 4.0:  # gone before the lag can be told
        lag = time < SETTLE
    fine = np.full(len(time), True)
    for error, most in ((place_error, LOST_M), (turn_error, LOST_RAD), (joint_error, LOST_JOINT)):
        fine &= np.abs(error - error[lag].mean(axis=0)).max(axis=1, initial=0.0) < most
    fine = np.flatnonzero(fine)
    last = int(fine[-1]) if fine.size else 0
    lost = last < len(time) - 1
    return {
        "predicted_wrench": _wrench(found["held"], unit),
        "lost_wrench": _wrench(float(size[last]), unit) if lost else None,
        "lost_s": float(time[last]) if lost else None,
        "ratio": float(size[last] / found["held"]),
        "limit_ratio": _first_limit(recording, size / found["held"]),
        "tracking_lost": bool(lost),
    }


def _first_limit(recording: Recording, share: Any) -> float | None:
    """Returns the share of the prediction at which a rotor or a joint servo first is at its limit.

    For the printed pseudo-inverse this is what the `controller` margin promises; the loop may
    hold on beyond it.
    """
    limits = recording.meta["limits"]
    asked = recording.channel("thrust_command").values
    most, least = np.asarray(limits["thrust_max"]), np.asarray(limits["thrust_min"])
    slack = 1e-4 * most
    at = np.any((asked >= most - slack) | (asked <= least + slack), axis=1)
    torque = np.abs(recording.channel("joint_torque").values)
    at |= np.any(torque >= 0.999 * np.asarray(limits["joint_torque"]), axis=1)
    first = np.flatnonzero(at)
    return float(share[first[0]]) if first.size else None


def _wrench(size: float, unit: Any) -> list[float]:
    return [float(x) for x in size * unit]
