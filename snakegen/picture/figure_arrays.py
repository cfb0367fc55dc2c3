"""What is drawn of a robot in a posture: sticks, discs and marks as arrays, each of its shape."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snakegen.errors import SnakegenError

Array = NDArray[np.float64]


def _nowhere() -> Array:
    return np.zeros((0, 3))


def _none() -> Array:
    return np.zeros(0)


@dataclass(frozen=True, eq=False)
class RobotFigure:
    """A robot as sticks and discs, in the world; what is empty is not drawn.

    Attributes:
        link_segments: (n, 2, 3) [m], both ends of each link, root first.
        rotor_positions: (r, 3) [m].
        rotor_axes: (r, 3), directions of thrust.
        rotor_radius: (r,) [m]; 0.05 if empty.
        rotor_apparatus: (r,) number of each rotor's apparatus, from 1.
        thrusts: (r,) [N]; an arrow along each axis.
        cog: (3,) [m] centre of gravity.
        payloads: (p, 3) [m] their places.
        link_names: (n,) what stands beside each link.
        bolted: whether the root is fixed to the world.
    """

    link_segments: Array
    rotor_positions: Array = field(default_factory=_nowhere)
    rotor_axes: Array = field(default_factory=_nowhere)
    rotor_radius: Array = field(default_factory=_none)
    rotor_apparatus: Sequence[int] = ()
    thrusts: Array = field(default_factory=_none)
    cog: Array | None = None
    payloads: Array = field(default_factory=_nowhere)
    link_names: Sequence[str] = ()
    bolted: bool = False

    def __post_init__(self) -> None:
        """Holds the shapes.

        Raises:
            SnakegenError: arrays of other shapes, or numbers that are not finite.
        """
        segments = _checked("link_segments", self.link_segments, (None, 2, 3))
        rotors = _checked("rotor_positions", self.rotor_positions, (None, 3))
        count = len(rotors)
        axes = _checked("rotor_axes", self.rotor_axes, (count, 3))
        norms = np.linalg.norm(axes, axis=1, keepdims=True)
        radii = self.rotor_radius if np.size(self.rotor_radius) else np.full(count, 0.05)
        thrusts = self.thrusts if np.size(self.thrusts) else np.zeros(count)
        ready = {
            "link_segments": segments,
            "rotor_positions": rotors,
            "rotor_axes": axes / np.where(norms > 0, norms, 1.0),
            "rotor_radius": _checked("rotor_radius", radii, (count,)),
            "thrusts": _checked("thrusts", thrusts, (count,)),
            "payloads": _checked("payloads", self.payloads, (None, 3)),
            "cog": None if self.cog is None else _checked("cog", self.cog, (3,)),
        }
        for name, array in ready.items():
            object.__setattr__(self, name, array)
        for name, names, wanted in (
            ("link_names", self.link_names, len(segments)),
            ("rotor_apparatus", self.rotor_apparatus, count),
        ):
            if len(names) not in (0, wanted):
                raise SnakegenError(f"draw_robot: {name} has {len(names)} entries, not {wanted}.")

    @property
    def size(self) -> float:
        """Longest extent along an axis of the world [m]."""
        points = np.concatenate([self.link_segments.reshape(-1, 3), self.rotor_positions])
        return float(np.ptp(points, axis=0).max()) or 1.0

    def arrows(self, scale: float | None = None) -> Array:
        """Returns (r, 2, 3) [m], thrusts from each rotor; the longest is 0.35 of the size.

        Args:
            scale: length [m/N] instead.
        """
        longest = np.abs(self.thrusts).max(initial=0.0)
        if scale is None:
            scale = 0.35 * self.size / longest if longest > 0 else 0.0
        reach = (scale * self.thrusts)[:, None] * self.rotor_axes
        return np.stack([self.rotor_positions, self.rotor_positions + reach], axis=1)


def _checked(name: str, values: Any, shape: tuple[int | None, ...]) -> Array:
    array = np.asarray(values, dtype=float)
    fits = array.ndim == len(shape) and all(
        want is None or have == want for have, want in zip(array.shape, shape, strict=True)
    )
    if not fits or not np.isfinite(array).all():
        wanted = ", ".join("n" if want is None else str(want) for want in shape)
        raise SnakegenError(
            f"draw_robot: {name} must be finite and of shape ({wanted}), not {array.shape}."
        )
    return array
