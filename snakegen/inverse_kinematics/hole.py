"""A hole that a body enters: its centreline in space, and the room about it."""

from dataclasses import dataclass

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError


@dataclass(frozen=True)
class Hole:
    """A hole's centreline, from its mouth inwards.

    Attributes:
        points: (m, 3) m from the base origin, world axes.
        room: m, that the body's line may be off it.
    """

    points: Floats
    room: float

    @property
    def arcs(self) -> Floats:
        """Arc length (m,) [m] at the points."""
        steps = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])

    @property
    def inwards(self) -> Floats:
        """Unit direction (3,) at the mouth."""
        step = self.points[1] - self.points[0]
        return np.asarray(step / np.linalg.norm(step))

    def with_run_up(self, length: float) -> "Hole":
        """Returns the hole with its centreline drawn out of the mouth, straight."""
        begin = self.points[0] - length * self.inwards
        return Hole(np.vstack([begin, self.points]), self.room)

    def at(self, s: float) -> Floats:
        """Returns the place (3,) at arc length s [m]."""
        return np.array([np.interp(s, self.arcs, self.points[:, k]) for k in range(3)])

    def nearest(self, places: Floats) -> tuple[Floats, Floats, Floats]:
        """Returns the nearest points (n, 3), directions (n, 3) and arcs (n,) [m] of the line."""
        a, step = self.points[:-1], np.diff(self.points, axis=0)
        size = np.sum(step**2, axis=1)
        t = np.clip(np.sum((places[:, None] - a) * step, axis=-1) / size, 0.0, 1.0)
        on = a + t[..., None] * step
        k = np.argmin(np.sum((places[:, None] - on) ** 2, axis=-1), axis=1)
        rows = np.arange(len(places))
        long = np.sqrt(size[k])
        return on[rows, k], step[k] / long[:, None], self.arcs[k] + t[rows, k] * long


def checked_hole(points: Floats, room: float) -> Hole:
    """Returns a hole after a check of its numbers.

    Raises:
        AnalysisError: a room that is not positive, two points in one place.
    """
    if not (np.isfinite(room) and room > 0):
        raise AnalysisError(f"room = {room:g} m: more than 0 is needed.")
    short = np.linalg.norm(np.diff(points, axis=0), axis=1) <= 1e-9
    if np.any(short):
        raise AnalysisError(f"path: points {int(np.argmax(short)) + 1} and the next are the same.")
    return Hole(points, room)
