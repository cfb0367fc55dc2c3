"""Trim before a mission: a hover in which the integrals run faster, as real platforms fly first.

A robot of the paper has taken off and hovers before an experiment's clock starts; its integrals
then hold what unequal rotors and a tilted IMU ask for. With Table 5's K_f,i of 0.03 that takes
minutes. Here the error is integrated faster for a while: K_i itself stays, so the gains are the
paper's again, without a bump, when the mission begins at t = 0. The integrals' clamps stay too.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snakegen.base.sample_store import in_pieces
from snakegen.control.gains import Floats
from snakegen.errors import MissionError
from snakegen.kernels.control.types import Law, State
from snakegen.simulation.flight.plan import Plan

SECONDS = 10.0  # s, five times SETTLING: what is left of an offset is under 1 %
SETTLING = 2.0  # s, in which an integral settles while trimming
SLOW_SECONDS = 20.0  # s, where x or y settle by themselves, within QUICK
QUICK = 8.0  # s, K_p / K_i
STABLE = 1.0 / 3.0  # of K_p K_d, the K_i at which a lagless loop turns unstable


@dataclass(frozen=True)
class TrimOption:
    """Option of a mission that may begin with a trim.

    Attributes:
        trim: s of hover before t = 0, in which the integrals run faster; 0: none; if absent 10, or
            20 where the body tilts to move sideways, but from the floor 0
    """

    trim: float | None = None


def trimmed(plan: Plan, seconds: float) -> Plan:
    """Returns the plan with `seconds` of hover in its first pose and posture before t = 0.

    The mission's own times stay; nothing disturbs the hover but the plant's own imperfections.

    Raises:
        MissionError: less than no time, or a start on the floor, where nothing can be trimmed.
    """
    if not seconds >= 0.0:
        raise MissionError(f"trim {seconds:g} s: 0 or more is needed.")
    if seconds == 0.0:
        return plan
    if plan.on_floor:
        raise MissionError("a start on the floor cannot be trimmed; set trim=0.")
    if len(plan.time) < 2:
        return plan
    step = float(plan.time[1] - plan.time[0])
    count = round(seconds / step)

    def held(rows: Any) -> Any:
        if rows is None or rows.strides[0] == 0:  # one row that represents all
            return (
                rows
                if rows is None
                else np.broadcast_to(rows[0], (count + len(rows), *rows[0].shape))
            )
        return _behind(np.repeat(rows[:1], count, 0), rows)

    def still(rows: Any) -> Any:
        if rows is None:
            return None
        if rows.strides[0] == 0 and not np.any(rows[0]):
            return held(rows)
        return _behind(np.zeros((count, *np.shape(rows)[1:])), rows)

    return replace(
        plan,
        time=np.concatenate([plan.time[0] + step * np.arange(-count, 0), plan.time]),
        position=held(plan.position),
        velocity=still(plan.velocity),
        acceleration=still(plan.acceleration),
        rotation=held(plan.rotation),
        angular=still(plan.angular),
        joints=held(plan.joints),
        mode=held(plan.mode),
        disturbance=still(plan.disturbance),
        wind=still(plan.wind),
        window=plan.window or (float(plan.time[0]), float(plan.time[-1])),
        trim=count,
    )


def _behind(first: Floats, rows: Floats) -> Floats:
    """Returns `rows` behind `first`; those of a long run come in pieces."""
    count = len(first)

    def both(part: slice) -> tuple[Floats]:
        late = slice(max(part.start - count, 0), max(part.stop - count, 0))
        return (np.concatenate([first[part], rows[late]]),)

    return in_pieces(count + len(rows), both)[0]


def integral_rates(law: Law, settling: float = SETTLING) -> Floats:
    """Returns how many times faster each integral (2, 3) runs to settle in time, 1 or more.

    ``K_i f = K_p / settling``, at most a third of ``K_p K_d``; where K_i is 0 there is nothing to
    trim. Along x and y an integral that settles within `QUICK` by itself is not hurried: where the
    body tilts to move sideways, the attitude loop in between leaves little damping.

    Args:
        law: with the gains.
        settling: s; 0: as the gains have it.
    """
    out = np.ones((2, 3))
    if settling <= 0.0:
        return out
    for row, (p, i, d) in enumerate((law.force, law.torque)):
        wanted = p * np.minimum(1.0 / settling, STABLE * d)
        out[row] = np.where(i > 0.0, np.maximum(wanted / np.where(i > 0.0, i, 1.0), 1.0), 1.0)
    out[0, :2][_settles(law)] = 1.0
    return out


def usual_seconds(law: Law) -> float:
    """Returns for how long [s] a mission is trimmed unless asked otherwise."""
    return SLOW_SECONDS if np.any(_settles(law)) else SECONDS


def _settles(law: Law) -> NDArray[np.bool_]:
    """Returns whether the integrals along x and y settle within `QUICK` by themselves."""
    return np.asarray(law.force[1, :2] >= law.force[0, :2] / QUICK)


def integrator_state(law: Law, state: State) -> dict[str, Any]:
    """Returns what the integrals hold, as accelerations, and which are at their clamps."""
    force, torque = law.force[1] * state.force_integral, law.torque[1] * state.torque_integral
    full = [
        name
        for values, limit, names in (
            (state.force_integral, law.force_integral_limit, ("x", "y", "z")),
            (state.torque_integral, law.torque_integral_limit, ("roll", "pitch", "yaw")),
        )
        for name, value, most in zip(names, values, limit, strict=True)
        if most > 0.0 and abs(value) >= most * (1.0 - 1e-9)
    ]
    return {
        "force_integral_m_s2": force.tolist(),
        "torque_integral_rad_s2": torque.tolist(),
        "at_clamp": full,
    }


def trim_events(plan: Plan, law: Law, held: dict[str, Any]) -> list[tuple[float, str, str]]:
    """Returns the events of a run: when trimming began, and what it `held` when it ended."""
    if not plan.trim:
        return []
    most = integral_rates(law).max()
    begun = "trim in hover"
    if most >= 1.5:
        begun += f": integrals run up to {most:.0f} times faster"
    out = [(float(plan.time[0]), "INFO", begun)]
    if held:
        out.append((float(plan.time[plan.trim]), "INFO", f"trimmed: {describe_trim(held)}"))
    return out


def describe_trim(held: dict[str, Any]) -> str:
    """Returns in words what `integrator_state` returned."""
    force, torque = (
        " ".join(f"{v:.3f}" for v in held[k])
        for k in ("force_integral_m_s2", "torque_integral_rad_s2")
    )
    text = f"integrals hold {force} m/s² and {torque} rad/s²"
    if held["at_clamp"]:
        text += f"; {', '.join(held['at_clamp'])} at the clamp, so not trimmed out"
    return text
