"""Margins of a push by allocator and limits, and the one that predicts a flight's limit."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

UNITS = {"force": " N", "torque": " N·m", "attitude_altitude": ""}
OPEN = 0.01  # share by which bounds may differ without a word
NAMES = {"attitude_altitude": "lift and torque"}
LABELS = {
    "exact_thrust": "exact, thrust limits",
    "exact_servo": "exact, servo limits",
    "pseudo_inverse_thrust": "pseudo-inverse, thrust limits",
    "pseudo_inverse_servo": "pseudo-inverse, servo limits",
}  # servo limits: besides those of thrust
ALLOCATORS = {"paper": "pseudo_inverse", "constrained": "exact"}  # of a flight controller


@dataclass(frozen=True)
class PushMargin:
    """Largest push of one kind that is held in every direction.

    Attributes:
        value: N, N·m, or scaled; nan where hover itself breaks a limit.
        bounds: certified lower and upper; equal where the value is exact.
        push: (6,) weakest push on the robot, of margin 1: ``value * push`` is at the limit; N and
            N·m about the CoG, root-link axes; nan where the margin is 0 or nan.
        at_limit: names of the rotors, apparatuses or joints at their limit there.
        followed: size of the weakest push at its limit when gimbals turn to the forces that they
            carry, thrust points and centre of gravity with them; None where not computed.
    """

    value: float
    bounds: tuple[float, float]
    push: tuple[float, ...]
    at_limit: tuple[str, ...]
    followed: float | None = None

    @property
    def predicted(self) -> float:
        """Returns the size of `push` at which a flight is predicted to lose it."""
        return self.value if self.followed is None else self.followed

    def to_json(self) -> dict[str, Any]:
        """Returns plain data; `followed` where it was computed."""
        out = asdict(self)
        return out if self.followed is not None else {k: out[k] for k in out if k != "followed"}

    def text(self, kind: str) -> str:
        """Returns value, direction and limits for people."""
        if np.isnan(self.value):
            return "hover itself exceeds a limit"
        size = f"{self.value:.4g}{UNITS[kind]}"
        if self.followed is not None:
            size = f"{self.followed:.3g}{UNITS[kind]} as gimbals follow, margin {size}"
        if self.bounds[1] > (1.0 + OPEN) * self.bounds[0]:
            size += f" (at most {self.bounds[1]:.4g})"
        if not np.isfinite(self.push).all():
            return size
        parts = [
            f"{_direction(part)}{unit}"
            for part, unit in ((self.push[:3], " N"), (self.push[3:], " N·m"))
            if np.any(part)
        ]
        if kind in ("force", "torque"):
            parts = [_direction(self.push[:3] if kind == "force" else self.push[3:])]
        at = f" ({', '.join(self.at_limit)})" if self.at_limit else ""
        return f"{size} along {', '.join(parts)}{at}"


def _direction(part: tuple[float, ...]) -> str:
    return " ".join(f"{round(x, 2) + 0.0:+.2f}" for x in part)


@dataclass(frozen=True)
class PushMargins:
    """Push margins of one mode on one link.

    Attributes:
        link: that carries the push.
        kinds: by kind (`UNITS`), then by allocator and limits (`LABELS`).
    """

    link: str
    kinds: dict[str, dict[str, PushMargin]]

    def prediction(self, kind: str, allocator: str) -> tuple[str, PushMargin]:
        """Returns the smallest margin that applies to an allocator, and its key of `LABELS`.

        Args:
            kind: of `UNITS`.
            allocator: ``paper`` (pseudo-inverse) or ``constrained`` (exact).
        """
        mine = {k: m for k, m in self.kinds[kind].items() if k.startswith(ALLOCATORS[allocator])}
        least = min(mine, key=lambda k: -np.inf if np.isnan(mine[k].value) else mine[k].value)
        first = least.replace("servo", "thrust")
        if (
            mine[first].at_limit == mine[least].at_limit
        ):  # no joint limits: one margin, two searches
            least = first
        return least, mine[least]

    def to_json(self) -> dict[str, Any]:
        """Returns plain data: margins by kind, and the prediction of each allocator."""
        out: dict[str, Any] = {"link": self.link}
        for kind, found in self.kinds.items():
            out[kind] = {key: margin.to_json() for key, margin in found.items()}
            out[kind]["prediction"] = {a: self.prediction(kind, a)[0] for a in ALLOCATORS}
        return out

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people, a row an allocator, its limits and a kind."""
        out = [(f"  push on {self.link}", "largest held in every direction, and the weakest:")]
        for key, label in LABELS.items():
            shown = [(k, m[key]) for k, m in self.kinds.items() if key in m]
            texts = [f"{NAMES.get(k, k)} {m.text(k)}" for k, m in shown]
            out += [("" if i else f"    {label}", text) for i, text in enumerate(texts)]
        return out
