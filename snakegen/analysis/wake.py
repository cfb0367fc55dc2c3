"""Wake: rotors that stand in the stream of another rotor, named, with distance and thrust lost.

Links that a stream blows on, the rotor's own among them, are named with the thrust they take.
"""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.special import erf

from snakegen.analysis.allocation import Allocation, allocation
from snakegen.base.geometry import Floats
from snakegen.description.meshes.solids_of import rod_radii
from snakegen.errors import AnalysisError
from snakegen.robot.kinematics import centre_of_gravity, forward
from snakegen.robot.modules import Rotor
from snakegen.robot.robot import Robot
from snakegen.robot.rotor_streams import mean_inflow, thrust_kept

COMMAND = "wake"
ORDER = 45
_DRAG = 1.1  # of a cylinder across the flow, where the plant says nothing (Hoerner)
_LEAST = 0.01  # of a rotor's thrust: what links take below this is not worth a line
_PIECES = 400  # of a rod, at whose middles the stream is evaluated


@dataclass(frozen=True)
class Blocked:
    """Link `link` stands in the stream of rotor `source` and takes `share` of its thrust."""

    source: str
    link: str
    share: float  # drag of the link along the stream over the rotor's thrust
    distance: float  # m, along the stream to the nearest point of the rod that it meets


@dataclass(frozen=True)
class Overlap:
    """Rotor `hit` stands in the stream of rotor `source`, `distance` m downstream."""

    source: str
    hit: str
    distance: float  # m, along the stream
    offset: float  # m, from the stream's axis
    covered: float  # share of the reach between touching (0) and centred (1)
    lost: float = 0.0  # share of its thrust that `hit` loses, both rotors at the same disc loading
    counted: bool = False  # whether limits and drag ratio of `hit` count on a loss


