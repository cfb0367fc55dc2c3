"""Dry friction of joints: static at rest, sliding in motion, a smooth fall between (Stribeck)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from snakegen.errors import AnalysisError
from snakegen.geometry import Floats


@dataclass(frozen=True)
class Friction:
    """Dry friction, the same in every joint.

    Attributes:
        static: N m, at rest.
        sliding: N m, in motion.
        speed: rad/s, at which static friction has fallen to 1/e of its way to sliding.
        creep: rad/s, below which a joint counts as at rest: there friction grows with the rate.
    """

    static: float = 0.0
    sliding: float = 0.0
    speed: float = 0.02
    creep: float = 0.002

    def __post_init__(self) -> None:
        """Checks the numbers: 0 ≤ sliding ≤ static, speeds above 0."""
        good = np.all(np.isfinite([self.static, self.sliding, self.speed]))
        if not (good and 0 <= self.sliding <= self.static and self.speed > 0 and self.creep > 0):
            raise AnalysisError(
                f"friction {self.static:g},{self.sliding:g}: static and sliding friction [N m] "
                "with 0 ≤ sliding ≤ static are needed."
            )

    @property
    def present(self) -> bool:
        """Tells whether there is any."""
        return self.static > 0

    def bound(self, rate: Floats) -> Floats:
        """Returns the most that friction can hold at `rate` [rad/s]: N m, of rate's shape.

        ``F(q̇) = F_sliding + (F_static - F_sliding) exp(-(q̇/v_s)²)``.
        """
        fall = np.exp(-((np.asarray(rate) / self.speed) ** 2))
        return np.asarray(self.sliding + (self.static - self.sliding) * fall)

    def torque(self, rate: Floats) -> Floats:
        """Returns what the servo has to add to the law: ``F(q̇) tanh(q̇ / creep)``, N m."""
        return np.tanh(np.asarray(rate) / self.creep) * self.bound(rate)


def friction_of(given: Friction | ArrayLike | None) -> Friction:
    """Returns friction from ``static,sliding`` [N m], from one number for both, or none.

    Raises:
        AnalysisError: no numbers, or static below sliding.
    """
    if given is None:
        return Friction()
    if isinstance(given, Friction):
        return given
    try:
        listed = given.split(",") if isinstance(given, str) else given
        numbers = np.atleast_1d(np.array(listed, float))
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if numbers.shape not in ((1,), (2,)):
        raise AnalysisError(f"friction: {given!r}: write static,sliding in N m, as in 0.1,0.06.")
    return Friction(float(numbers[0]), float(numbers[-1]))
