"""What a spec allows and its maker should know: warnings of a build."""

import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from snakegen.spec import RobotSpec


def warnings(spec: "RobotSpec") -> tuple[str, ...]:
    """Returns what a spec allows and its maker should know."""
    resolved = spec.resolved()
    return (*_apparatuses(resolved), *_screws(spec, resolved))


def _apparatuses(resolved: dict[str, Any]) -> list[str]:
    """Returns warnings of apparatuses that overlap, or cannot lift the robot."""
    part = resolved.get("vectoring_apparatus")
    if part is None or resolved["base"] != "floating":
        return []
    out, places = [], part["at"]
    for j in range(1, len(places)):
        one, two = places[j - 1], places[j]
        length = resolved["chain"]["length"][one["link"] - 1]
        gap = (two["position"] - one["position"]) * length
        if one["link"] == two["link"] and gap < part["rotor_diameter"][j]:
            out.append(
                f"vectoring_apparatus.at: apparatuses {j} and {j + 1} stand {gap:.3g} m apart on "
                f"link {one['link']}, less than a rotor's {part['rotor_diameter'][j]:.3g} m"
            )
    thrust = sum(n * t for n, t in zip(part["rotors"], part["thrust_max"], strict=True))
    weight = 9.81 * _mass(resolved)
    if thrust <= weight:
        out.append(f"too heavy to hover: {weight:.1f} N of weight, {thrust:.1f} N of thrust")
    return out


def _mass(resolved: dict[str, Any]) -> float:
    """Returns the mass of chain, crosses, apparatuses and payloads [kg]; drums left out."""
    joint, part = resolved["joint"], resolved["vectoring_apparatus"]
    crosses = sum(m for m, a in zip(joint["mass"], joint["axes"], strict=True) if len(a) == 2)
    modules = sum(part["roll_mass"]) + sum(part["pitch_mass"])
    payload = sum(resolved["payload"]["mass"]) if "payload" in resolved else 0.0
    return float(sum(resolved["chain"]["mass"]) + crosses + modules + payload)


def _screws(spec: "RobotSpec", resolved: dict[str, Any]) -> list[str]:
    """Returns warnings of screw drives."""
    if spec.screw_drive is None:
        return []
    alpha = resolved["screw_drive"]["alpha"]
    out = []
    if len({a > 0 for a in alpha}) == 1:
        degrees = ", ".join(f"{math.degrees(a):.4g}°" for a in alpha)
        out.append(
            f"screw_drive: all {len(alpha)} drums have one hand (α {degrees}): a straight body "
            "slides across its course and cannot steer straight"
        )
    elif len(alpha) < 3:
        out.append(f"screw_drive: {len(alpha)} drums leave a turn free in every shape; 3 hold it")
    if spec.screw_drive.rollers == "ball":
        out.append(
            "screw_drive.rollers: a ball for each drum is in the MJCF alone; the URDF has the "
            "wheels, and URDF and MJCF were compared with the wheels in both"
        )
    if spec.caster is None:
        out.append("no caster: a straight body stands on a line and rolls over; put one at 1@0")
    return out
