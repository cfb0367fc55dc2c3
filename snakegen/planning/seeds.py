"""Seeds: curves from a start through the openings to a goal, which the body follows."""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.errors import PlanError
from snakegen.planning.body import PlannedBody
from snakegen.planning.curves import Curve, arc_between, bridge, dense, rounded, waved
from snakegen.planning.ends import End, ends_of, line_of, moved
from snakegen.planning.follow import Chain
from snakegen.scene.schema import Scene

RADII = (0.4, 0.5, 0.32, 0.65)  # m, of the turns into and out of an opening
LEANS = (0.6, 0.4, 0.0)  # rad, of the way through an opening overhead from the vertical
WAVES = (0.12, 0.2, 0.3)  # m, by which a level way swings to both sides
WAVELENGTH = 5.0  # links


@dataclass(frozen=True)
class Family:
    """What seeds have in common that fare alike.

    Attributes:
        tip: whether the chain's tip leads.
        radius: m, of the turns into and out of openings.
        lean: rad, of the way through an opening overhead.
        wave: m, of a level way.
        turn: 45°, from the way in to the way out.
    """

    tip: bool
    radius: float
    lean: float
    wave: float
    turn: int = 0


@dataclass(frozen=True, eq=False)
class Seed:
    """A curve, and the body at its beginning and end.

    Attributes:
        chain: the body and who leads.
        points: (m, 3) m, of the curve that it follows.
        first: m, arc of the leader at the start.
        start, goal: the ends.
        cost: rank among seeds before any is looked at: sharp turns and long ways count.
        family: seeds of one fare alike.
    """

    chain: Chain
    points: Floats
    first: float
    start: End
    goal: End
    cost: float
    family: Family

    @cached_property
    def curve(self) -> Curve:
        """The curve, densely sampled."""
        return Curve(dense(self.points))


def seeds(body: PlannedBody, scene: Scene, way: Floats, lines: list[Floats]) -> list[list[Seed]]:
    """Returns families of seeds along a way, the most promising first, in each too.

    Args:
        body: that follows.
        scene: with a start and a goal.
        way: (m, 3) m, of a point from start to goal.
        lines: through the openings on the way, in order.
    """
    if scene.start is None or scene.goal is None:
        raise PlanError(f"{scene.name}: a scene to plan through needs 'start' and 'goal'.")
    found: dict[Family, list[Seed]] = {}
    starts, goals = list(ends_of(body, scene.start)), list(ends_of(body, scene.goal))
    overhead = any(_overhead(line) for line in lines)
    for tip, start, (lean, wave) in product(
        (True, False), starts, [(x, 0.0) for x in LEANS] + [(0.0, x) for x in WAVES]
    ):
        if (lean > 0.0 and not overhead) or (wave > 0.0 and overhead):
            continue
        chain = Chain(body.turned(heading_of(start)), tip)
        _, _, head = line_of(chain, start)
        through = _through(way, [_leaning(line, head, lean) for line in lines])
        if wave > 0.0:
            through = waved(through, wave, WAVELENGTH * float(chain.chords.mean()))
        along = _directions(through)
        for radius in RADII:
            begin = _begin(chain, start, through[0], along[0], radius)
            if begin is None:
                continue
            for goal in goals:
                finish = _finish(chain, goal, through[-1], along[1], radius)
                if finish is not None:
                    family = Family(tip, radius, lean, wave)
                    one = _joined(chain, begin, finish, through, along, family)
                    found.setdefault(one.family, []).append(one)
    families = [sorted(each, key=lambda s: s.cost) for each in found.values()]
    return sorted(families, key=lambda each: each[0].cost)


