"""Pairs of values, declared by the URDF and read from the MJCF, and how far they differ."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.geometry import Floats

SMALLEST = 1e-6  # SI units: values below it are compared to it, for zeros have rounding errors


@dataclass(frozen=True)
class Pairs:
    """One quantity of several actuators, joints, sites or geoms, in both descriptions.

    Attributes:
        quantity: as in ``thrust wrench``.
        names: (m,) what carries it, as in ``rotor1_1``.
        columns: (k,) its components with their units.
        declared: (m, k) by the URDF and its modules; infinite where there is no limit.
        mjcf: (m, k) the same, as MuJoCo has it; NaN where it has another kind of thing.
        scale: size of what the values are sums of, which may cancel.
    """

    quantity: str
    names: tuple[str, ...]
    columns: tuple[str, ...]
    declared: Floats
    mjcf: Floats
    scale: float


@dataclass(frozen=True)
class Difference:
    """The largest difference of one quantity of one actuator, joint, site or geom."""

    quantity: str
    name: str
    column: str
    declared: float
    mjcf: float
    error: float

    def __str__(self) -> str:
        """Names what differs, and both values."""
        return (
            f"{self.name}: {self.quantity}, {self.column}: "
            f"{self.declared:.9g} in the URDF, {self.mjcf:.9g} in the MJCF"
        )


def pairs(
    quantity: str,
    names: Sequence[str],
    columns: Sequence[str],
    declared: ArrayLike,
    mjcf: ArrayLike,
    scale: float = 0.0,
) -> Pairs:
    """Returns `Pairs` of arrays or nested lists that are reshaped to (names, columns)."""
    shape = (len(names), len(columns))
    return Pairs(
        quantity,
        tuple(names),
        tuple(columns),
        np.array(declared, float).reshape(shape),
        np.array(mjcf, float).reshape(shape),
        max(scale, SMALLEST),
    )


def worst_differences(found: Iterable[Pairs]) -> tuple[Difference, ...]:
    """Returns the largest difference of each quantity of each name, in the order of `found`.

    Error: ``|a - b| / max(|a|, |b|, largest finite entry of that quantity, its scale)``, 0 where
    both are the same, infinite where one of them is infinite or NaN.
    """
    together = list(found)
    scales: dict[str, float] = {}
    for p in together:
        entries = np.abs(np.concatenate([p.declared.ravel(), p.mjcf.ravel(), [p.scale]]))
        largest = float(entries[np.isfinite(entries)].max())
        scales[p.quantity] = max(scales.get(p.quantity, 0.0), largest)
    worst: dict[tuple[str, str], Difference] = {}
    for p in together:
        errors = _errors(p, scales[p.quantity])
        for name, row, a, b in zip(p.names, errors, p.declared, p.mjcf, strict=True):
            k = int(np.argmax(row))
            key, error = (p.quantity, name), float(row[k])
            if key not in worst or error > worst[key].error:
                worst[key] = Difference(*key, p.columns[k], float(a[k]), float(b[k]), error)
    return tuple(worst.values())


def _errors(p: Pairs, scale: float) -> Floats:
    with np.errstate(invalid="ignore"):
        gap = np.abs(p.declared - p.mjcf)
    same = (p.declared == p.mjcf) | (gap == 0.0)
    return np.where(same, 0.0, np.where(np.isfinite(gap), gap / scale, np.inf))
