"""Rank, condition and class of each mode, as data and as text."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from snakegen.analysis.allocation import Allocation


@dataclass(frozen=True)
class Rank:
    """Scaled singular values of an allocation matrix, ``S Q diag(λ_max)``."""

    matrix: str
    singular_values: tuple[float, ...]
    rank: int
    condition: float  # σ1/σ6, infinite when the rank is below 6
    lost: tuple[str, ...]  # motions that no thrust works on, in words

    @property
    def sigma_min(self) -> float:
        """The smallest of the six singular values."""
        return self.singular_values[-1]


@dataclass(frozen=True)
class ModeClass:
    """The class of one mode in one posture, and why."""

    mode: str
    value: str
    sentence: str
    paper: str  # what the paper's rule says
    agrees: bool


@dataclass(frozen=True)
class Actuation:
    """Ranks of the four allocation matrices and of all inputs together; a class per mode."""

    tolerance: float
    force_scale: float
    torque_scale: float
    ranks: tuple[Rank, ...]
    modes: tuple[ModeClass, ...]
    allocation: Allocation

    def rank_of(self, matrix: str) -> Rank:
        """Returns the rank entry of ``dual``, ``virtual``, ``force``, ``jacobian`` or ``all``."""
        return next(r for r in self.ranks if r.matrix == matrix)

    def to_json(self) -> dict[str, Any]:
        """Returns plain data for a program."""
        return {
            "rank_tolerance": self.tolerance,
            "force_scale_N": self.force_scale,
            "torque_scale_Nm": self.torque_scale,
            "ranks": {
                r.matrix: {
                    "rank": r.rank,
                    "scaled_singular_values": list(r.singular_values),
                    "condition": r.condition if np.isfinite(r.condition) else None,
                    "lost": list(r.lost),
                }
                for r in self.ranks
            },
            "modes": [asdict(m) for m in self.modes],
            "allocation": self.allocation.to_json(),
        }

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people."""
        out = []
        for r in self.ranks:
            values = " ".join(f"{s:.3g}" for s in r.singular_values)
            condition = f"condition {r.condition:.3g}" if np.isfinite(r.condition) else "singular"
            text = f"{r.rank} of 6   singular values {values}   {condition}"
            out.append((f"rank of Q {r.matrix}", text))
        for m in self.modes:
            out.append(
                (f"{m.mode.replace('_', '-')} mode", f"{m.value.replace('_', ' ')}: {m.sentence}")
            )
            if not m.agrees:
                out.append(("", f"the paper's rule says otherwise: {m.paper}"))
        return out
