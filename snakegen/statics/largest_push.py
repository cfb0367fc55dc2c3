"""Largest push that a rigid body holds by the least forces, gimbals turned to what they carry.

``min Σ (λ_j/L_j)²`` with ``w(x) = -t d``, joint torques and settings x within limits
(`VectoredBody`), followed from hover as t grows: the law of an allocator of least forces within
limits, by its own equations and none of its code. The end is where no setting near the last one
holds more. Each answer is checked against the statics: what is returned is held.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import minimize

from snakegen.base.geometry import Floats
from snakegen.statics.vectored_body import VectoredBody

STRIDE, FINEST = 0.25, 5e-4  # of the expected push: first step, and where steps end
FARTHEST = 3.0  # times the expected push
JUMP = 0.5  # rad, of a gimbal in one step: farther is another branch
HELD, OVER = 1e-6, 1e-5  # share of weight and of servo limits that an answer may miss
ROUNDS = 60


@dataclass(frozen=True, eq=False)
class LargestPush:
    """The end of a push.

    Attributes:
        t: multiple of the push; nan where hover itself was not found within limits.
        x: settings there (`VectoredBody`).
        at_limit: apparatuses at full thrust and joints at their limit.
    """

    t: float
    x: Floats
    at_limit: tuple[str, ...]


def largest_push(body: VectoredBody, expected: float) -> LargestPush:
    """Returns the largest multiple of the body's push that is held, followed from hover.

    Args:
        body: posture, push and limits.
        expected: multiple to expect; sets the steps.
    """
    n = body.apparatuses
    x, t = _least_forces(body, body.start(), 0.0), 0.0
    if x is None:
        return LargestPush(float("nan"), body.start(), ())
    step = STRIDE * expected
    while step > FINEST * expected and t < FARTHEST * expected:
        there = _least_forces(body, x, t + step)
        if there is None or np.abs(there - x)[n:].max(initial=0.0) > JUMP:
            step *= 0.5
        else:
            x, t = there, t + step
    return LargestPush(float(t), x, body.limits_met(x, t, 20.0 * FINEST))


def _least_forces(body: VectoredBody, start: Floats, t: float) -> Floats | None:
    """Returns the settings of least forces near `start` that hold t times the push, or None."""
    n, k = body.apparatuses, len(body.most)
    unit = np.where(np.arange(len(start)) < n, body.upper, 1.0)
    rows = np.repeat([1.0, 1.0 / body.robot.link_length], 3) / body.robot.force_scale
    kept: dict[bytes, tuple[Floats, Floats, Floats, Floats]] = {}

    def at(z: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        key = z.tobytes()
        if key not in kept:
            kept.clear()
            wrench, torque, pushed = body.balance(z * unit)
            by_wrench, by_torque = body.slopes(z * unit)
            whole = torque + t * pushed
            room = np.concatenate([body.most - whole, whole - body.least]) / np.tile(body.most, 2)
            bent = by_torque * unit / body.most[:, None]
            kept[key] = (
                rows * (wrench + t * body.push),
                rows[:, None] * by_wrench * unit,
                room,
                np.vstack([-bent, bent]),
            )
        return kept[key]

    weights = np.where(np.arange(len(start)) < n, 1.0, 0.0)
    limits: list[dict[str, Any]] = [
        {"type": "eq", "fun": lambda z: at(z)[0], "jac": lambda z: at(z)[1]}
    ]
    if k:
        limits.append({"type": "ineq", "fun": lambda z: at(z)[2], "jac": lambda z: at(z)[3]})
    found = minimize(
        lambda z: 0.5 * float(weights @ z**2),
        start / unit,
        jac=lambda z: weights * z,
        bounds=list(zip(body.lower / unit, body.upper / unit, strict=True)),
        constraints=limits,
        method="SLSQP",
        options={"maxiter": ROUNDS, "ftol": 1e-9},
    )
    missed, _, room, _ = at(found.x)
    held = np.abs(missed).max() < HELD and room.min(initial=1.0) > -OVER
    return np.clip(found.x * unit, body.lower, body.upper) if held else None