def heading_of(end: End) -> float:
    """Returns the heading [rad] of the root link at an end."""
    x, y, z, w = end.q[3:7]
    return float(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


def _overhead(line: Floats) -> bool:
    """Tells whether a way through an opening is straight and nearly vertical."""
    step = line[-1] - line[0]
    return len(line) == 2 and abs(step[2]) > 0.9 * float(np.linalg.norm(step))


def _leaning(line: Floats, head: Floats, lean: float) -> Floats:
    """Returns a vertical way through an opening, leaning toward the body's heading.

    A link across the vertical keeps the roll of its gimbal: beside it, the slightest change of
    thrust turns it all the way round.
    """
    if lean == 0.0 or not _overhead(line):
        return line
    middle, half = line.mean(axis=0), 0.5 * (line[1] - line[0])
    flat = head * [1.0, 1.0, 0.0]
    size = float(np.linalg.norm(flat))
    if size < 1e-6:
        return line
    half = (1.0 + 1.2 * lean) * half  # links beside the opening lie lower, and need the room
    long = float(np.linalg.norm(half))
    step = np.cos(lean) * half + np.sin(lean) * long * flat / size
    return np.array([middle - step, middle + step])


def _through(way: Floats, lines: list[Floats]) -> Floats:
    """Returns the middle of the curve (m, 3): the openings' lines joined, or the way itself."""
    if not lines:
        middle = rounded(_thinned(way), 0.5)
        third = len(middle) // 3
        return middle[third : max(len(middle) - third, third + 2)]
    out = [lines[0]]
    for line in lines[1:]:
        last = out[-1]
        u, v = last[-1] - last[-2], line[1] - line[0]
        join = bridge(last[-1], u / np.linalg.norm(u), line[0], v / np.linalg.norm(v))
        out += [join[1:-1], line]
    return rounded(np.concatenate(out), 0.4)


def _thinned(way: Floats) -> Floats:
    """Returns a way on a grid as few points, smoothed."""
    out = way.copy()
    for _ in range(20):
        out[1:-1] = 0.25 * out[:-2] + 0.5 * out[1:-1] + 0.25 * out[2:]
    keep = np.unique(np.concatenate([np.arange(0, len(out), 4), [len(out) - 1]]))
    return np.asarray(out[keep])


def _directions(line: Floats) -> tuple[Floats, Floats]:
    first, last = line[1] - line[0], line[-1] - line[-2]
    return first / np.linalg.norm(first), last / np.linalg.norm(last)


def _begin(
    chain: Chain, end: End, entry: Floats, along: Floats, radius: float
) -> tuple[End, Floats, Floats] | None:
    """Returns the start, its line, and the curve from its head to the entry."""
    line, _, head = line_of(chain, end)
    if not end.free:
        return end, line, bridge(line[-1], head, entry, along)
    arc = arc_between(head, along, radius)
    placed = moved(end, chain.body, entry - arc[-1] - line[-1])
    if placed is None:
        return None
    shift = placed.q[:3] - end.q[:3]
    return placed, line + shift, line[-1] + shift + arc


def _finish(
    chain: Chain, end: End, exit_: Floats, along: Floats, radius: float
) -> tuple[End, Floats, Floats] | None:
    """Returns the goal, its line, and the curve from the exit to its tail."""
    line, tail, _ = line_of(chain, end)
    if not end.free:
        return end, line, bridge(exit_, along, line[0], tail)
    arc = exit_ + arc_between(along, tail, radius)
    placed = moved(end, chain.body, arc[-1] - line[0])
    if placed is None:
        return None
    return placed, line + placed.q[:3] - end.q[:3], arc


def _joined(
    chain: Chain,
    begin: tuple[End, Floats, Floats],
    finish: tuple[End, Floats, Floats],
    through: Floats,
    along: tuple[Floats, Floats],
    family: Family,
) -> Seed:
    start, first, into = begin
    goal, last, out = finish
    points = np.concatenate([first, into[1:], through[1:-1], out, last[1:]])
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    points = points[np.concatenate([[True], steps > 1e-9])]
    begun = float(np.linalg.norm(np.diff(first, axis=0), axis=1).sum())
    head = first[-1] - first[-2]
    tail = last[1] - last[0]
    head, tail = head / np.linalg.norm(head), tail / np.linalg.norm(tail)
    # turns into the openings, out of them, and from the way in to the way out: a right angle
    # keeps the body far from a straight line
    turns = [float(np.arccos(np.clip(a @ b, -1.0, 1.0)))
             for a, b in ((head, along[0]), (along[1], tail), (head, tail))]  # fmt: skip
    cost = turns[0] + turns[1] + 0.4 * abs(turns[2] - 0.5 * np.pi) + 0.2 * float(steps.sum())
    cost += (
        0.15 * RADII.index(family.radius) + 2.0 * family.wave + (0.0 if chain.tip_leads else 0.05)
    )
    # where the body ends as it was trimmed, unequal thrusts leave no error
    at = chain.body.at
    cost += 0.0 if np.allclose(start.q[at], goal.q[at]) else 0.6
    cost += 0.1 * abs(np.angle(np.exp(1j * (heading_of(goal) - heading_of(start)))))
    return Seed(
        chain, points, begun, start, goal, cost, replace(family, turn=round(4.0 * turns[2] / np.pi))
    )
