"""Resolving a spec: lists spelled out, apparatuses in order, inertias computed from geometry."""

from typing import Any

from snakegen.spec import inertia
from snakegen.spec.base import resolve_base
from snakegen.spec.chain import Chain, Joint
from snakegen.spec.defaults import rate_filter
from snakegen.spec.fields import Part, spread
from snakegen.spec.inertia_limits import refuse_excess
from snakegen.spec.module_resolution import (
    inertias_of,
    lists,
    resolve_apparatuses,
    resolve_battery,
    resolve_casters,
    resolve_payload,
    resolve_screws,
)
from snakegen.spec.sections import SpecSections

_CROSS_MASS = 0.1  # kg, of the joint's body where no mass is given (assumed)


def resolve(spec: SpecSections) -> dict[str, Any]:
    """Returns `spec` as plain data that is itself a valid spec, every default filled in.

    Raises:
        ValueError: a list of the wrong length, a link that does not exist, an impossible inertia.
    """
    n = spec.chain.links
    out = spec.model_dump(mode="json", exclude_none=True)
    out["chain"] |= _chain(spec.chain)
    out["joint"] |= _joint(spec.joint, n - 1, out["chain"]["radius"])
    count = 0
    if spec.vectoring_apparatus is not None:
        out["vectoring_apparatus"] |= resolve_apparatuses(
            spec.vectoring_apparatus, n, out["chain"]["radius"]
        )
        count = len(out["vectoring_apparatus"]["at"])
    for name, gains in spec.control.gain_sets.items():
        for key in ("vectoring_roll", "vectoring_pitch"):
            where = f"control.gain_sets.{name}.{key}"
            values = spread(getattr(gains, key), count, where, "apparatuses")
            out["control"]["gain_sets"][name][key] = values
    told, rate, bends = (
        spec.control.rate_filter,
        spec.control.attitude_rate,
        spec.plant.link_stiffness,
    )
    out["control"]["rate_filter"] = rate_filter(told, rate, spec.chain.links, bends=bends > 0.0)
    if spec.screw_drive is not None:
        out["screw_drive"] |= resolve_screws(spec.screw_drive, out["chain"]["length"])
    if spec.caster is not None:
        out["caster"] |= resolve_casters(spec.caster, n, spec.screw_drive)
    if spec.payload is not None:
        out["payload"] |= resolve_payload(spec.payload, n, spec.folder)
    if spec.battery is not None:
        out["battery"] |= resolve_battery(spec.battery, n)
    refuse_excess(out)
    out["base"] = resolve_base(spec.base, out)
    for name, part in spec:  # in the grammar's order, so that resolving again changes nothing
        if isinstance(part, Part):
            known = out[name]
            out[name] = {k: known[k] for k in type(part).model_fields if k in known}
    return out


def _chain(chain: Chain) -> dict[str, Any]:
    n = chain.links
    out = lists(chain, "chain", ("length", "mass", "radius", "com"), n, "links")
    walls = spread(chain.wall, n, "chain.wall", "links")

    def rod(i: int) -> inertia.Diagonal:
        wall = out["radius"][i] if walls[i] is None else walls[i]
        return inertia.tube(out["mass"][i], out["radius"][i], wall, out["length"][i])

    for i, wall in enumerate(walls):
        if wall is not None and wall > out["radius"][i]:
            raise ValueError(f"chain.wall: {wall} m is more than the radius {out['radius'][i]} m")
    out["inertia"] = inertias_of(chain.inertia, n, "chain.inertia", "links", rod)
    return out


def _joint(joint: Joint, n: int, radius: list[float]) -> dict[str, Any]:
    names = ("gap", "upper", "effort", "velocity")
    out = lists(joint, "joint", names, n, "joints") | {"axes": joint.axes_of(n)}
    masses = spread(joint.mass, n, "joint.mass", "joints")
    given = spread(joint.inertia, n, "joint.inertia", "joints")
    bodies = [
        len(axes) == 2 or gap > 0 or mass is not None or inert is not None
        for axes, gap, mass, inert in zip(out["axes"], out["gap"], masses, given, strict=True)
    ]
    masses = [_CROSS_MASS if m is None else m for m in masses]
    lower = spread(joint.lower, n, "joint.lower", "joints")
    out["lower"] = [-u if low is None else low for low, u in zip(lower, out["upper"], strict=True)]
    for i, (low, high) in enumerate(zip(out["lower"], out["upper"], strict=True)):
        if low >= high:
            raise ValueError(f"joint.lower: {low} is not below joint.upper {high} (joint {i + 1})")

    def shown(i: int) -> inertia.Diagonal:
        """Fills what parts/joint.xacro shows: a cross between two axes, a block on one."""
        if len(out["axes"][i]) == 2:
            return inertia.joint_cross(masses[i], out["gap"][i], radius[i])
        wide = 2.4 * radius[i]
        return inertia.box(masses[i], (out["gap"][i] + wide, wide, wide))

    inertias = inertias_of(joint.inertia, n, "joint.inertia", "joints", shown)
    out["mass"] = [m if body else None for m, body in zip(masses, bodies, strict=True)]
    out["inertia"] = [row if body else None for row, body in zip(inertias, bodies, strict=True)]
    return out
