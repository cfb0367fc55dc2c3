"""Play of a drive's joints and the drag of the cable behind it: what its hardware takes away."""

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.robot.losses import Losses
from snakegen.robot.robot import GRAVITY

_STILL = 0.002  # m/s of the tail, below which friction of the cable is not yet full
_PIECE = 0.05  # m of trail, over which its direction is taken: wheels make the tail tremble


def through_play(target: Floats, angle: Floats, play: float) -> Floats:
    """Returns the target (m,) [rad] at which a servo without play gives a joint's torque.

    The dead zone of a stiff gear with `play` rad between stops: ``τ = k D(target − q)``, D zero
    within ± play / 2.
    """
    gap = target - angle
    return np.asarray(angle + np.sign(gap) * np.maximum(np.abs(gap) - 0.5 * play, 0.0))


def motor_side(target: Floats, angle: Floats, play: float) -> Floats:
    """Returns the angles (m,) [rad] that encoders on the motor's side of the play read."""
    return np.asarray(angle + np.clip(target - angle, -0.5 * play, 0.5 * play))


class CableDrag:
    """Pull of a cable that lies on open ground behind the tail and is drawn along.

    The ground holds each metre of it by μ λ g at most, whatever way it lies, so the tail feels
    ``T = μ λ g (length laid out + way driven)`` at most: that is the figure. Corners that would
    hold the cable (the capstan equation) are not on open ground, where it cuts them.
    """

    def __init__(self, losses: Losses) -> None:
        """Begins with ``cable_length`` laid out straight."""
        self.straight = losses.cable_friction * losses.cable_mass * GRAVITY  # N/m
        self.tension = self.straight * losses.cable_length  # N
        self.mark: Floats | None = None
        self.last = np.zeros(2)
        self.ahead: Floats | None = None

    def force(self, tail: Floats, period: float) -> Floats:
        """Returns the pull (3,) [N] on the tail, now at `tail` (3,) [m], `period` s after the last.

        A tail that goes back slackens the cable, and is not pulled.
        """
        here = np.array(tail[:2])
        if self.mark is None:
            self.mark = self.last = here
        step, self.last = here - self.last, here
        gone = here - self.mark
        way = float(np.hypot(*gone))
        if way >= _PIECE:
            ahead = gone / way
            self.tension += self.straight * way
            self.mark, self.ahead = here, ahead
        if self.ahead is None:
            return np.zeros(3)
        speed = float(step @ self.ahead) / period
        pull = self.tension * min(1.0, max(0.0, speed / _STILL))
        return np.append(-pull * self.ahead, 0.0)
