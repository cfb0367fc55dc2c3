"""Wake: rotors that stand in the stream of another apparatus, named, with the distance."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from snakegen.analysis.allocation import allocation
from snakegen.errors import AnalysisError
from snakegen.geometry import Floats
from snakegen.robot import Robot

COMMAND = "wake"
ORDER = 45
OPTIONS = {
    "reach": [2.0, "m downstream within which a stream counts"],
    "spread": [0.10, "tangent of the stream's half angle (free jets: about 0.1)"],
}


@dataclass(frozen=True)
class Overlap:
    """Rotor `hit` stands in the stream of rotor `source`, `distance` m downstream."""

    source: str
    hit: str
    distance: float  # m, along the stream
    offset: float  # m, from the stream's axis
    covered: float  # share of the reach between touching (0) and centred (1)


@dataclass(frozen=True)
class Wake:
    """All overlaps between rotors of different apparatuses, nearest first."""

    overlaps: tuple[Overlap, ...]
    reach: float
    spread: float

    def to_json(self) -> dict[str, Any]:
        """Returns plain data for a program."""
        return {
            "reach_m": self.reach,
            "spread": self.spread,
            "overlaps": [asdict(o) for o in self.overlaps],
        }

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people."""
        if not self.overlaps:
            return [("wake", f"no rotor stands in another's stream within {self.reach:g} m")]
        shown = [
            ("wake", f"{o.hit} is in the stream of {o.source}, {o.distance:.2f} m downstream "
                     f"({100 * o.covered:.0f} % covered)")
            for o in self.overlaps[:6]
        ]  # fmt: skip
        if len(self.overlaps) > 6:
            shown.append(("", f"and {len(self.overlaps) - 6} more"))
        return shown


def applies(robot: Robot) -> bool:
    """More than one apparatus."""
    return len(robot.modules.apparatuses) > 1


def analyze(robot: Robot, q: Floats, reach: float = 2.0, spread: float = 0.10) -> Wake:
    """Returns which rotor discs the streams touch.

    A stream is a cone along −u from its rotor: radius ``r + spread · d`` at distance d. A disc of
    radius r' at offset e is touched where ``e < r + spread d + r'``. A simple geometric model.
    """
    for name, value in (("reach", reach), ("spread", spread)):
        if not 0.0 <= value < np.inf:
            raise AnalysisError(f"--{name} {value:g}: a number from 0 on is needed.")
    a = allocation(robot, q)
    rows = [(j, r) for j, m in enumerate(robot.modules.apparatuses) for r in m.rotors]
    found = []
    for s, (j, source) in enumerate(rows):
        for h, (k, hit) in enumerate(rows):
            if j == k:
                continue
            away = a.rotor_positions[h] - a.rotor_positions[s]
            distance = float(away @ -a.rotor_axes[s])
            if not 0.0 < distance <= reach:
                continue
            offset = float(np.linalg.norm(away + distance * a.rotor_axes[s]))
            radius = 0.5 * source.diameter + spread * distance + 0.5 * hit.diameter
            if offset < radius:
                found.append(Overlap(source.link, hit.link, distance, offset, 1 - offset / radius))
    return Wake(tuple(sorted(found, key=lambda o: o.distance)), reach, spread)
