"""Paths on the ground and how they are travelled: pieces, named shapes, time laws, references.

A path is a list of ``("line", length)`` and ``("arc", angle, radius)`` from the origin along +x,
left turns positive, continued straight at both ends. HA section IV drives such paths by
follow-the-leader; its square (section V) is translated along with the body's shape held fixed.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.errors import AnalysisError
from snakegen.kernels.screw.constraints import follow, path_point

Floats = NDArray[np.float64]
Piece = tuple[str, float] | tuple[str, float, float]
Path = Sequence[Piece]


def _measure(piece: Piece, index: int) -> tuple[float, float]:
    """Returns (length, curvature) of one piece; says which piece is wrong, and why."""
    what = f"path piece {index} is {piece!r}"
    try:
        kind, values = piece[0], [float(value) for value in piece[1:]]
    except (TypeError, ValueError, IndexError):
        raise AnalysisError(f'{what}: need ("line", length) or ("arc", angle, radius).') from None
    if not all(math.isfinite(value) for value in values):
        raise AnalysisError(f"{what}: its numbers must be finite.")
    if kind == "line" and len(values) == 1:
        if values[0] < 0:
            raise AnalysisError(f"{what}: a line's length must not be negative.")
        return values[0], 0.0
    if kind == "arc" and len(values) == 2:
        angle, radius = values
        if radius <= 0:
            raise AnalysisError(
                f"{what}: the radius must be positive; a negative angle turns right."
            )
        return abs(angle) * radius, math.copysign(1.0 / radius, angle)
    raise AnalysisError(f'{what}: need ("line", length) or ("arc", angle, radius).')


def path_pieces(path: Path) -> Floats:
    """Returns the kernels' array (m + 2, 6): ``[s0, x, y, heading, curvature, length]``.

    The first and last rows are the straight continuations. Raises AnalysisError on a bad piece.
    """
    measured = [_measure(piece, index) for index, piece in enumerate(path)]
    rows = [[0.0] * 6]
    s = x = y = heading = 0.0
    for length, curvature in [*(m for m in measured if m[0] > 0.0), (0.0, 0.0)]:
        rows.append([s, x, y, heading, curvature, length])
        half = 0.5 * curvature * length
        chord = length if curvature == 0.0 else 2.0 * math.sin(half) / curvature
        x, y = x + chord * math.cos(heading + half), y + chord * math.sin(heading + half)
        s, heading = s + length, heading + curvature * length
    return np.array(rows)


def path_length(path: Path) -> float:
    """Returns the length of the path [m], without its continuations."""
    return sum(_measure(piece, index)[0] for index, piece in enumerate(path))


def l_crank(lead: float = 1.0, radius: float = 0.6, tail: float = 1.2) -> list[Piece]:
    """Returns HA Fig 9's corner: a line, a quarter turn to the left, a line [m]."""
    return [("line", lead), ("arc", math.pi / 2, radius), ("line", tail)]


def s_curve(
    radius: float = 0.6, angle: float = math.pi / 3, lead: float = 0.5, tail: float = 0.5
) -> list[Piece]:
    """Returns a left arc and an equal right arc between two lines [m, rad]."""
    return [("line", lead), ("arc", angle, radius), ("arc", -angle, radius), ("line", tail)]


NAMED: dict[str, Callable[[], list[Piece]]] = {
    "line": lambda: [("line", 2.0)],
    "arc": lambda: [("arc", math.pi, 0.6)],
    "lcrank": l_crank,
    "scurve": s_curve,
}


def waypoints(points: ArrayLike, radius: float) -> tuple[list[Piece], tuple[float, float, float]]:
    """Returns the path through waypoints (m, 2) with corners rounded to `radius`, and its start.

    The path itself begins at the origin along +x; the start ``(x, y, heading)`` says where that
    lies. A corner of turn β uses up ``radius · tan(β/2)`` of both its legs; raises AnalysisError
    with the largest radius that would fit when a leg is too short.
    """
    try:
        p = np.asarray(points, float)
    except (TypeError, ValueError):
        raise AnalysisError("waypoints must be x, y pairs, as in [[0, 0], [2, 1]].") from None
    if p.ndim != 2 or p.shape[1] != 2 or len(p) < 2:
        raise AnalysisError(f"waypoints must be at least two x, y pairs; got {p.shape}.")
    if not np.isfinite(p).all():
        bad = int(np.argmin(np.isfinite(p).all(axis=1)))
        raise AnalysisError(f"waypoint {bad} is {p[bad].tolist()}: finite numbers are needed.")
    legs = np.diff(p, axis=0)
    lengths = np.hypot(legs[:, 0], legs[:, 1])
    if (lengths == 0).any():
        raise AnalysisError(f"waypoints {lengths.argmin()} and {lengths.argmin() + 1} coincide.")
    headings = np.arctan2(legs[:, 1], legs[:, 0])
    turns = (np.diff(headings) + np.pi) % (2 * np.pi) - np.pi
    cut = np.concatenate([[0.0], np.tan(np.abs(turns) / 2), [0.0]])
    worst = float(((cut[:-1] + cut[1:]) / lengths).max())
    if radius <= 0 or radius * worst > 1 + 1e-12:
        fits = f"at most {1 / worst:.4g} m fits" if worst > 0 else "it must be positive"
        raise AnalysisError(f"a corner radius of {radius:g} m does not fit the waypoints: {fits}.")
    path: list[Piece] = []
    for k, length in enumerate(lengths):
        path.append(("line", float(max(length - radius * (cut[k] + cut[k + 1]), 0.0))))
        if k < len(turns) and turns[k] != 0.0:
            path.append(("arc", float(turns[k]), radius))
    return path, (float(p[0, 0]), float(p[0, 1]), float(headings[0]))


