"""Poses over time: cubic splines through waypoints, at rest at both ends."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A twice differentiable path through waypoints, at rest before the first and after the last.

    Attributes:
        times: (m,) s, rising.
        poses: (m, 6 + k): CoG [m], rotation vector r [rad], joints [rad]. The root link's attitude
            is ``exp(r) Rz(heading)``: no angle of it is singular below a whole turn.
        heading: rad.
    """

    times: Floats
    poses: Floats
    heading: float = 0.0

    @cached_property
    def spline(self) -> Any:
        """The cubic spline, clamped."""
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.times, self.poses, bc_type="clamped")

    def at(self, time: Floats | float, order: int = 0) -> Floats:
        """Returns poses (…, 6 + k), or their derivatives in time, at `time` [s]."""
        t = np.asarray(time, float)
        out = self.spline(np.clip(t, self.times[0], self.times[-1]), order)
        if order:
            out[(t < self.times[0]) | (t > self.times[-1])] = 0.0
        return np.asarray(out)

    def pieces(self) -> list[tuple[float, float]]:
        """Returns the intervals (start, end) [s] on each of which the path is a cubic."""
        return list(zip(self.times[:-1].tolist(), self.times[1:].tolist(), strict=True))

    def swing(self, start: float, end: float) -> tuple[Floats, "Swing"]:
        """Returns the pose halfway in time, and how far any pose between `start` and `end` is.

        Both ends must lie in one piece: there ``x(t) = c₀ + c₁ τ + c₂ τ² + c₃ τ³``, τ from the
        middle, so ``|x - c₀| ≤ |c₁| h + |c₂| h² + |c₃| h³``, h half the interval.
        """
        middle, h = 0.5 * (start + end), 0.5 * (end - start)
        piece = int(np.clip(np.searchsorted(self.times, middle) - 1, 0, len(self.times) - 2))
        tau = middle - self.times[piece]
        c = self.spline.c[:, piece]
        c0 = ((c[0] * tau + c[1]) * tau + c[2]) * tau + c[3]
        c1 = (3.0 * c[0] * tau + 2.0 * c[1]) * tau + c[2]
        c2 = 3.0 * c[0] * tau + c[1]
        terms = np.array([c1 * h, c2 * h**2, c[0] * h**3])
        return c0, Swing(
            float(np.linalg.norm(terms[:, :3], axis=1).sum()),
            float(np.linalg.norm(terms[:, 3:6], axis=1).sum()),
            np.abs(terms[:, 6:]).sum(axis=0),
        )


@dataclass(frozen=True, eq=False)
class Swing:
    """Most that a pose departs from the middle of an interval.

    Attributes:
        shift: m, of the CoG.
        turn: rad, of the rotation vector; the attitude turns by no more, since the derivative of
            the exponential map has no singular value above 1.
        joints: (k,) rad.
    """

    shift: float
    turn: float
    joints: Floats
