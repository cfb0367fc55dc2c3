"""Curves in space for a body to follow: pieces joined with continuous tangents, densely sampled."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from snakegen.base.geometry import Floats

SPACING = 0.01  # m


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve sampled by points (m, 3) [m]."""

    points: Floats

    @cached_property
    def arcs(self) -> Floats:
        """(m,) m, length along the curve at each point."""
        steps = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])

    @property
    def length(self) -> float:
        """m."""
        return float(self.arcs[-1])

    def at(self, arc: float) -> Floats:
        """Returns the point (3,) at `arc` [m]; before the beginning, straight on backward."""
        if arc < 0.0:
            ahead = self.points[1] - self.points[0]
            return np.asarray(self.points[0] + arc * ahead / np.linalg.norm(ahead))
        return np.array([np.interp(arc, self.arcs, self.points[:, k]) for k in range(3)])

    def behind(self, arc: float, chord: float) -> float:
        """Returns the nearest arc [m] behind `arc` whose point is `chord` [m] away.

        Before the curve's beginning it goes straight on (arcs below 0).
        """
        here = self.at(arc)
        last = int(np.searchsorted(self.arcs, arc, side="left")) - 1
        gaps = np.linalg.norm(self.points[: last + 1] - here, axis=1)
        beyond = np.flatnonzero(gaps >= chord)
        if not len(beyond):
            k, far = -1, 2.0 * chord
            a, b, begin, end = self.at(-far), self.points[0], -far, 0.0
        else:
            k = int(beyond[-1])
            a, begin = self.points[k], float(self.arcs[k])
            b, end = (self.points[k + 1], float(self.arcs[k + 1])) if k < last else (here, arc)
        # |a + s (b - a) - here| = chord, the root in 0 … 1 nearest to b
        d, e = b - a, a - here
        aa, bb, cc = float(d @ d), float(d @ e), float(e @ e) - chord**2
        root = (-bb - np.sqrt(max(bb * bb - aa * cc, 0.0))) / aa if aa > 0 else 0.0
        return begin + float(np.clip(root, 0.0, 1.0)) * (end - begin)

    def nodes(self, arc: float, chords: Floats) -> Floats:
        """Returns points (r + 1, 3): the leader at `arc`, then each `chord` behind the last."""
        out = [self.at(arc)]
        for chord in chords:
            arc = self.behind(arc, float(chord))
            out.append(self.at(arc))
        return np.array(out)


def dense(points: Floats) -> Floats:
    """Returns a line of points (m, 3) resampled about every `SPACING`, corners kept."""
    steps = np.diff(points, axis=0)
    counts = np.maximum(np.ceil(np.linalg.norm(steps, axis=1) / SPACING), 1).astype(int)
    at = np.repeat(np.arange(len(steps)), counts)
    share = (np.arange(len(at)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[at]
    return np.concatenate([points[at] + share[:, None] * steps[at], points[-1:]])


def arc_between(start: Floats, end: Floats, radius: float) -> Floats:
    """Returns points (m, 3), from the origin, of a circular arc between two unit directions."""
    angle = float(np.arccos(np.clip(start @ end, -1.0, 1.0)))
    across = end - start * (start @ end)
    size = float(np.linalg.norm(across))
    if size < 1e-9:
        return np.zeros((1, 3))
    turns = np.linspace(0.0, angle, max(int(np.ceil(radius * angle / SPACING)), 2))[:, None]
    return np.asarray(radius * (np.sin(turns) * start + (1.0 - np.cos(turns)) * across / size))


def bridge(start: Floats, out: Floats, end: Floats, into: Floats) -> Floats:
    """Returns points (m, 3) of the cubic from `start`, leaving along `out`, to `end` along `into`.

    The handles are 0.39 of the distance, which makes a quarter of a circle round.
    """
    span = float(np.linalg.norm(end - start))
    t = np.linspace(0.0, 1.0, max(int(np.ceil(1.5 * span / SPACING)), 4))[:, None]
    p1, p2 = start + 0.39 * span * out, end - 0.39 * span * into
    return np.asarray(
        (1 - t) ** 3 * start + 3 * (1 - t) ** 2 * t * p1 + 3 * (1 - t) * t**2 * p2 + t**3 * end
    )


def rounded(line: Floats, radius: float) -> Floats:
    """Returns points (m, 3) of a line of points with its corners rounded.

    Corners get arcs of `radius` [m], or the largest that leaves half of either side.
    """
    if len(line) < 3:
        return dense(line)
    out = [line[:1]]
    for a, b, c in zip(line[:-2], line[1:-1], line[2:], strict=True):
        before, after = b - a, c - b
        lengths = np.linalg.norm(before), np.linalg.norm(after)
        u, v = before / lengths[0], after / lengths[1]
        half = 0.5 * np.arccos(np.clip(u @ v, -1.0, 1.0))
        if half < 1e-6:
            continue
        cut = min(radius * np.tan(half), 0.5 * float(min(lengths)))
        out.append(b - cut * u + arc_between(u, v, cut / float(np.tan(half))))
    out.append(line[-1:])
    return dense(np.concatenate(out))


def waved(line: Floats, amplitude: float, length: float) -> Floats:
    """Returns a line that swings to both sides, ``a sin(2π s / length)`` about its middle.

    A straight body has next to no torque about itself; one in waves has the arms. Swings are level,
    so that links stay so, and fade out toward both ends, which are drawn out by half a wave.

    Args:
        line: (m, 3) m.
        amplitude: m, a.
        length: m, of a wave.
    """
    first, last = line[1] - line[0], line[-1] - line[-2]
    reach = 0.5 * length
    begin = line[0] - reach * first / np.linalg.norm(first)
    end = line[-1] + reach * last / np.linalg.norm(last)
    points = dense(np.vstack([begin, line, end]))
    tangent = np.gradient(points, axis=0)
    side = np.cross([0.0, 0.0, 1.0], tangent)
    level = np.linalg.norm(side, axis=1) / np.maximum(np.linalg.norm(tangent, axis=1), 1e-12)
    side /= np.maximum(np.linalg.norm(side, axis=1), 1e-12)[:, None]
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    arcs = np.concatenate([[0.0], np.cumsum(steps)])
    inward = np.clip(np.minimum(arcs, arcs[-1] - arcs) / reach, 0.0, 1.0)
    fade = inward**2 * (3.0 - 2.0 * inward) * np.clip(2.0 * level - 1.0, 0.0, 1.0)
    swing = amplitude * fade * np.sin(2.0 * np.pi * (arcs - 0.5 * arcs[-1]) / length)
    return np.asarray(points + swing[:, None] * side)