@dataclass(frozen=True)
class TimeLaw:
    """Trapezoidal travel: each stretch starts and ends at rest; infinite acceleration: steps."""

    stretches: tuple[float, ...]
    speed: float
    acceleration: float = math.inf

    def __post_init__(self) -> None:
        """Raises AnalysisError unless speed and acceleration are positive, stretches finite."""
        if not self.speed > 0 or not self.acceleration > 0:
            raise AnalysisError(
                f"speed and acceleration must be positive; got {self.speed}, {self.acceleration}."
            )
        if not all(0 <= length < math.inf for length in self.stretches):
            worst = min(self.stretches)
            raise AnalysisError(f"a way of {worst:g} m cannot be travelled; 0 m or more can.")

    @cached_property
    def _phases(self) -> list[tuple[float, float, float, float]]:
        """Each stretch as (start time, length, peak speed, ramp time)."""
        phases, t = [], 0.0
        for length in self.stretches:
            peak = min(self.speed, math.sqrt(self.acceleration * length))
            ramp = peak / self.acceleration
            phases.append((t, length, peak, ramp))
            t += (length / peak if peak > 0 else 0.0) + ramp
        phases.append((t, 0.0, 0.0, 0.0))
        return phases

    @property
    def duration(self) -> float:
        """Time from start to rest at the end [s]."""
        return self._phases[-1][0]

    def at(self, t: float) -> tuple[float, float]:
        """Returns the arc length [m] and speed [m/s] at time t [s]; at rest outside the travel."""
        done = 0.0
        for (start, length, peak, ramp), (end, *_) in zip(
            self._phases, self._phases[1:], strict=False
        ):
            if t >= end:
                done += length
                continue
            u = t - start
            if u < 0:
                break
            if u < ramp:
                return done + 0.5 * self.acceleration * u * u, self.acceleration * u
            left = end - t
            if left < ramp:
                return (
                    done + length - 0.5 * self.acceleration * left * left,
                    self.acceleration * left,
                )
            return done + peak * (u - 0.5 * ramp), peak
        return done, 0.0


class Reference(Protocol):
    """What a drive follows: w_d and ẇ_d at any time, at rest after `duration`."""

    @property
    def duration(self) -> float:
        """Time from start to rest [s]."""

    def at(self, t: float) -> tuple[Floats, Floats]:
        """Returns w_d and ẇ_d, each (n + 2,), at time t [s]."""


@dataclass(frozen=True)
class FollowReference:
    """Follow-the-leader along a path: every joint passes where the head passed."""

    path: Path
    links: tuple[float, ...]
    law: TimeLaw
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @cached_property
    def pieces(self) -> Floats:
        """The path as the kernels' array."""
        return path_pieces(self.path)

    @property
    def duration(self) -> float:
        """Time from start to rest [s]."""
        return self.law.duration

    def at(self, t: float) -> tuple[Floats, Floats]:
        """Returns w_d and ẇ_d = (dw_d/ds) ṡ at time t [s]."""
        s, speed = self.law.at(t)
        w, slope = follow(self.pieces, s, np.array(self.links))
        x, y, heading = self.start
        c, sn = math.cos(heading), math.sin(heading)
        turn = np.array([[c, -sn], [sn, c]])
        w[:2] = turn @ w[:2] + (x, y)
        slope[:2] = turn @ slope[:2]
        w[2] += heading
        return w, slope * speed


@dataclass(frozen=True)
class CrabReference:
    """A polyline travelled with heading and shape held: HA's square (section V, i)."""

    points: tuple[tuple[float, float], ...]
    shape: tuple[float, ...]
    law: TimeLaw
    heading: float = 0.0

    @property
    def duration(self) -> float:
        """Time from start to rest [s]."""
        return self.law.duration

    def at(self, t: float) -> tuple[Floats, Floats]:
        """Returns w_d and ẇ_d at time t [s]."""
        s, speed = self.law.at(t)
        p = np.array(self.points)
        legs = np.diff(p, axis=0)
        lengths = np.hypot(legs[:, 0], legs[:, 1])
        ends = np.cumsum(lengths)
        k = min(int(np.searchsorted(ends, s, side="right")), len(legs) - 1)
        direction = legs[k] / lengths[k]
        w, rate = np.zeros(3 + len(self.shape)), np.zeros(3 + len(self.shape))
        w[:2] = p[k] + direction * (s - (ends[k] - lengths[k]))
        w[2], w[3:] = self.heading, self.shape
        rate[:2] = direction * speed
        return w, rate


def square(
    side: float, speed: float, acceleration: float, joints: int, heading: float = 0.0
) -> CrabReference:
    """Returns HA's square (there 1.2 m, 0.2 m/s), at rest in each corner, joints straight."""
    corners = ((0.0, 0.0), (side, 0.0), (side, side), (0.0, side), (0.0, 0.0))
    law = TimeLaw((side,) * 4, speed, acceleration)
    return CrabReference(corners, (0.0,) * joints, law, heading)


def path_points(path: Path, s: ArrayLike) -> Floats:
    """Returns x, y and heading, (m, 3), at the arc lengths s (m,)."""
    pieces = path_pieces(path)
    return np.array([path_point(pieces, value) for value in np.atleast_1d(np.asarray(s, float))])
