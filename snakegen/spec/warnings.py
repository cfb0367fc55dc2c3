"""What a spec allows and its maker should know: warnings of a build."""

import math
from typing import Any

from snakegen.spec.drum_fit import drum_warnings
from snakegen.spec.module_resolution import lone_clearance
from snakegen.spec.robot_spec import RobotSpec

_TURN = 4.0 * math.pi  # rad; hardly a joint turns further, but any limit in degrees reads so
_LONG, _SHORT = 20.0, 1e-3  # m; lengths beyond are millimetres, or kilometres, in all likelihood
_DRAG_RATIO = 0.5  # m; propellers have 0.005 to 0.05
_LENGTHS = {
    "chain": ("length", "radius"),
    "joint": ("gap",),
    "vectoring_apparatus": ("separation", "offset", "rotor_diameter"),
    "screw_drive": ("radius",),
    "payload": ("radius",),
}


def warnings(spec: RobotSpec) -> tuple[str, ...]:
    """Returns what a spec allows and its maker should know."""
    resolved = spec.resolved()
    return (
        *_scaled(spec, resolved),
        *_sizes(resolved),
        *_apparatuses(resolved),
        *_screws(spec, resolved),
    )


def _scaled(spec: RobotSpec, resolved: dict[str, Any]) -> list[str]:
    """Returns a note of each inertia that follows the masses and sizes set over a file's."""
    out = []
    for field in spec.scaled:
        section, name = field.split(".")
        first = next(row for row in resolved[section][name] if row is not None)
        row = ", ".join(f"{x:.4g}" for x in first)
        out.append(f"{field}: scaled with mass and size of that body, to [{row}] kg·m²")
    return out


def _sizes(resolved: dict[str, Any]) -> list[str]:
    """Returns warnings of quantities that are off by orders: another unit was meant."""
    out = []
    for section, names in _LENGTHS.items():
        for name in names:
            for x in _different(resolved.get(section, {}).get(name)):
                if abs(x) > _LONG or 0 < abs(x) < _SHORT:
                    meant = "millimetres?" if abs(x) > _LONG else "metres are meant"
                    out.append(f"{section}.{name}: {x:g} m; {meant}")
    angles = {"joint": ("lower", "upper"), "vectoring_apparatus": ("roll_limit", "pitch_limit")}
    for section, names in angles.items():
        for name in names:
            for x in _different(resolved.get(section, {}).get(name)):
                if abs(x) > _TURN:
                    out.append(
                        f"{section}.{name}: {x:g} rad are {abs(x) / (2 * math.pi):.3g} turns; "
                        f"degrees? {x:g}° are {math.radians(x):.4g} rad"
                    )
    chain = resolved["chain"]
    for radius, length in sorted(set(zip(chain["radius"], chain["length"], strict=True))):
        if radius > 0.5 * length:
            out.append(
                f"chain.radius: {radius:g} m is more than half the length of {length:g} m; "
                "a link is a rod along its length"
            )
    for ratio in _different(resolved.get("vectoring_apparatus", {}).get("drag_ratio")):
        if ratio > _DRAG_RATIO:
            out.append(
                f"vectoring_apparatus.drag_ratio: {ratio:g} m; millimetres? torque over thrust of "
                "a propeller is 0.005 to 0.05 m"
            )
    return out


def _different(values: Any) -> list[float]:
    """Returns the different numbers of one value, a list, or nothing, in order."""
    listed = values if isinstance(values, list) else [values]
    return list(dict.fromkeys(x for x in listed if x is not None))


def _apparatuses(resolved: dict[str, Any]) -> list[str]:
    """Returns warnings of apparatuses that overlap, or cannot lift the robot."""
    part = resolved.get("vectoring_apparatus")
    if part is None:
        return []
    out = [*_between(resolved, part), *_within(resolved, part)]
    thrust = sum(n * t for n, t in zip(part["rotors"], part["thrust_max"], strict=True))
    weight = 9.81 * _mass(resolved)
    if resolved["base"] == "floating" and thrust <= weight:
        out.append(f"too heavy to hover: {weight:.1f} N of weight, {thrust:.1f} N of thrust")
    return out


