"""Bounds between waypoints: clearance and margins of a trajectory at every instant.

An interval of time is judged by its middle. Every point of the body is displaced by at most
``δ = |Δcog| + |Δr| ρ + Σ κ_j |Δq_j|`` from there (`Reach`), and a distance changes by no more than
the displacement of the points between which it is measured, so

    clearance ≥ d(middle) - δ.

Margins depend on the thrust points p_j about the CoG, in world axes, alone. With forces within
L_j, torques change by at most ``ε = Σ L_j |Δp_j|``. The torque margin is
``min over ‖ω‖ = 1 and v of Σ L_j ‖v + ω × p_j‖ - v·w0``, so

    torque ≥ τ - ε,

and the force margin F follows by mixing the forces that reach F with those that undo the change of
torque, in shares of ``(1 - ε/τ)`` and ``ε/τ`` at most:

    force ≥ F (1 - ε/τ).

Intervals are halved, the worst first, until the bound is within `CLOSED` of the least value seen at
a middle, for each of the quantities. Every quantity is also looked at every `LOOK` seconds, so that
the least value seen means something where the search stopped early at a bound that is enough.
"""

import heapq
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.planning.body import PlannedBody
from snakegen.planning.mounts import STEEP
from snakegen.planning.trajectory import Trajectory

GJK = 1e-5  # m: coal's distances of curved shapes are iterated to 1e-6
CLOSED = {"clearance": 1e-3, "self_clearance": 1e-3, "force_margin": 0.02, "torque_margin": 0.02}
MOST = 60_000  # intervals
LOOK = 0.2  # s, between instants at which each quantity is looked at besides
SWUNG = 1.0 + 2.0 / STEEP  # m per m of offset and radian: itself, its direction, its uncertainty


@dataclass(frozen=True)
class Bound:
    """A proved least value along a trajectory.

    Attributes:
        lower: at every instant at least this.
        seen: the least found at any instant looked at.
        time: s, of that instant.
        between: the two bodies, of a distance.
        closed: whether `lower` is as near to `seen` as asked.
    """

    lower: float
    seen: float
    time: float
    between: tuple[str, str] = ("", "")
    closed: bool = True

    def to_json(self) -> dict[str, Any]:
        """Returns plain data."""
        out: dict[str, Any] = {
            "lower_bound": rounded_down(self.lower),
            "least_seen": float(f"{self.seen:.6g}"),
            "time_s": float(f"{self.time:.6g}"),
            "closed": self.closed,
        }
        return out | ({"between": list(self.between)} if self.between[0] else {})


def rounded_down(value: float) -> float:
    """Returns a bound in six digits, never above it."""
    shown = float(f"{value:.6g}")
    return shown if shown <= value else float(f"{value - 6e-6 * abs(value):.6g}")


@dataclass(frozen=True)
class Certificate:
    """What holds at every instant of a trajectory.

    Attributes:
        clearance, self_clearance: m, of the body with gimbals at any angle.
        force_margin, torque_margin: N, N·m, of hover.
        intervals: how many were looked at.
    """

    clearance: Bound
    self_clearance: Bound
    force_margin: Bound
    torque_margin: Bound
    intervals: int

    def bounds(self) -> dict[str, Bound]:
        """Returns the four by name."""
        return {k: getattr(self, k) for k in CLOSED}

    def to_json(self) -> dict[str, Any]:
        """Returns plain data."""
        units = {"clearance": "_m", "self_clearance": "_m"}
        units |= {"force_margin": "_N", "torque_margin": "_Nm"}
        return {k + units[k]: b.to_json() for k, b in self.bounds().items()} | {
            "intervals": self.intervals
        }


