"""Dry friction of joints: static at rest, sliding in motion, a smooth fall between (Stribeck)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError
from snakegen.robot.robot import Robot


@dataclass(frozen=True)
class Friction:
    """Dry friction of joints.

    Attributes:
        static: N·m, at rest; one value, or (k,) of each joint.
        sliding: N·m, in motion; likewise.
        speed: rad/s, at which static friction has fallen to 1/e of its way to sliding.
        creep: rad/s, below which a joint counts as at rest: there friction grows with the rate.
    """

    static: float | Floats = 0.0
    sliding: float | Floats = 0.0
    speed: float = 0.02
    creep: float = 0.002

    def __post_init__(self) -> None:
        """Checks the numbers: 0 ≤ sliding ≤ static, speeds above 0."""
        static, sliding = np.asarray(self.static), np.asarray(self.sliding)
        good = np.all(np.isfinite(static)) and np.all((sliding >= 0) & (sliding <= static))
        if not (good and np.isfinite(self.speed) and self.speed > 0 and self.creep > 0):
            raise AnalysisError(
                f"friction {static},{sliding}: static and sliding friction [N·m] "
                "with 0 ≤ sliding ≤ static are needed."
            )

    @property
    def present(self) -> bool:
        """Tells whether there is any."""
        return bool(np.any(np.asarray(self.static) > 0))

    @property
    def highest(self) -> tuple[float, float]:
        """The largest static and sliding friction of any joint [N·m]."""
        return float(np.max(self.static)), float(np.max(self.sliding))

    def bound(self, rate: Floats) -> Floats:
        """Returns the most that friction can hold at `rate` [rad/s]: N·m, of rate's shape.

        ``F(q̇) = F_sliding + (F_static - F_sliding) exp(-(q̇/v_s)²)``.
        """
        fall = np.exp(-((np.asarray(rate) / self.speed) ** 2))
        return np.asarray(self.sliding + (self.static - self.sliding) * fall)

    def torque(self, rate: Floats) -> Floats:
        """Returns what the servo has to add to the law: ``F(q̇) tanh(q̇ / creep)``, N·m."""
        return np.tanh(np.asarray(rate) / self.creep) * self.bound(rate)


def friction_of(
    given: Friction | ArrayLike | None, robot: Robot | None = None, joints: Sequence[str] = ()
) -> Friction:
    """Returns friction from ``static,sliding`` [N·m] or one number for both, else the robot's own.

    Args:
        given: in place of what the robot's servos say (`joint.servo.friction` of a spec).
        robot: whose servos; without one there is none.
        joints: in the order of which that is given.

    Raises:
        AnalysisError: no numbers, or static below sliding.
    """
    if given is None:
        own = {} if robot is None else {s.joint: s.friction for s in robot.modules.servos}
        each = np.array([own.get(name, 0.0) for name in joints])
        if not np.any(each):
            return Friction()
        same = float(each[0]) if np.all(each == each[0]) else each
        return Friction(same, same)
    if isinstance(given, Friction):
        return given
    try:
        listed = given.split(",") if isinstance(given, str) else given
        numbers = np.atleast_1d(np.array(listed, float))
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if numbers.shape not in ((1,), (2,)):
        raise AnalysisError(f"friction: {given!r}: write static,sliding in N·m, as in 0.1,0.06.")
    return Friction(float(numbers[0]), float(numbers[-1]))
