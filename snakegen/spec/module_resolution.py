"""Resolving the modules of a spec, and its lists: one entry per link, joint or part."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from snakegen.errors import SpecError
from snakegen.spec import inertia, payload
from snakegen.spec.fields import Part, spell_out, spread
from snakegen.spec.modules import Battery, Caster, Payload, ScrewDrive, VectoringApparatus
from snakegen.spec.wheel_layout import wheel_layout

_MODULE_WIDTH = 0.05  # m, of the gimbal modules where no inertia is given
_PAIR_OFFSET = 0.037  # m, DRAGON's pitch axis above the roll axis


def lists(part: Part, section: str, names: Iterable[str], count: int, what: str) -> dict:
    return {k: spread(getattr(part, k), count, f"{section}.{k}", what) for k in names}


def inertias_of(
    given: Any, count: int, place: str, what: str, compute: Callable[[int], inertia.Diagonal]
) -> list[list[float]]:
    """Returns an inertia diagonal per item: the given one, checked, or the computed one."""
    rows = spread(given, count, place, what)
    out = []
    for i, row in enumerate(rows):
        diagonal = compute(i) if row is None else tuple(row)
        if not inertia.obeys_triangle(diagonal):
            raise ValueError(
                f"{place}: {list(diagonal)} is no body's inertia: "
                "each moment must be positive and at most the sum of the other two"
            )
        out.append([float(x) for x in diagonal])
    return out


_APPARATUS_LISTS = (
    "rotors",
    "separation",
    "thrust_min",
    "thrust_max",
    "drag_ratio",
    "roll_limit",
    "pitch_limit",
    "effort",
    "velocity",
    "roll_mass",
    "pitch_mass",
    "rotor_diameter",
    "rotor_inertia",
    "rotor_speed",
    "motor_lag",
)


def lone_clearance(radius: float, diameter: float) -> float:
    """Returns how far from the axis a lone rotor's duct clears the roll module at any angle [m].

    The module is 1.9 times the rod's `radius`; the duct is 1 by 0.7 of the rotor's `diameter`.
    """
    return 1.9 * radius + 0.62 * diameter


def resolve_apparatuses(part: VectoringApparatus, links: int, radii: list[float]) -> dict[str, Any]:
    """Spells out the apparatuses, ordered from the root by link, then by position."""
    places = spell_out(part.at, links, "vectoring_apparatus.at")
    if not places:
        raise ValueError("vectoring_apparatus.at: empty; name a link, or leave the section out")
    n, section = len(places), "vectoring_apparatus"
    out = lists(part, section, _APPARATUS_LISTS, n, "apparatuses")
    offsets = spread(part.offset, n, f"{section}.offset", "apparatuses")

    def offset(i: int) -> float:
        # Below, for there the rotor's stream is free: above, it would blow on its own link.
        clear = lone_clearance(radii[places[i].link - 1], out["rotor_diameter"][i])
        return -round(clear, 9) if out["rotors"][i] == 1 else _PAIR_OFFSET

    out["offset"] = [offset(i) if x is None else float(x) for i, x in enumerate(offsets)]

    def roll(i: int) -> inertia.Diagonal:
        return inertia.box(out["roll_mass"][i], (_MODULE_WIDTH, 1.2 * _MODULE_WIDTH, _MODULE_WIDTH))

    def pitch(i: int) -> inertia.Diagonal:
        width = out["separation"][i] + out["rotor_diameter"][i]
        return inertia.box(out["pitch_mass"][i], (_MODULE_WIDTH, width, _MODULE_WIDTH))

    what = "apparatuses"
    out["roll_inertia"] = inertias_of(part.roll_inertia, n, f"{section}.roll_inertia", what, roll)
    out["pitch_inertia"] = inertias_of(
        part.pitch_inertia, n, f"{section}.pitch_inertia", what, pitch
    )
    for low, high in zip(out["thrust_min"], out["thrust_max"], strict=True):
        if low >= high:
            raise ValueError(f"{section}.thrust_min: {low} N is not below thrust_max {high} N")
    order = sorted(range(n), key=lambda j: (places[j].link, places[j].position))
    if isinstance(part.spin, list):
        spins = part.spins(n)
        out["spin"] = [spins[j] for j in order]
    out = {k: v if k == "spin" else [v[j] for j in order] for k, v in out.items()}
    if not isinstance(part.spin, list):
        out["spin"] = part.model_copy(update={"rotors": out["rotors"]}).spins(n)
    out["at"] = [{"link": places[j].link, "position": places[j].position} for j in order]
    return out


def resolve_screws(part: ScrewDrive, lengths: list[float]) -> dict[str, Any]:
    """Spells out the drums, ordered from the root, and lays out the wheels of each."""
    where, places = "screw_drive", spell_out(part.at, len(lengths), "screw_drive.at")
    n = len(places)
    if n < 2:
        raise ValueError(
            f"{where}.at: {n} drum cannot drive a body; 2 at least, and 3 to hold its course"
        )
    offsets = spread(part.offset, n, f"{where}.offset", "drums")
    share = [
        p.position if o is None else o / lengths[p.link - 1]
        for p, o in zip(places, offsets, strict=True)
    ]
    for p, o, x in zip(places, offsets, share, strict=True):
        if x > 1:
            raise ValueError(
                f"{where}.offset: {o:g} m lies off link {p.link}, {lengths[p.link - 1]:g} m long"
            )
    angles = spread(part.helix_angle, n, f"{where}.helix_angle", "drums")
    masses = spread(part.mass, n, f"{where}.mass", "drums")
    order = sorted(range(n), key=lambda j: (places[j].link, share[j]))
    signs = part.signs(n)
    if part.hand != "alternating":
        signs = [signs[j] for j in order]
    angles, masses = [angles[j] for j in order], [masses[j] for j in order]
    for angle in angles:
        if angle < 0:
            raise ValueError(f"{where}.helix_angle: {angle:g} rad; its sign is the hand's: right")
    alpha = [sign * angle for sign, angle in zip(signs, angles, strict=True)]
    wheels = [_wheels(part, a) for a in alpha]
    reach = max(abs(p[0]) for one in wheels for p in one["position"])
    length = part.length or 2.0 * (reach + 2.0 * part.wheel_radius)

    def drum(i: int) -> inertia.Diagonal:
        return inertia.cylinder(masses[i], 0.8 * part.radius, length)

    inertias = inertias_of(part.inertia, n, f"{where}.inertia", "drums", drum)
    out = {
        "at": [{"link": places[j].link, "position": share[j]} for j in order],
        "helix_angle": angles,
        "hand": ["left" if sign > 0 else "right" for sign in signs],
        "length": length,
        "mass": masses,
        "inertia": [inertias[j] for j in order] if isinstance(part.inertia, list) else inertias,
        "alpha": alpha,
        "wheels": wheels,
    }
    return out if part.offset is None else out | {"offset": [offsets[j] for j in order]}


def _wheels(part: ScrewDrive, alpha: float) -> dict[str, Any]:
    """Returns the wheels of a drum as plain lists: xacro cannot work them out."""
    try:
        layout = wheel_layout(
            alpha,
            part.radius,
            part.blades,
            part.wheels_per_blade,
            part.rollers,
            part.wheel_radius,
        )
    except SpecError as error:
        raise ValueError(f"screw_drive: {str(error).rstrip('.')}") from None
    return {
        "position": layout.position.round(12).tolist(),
        "rpy": layout.rpy.round(12).tolist(),
        "blade": layout.blade.tolist(),
        "wheel": layout.wheel.tolist(),
        "half_length": float(layout.half_length),
    }


def resolve_casters(part: Caster, links: int, screws: ScrewDrive | None) -> dict[str, Any]:
    places = spell_out(part.at, links, "caster.at")
    n = len(places)
    if part.drop is None and screws is None:
        raise ValueError("caster.drop: needed, in m, where there are no drums to stand on")
    drop = part.drop if part.drop is not None or screws is None else screws.radius
    out = lists(part, "caster", ("track", "radius", "mass"), n, "casters")
    out["drop"] = spread(drop, n, "caster.drop", "casters")

    def ball(i: int) -> inertia.Diagonal:
        return inertia.sphere(out["mass"][i], out["radius"][i])

    out["inertia"] = inertias_of(part.inertia, n, "caster.inertia", "casters", ball)
    out["at"] = [{"link": p.link, "position": p.position} for p in places]
    return out


def resolve_payload(part: Payload, links: int, folder: Path) -> dict[str, Any]:
    """Spells out the payloads; a mesh gives what the spec leaves open, and moves to ``meshes/``."""
    places = spell_out(part.at, links, "payload.at")
    n = len(places)
    out = lists(part, "payload", ("mass", "offset", "radius"), n, "payloads")
    out["at"] = [{"link": p.link, "position": p.position} for p in places]
    com, solid = (0.0, 0.0, 0.0), None
    if part.mesh is not None:
        solid = payload.filled(payload.locate(part.mesh, folder))
        com = solid.com
        out["mesh"] = payload.target(part.mesh)
        out["box_size"] = list(part.box_size or solid.box_size)
        out["box_centre"] = list(part.box_centre or solid.box_centre)
    coms = spread(part.com, n, "payload.com", "payloads")
    out["com"] = [list(com if c is None else c) for c in coms]
    out["offset"] = [list(o) for o in out["offset"]]
    given = spread(part.inertia, n, "payload.inertia", "payloads")
    out["inertia"] = []
    for mass, radius, row in zip(out["mass"], out["radius"], given, strict=True):
        if row is None:
            ball = inertia.sphere(mass, radius)
            row = ball if solid is None else [mass * x for x in solid.inertia]
        if not inertia.obeys_triangle(inertia.principal(row)):
            raise ValueError(f"payload.inertia: {list(row)} is no body's inertia")
        out["inertia"].append([float(x) for x in row])
    return out


def resolve_battery(part: "Battery", links: int) -> dict[str, Any]:
    """Spells out where the battery is."""
    places = spell_out(part.at, links, "battery.at")
    if len(places) != 1:
        raise ValueError(f"battery.at: {len(places)} places; one is needed")
    return {"at": [{"link": places[0].link, "position": places[0].position}]}