def certify(
    body: PlannedBody, path: Trajectory, *, most: int = MOST, enough: dict[str, float] | None = None
) -> Certificate:
    """Returns proved bounds of clearance and margins along `path`.

    Args:
        body: among its obstacles.
        path: its motion.
        most: intervals to look at for distances, and again for margins.
        enough: a bound by name that need not be bettered; the search for it stops there.
    """
    goals = dict.fromkeys(CLOSED, np.inf) | (enough or {})
    count = [0]

    def distances(start: float, end: float) -> dict[str, tuple[float, float, Any]]:
        middle, swing = path.swing(start, end)
        now = body.at_pose(middle)
        found = body.distances(now.q) - GJK
        reach, shapes = body.reach, body.shapes
        arms = np.array(
            [
                np.linalg.norm(body.data.oMi[j].act(c) - middle[:3]) + r
                for j, c, r in zip(shapes.joints, shapes.centres, shapes.radii, strict=True)
            ]
        )
        turned = arms + SWUNG * reach.shift
        moved = swing.shift + swing.turn * turned + reach.shapes @ swing.joints
        first = shapes.pairs[: shapes.outer, 0]
        own = found[shapes.outer :]
        return {
            "clearance": _least(found[: shapes.outer] - now.slack, moved[first], 0),
            "self_clearance": _least(own, reach.own @ swing.joints, shapes.outer),
        }

    def margins(intervals: list[tuple[float, float]]) -> list[dict[str, tuple[float, float, Any]]]:
        swings = [path.swing(*pair) for pair in intervals]
        nows = [body.at_pose(middle) for middle, _ in swings]
        force, torque = body.margins(np.array([now.points for now in nows]))
        limits, reach = np.asarray(body.sets.high), body.reach
        out = []
        for (_, swing), now, f, t in zip(swings, nows, force, torque, strict=True):
            arms = np.linalg.norm(now.points, axis=1) + SWUNG * (
                reach.shift + np.abs(body.mounts.lever)
            )
            rest = float(limits @ now.uncertainty)
            moved = limits @ (now.uncertainty + swing.turn * arms + reach.points @ swing.joints)
            out.append(
                {
                    "force_margin": (_scaled(f, t, rest), _scaled(f, t, float(moved)), None),
                    "torque_margin": (t - rest, t - float(moved), None),
                }
            )
        return out

    pieces = path.pieces()
    one = lambda pairs: [distances(*pair) for pair in pairs]  # noqa: E731
    found = _search(one, pieces, ("clearance", "self_clearance"), goals, most, count, 1)
    found |= _search(margins, pieces, ("force_margin", "torque_margin"), goals, most, count, 32)
    end = float(path.times[-1])
    looked = [(t, t) for t in np.linspace(0.0, end, max(int(end / LOOK), 1) + 1).tolist()]
    samples = [a | b for a, b in zip(one(looked), margins(looked), strict=True)]
    bounds = {}
    for name, (lower, seen, time, where, closed) in found.items():
        for (t, _), sample in zip(looked, samples, strict=True):
            if sample[name][0] < seen:  # where a bound is good enough, the search leaves it
                seen, time, where = sample[name][0], t, sample[name][2]
        names = ("", "")
        if where is not None:
            a, b = body.shapes.pairs[where]
            names = (body.shapes.labels[a], body.shapes.labels[b])
        bounds[name] = Bound(lower, seen, time, names, closed)
    return Certificate(**bounds, intervals=count[0])


def _scaled(force: float, torque: float, change: float) -> float:
    """Returns the force margin after a change of torque; see the module."""
    if torque <= 0.0:
        return min(force, torque - change)
    return force * (1.0 - change / torque) if change < torque else -1.0


def _least(found: Floats, moved: Floats, first: int) -> tuple[float, float, Any]:
    """Returns the least value, the least bound, and the pair of the least value."""
    if not len(found):
        return np.inf, np.inf, None
    k = int(np.argmin(found))
    return float(found[k]), float((found - moved).min()), first + k


def _search(
    judge: Callable[[list[tuple[float, float]]], list[dict[str, tuple[float, float, Any]]]],
    pieces: list[tuple[float, float]],
    names: tuple[str, ...],
    goals: dict[str, float],
    most: int,
    count: list[int],
    batch: int,
) -> dict[str, tuple[float, float, float, Any, bool]]:
    """Returns bound, least value, its time, its pair and whether closed, for each of `names`."""
    seen: dict[str, tuple[float, float, Any]] = dict.fromkeys(names, (np.inf, 0.0, None))
    heaps: dict[str, list[tuple[float, float, float]]] = {n: [] for n in names}
    cells: dict[tuple[float, float], dict[str, float]] = {}

    def look(pairs: list[tuple[float, float]]) -> None:
        count[0] += len(pairs)
        for pair, values in zip(pairs, judge(pairs), strict=True):
            cells[pair] = {n: values[n][1] for n in names}
            for n in names:
                value, low, where = values[n]
                if value < seen[n][0]:
                    seen[n] = (value, 0.5 * (pair[0] + pair[1]), where)
                heapq.heappush(heaps[n], (low, *pair))

    def lowest(n: str) -> tuple[float, float, float]:
        while heaps[n] and (heaps[n][0][1], heaps[n][0][2]) not in cells:
            heapq.heappop(heaps[n])
        return heaps[n][0]

    def open_(n: str) -> bool:
        low, value = lowest(n)[0], seen[n][0]
        if not np.isfinite(value):
            return False
        near = CLOSED[n] if n.endswith("clearance") else CLOSED[n] * max(value, 1e-3)
        return low < min(value - near, goals[n])

    look(pieces)
    begun = count[0]
    while count[0] - begun < most:
        worst = [n for n in names if open_(n)]
        if not worst:
            break
        chosen: list[tuple[float, float]] = []
        for n in worst:
            for low, a, b in heapq.nsmallest(batch, heaps[n]):
                if (a, b) in cells and low < min(seen[n][0], goals[n]) and (a, b) not in chosen:
                    chosen.append((a, b))
        halves = []
        for a, b in chosen:
            del cells[(a, b)]
            halves += [(a, 0.5 * (a + b)), (0.5 * (a + b), b)]
        if not halves:
            break
        look(halves)
    out = {}
    for n in names:
        value, time, where = seen[n]
        out[n] = (lowest(n)[0], value, time, where, not open_(n))
    return out
