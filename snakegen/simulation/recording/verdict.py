"""The verdict of a run: named checks, each with its number, its bound and whether it holds.

A run that ends lying on the floor has not diverged, yet it has not flown either: so the checks
ask for take-off, for no contact afterwards and for tracking, not for survival alone.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from snakegen.errors import MissionError

KINDS = ("at_most", "at_least", "equals")
_SIGN = {"at_most": "≤", "at_least": "≥", "equals": "="}

FLIGHT_THRESHOLDS: dict[str, dict[str, Any]] = {
    "finite": {"equals": True},
    "took_off": {"equals": True},
    "floor_contact_after_takeoff_s": {"at_most": 0.0},
    "position_rmse_m": {"at_most": 0.2},
    "position_max_m": {"at_most": 0.5},
    "attitude_rmse_rad": {"at_most": 0.2},
    "saturation_share": {"at_most": 0.05},
    "joint_torque_use": {"at_most": 0.99, "channel": "joint_torque"},
    # sensor noise alone asks a stiff gimbal servo for all it has on single ticks
    "gimbal_torque_limit_share": {"at_most": 0.01, "channel": "gimbal_torque"},
    "min_self_distance_m": {"at_least": 0.0, "channel": "self_distance"},
    "min_obstacle_distance_m": {"at_least": 0.0, "channel": "obstacle_distance"},
}


@dataclass(frozen=True)
class Place:
    """Where and when a check is at its worst: the part, and times in s."""

    part: str
    time_s: float
    from_s: float
    to_s: float

    def text(self) -> str:
        """Returns the place in words."""
        at = f"{self.part}, " if self.part else ""
        if self.to_s > self.from_s:
            return f"{at}{self.from_s:.2f} … {self.to_s:.2f} s"
        return f"{at}{self.time_s:.2f} s"


@dataclass(frozen=True, repr=False)
class Check:
    """One check: `metric` against `bound`; None, not measured or never reached, does not pass.

    `worst` is where and when the run is at its worst, where a signal of the run shows it.
    """

    metric: str
    value: Any
    kind: str
    bound: Any
    passed: bool
    worst: Place | None = None

    def __repr__(self) -> str:
        """Returns the check as one line of text."""
        return f"Check({' '.join(self.line().split())})"

    def line(self) -> str:
        """Returns the check as one line of text."""
        mark = "ok  " if self.passed else "FAIL"
        value = "no value" if self.value is None else _shown(self.value)
        text = f"{mark} {self.metric} = {value} ({_SIGN[self.kind]} {_shown(self.bound)})"
        return text if self.worst is None else f"{text} at {self.worst.text()}"


@dataclass(frozen=True, repr=False)
class Verdict:
    """All checks of a run; it passes when each of them does, and there is at least one."""

    checks: tuple[Check, ...]

    def __repr__(self) -> str:
        """Returns the summary."""
        return f"Verdict({self.summary()})"

    @property
    def passed(self) -> bool:
        """True when every check passed."""
        return bool(self.checks) and all(c.passed for c in self.checks)

    @property
    def failed(self) -> tuple[Check, ...]:
        """The checks that did not pass."""
        return tuple(c for c in self.checks if not c.passed)

    def thresholds(self) -> dict[str, dict[str, Any]]:
        """Returns the thresholds that give these checks again from the same metrics."""
        out: dict[str, dict[str, Any]] = {}
        for c in self.checks:
            out.setdefault(c.metric, {})[c.kind] = c.bound
        return out

    def to_json(self) -> dict[str, Any]:
        """Returns plain JSON: ``{"passed": bool, "checks": [{metric, value, …, worst}]}``.

        ``worst`` is ``{part, time_s, from_s, to_s}`` or None.
        """
        return {"passed": self.passed, "checks": [asdict(c) for c in self.checks]}

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> Verdict:
        """Returns the verdict that `to_json` wrote."""

        def check(c: Mapping[str, Any]) -> Check:
            place = c.get("worst")  # logs of older versions have none
            return Check(**{**c, "worst": None if place is None else Place(**place)})

        return Verdict(tuple(check(c) for c in data["checks"]))

    def summary(self) -> str:
        """Returns one line: passed, or which checks failed."""
        if self.passed:
            return f"passed {len(self.checks)} checks"
        if not self.checks:
            return "failed: there was nothing to check"
        return "failed: " + ", ".join(c.metric for c in self.failed)


def verdict(
    metrics: Mapping[str, Any],
    thresholds: Mapping[str, Mapping[str, Any]],
    channels: Collection[str] | None = None,
) -> Verdict:
    """Checks `metrics` against `thresholds`; a metric that was not measured does not pass.

    Args:
        metrics: what `snakegen.simulation.recording.metrics.metrics` returns.
        thresholds: ``{metric: {"at_most" | "at_least" | "equals": bound}}``; a list of numbers is
            held against a bound of the same length or against one number, entry by entry.
            ``"channel": name`` limits the check to runs that record that channel (a robot without
            joints has no joint torque); an absent or undefined number fails.
        channels: names of the channels that the run records (`Recording.recorded`); None: all.

    Raises:
        MissionError: a threshold that names no kind of bound, or whose length does not fit.
    """
    checks = []
    for metric, bounds in thresholds.items():
        kinds = [k for k in bounds if k != "channel"]
        if not kinds or any(k not in KINDS for k in kinds):
            raise MissionError(f"the threshold of '{metric}' needs one of {', '.join(KINDS)}")
        source = bounds.get("channel")
        if source is not None and channels is not None and source not in channels:
            continue
        value = metrics.get(metric)
        for kind in kinds:
            passed = _holds(metric, value, kind, bounds[kind])
            checks.append(Check(metric, value, kind, bounds[kind], passed))
    return Verdict(tuple(checks))


def _holds(metric: str, value: Any, kind: str, bound: Any) -> bool:
    if value is None:
        return False
    if kind == "equals":
        return bool(value == bound)
    values = value if isinstance(value, list | tuple) else [value]
    bounds = bound if isinstance(bound, list | tuple) else [bound] * len(values)
    if len(bounds) != len(values):
        raise MissionError(
            f"the threshold of '{metric}' has {len(bounds)} numbers, the metric {len(values)}"
        )
    if any(v is None or not math.isfinite(v) for v in values):
        return False
    if kind == "at_most":
        return all(v <= b for v, b in zip(values, bounds, strict=True))
    return all(v >= b for v, b in zip(values, bounds, strict=True))


def _shown(value: Any) -> str:
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_shown(v) for v in value) + "]"
    if isinstance(value, float):
        return f"{value:.4g}"
    return str(value)
