"""Signals derived from a recording: tracking errors, actuator limits, rotors at a limit."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.base.geometry import Floats
from snakegen.errors import LogError
from snakegen.simulation.recording.recording import Recording

PIECE = 16_384  # rows computed together
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


class Signal(NamedTuple):
    """A signal that is computed a few rows at a time, so that a long run fits into memory."""

    time: Floats  # (T,) s
    rows: Callable[[slice], Floats]  # the values (n, k) of some rows
    release: Callable[[], None]  # gives back the memory of what was read

    def pieces(
        self, start: float = -np.inf, end: float = np.inf
    ) -> Iterator[tuple[Floats, Floats]]:
        """Yields times (n,) and values (n, k) from `start` to `end` [s], in pieces of some rows."""
        for first in range(0, len(self.time), PIECE):
            part = slice(first, first + PIECE)
            time = self.time[part]
            inside = (time >= start) & (time <= end)
            if inside.any():
                values = self.rows(part)
                yield time[inside], values if inside.all() else values[inside]
            self.release()

    def whole(self) -> Floats:
        """Returns all rows, (T, k)."""
        return np.concatenate([values for _, values in self.pieces()])


def stored(recording: Recording, name: str) -> Signal:
    """Returns a channel as a signal."""
    values = recording.channel(name).values
    return Signal(recording.times(name), lambda part: values[part], recording.release)


def tracking_error(recording: Recording, name: str) -> Signal:
    """Returns the error of "position" or "attitude" as `position_error` and `attitude_error` do."""
    time, actual = recording.times(name), recording.channel(name).values

    def rows(part: slice) -> Floats:
        target = recording.held(f"{name}_target", time[part], part)
        if name == "position":
            return np.ascontiguousarray(target - actual[part])  # sums do not depend on the order
        return rotation_vectors(actual[part], target)

    return Signal(time, rows, recording.release)


def position_error(recording: Recording) -> Floats:
    """Returns target − position, (T, 3) m, at the times of `position`."""
    return tracking_error(recording, "position").whole()


def attitude_error(recording: Recording) -> Floats:
    """Returns the rotation vector of ``Rᵀ R_target``, (T, 3) rad, at the times of `attitude`."""
    return tracking_error(recording, "attitude").whole()


def is_finite(recording: Recording, name: str) -> bool:
    """Tells whether all samples of a channel are finite."""
    return all(np.all(np.isfinite(values)) for _, values in stored(recording, name).pieces())


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


def at_limit(recording: Recording) -> Signal | None:
    """Returns whether each rotor's command is at an end of its range, (T, n) 0 or 1.

    Where commands are not recorded the thrusts given are taken; None if unknown.
    """
    if "thrust" not in recording.channels:
        return None
    name = "thrust_command" if "thrust_command" in recording.channels else "thrust"
    width = recording.channel(name).values.shape[1]
    upper = held_limit(recording, "thrust_max", width)
    if upper is None:
        return None
    lower = held_limit(recording, "thrust_min", width)
    lower = np.zeros_like(upper) if lower is None else lower
    return _at_ends(recording, name, lower, upper, np.ones(width, bool))


def gimbals_at_limit(recording: Recording) -> Signal | None:
    """Returns whether each gimbal's command is at an end of its range, (T, k) 0 or 1.

    None where no gimbal has limits: a range of a whole turn is none.
    """
    limits = recording.meta.get("limits", {})
    if "gimbal_command" not in recording.channels or "gimbal_lower" not in limits:
        return None
    width = recording.channel("gimbal_command").values.shape[1]
    lower = held_limit(recording, "gimbal_lower", width)
    upper = held_limit(recording, "gimbal_upper", width)
    if lower is None or upper is None:
        return None
    held = upper - lower < 2.0 * np.pi - WHOLE_TURN
    return _at_ends(recording, "gimbal_command", lower, upper, held) if held.any() else None


def _at_ends(
    recording: Recording, name: str, lower: Floats, upper: Floats, held: NDArray[np.bool_]
) -> Signal:
    """Returns whether the columns `held` of a channel are at an end of their range, 0 or 1."""
    slack = AT_LIMIT * (upper - lower)
    asked = recording.channel(name).values

    def rows(part: slice) -> Floats:
        values = asked[part]
        found = held & ((values >= upper - slack) | (values <= lower + slack))
        return np.asarray(found, float)

    return Signal(recording.times(name), rows, recording.release)
