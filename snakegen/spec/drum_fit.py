"""Whether screw drums fit: wheels on their drum, a drum on its link, drums beside each other."""

import math
from typing import Any

import numpy as np

_RESERVE = 1e-9  # m


def drum_warnings(resolved: dict[str, Any]) -> list[str]:
    """Returns warnings of drums in a resolved spec that could not be built, or meet when bent."""
    return [*_wheels(resolved), *_on_links(resolved), *_neighbours(resolved)]


def _wheels(resolved: dict[str, Any]) -> list[str]:
    """Wheels of neighbouring blades are ``2π R cos α / blades`` apart, across the blades."""
    part = resolved["screw_drive"]
    radius, wheel = part["radius"], part["wheel_radius"]
    out = []
    rods = {resolved["chain"]["radius"][place["link"] - 1] for place in part["at"]}
    hub = radius - 2.0 * wheel
    if hub < max(rods) - _RESERVE:
        out.append(
            f"screw_drive.wheel_radius: wheels of {wheel:g} m leave a hub of {max(hub, 0.0):.3g} m "
            f"in a drum of {radius:g} m; the rod inside has a radius of {max(rods):g} m"
        )
    if part["rollers"] == "helix_capsule":
        steepest = max(abs(alpha) for alpha in part["alpha"])
        across = 2.0 * math.pi * (radius - wheel) * math.cos(steepest) / part["blades"]
        if across < 2.0 * wheel - _RESERVE:
            out.append(
                f"screw_drive.blades: wheels of {part['blades']} blades are {across:.3g} m apart, "
                f"less than their diameter of {2 * wheel:g} m"
            )
    return out


def _on_links(resolved: dict[str, Any]) -> list[str]:
    part, half = resolved["screw_drive"], 0.5 * resolved["screw_drive"]["length"]
    out = []
    for k, place in enumerate(part["at"]):
        length = resolved["chain"]["length"][place["link"] - 1]
        centre = place["position"] * length
        over = max(half - centre, centre + half - length)
        if over > _RESERVE:
            out.append(
                f"screw_drive.at: drum {k + 1}, {2 * half:.3g} m long, reaches {over:.3g} m beyond "
                f"link {place['link']}"
            )
    return out


def _neighbours(resolved: dict[str, Any]) -> list[str]:
    """Drums on both sides of a joint, as seen across its axis."""
    part, joint = resolved["screw_drive"], resolved["joint"]
    half, radius = 0.5 * part["length"], part["radius"]
    lengths = resolved["chain"]["length"]
    out = []
    for k in range(len(part["at"]) - 1):
        one, two = part["at"][k], part["at"][k + 1]
        behind = lengths[one["link"] - 1] * (1.0 - one["position"]) - half
        ahead = lengths[two["link"] - 1] * two["position"] - half
        if one["link"] == two["link"]:
            apart = (two["position"] - one["position"]) * lengths[one["link"] - 1] - 2 * half
            if apart < -_RESERVE:
                out.append(f"screw_drive.at: drums {k + 1} and {k + 2} overlap by {-apart:.3g} m")
        elif two["link"] == one["link"] + 1:
            meet = _meeting(behind, ahead, radius)
            limit = _bend(joint, one["link"] - 1)
            if meet < limit - 1e-9:
                out.append(
                    f"screw_drive: drums {k + 1} and {k + 2} meet where joint {one['link']} bends "
                    f"{math.degrees(meet):.1f}°; its limits allow {math.degrees(limit):.1f}°"
                )
    return out


def _meeting(behind: float, ahead: float, radius: float) -> float:
    """Returns the bend [rad] at which a rim enters the other drum's rectangle; π if never.

    The rim at distance b ahead of the joint is in the drum that ends a behind it where
    ``r sin θ - b cos θ ≥ a`` and ``b sin θ + r cos θ ≤ r``, and the other way round.
    """
    bend = np.linspace(0.0, math.pi, 3142)
    sine, cosine = np.sin(bend), np.cos(bend)
    inside = np.zeros(bend.size, bool)
    for a, b in ((behind, ahead), (ahead, behind)):
        inside |= (radius * sine - b * cosine >= a) & (b * sine + radius * cosine <= radius)
    return float(bend[inside][0]) if inside.any() else math.pi


def _bend(joint: dict[str, Any], index: int) -> float:
    """Returns the largest angle [rad] between two links that the joint's limits allow.

    Two crossed axes of limits θ₁ and θ₂ bend by ``acos(cos θ₁ cos θ₂)``.
    """
    axes = joint["axes"][index] if isinstance(joint["axes"][0], list) else joint["axes"]
    limits = []
    for name in ("lower", "upper"):
        value = joint[name][index] if isinstance(joint[name], list) else joint[name]
        limits.append([value] * len(axes) if not isinstance(value, list) else value)
    cosine = 1.0
    for axis, low, high in zip(axes, *limits, strict=True):
        if axis != "roll":
            most = min(max(abs(low), abs(high)), math.pi)
            cosine *= max(math.cos(most), 0.0) if len(axes) > 1 else math.cos(most)
    return math.acos(cosine)
