"""Signals derived from a recording: tracking errors, actuator limits, rotors at a limit."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.base.geometry import Floats
from snakegen.errors import LogError
from snakegen.simulation.recording.recording import Recording

AT_LIMIT = 1e-3  # share of the thrust range that counts as being at its end
MAY_BE_UNDEFINED = frozenset(
    {
        "wrench_margin",
        "force_margin",
        "torque_margin",
        "force_margin_upper",
        "torque_margin_upper",
        "sigma_min",
        "disturbance_point",
        "obstacle_distance",
        "contact_point",
    }
)  # channels in which NaN says "not defined here"

WHOLE_TURN = 2e-3  # rad: limits of ±3.14 mean a whole turn


def position_error(recording: Recording) -> Floats:
    """Returns target − position, (T, 3) m, at the times of `position`."""
    target = recording.held("position_target", recording.times("position"))
    return target - recording.channel("position").values


def attitude_error(recording: Recording) -> Floats:
    """Returns the rotation vector of ``Rᵀ R_target``, (T, 3) rad, at the times of `attitude`."""
    actual = recording.channel("attitude").values
    target = recording.held("attitude_target", recording.times("attitude"))
    return rotation_vectors(actual, target)


def rotation_vectors(actual: Floats, target: Floats) -> Floats:
    """Returns log(Rᵀ R_target) of quaternions xyzw (T, 4): (T, 3) rad, the short way round."""
    v, w = -actual[:, :3], actual[:, 3:]
    vt, wt = target[:, :3], target[:, 3:]
    vector = w * vt + wt * v + np.cross(v, vt)
    scalar = w * wt - np.sum(v * vt, axis=1, keepdims=True)
    vector = np.where(scalar < 0, -vector, vector)
    size = np.linalg.norm(vector, axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(size, np.abs(scalar))
    small = size < 1e-12
    factor = np.where(small, 2.0, angle / np.where(small, 1.0, size))
    return factor * vector


def held_limit(recording: Recording, name: str, width: int) -> Floats | None:
    """Returns ``meta["limits"][name]``, one a column (k,); None where there is none.

    Raises:
        LogError: a limit whose length does not fit its channel.
    """
    value: ArrayLike | None = recording.meta.get("limits", {}).get(name)
    if value is None:
        return None
    limit = np.asarray(value, float)
    if limit.shape not in ((), (1,), (width,)):
        raise LogError(f"limits.{name} has {limit.size} numbers for {width} columns")
    return np.broadcast_to(limit, (width,))


def at_limit(recording: Recording) -> NDArray[np.bool_] | None:
    """Returns whether each rotor's command is at an end of its range, (T, n); None if unknown.

    Where commands are not recorded the thrusts given are taken.
    """
    if "thrust" not in recording.channels:
        return None
    name = "thrust_command" if "thrust_command" in recording.channels else "thrust"
    asked = recording.channel(name).values
    upper = held_limit(recording, "thrust_max", asked.shape[1])
    if upper is None:
        return None
    lower = held_limit(recording, "thrust_min", asked.shape[1])
    lower = np.zeros_like(upper) if lower is None else lower
    slack = AT_LIMIT * (upper - lower)
    return np.asarray((asked >= upper - slack) | (asked <= lower + slack))


def gimbals_at_limit(recording: Recording) -> NDArray[np.bool_] | None:
    """Returns whether each gimbal's command is at an end of its range, (T, k).

    None where no gimbal has limits: a range of a whole turn is none.
    """
    limits = recording.meta.get("limits", {})
    if "gimbal_command" not in recording.channels or "gimbal_lower" not in limits:
        return None
    asked = recording.channel("gimbal_command").values
    lower = held_limit(recording, "gimbal_lower", asked.shape[1])
    upper = held_limit(recording, "gimbal_upper", asked.shape[1])
    if lower is None or upper is None:
        return None
    held = upper - lower < 2.0 * np.pi - WHOLE_TURN
    if not held.any():
        return None
    slack = AT_LIMIT * (upper - lower)
    return np.asarray(held & ((asked >= upper - slack) | (asked <= lower + slack)))
