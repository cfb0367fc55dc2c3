"""Slope, pull and payload that a screw drive holds: brackets from `traction_program`."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.errors import DescriptionError
from snakegen.robot.robot import GRAVITY
from snakegen.screw_drive.ground_stance import Stance
from snakegen.screw_drive.traction_program import HeldLoad, held_load, upper_bound

SIDES = ("nose_up", "nose_down", "left_down", "right_down")
STEEPEST = math.radians(89.0)  # a wall: contacts carry nothing beyond
_ANGLE = 1e-5  # rad, of a slope
_Program = Callable[[Stance, Floats, Floats, float], HeldLoad]


@dataclass(frozen=True, eq=False)
class Held:
    """A limit: what is held with loads shared by compliance, and what no sharing exceeds.

    Attributes:
        value: the figure, on the safe side; nan where the body does not rest.
        upper: bound.
        at: forces at `value`, and what limits it.
    """

    value: float
    upper: float
    at: HeldLoad


def travel_direction(body: Stance) -> Floats:
    """Returns the unit vector (3,) in the plane from the tail's end to the head P."""
    name = list(body.robot.modules.lengths)[-1]
    index, turn, shift = body.robot.body_of_link(name)
    tail = body.place(index, shift + turn @ [body.robot.modules.lengths[name], 0.0, 0.0])
    head = -tail
    head[2] = 0.0
    return np.asarray(head / np.linalg.norm(head))


def downhill(body: Stance, side: str) -> Floats:
    """Returns the direction (3,) in the plane in which gravity pulls on a slope of `side`."""
    ahead = travel_direction(body)
    left = np.array([-ahead[1], ahead[0], 0.0])
    return {"nose_up": -ahead, "nose_down": ahead, "left_down": left, "right_down": -left}[side]


def gravity_on(slope: float, direction: Floats) -> Floats:
    """Returns gravity (3,) [m/s²] in axes of a plane inclined by `slope` [rad]."""
    return GRAVITY * (math.sin(slope) * direction - math.cos(slope) * np.array([0.0, 0.0, 1.0]))


def steepest_slope(body: Stance, direction: Floats, friction: float) -> Held:
    """Returns the steepest slope [rad] that is held, gravity pulling along `direction`.

    The slope β at which ``t(β) = sin β``, t the largest share of g that is held along the plane
    with g cos β across it.
    """

    def solve(program: _Program) -> tuple[float, HeldLoad]:
        from scipy.optimize import brentq

        def at(slope: float) -> HeldLoad:
            across = body.gravity @ [0.0, 0.0, -GRAVITY * math.cos(slope)]
            return program(body, across, body.gravity @ (GRAVITY * direction), friction)

        def surplus(slope: float) -> float:
            factor = at(slope).factor
            return (2.0 if math.isinf(factor) else factor) - math.sin(slope)

        level = at(0.0)
        if math.isnan(level.factor):
            return math.nan, level
        if surplus(STEEPEST) >= 0.0:
            return STEEPEST, at(STEEPEST)
        slope = float(brentq(lambda x: np.nan_to_num(surplus(x), nan=-1.0), 0.0, STEEPEST,
                             xtol=_ANGLE))  # fmt: skip
        return max(slope - _ANGLE, 0.0), at(max(slope - _ANGLE, 0.0))

    low, forces = solve(held_load)
    return Held(low, max(solve(upper_bound)[0] + 2 * _ANGLE, low), forces)


def largest_pull(
    body: Stance,
    direction: Floats,
    friction: float,
    slope: float = 0.0,
    link: str = "",
) -> Held:
    """Returns the largest force [N] at the end of a link that is held along `direction`.

    Args:
        body: at rest.
        direction: (3,) of the force.
        friction: μ.
        slope: rad, nose up.
        link: name; the last of the chain if empty.
    """
    lengths = body.robot.modules.lengths
    name = link or list(lengths)[-1]
    weight = body.gravity @ gravity_on(slope, downhill(body, "nose_up"))
    rising = body.load_at(name, [lengths.get(name, 0.0), 0.0, 0.0]) @ direction
    return _bracket(body, weight, rising, friction)


def largest_payload(body: Stance, friction: float, slope: float = 0.0, link: str = "") -> Held:
    """Returns the largest mass [kg] that is held at the worst place, nose up on `slope`.

    Places are the middles and ends of the links (of one link, where it is named), on their axes.

    Raises:
        DescriptionError: no link is named and the robot states no link lengths.
    """
    lengths = body.robot.modules.lengths
    down = gravity_on(slope, downhill(body, "nose_up"))
    weight, worst = body.gravity @ down, None
    for name in (link,) if link else lengths:
        for share in (0.5, 1.0):
            place = [share * lengths.get(name, 0.0), 0.0, 0.0]
            held = _bracket(body, weight, body.load_at(name, place) @ down, friction)
            if worst is None or not held.value >= worst.value:
                worst = held
    if worst is None:
        raise DescriptionError(
            f"{body.robot.name}: no link has a length, so there is no place for a payload; "
            "name a link or give link lengths."
        )
    return worst


def _bracket(body: Stance, fixed: Floats, rising: Floats, friction: float) -> Held:
    at = held_load(body, fixed, rising, friction)
    upper = upper_bound(body, fixed, rising, friction).certified
    return Held(at.factor, max(upper, at.factor), at)