@dataclass(frozen=True)
class Wake:
    """Overlaps between rotors, nearest first; links that are blown on.

    Links are listed by what they take, from 1 % of a rotor's thrust on.
    """

    overlaps: tuple[Overlap, ...]
    blocked: tuple[Blocked, ...]
    reach: float
    spread: float

    def to_json(self) -> dict[str, Any]:
        """Returns plain data for a program."""
        return {
            "reach_m": self.reach,
            "spread": self.spread,
            "overlaps": [asdict(o) for o in self.overlaps],
            "blocked_by_links": [asdict(b) for b in self.blocked],
        }

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people."""
        return self._overlap_rows() + self._blocked_rows()

    def _blocked_rows(self) -> list[tuple[str, str]]:
        shown = [
            ("thrust lost", f"{b.link} stands in the stream of {b.source}, {b.distance:.2g} m "
                            f"downstream, and takes {100 * b.share:.2g} % of its thrust")
            for b in self.blocked[:6]
        ]  # fmt: skip
        if len(self.blocked) > 6:
            shown.append(("", f"and {len(self.blocked) - 6} more"))
        return shown

    def _overlap_rows(self) -> list[tuple[str, str]]:
        if not self.overlaps:
            return [("wake", f"no rotor stands in another's stream within {self.reach:g} m")]
        shown = [
            ("wake", f"{o.hit} is in the stream of {o.source}, {o.distance:.2f} m downstream "
                     f"({100 * o.covered:.0f} % covered), loses {100 * o.lost:.2g} % of its thrust"
                     f"{' (counted in its limits)' if o.counted else ''}")
            for o in self.overlaps[:6]
        ]  # fmt: skip
        if len(self.overlaps) > 6:
            shown.append(("", f"and {len(self.overlaps) - 6} more"))
        return shown


def applies(robot: Robot) -> bool:
    """More than one rotor, or one on links of known length."""
    rotors = sum(len(a.rotors) for a in robot.modules.apparatuses)
    return rotors > (0 if robot.modules.lengths else 1)


def analyze(robot: Robot, q: Floats, reach: float = 2.0, spread: float = 0.10) -> Wake:
    """Returns which rotor discs the streams touch, and which links they blow on.

    A stream is a cone along −u from its rotor: radius ``r + spread · d`` at distance d. A disc of
    radius r' at offset e is touched where ``e < r + spread d + r'``. What it loses is momentum
    theory's share at the same power, as the simulated plant has it (`robot.rotor_streams`).

    Options:
        reach: m downstream within which a stream counts
        spread: tangent of the stream's half angle (free jets: about 0.1)
    """
    for name, value in (("reach", reach), ("spread", spread)):
        if not 0.0 <= value < np.inf:
            raise AnalysisError(f"--{name} {value:g}: a number from 0 on is needed.")
    a = allocation(robot, q)
    rows = [r for m in robot.modules.apparatuses for r in m.rotors]
    found = []
    for s, source in enumerate(rows):
        for h, hit in enumerate(rows):
            if s == h:
                continue
            away = a.rotor_positions[h] - a.rotor_positions[s]
            distance = float(away @ -a.rotor_axes[s])
            if not 1e-6 < distance <= reach:
                continue
            offset = float(np.linalg.norm(away + distance * a.rotor_axes[s]))
            radius = 0.5 * source.diameter + spread * distance + 0.5 * hit.diameter
            if offset < radius:
                inflow = mean_inflow(
                    distance, offset, 0.5 * source.diameter, 0.5 * hit.diameter, spread
                )
                lost = 1.0 - float(thrust_kept(inflow))
                covered = 1 - offset / radius
                together = bool(robot.rotors.body[s] == robot.rotors.body[h])
                counted = together and hit.stream_efficiency < 1.0
                pair = (source.label, hit.label)
                found.append(Overlap(*pair, distance, offset, covered, lost, counted))
    blocked = _blocked(robot, q, a, reach, spread)
    return Wake(tuple(sorted(found, key=lambda o: o.distance)), blocked, reach, spread)


def _blocked(
    robot: Robot, q: Floats, a: Allocation, reach: float, spread: float
) -> tuple[Blocked, ...]:
    """Returns the links that take thrust from a rotor, the own ones too, worst first."""
    names = list(robot.modules.lengths)
    radii = rod_radii(robot.urdf, names)
    drag = float(robot.modules.plant.get("drag_coefficient", _DRAG))
    rotation, position = forward(robot.tree, np.eye(3), np.zeros(3), robot.angles(q))
    _, cog = centre_of_gravity(robot.tree, rotation, position)  # root-link axes, as a has
    rotors = [r for m in robot.modules.apparatuses for r in m.rotors]
    out = []
    for name, radius in zip(names, radii, strict=True):
        body, turn, origin = robot.body_of_link(name)
        start = position[body] + rotation[body] @ origin - cog
        rod = rotation[body] @ turn[:, 0]
        for k, rotor in enumerate(rotors):
            share, distance = blocked_share(
                rotor, a.rotor_positions[k], a.rotor_axes[k], start, rod,
                robot.modules.lengths[name], float(radius), drag, reach, spread,
            )  # fmt: skip
            if share >= _LEAST:
                out.append(Blocked(rotor.label, name, share, distance))
    return tuple(sorted(out, key=lambda b: -b.share))


def blocked_share(
    rotor: Rotor, place: Floats, axis: Floats, start: Floats, rod: Floats, length: float,
    radius: float, drag: float, reach: float, spread: float,
) -> tuple[float, float]:  # fmt: skip
    """Returns the share of a rotor's thrust that a rod in its stream takes, and how near it is.

    The stream is that of `kernels.air.add_stream`, ``V² = 2T/(ρπb²) exp(−2(e/b)²)`` with
    ``b = R + spread·d``. On each piece of rod the drag of the flow across it, along the stream:
    ``½ ρ C_d V² sin³γ`` per area, γ between rod and stream; V² is integrated over the rod's width.

    Args:
        rotor: for its diameter.
        place, axis: (3,) m and unit, of its disc; the stream goes along −axis.
        start, rod: (3,) m and unit, the rod's end and direction.
        length, radius: m, of the rod.
        drag: C_d.
        reach, spread: as in `analyze`.
    """
    middles = (np.arange(_PIECES) + 0.5) * length / _PIECES
    away = start + middles[:, None] * rod - place
    down = -(away @ axis)
    met = (down > 0.0) & (down <= reach)
    across = np.cross(axis, rod)
    sine = float(np.linalg.norm(across))
    if not met.any() or radius <= 0.0 or rotor.diameter <= 0.0 or sine < 1e-9:
        return 0.0, np.inf
    away, down = away[met], down[met]
    wide = 0.5 * rotor.diameter + spread * down
    aside = away @ (across / sine)
    other = np.sum(away**2, axis=1) - down**2 - aside**2
    edge = np.sqrt(2.0) / wide
    strip = (
        np.sqrt(np.pi / 8.0) * wide * (erf(edge * (aside + radius)) - erf(edge * (aside - radius)))
    )
    taken = drag * sine**3 / (np.pi * wide**2) * np.exp(-2.0 * other / wide**2) * strip
    inside = other + aside**2 < wide**2
    near = float(down[inside].min()) if inside.any() else float(down.min())
    return float(taken.sum() * length / _PIECES), near
