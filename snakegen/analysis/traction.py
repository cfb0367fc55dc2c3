"""Traction of a screw drive: steepest slopes, pull, payload, tip-over, and which drums carry.

Quasi-static, on a hard plane, in any posture: every drum holds a force along its wheels' axles up
to friction times its load, by linear programs (`traction_program`). The figures are for loads
shared by the compliance of servos and contacts; in brackets what no sharing of the load exceeds.
Wheels are averaged round the drum: which of them touches changes the load of single drums. Coulomb
friction is not associated, so the figure is no strict bound: docs/drives.md compares it with slopes
and pulls measured in contact.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError
from snakegen.robot.robot import GRAVITY, Robot
from snakegen.screw_drive.ground_stance import Stance, stance
from snakegen.screw_drive.load_sharing import resting_loads
from snakegen.screw_drive.traction_limits import (
    SIDES,
    STEEPEST,
    Held,
    downhill,
    largest_payload,
    largest_pull,
    steepest_slope,
)

COMMAND = "traction"
EXAMPLE = "screw4 --friction 0.2,0.8 --joint joint1_yaw=0.5"
ORDER = 61
REPORT = False  # some seconds of linear programs
NARROW = math.radians(8.0)  # play and servos roll a zigzag by 0.11 rad (docs/drives.md)
_NEW = (0.2, 0.5)  # wet or dusty ground, and smooth ground, beside the robot's own


@dataclass(frozen=True)
class Grip:
    """What is held at one friction."""

    friction: float
    slopes: dict[str, Held]  # rad by side: nose_up, nose_down, left_down, right_down
    pull: Held  # N, backwards at the tail
    payload: Held  # kg

    def to_json(self) -> dict[str, Any]:
        """Returns plain data; keys carry units."""
        return {
            "friction": self.friction,
            "slope_deg": {k: _plain(math.degrees(h.value)) for k, h in self.slopes.items()},
            "slope_upper_deg": {k: _plain(math.degrees(h.upper)) for k, h in self.slopes.items()},
            "slope_limits": {k: list(h.at.limits) for k, h in self.slopes.items()},
            "pull_n": _plain(self.pull.value),
            "pull_upper_n": _plain(self.pull.upper),
            "pull_limits": list(self.pull.at.limits),
            "payload_kg": _plain(self.payload.value),
            "payload_upper_kg": _plain(self.payload.upper),
            "payload_limits": list(self.payload.at.limits),
        }


@dataclass(frozen=True)
class TractionResult:
    """Traction in one posture.

    Attributes:
        load: N at rest on level ground by drum and caster.
        lifting: drums without load there, or at the slope that is held.
        tip_over: rad by side, at which the body rolls or pitches over however good the grip.
        grips: by friction.
        slope: rad, of pull and payload.
    """

    load: dict[str, float]
    lifting: tuple[str, ...]
    tip_over: dict[str, float]
    grips: tuple[Grip, ...]
    slope: float

    @property
    def narrow(self) -> bool:
        """Whether play and servo give, which figures leave out, may roll it to where it tips."""
        return min(self.tip_over.values()) < NARROW

    def to_json(self) -> dict[str, Any]:
        """Returns plain data; keys carry units."""
        return {
            "load_n": self.load,
            "lifting": list(self.lifting),
            "tip_over_deg": {k: _plain(math.degrees(x)) for k, x in self.tip_over.items()},
            "narrow_stance": self.narrow,
            "slope_of_pull_and_payload_deg": math.degrees(self.slope),
            "frictions": [grip.to_json() for grip in self.grips],
        }

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people."""
        carried = ", ".join(f"{name} {force:.1f}" for name, force in self.load.items())
        tips = ", ".join(f"{_side(k)} {_degrees(x)}" for k, x in self.tip_over.items())
        out = [("carries, level", f"{carried} N"), ("tips over at", tips)]
        if self.lifting:
            out.append(("may lift", ", ".join(self.lifting)))
        if self.narrow:
            side = min(self.tip_over, key=lambda k: self.tip_over[k])
            roll = _degrees(self.tip_over[side])
            text = (
                f"a roll of {roll} {_side(side)} tips it, and play and servos, which are left out"
            )
            text += " here, give about as much: pulls to that side are up to 13 % too high"
            out.append(("narrow stance", text))
        for grip in self.grips:
            label = f"friction {grip.friction:g}"
            for k, held in grip.slopes.items():
                text = f"slope {_side(k)} {_degrees(held.value)} (≤ {_degrees(held.upper)})"
                why = f", limit: {', '.join(held.at.limits[:2])}" if held.at.limits else ""
                out.append((label, text + why))
                label = ""
            where = "" if self.slope == 0 else f" on {_degrees(self.slope)}"
            pull, mass = grip.pull, grip.payload
            out.append((label, f"pull{where} {_number(pull, 'N')}"))
            out.append((label, f"payload{where} {_number(mass, 'kg')}"))
        return out