def _between(resolved: dict[str, Any], part: dict[str, Any]) -> list[str]:
    """Returns warnings of apparatuses of one link that stand in one another's place."""
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
    return out


def _within(resolved: dict[str, Any], part: dict[str, Any]) -> list[str]:
    """Returns warnings of a duct that stands in its twin's place, or in its own link's."""
    places = part["at"]
    pairs: dict[tuple[float, float], list[int]] = {}
    lone: dict[tuple[float, float], list[int]] = {}
    for j, place in enumerate(places):
        wide = part["rotor_diameter"][j]
        if part["rotors"][j] == 2 and part["separation"][j] < wide:
            pairs.setdefault((part["separation"][j], wide), []).append(j + 1)
        clear = lone_clearance(resolved["chain"]["radius"][place["link"] - 1], wide)
        if part["rotors"][j] == 1 and (part["offset"][j] > 0 or -part["offset"][j] < clear - 1e-6):
            lone.setdefault((part["offset"][j], clear), []).append(j + 1)
    out = [
        f"vectoring_apparatus.separation: {apart:g} m between the rotors of "
        f"{_named(which, places)} is less than their diameter, {wide:g} m: the ducts overlap"
        for (apart, wide), which in pairs.items()
    ]
    for (offset, clear), which in lone.items():
        what = f"vectoring_apparatus.offset: the one rotor of {_named(which, places)}, "
        what += f"at {offset:g} m,"
        if abs(offset) < clear - 1e-6:
            out.append(
                f"{what} stands inside its own link's space; {-clear:.3g} m clears it at every "
                "angle, as does leaving offset out"
            )
        else:
            out.append(
                f"{what} blows on its own link, which takes thrust (`analyze wake` says how much); "
                f"{-clear:.3g} m hangs it below, where its stream is free"
            )
    return out


def _named(numbers: list[int], places: list[dict[str, Any]]) -> str:
    """Returns apparatuses in words: ``apparatus 2 on link2``, ``apparatuses 1 and 2 on link1``."""
    links = ", ".join(dict.fromkeys(f"link{places[n - 1]['link']}" for n in numbers))
    if len(numbers) == 1:
        return f"apparatus {numbers[0]} on {links}"
    return f"apparatuses {', '.join(map(str, numbers[:-1]))} and {numbers[-1]} on {links}"


def _mass(resolved: dict[str, Any]) -> float:
    """Returns the mass [kg] of all parts but drums."""
    joint, part = resolved["joint"], resolved["vectoring_apparatus"]
    crosses = sum(m for m in joint["mass"] if m is not None)
    modules = sum(part["roll_mass"]) + sum(part["pitch_mass"])
    payload = sum(resolved["payload"]["mass"]) if "payload" in resolved else 0.0
    battery = resolved["battery"]["mass"] if "battery" in resolved else 0.0
    return float(sum(resolved["chain"]["mass"]) + crosses + modules + payload + battery)


def _screws(spec: RobotSpec, resolved: dict[str, Any]) -> list[str]:
    """Returns warnings of screw drives."""
    if spec.screw_drive is None:
        return []
    alpha = resolved["screw_drive"]["alpha"]
    out = drum_warnings(resolved)
    drives = spec.base == "floating"  # what is bolted to the world does not drive
    if drives and len({a > 0 for a in alpha}) == 1:
        degrees = ", ".join(f"{math.degrees(a):.4g}°" for a in alpha)
        out.append(
            f"screw_drive: all {len(alpha)} drums have one hand (α {degrees}): a straight body "
            "slides across its course and cannot steer straight"
        )
    elif drives and len(alpha) < 3:
        out.append(f"screw_drive: {len(alpha)} drums leave a turn free in every shape; 3 hold it")
    if spec.screw_drive.rollers == "ball":
        out.append(
            "screw_drive.rollers: a ball for each drum is in the MJCF alone; the URDF has the "
            "wheels, and URDF and MJCF were compared with the wheels in both"
        )
    if drives and spec.caster is None:
        out.append("no caster: a straight body stands on a line and rolls over; put one at 1@0")
    return out
