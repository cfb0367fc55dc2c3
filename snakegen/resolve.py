"""Resolving a spec: lists spelled out, apparatuses in order, inertias computed from geometry."""

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from snakegen import inertia
from snakegen.places import Part, spell_out, spread

if TYPE_CHECKING:
    from snakegen.spec import Chain, Joint, Payload, RobotSpec, VectoringApparatus

_CROSS_WIDTH = 0.05  # m, of the joint cross and the gimbal modules where no inertia is given


def resolve(spec: "RobotSpec") -> dict[str, Any]:
    """Returns `spec` as plain data that is itself a valid spec, every default filled in.

    Raises:
        ValueError: a list of the wrong length, a link that does not exist, an impossible inertia.
    """
    n = spec.chain.links
    out = spec.model_dump(mode="json", exclude_none=True)
    out["chain"] |= _chain(spec.chain)
    out["joint"] |= _joint(spec.joint, n - 1)
    count = 0
    if spec.vectoring_apparatus is not None:
        out["vectoring_apparatus"] |= _apparatuses(spec.vectoring_apparatus, n)
        count = len(out["vectoring_apparatus"]["at"])
    for name, gains in spec.control.gain_sets.items():
        for key in ("vectoring_roll", "vectoring_pitch"):
            where = f"control.gain_sets.{name}.{key}"
            values = spread(getattr(gains, key), count, where, "apparatuses")
            out["control"]["gain_sets"][name][key] = values
    if spec.payload is not None:
        out["payload"] |= _payload(spec.payload, n)
    return out


def _lists(part: Part, section: str, names: Iterable[str], count: int, what: str) -> dict:
    return {k: spread(getattr(part, k), count, f"{section}.{k}", what) for k in names}


def _inertias(
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


def _chain(chain: "Chain") -> dict[str, Any]:
    n = chain.links
    out = _lists(chain, "chain", ("length", "mass", "radius", "com"), n, "links")
    walls = spread(chain.wall, n, "chain.wall", "links")

    def rod(i: int) -> inertia.Diagonal:
        wall = out["radius"][i] if walls[i] is None else walls[i]
        return inertia.tube(out["mass"][i], out["radius"][i], wall, out["length"][i])

    for i, wall in enumerate(walls):
        if wall is not None and wall > out["radius"][i]:
            raise ValueError(f"chain.wall: {wall} m is more than the radius {out['radius'][i]} m")
    out["inertia"] = _inertias(chain.inertia, n, "chain.inertia", "links", rod)
    return out


def _joint(joint: "Joint", n: int) -> dict[str, Any]:
    names = ("gap", "mass", "upper", "effort", "velocity")
    out = _lists(joint, "joint", names, n, "joints") | {"axes": joint.axes_of(n)}
    lower = spread(joint.lower, n, "joint.lower", "joints")
    out["lower"] = [-u if low is None else low for low, u in zip(lower, out["upper"], strict=True)]
    for i, (low, high) in enumerate(zip(out["lower"], out["upper"], strict=True)):
        if low >= high:
            raise ValueError(f"joint.lower: {low} is not below joint.upper {high} (joint {i + 1})")

    def cross(i: int) -> inertia.Diagonal:
        return inertia.box(
            out["mass"][i], (out["gap"][i] + _CROSS_WIDTH, _CROSS_WIDTH, _CROSS_WIDTH)
        )

    out["inertia"] = _inertias(joint.inertia, n, "joint.inertia", "joints", cross)
    return out


_APPARATUS_LISTS = (
    "rotors",
    "separation",
    "offset",
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


def _apparatuses(part: "VectoringApparatus", links: int) -> dict[str, Any]:
    """Spells out the apparatuses, ordered from the root by link, then by position."""
    places = spell_out(part.at, links, "vectoring_apparatus.at")
    if not places:
        raise ValueError("vectoring_apparatus.at: empty; name a link, or leave the section out")
    n, section = len(places), "vectoring_apparatus"
    out = _lists(part, section, _APPARATUS_LISTS, n, "apparatuses")

    def roll(i: int) -> inertia.Diagonal:
        return inertia.box(out["roll_mass"][i], (_CROSS_WIDTH, 1.2 * _CROSS_WIDTH, _CROSS_WIDTH))

    def pitch(i: int) -> inertia.Diagonal:
        width = out["separation"][i] + out["rotor_diameter"][i]
        return inertia.box(out["pitch_mass"][i], (_CROSS_WIDTH, width, _CROSS_WIDTH))

    what = "apparatuses"
    out["roll_inertia"] = _inertias(part.roll_inertia, n, f"{section}.roll_inertia", what, roll)
    out["pitch_inertia"] = _inertias(part.pitch_inertia, n, f"{section}.pitch_inertia", what, pitch)
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


def _payload(part: "Payload", links: int) -> dict[str, Any]:
    places = spell_out(part.at, links, "payload.at")
    n = len(places)
    out = _lists(part, "payload", ("mass", "offset", "radius"), n, "payloads")
    out["offset"] = [list(o) for o in out["offset"]]

    def ball(i: int) -> inertia.Diagonal:
        return inertia.sphere(out["mass"][i], out["radius"][i])

    out["inertia"] = _inertias(part.inertia, n, "payload.inertia", "payloads", ball)
    out["at"] = [{"link": p.link, "position": p.position} for p in places]
    return out