def applies(robot: Robot) -> bool:
    """A floating base and screw units."""
    return robot.floating and bool(robot.modules.screws)


def analyze(
    robot: Robot, q: Floats, friction: str = "", slope: float = 0.0, link: str = ""
) -> TractionResult:
    """Returns what a drive holds in the posture of q.

    Args:
        robot: with drums.
        q: its joints; its attitude is that at which it rests.

    Options:
        friction: μ of wheels on the ground, comma-separated; 0.2, 0.5 and its own if absent
        slope: degrees nose up, on which pull and payload are taken
        link: link that carries the payload, at its worst place; the worst link if absent

    Raises:
        AnalysisError: no such friction or slope; drums that do not reach the ground.
    """
    values, body = _frictions(robot, friction), stance(robot, q)
    if not (math.isfinite(slope) and 0.0 <= slope < math.degrees(STEEPEST)):
        raise AnalysisError(f"slope {slope:g}°: from 0 to less than 89 is needed.")
    angle = math.radians(slope)
    grips = tuple(_grip(body, mu, angle, link) for mu in values)
    tips = {}
    for side in SIDES:
        ideal = steepest_slope(body, downhill(body, side), math.inf).value
        tips[side] = float(np.nanmax([ideal, *(grip.slopes[side].value for grip in grips)]))
    resting = resting_loads(body, body.gravity @ [0.0, 0.0, -GRAVITY])
    load = _by_name(body, resting)
    held = [h for grip in grips for h in grip.slopes.values()]
    drums = dict.fromkeys(c.name for c, drum in zip(body.contacts, body.drums, strict=True) if drum)
    light = [name for name in drums if min(_carried(body, h, name) for h in held) < 1e-6]
    lifting = tuple(name for name in drums if load[name] < 1e-6 or name in light)
    return TractionResult(load, lifting, tips, grips, angle)


def _frictions(robot: Robot, text: str) -> tuple[float, ...]:
    """Returns the frictions asked for, rising."""
    own = min(screw.friction for screw in robot.modules.screws)
    if not text:
        return tuple(sorted({*_NEW, own}))
    try:
        values = tuple(float(x) for x in text.split(","))
    except ValueError:
        raise AnalysisError(f"friction '{text}': numbers are needed, as in 0.2,0.8.") from None
    if not all(math.isfinite(x) and x > 0 for x in values):
        raise AnalysisError(f"friction '{text}': each must be more than 0.")
    return values


def _grip(body: Stance, friction: float, slope: float, link: str) -> Grip:
    back = downhill(body, "nose_up")
    return Grip(
        friction,
        {side: steepest_slope(body, downhill(body, side), friction) for side in SIDES},
        largest_pull(body, back, friction, slope),
        largest_payload(body, friction, slope, link),
    )


def _by_name(body: Stance, force: Floats) -> dict[str, float]:
    out: dict[str, float] = {}
    for contact, value in zip(body.contacts, force, strict=True):
        out[contact.name] = out.get(contact.name, 0.0) + float(value)
    return out


def _carried(body: Stance, held: Held, name: str) -> float:
    return math.inf if math.isnan(held.value) else _by_name(body, held.at.normal)[name]


def _side(name: str) -> str:
    return name.replace("_", " ")


def _degrees(angle: float) -> str:
    if math.isnan(angle):
        return "none"
    return "89° or more" if angle >= STEEPEST else f"{math.degrees(angle):.1f}°"


def _number(held: Held, unit: str) -> str:
    if math.isnan(held.value):
        return "none: the body is not held there"
    return f"{held.value:.3g} {unit} (≤ {held.upper:.3g})"


def _plain(value: float) -> float | None:
    return value if math.isfinite(value) else None
