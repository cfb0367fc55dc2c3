"""Inertias that a spec gives explicitly, scaled when its masses and sizes are changed.

A body whose mass becomes μ times as much and whose edges become s_x, s_y, s_z times as long keeps
its shape: with the second moments ``S = ½ tr(I) 1 - I`` about the centre of mass,
``S' = μ diag(s) S diag(s)`` and ``I' = tr(S') 1 - S'``.
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats


@dataclass(frozen=True)
class Sizes:
    """The fields on which an inertia depends: a mass, and what spans x, y and z (added up)."""

    section: str
    inertia: str
    mass: str
    spans: tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]
    added: float = 0.0  # m, to the first span


_DEPENDENCE = (
    Sizes("chain", "inertia", "mass", (("length",), ("radius",), ("radius",))),
    Sizes("joint", "inertia", "mass", (("gap",), (), ()), 0.05),
    Sizes("vectoring_apparatus", "roll_inertia", "roll_mass", ((), (), ())),
    Sizes(
        "vectoring_apparatus",
        "pitch_inertia",
        "pitch_mass",
        ((), ("separation", "rotor_diameter"), ()),
    ),
    Sizes("screw_drive", "inertia", "mass", (("length",), ("radius",), ("radius",))),
    Sizes("caster", "inertia", "mass", (("radius",),) * 3),
    Sizes("payload", "inertia", "mass", (("radius",),) * 3),
)


def scale_inertias(
    before: dict[str, Any],
    after: dict[str, Any],
    defaults: dict[str, dict[str, Any]],
    changed: Collection[str],
) -> dict[str, list[Any]]:
    """Scales in `after` the inertias that it took over from `before`; returns them by field.

    Args:
        before: a spec as plain data.
        after: the same with some fields set anew; changed in place.
        defaults: values of fields that a spec leaves out, by section.
        changed: the fields set anew, as in ``chain.length`` or ``chain.mass.2``.
    """
    out = {}
    for kind in _DEPENDENCE:
        section, field = after.get(kind.section), f"{kind.section}.{kind.inertia}"
        if not isinstance(section, dict) or section.get(kind.inertia) is None:
            continue
        if any(f"{c}.".startswith((f"{field}.", f"{kind.section}.at.")) for c in changed):
            continue
        if not any(c == kind.section or c.startswith(f"{kind.section}.") for c in changed):
            continue
        given = defaults.get(kind.section, {})
        old, new = given | (before.get(kind.section) or {}), given | section
        scaled = _scaled(kind, old, new)
        if scaled is not None and scaled != section[kind.inertia]:
            section[kind.inertia] = out[field] = scaled
    return out


def _scaled(kind: Sizes, old: dict[str, Any], new: dict[str, Any]) -> Any:
    """Returns the inertia, or list of them, with the sizes of `new`, None if these are unclear."""
    given = new[kind.inertia]
    nested = isinstance(given, list) and given and isinstance(given[0], list | None)
    names = {kind.mass, *(n for span in kind.spans for n in span)}
    values = [d.get(n) for d in (old, new) for n in names]
    counts = {len(v) for v in (*values, given if nested else None) if isinstance(v, list)}
    if len(counts) > 1:
        return None  # lists of unequal length are refused elsewhere
    count = counts.pop() if counts else 1
    try:
        rows = [
            _row(given[i] if nested else given, *_ratios(kind, old, new, i)) for i in range(count)
        ]
    except (TypeError, ValueError, ZeroDivisionError, KeyError):
        return None  # what is no number is refused elsewhere
    alike = all(row == rows[0] for row in rows)
    return rows[0] if alike and not nested else rows


def _ratios(
    kind: Sizes, old: dict[str, Any], new: dict[str, Any], i: int
) -> tuple[float, list[float]]:
    """Returns the ratio of masses and of the three spans of item `i`."""

    def at(data: dict[str, Any], name: str) -> float | None:
        value = data.get(name)
        value = value[i] if isinstance(value, list) else value
        return None if value is None else float(value)

    def ratio(names: tuple[str, ...], added: float) -> float:
        pairs = [(at(old, n), at(new, n)) for n in names]
        known = [(a, b) for a, b in pairs if a is not None and b is not None]
        first = sum(a for a, _ in known) + added
        return (sum(b for _, b in known) + added) / first if known and first > 0 else 1.0

    spans = [ratio(s, kind.added if k == 0 else 0.0) for k, s in enumerate(kind.spans)]
    return ratio((kind.mass,), 0.0), spans


def _row(row: Any, mass: float, spans: list[float]) -> Any:
    """Returns Ixx Iyy Izz, or these with Ixy Ixz Iyz, of the scaled body."""
    if row is None or (mass == 1.0 and all(s == 1.0 for s in spans)):
        return row
    if not np.isfinite([mass, *spans]).all():
        raise ValueError("a size is no number")
    tensor = np.diag([float(x) for x in row[:3]])
    for value, (a, b) in zip(row[3:], ((0, 1), (0, 2), (1, 2)), strict=False):
        tensor[a, b] = tensor[b, a] = float(value)
    second = 0.5 * np.trace(tensor) * np.eye(3) - tensor
    second = mass * np.outer(spans, spans) * second
    scaled = np.trace(second) * np.eye(3) - second
    return [float(f"{x:.9g}") for x in _entries(scaled, len(row))]


def _entries(tensor: Floats, count: int) -> Iterator[float]:
    yield from np.diag(tensor)
    if count > 3:
        yield from (tensor[0, 1], tensor[0, 2], tensor[1, 2])
