"""Rates, constraints and demands of a screw drive, as data and as text."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from snakegen.screw_drive.held_shape import DirectionCone
from snakegen.screw_drive.kinematics import (
    PathDemand,
    ScrewGeometry,
)
from snakegen.screw_drive.singularity import DriveHold, HoldSearch


@dataclass(frozen=True)
class DriveResult:
    """What a screw drive can do at a shape, and in all shapes that its joints allow."""

    geometry: ScrewGeometry
    hold: DriveHold  # at the given shape
    search: HoldSearch  # over all shapes
    dead: tuple[int, ...]  # units (from 1) whose α of 0 makes B singular
    slip: dict[
        str, float
    ]  # m/s RMS, turning at 3 links' radius, a parameter of the worst unit believed 1 % too large
    demand: PathDemand | None  # None where B is singular or the joints cannot follow the path
    refusal: str  # why there is no demand, or ""
    cone: DirectionCone | None
    following: tuple[float, float]  # m, smallest arcs that can be followed, left and right
    fixed: tuple[float, float]  # m, smallest arcs at this shape and speed, left and right
    speed: float  # m/s
    pitch: float  # rad, largest |angle| of the joints that are not yaws: the model needs 0

    @property
    def following_radius(self) -> float:
        """The smallest arc [m] that can be followed both ways."""
        return max(self.following)

    @property
    def fixed_radius(self) -> float:
        """The smallest arc [m] that can be driven both ways at this shape and speed."""
        return max(self.fixed)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a designer should know before building."""
        hands = np.sign(np.sin(self.geometry.alpha))
        out = []
        if self.dead:
            out.append(f"unit {self.dead[0]} has a helix angle of 0: its screw drives nothing")
        if self.geometry.units < 3:
            out.append(f"{self.geometry.units} units leave a turn free in every shape: needs 3")
        elif np.all(hands == hands[0]):
            out.append("all units have one hand: a straight body slides and cannot be steered")
        if self.pitch > 1e-3:
            out.append(
                f"joints are bent up to {math.degrees(self.pitch):.1f}° out of the plane; the "
                "model is that of the body laid flat"
            )
        return tuple(out)

    def to_json(self) -> dict[str, Any]:
        """Returns plain data; keys carry units."""
        found, cone = self.search, self.cone
        return {
            "units": self.geometry.units,
            "helix_angle_rad": list(self.geometry.alpha),
            "rank": self.hold.rank,
            "sigma": self.hold.sigma.tolist(),
            "hold": self.hold.kind,
            "hold_text": self.hold.text,
            "weakest_sigma": float(found.weakest.sigma[-1]),
            "weakest_shape_rad": found.weakest.shape.tolist(),
            "certified_sigma": found.certified,
            "singular_shapes": [
                {"shape_rad": h.shape.tolist(), "kind": h.kind, "text": h.text}
                for h in found.singular
            ],
            "dead_units": list(self.dead),
            "slip_m_s_per_percent": self.slip,
            "path": None if self.demand is None else _demand(self.demand),
            "path_refusal": self.refusal,
            "direction_speed_min_m_s": None if cone is None else _finite(float(cone.speed.min())),
            "direction_speed_max_m_s": None if cone is None else _finite(float(cone.speed.max())),
            "direction_cone_rad": None if cone is None else cone.width(self.speed),
            "following_radius_m": _finite(self.following_radius),
            "following_radius_left_right_m": [_finite(x) for x in self.following],
            "fixed_shape_radius_m": _finite(self.fixed_radius),
            "fixed_shape_radius_left_right_m": [_finite(x) for x in self.fixed],
            "shapes_sampled": found.sampled,
            "shapes_descended": found.descended,
            "speed_m_s": self.speed,
            "warnings": list(self.warnings),
        }

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people."""
        found = self.search
        out = [
            ("units", f"{self.geometry.units}, α {_degrees(self.geometry.alpha)}"),
            ("hold at this shape", f"rank {self.hold.rank}, {self.hold.text}"),
        ]
        if found.singular:
            shown = found.singular[:4]
            out += [("singular shape", f"{_degrees(h.shape)}: {h.text}") for h in shown]
            many = f"{len(shown)} of {len(found.singular)} that {found.descended} descents from the"
            many += f" best of {found.sampled} sampled shapes ended in; they may be one family"
            out.append(("", many))
        else:
            proof = f"; proved ≥ {found.certified:.3g} everywhere" if found.certified else ""
            where = _degrees(found.weakest.shape)
            out.append(("weakest shape", f"σ₃ {found.weakest.sigma[-1]:.3g} at {where}{proof}"))
        if self.demand is not None:
            d = self.demand
            rates = f"screws {d.screw_rate:.2f}, joints {d.joint_rate:.2f} rad/s"
            out.append((f"path at {d.speed:g} m/s", f"{rates}; motors allow {d.fastest:.2f} m/s"))
        elif self.refusal:
            out.append(("path", self.refusal))
        if self.cone is not None:
            low, high = self.cone.speed.min(), self.cone.speed.max()
            wide = math.degrees(self.cone.width(self.speed))
            text = f"{low:.3f} to {high:.3f} m/s; {self.speed:g} m/s over {wide:.0f}°"
            out.append(("any direction", text))
        out.append(("turning radius", f"{_two_ways(self.following)} follow-the-leader"))
        at = "" if np.isfinite(self.fixed).all() else f" at {self.speed:g} m/s"
        out.append(("", f"{_two_ways(self.fixed)} with the shape held{at}"))
        if self.slip:
            slip = ", ".join(f"{name} {1e3 * value:.2g}" for name, value in self.slip.items())
            out.append(
                ("slip per 1 % error", f"{slip} mm/s (turning, bent either way, worst unit)")
            )
        return out + [("warning", text) for text in self.warnings]


def _two_ways(radii: tuple[float, float]) -> str:
    """Returns the radii of left and right turns as text; one where they agree."""
    left, right = radii
    if left == right or abs(left - right) < 5e-4:
        return _radius(left)
    return f"{_radius(left)} to the left, {_radius(right)} to the right,"


def _radius(value: float) -> str:
    return f"{value:.3f} m" if math.isfinite(value) else "none"


def _degrees(angles: ArrayLike) -> str:
    """Returns angles [rad] as text."""
    return "[" + ", ".join(f"{math.degrees(a):.1f}" for a in np.asarray(angles, float)) + "]°"


def _demand(demand: PathDemand) -> dict[str, float | None]:
    """Returns what a path takes under keys that carry their units."""
    return {
        "screw_rate_rad_s": demand.screw_rate,
        "joint_rate_rad_s": demand.joint_rate,
        "joint_angle_rad": demand.joint_angle,
        "speed_m_s": demand.speed,
        "fastest_m_s": _finite(demand.fastest),
    }


def _finite(value: float) -> float | None:
    """Returns `value`, None if it is infinite: JSON has no infinity."""
    return value if math.isfinite(value) else None
