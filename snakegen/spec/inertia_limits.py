"""Largest moments of inertia that the bodies of a spec can have, from their masses and lengths."""

from collections.abc import Iterator
from typing import Any

Limit = tuple[str, str, list[float], float, float]  # field, body, moments across, axial, ∫x² dm


def refuse_excess(resolved: dict[str, Any]) -> None:
    """Refuses moments across a body's length that no body of its mass and length has.

    Of mass m that lies within a length L of the x axis, its centre at the share c of it,
    ``Iyy ≤ m c (1 - c) L² + Ixx``, for ``∫ x² dm ≤ m c (1 - c) L²`` and ``∫ z² dm ≤ Ixx``.

    Args:
        resolved: a spec with lists spelled out.

    Raises:
        ValueError: the field, the body, its moment and the limit.
    """
    for field, body, moments, axial, spread in _limits(resolved):
        most = spread + axial
        if max(moments) > most * (1.0 + 1e-9):
            raise ValueError(
                f"{field}: {max(moments):.4g} kg·m² is more than a body of that mass and length "
                f"can have ({body}: {most:.4g})"
            )


def _limits(resolved: dict[str, Any]) -> Iterator[Limit]:
    chain = resolved["chain"]
    columns = (chain[k] for k in ("inertia", "mass", "length", "com"))
    for i, (row, mass, length, com) in enumerate(zip(*columns, strict=True)):
        share = max(com * (1.0 - com), 1.0 / 12.0)  # not less than a rod's, the default
        body = f"link {i + 1}, {mass:g} kg on {length:g} m"
        yield "chain.inertia", body, row[1:], row[0], share * mass * length**2
    part = resolved.get("vectoring_apparatus")
    if part is not None:
        names = ("pitch_inertia", "pitch_mass", "separation", "rotor_diameter")
        for j, (row, mass, apart, wide) in enumerate(zip(*(part[k] for k in names), strict=True)):
            link = part["at"][j]["link"]
            body = f"apparatus {j + 1} on link{link}, {mass:g} kg on {apart + wide:g} m"
            most = mass * max(0.25 * (apart + wide) ** 2, 0.05**2)
            yield "vectoring_apparatus.pitch_inertia", body, [row[0], row[2]], row[1], most
    drums = resolved.get("screw_drive")
    if drums is not None:
        for i, (row, mass) in enumerate(zip(drums["inertia"], drums["mass"], strict=True)):
            body = f"drum {i + 1}, {mass:g} kg on {drums['length']:g} m"
            yield "screw_drive.inertia", body, row[1:], row[0], 0.25 * mass * drums["length"] ** 2
