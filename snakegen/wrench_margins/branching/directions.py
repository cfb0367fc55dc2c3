"""Closer bounds of one posture's force and torque margins, by branching (THEORY A4).

From below: the sphere of directions is split into triangles, each covered from hover outwards
by products of convex pieces: one that holds hover and the wrenches it reaches along three corners
holds the simplex between, one that begins within what is covered goes on from there. Where products
near those known do not reach, forces of the sets that give a wrench farther out are searched for
and the pieces about them are added. From above: see `excluded_wrenches`.
"""

import heapq
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from numpy.typing import NDArray

from snakegen.kernels.margins.convex_pieces import pieces_into
from snakegen.kernels.margins.force_sets import Sets
from snakegen.kernels.margins.limited_margins import empty_pieces, ray
from snakegen.kernels.margins.settle_forces import settle, wrench_inverse
from snakegen.kernels.margins.slice_program import maximise, new_basis, start
from snakegen.wrench_margins.branching.excluded_wrenches import ENOUGH, GAP, lower_upper
from snakegen.wrench_margins.branching.triangle import triangle_distance
from snakegen.wrench_margins.force_sets import patch_row

Floats = NDArray[np.float64]
RAYS = (12_000, 60_000)  # of one slice from below: a second, and five where bounds stay apart
WIDE = 0.01  # relative gap that is worth five
HELD = 1e-9  # scaled, by which hover may be missed
SETTLE = 200  # projections on the way to forces that give a wrench
BACK = 1e-7  # share of a reach that is left out where the beginning is shot from there
HELD_FORCES = 1e-7  # scaled, by which those may miss it
SHRUNK = (0.1, 0.02, 0.0)  # of the sets' ranges, within which those are looked for first
# share of the way to the upper bound at which forces are looked for; random forces to begin with
SEARCHES = ((0.02, 0), (0.3, 0), (1.0, 0), (0.02, 6), (-0.1, 6), (0.3, 6), (1.0, 6))
PASSED_ON = 12  # products that reach far, which parts of a triangle begin with too


@dataclass(eq=False)
class Pool:
    """Products of convex pieces, and how far each reaches along directions."""

    hull: Sets
    hover: Floats
    part: slice
    products: list[Sets] = field(default_factory=list)
    known: dict[tuple[int, bytes], tuple[float, Floats]] = field(default_factory=dict)
    beside: dict[bytes, set[int]] = field(default_factory=dict)
    rays: int = 0

    def __post_init__(self) -> None:
        self.inverse = wrench_inverse(self.hull)
        self.rng = np.random.default_rng(0)
        self.inner = [_shrunk(self.hull, share) for share in SHRUNK]

    def reach(self, index: int, e: Floats) -> tuple[float, Floats]:
        """Returns (t, forces): how far product `index` reaches along e (3,), -inf where not.

        Product -1 is the hull.
        """
        key = (index, e.tobytes())
        if key not in self.known:
            sets = self.products[index] if index >= 0 else self.hull
            self.known[key] = self._shoot(sets, e)
        return self.known[key]

    def begin(self, index: int, e: Floats) -> tuple[float, Floats]:
        """Returns (t, forces): where product `index` begins along e, inf where it holds nothing.

        Shot back from the end: seen from there the answer is not negative, as rays want it.
        """
        key = (index, b"back" + e.tobytes())
        if key not in self.known:
            end, forces = self.reach(index, e)
            if end > -np.inf:
                end -= BACK * abs(end)
                back, forces = self._shoot(self.products[index], -e, end * e)
                begun = end - max(back, 0.0)
                if 0.0 < begun < 2.0 * GAP * end:  # at hover, but for the ray's own gap
                    begun = min(begun, -self.reach(index, -e)[0])
                self.known[key] = begun, forces
            else:
                self.known[key] = np.inf, forces
        return self.known[key]

    def span(self, index: int, e: Floats) -> tuple[float, float]:
        """Returns the least and the largest t with ``hover + t e`` in product `index`."""
        return self.begin(index, e)[0], self.reach(index, e)[0]

    def _shoot(self, sets: Sets, e: Floats, moved: Floats | float = 0.0) -> tuple[float, Floats]:
        u, twist, forces = np.zeros(6), np.empty(6), np.empty((sets.faces.size, 3))
        u[self.part] = e
        origin = self.hover.copy()
        origin[self.part] += moved
        self.rays += 1
        low, _ = ray(u, sets, origin, GAP, forces, twist)
        return low, forces

    def add(self, anchors: Floats, e: Floats) -> int:
        """Adds the product near forces (n, 3) if it holds a wrench along e; its index, or -1."""
        sets = empty_pieces(self.hull)
        pieces_into(np.ascontiguousarray(anchors), self.hull, sets)
        ahead = self._shoot(sets, e)
        if not ahead[0] > 0.0:
            return -1
        self.products.append(sets)
        self.known[(len(self.products) - 1, e.tobytes())] = ahead
        return len(self.products) - 1

    def climb(self, index: int, e: Floats) -> set[int]:
        """Moves the pieces of a product to the forces that they gave along e; all indices met."""
        met = {index}
        for _ in range(3):
            t, forces = self.reach(index, e)
            held = self.begin(index, e)[1]
            found = {self.add(forces, e), self.add(forces + held, e)} - {-1}
            met |= found
            index = max(met, key=lambda i: self.reach(i, e)[0])
            if self.reach(index, e)[0] <= t * (1.0 + 1e-3) + 1e-9:
                break
        return met

    def settled(self, index: int, e: Floats, t: float, starts: int) -> set[int]:
        """Adds products near forces of the sets that give ``hover + t e``, if some are met.

        Begins with those of product `index` and the hull, or with `starts` random ones.
        """
        target = self.hover.copy()
        target[self.part] += t * e
        first = [self.reach(index, e)[1], self.reach(-1, e)[1]]
        if starts:
            shape = (starts, self.hull.faces.size, 3)
            first = [*(self.hull.high[:, None] * self.rng.normal(size=shape))]
        out = set[int]()
        for sets in self.inner:
            for forces in first:
                near = forces.copy()
                if settle(target, sets, self.inverse, SETTLE, near) < HELD_FORCES:
                    out.add(self.add(near, e))
            if out:
                break
        return out - {-1}

    def jump(self, e: Floats) -> set[int]:
        """Adds the product near the forces whose mixture reaches farthest along e."""
        return {self.add(self.reach(-1, e)[1], e)} - {-1}


def holding_anchors(
    hull: Sets, hover: Floats, first: list[Floats], tries: int = 12
) -> list[Floats]:
    """Returns forces (n, 3) whose convex pieces hold hover: near ones that give it, if found.

    Args:
        hull: the sets.
        hover: (6,) scaled.
        first: forces to begin with; random ones follow.
        tries: starts.
    """
    rng, out, inverse = np.random.default_rng(0), [], wrench_inverse(hull)
    inner = [_shrunk(hull, share) for share in SHRUNK]
    n = hull.faces.size
    sets, twist, free = empty_pieces(hull), np.empty(6), np.zeros(6)
    for k in range(tries):
        near = first[k].copy() if k < len(first) else rng.normal(size=(n, 3)) + 2.0 * hover[:3]
        for inside in inner:
            trial = near.copy()
            if settle(hover, inside, inverse, SETTLE, trial) < HELD_FORCES:
                near = trial
                break
        for _ in range(8):
            pieces_into(near, hull, sets)
            basis, forces = new_basis(6, n), np.empty((n, 3))
            start(np.eye(6), sets, hover, basis)
            held = maximise(free, np.eye(6), hover, sets, GAP, basis, forces, twist)[0] > -np.inf
            if held or np.abs(forces - near).max() < 1e-9:
                break
            near = forces
        if held:
            out.append(near)
        if len(out) == 4:
            break
    return out


@dataclass(eq=False)
class Cover:
    """Triangles of directions, the one covered least first, and the products that cover them."""

    pool: Pool
    heap: list[tuple[float, int, Floats, tuple[int, ...]]]
    count: int


def begin_cover(hull: Sets, hover: Floats, part: slice, anchors: list[Floats]) -> Cover | None:
    """Returns the octants of a slice, covered by products about `anchors`; None if none holds."""
    pool = Pool(hull, hover, part)
    axes = np.vstack([np.eye(3), -np.eye(3)])
    for anchor in anchors:
        for e in axes:
            pool.add(anchor, e)
    if not pool.products:
        return None
    heap: list[tuple[float, int, Floats, tuple[int, ...]]] = []
    for x, y, z in product((0, 3), (1, 4), (2, 5)):
        corners = axes[[x, y, z]]
        t, best = _best(pool, corners, range(len(pool.products)))
        heap.append((t, len(heap), corners, best))
    heapq.heapify(heap)
    return Cover(pool, heap, len(heap))


def raise_lower(cover: Cover, bounds: Floats, rays: int) -> Floats:
    """Raises the lower one of a slice's `bounds` (2,); returns directions (k, 3) of its limit.

    Args:
        cover: from `begin_cover` or the call before, refined.
        bounds: scaled, updated.
        rays: most that the cover's pool may have shot then.
    """
    pool, heap = cover.pool, cover.heap
    goal = bounds[1] * (1.0 - ENOUGH)
    while pool.rays < rays and heap[0][0] < goal:
        before, _, corners, near = heapq.heappop(heap)
        i, k = max(((0, 1), (1, 2), (2, 0)), key=lambda p: -corners[p[0]] @ corners[p[1]])
        middle = corners[i] + corners[k]
        middle /= np.linalg.norm(middle)
        for at in (i, k):
            half = corners.copy()
            half[at] = middle
            t, best = _cover(pool, half, near, goal, bounds[1])
            cover.count += 1
            heapq.heappush(heap, (max(t, before), cover.count, half, best))
    bounds[0] = max(bounds[0], min(heap[0][0], bounds[1]))
    return _looked_at(heap[0][2])


def _looked_at(corners: Floats) -> Floats:
    """Returns the centre and the corners of a triangle of directions, (4, 3)."""
    centre = corners.sum(axis=0)
    return np.vstack([centre / np.linalg.norm(centre), corners])


def _cover(
    pool: Pool, corners: Floats, near: tuple[int, ...], goal: float, bound: float
) -> tuple[float, tuple[int, ...]]:
    """Covers a triangle of directions by products near `near`, to `goal` if it can.

    Returns how far it does, and the indices of products to begin with in parts of it.
    """
    centre = corners.sum(axis=0) / np.linalg.norm(corners.sum(axis=0))
    tried = set(near)
    t, best = _best(pool, corners, tried)
    for step in range(len(SEARCHES) + 2):
        if t >= goal:
            break
        found = set[int]()
        if step == 0:
            found.update(*(pool.beside.get(e.tobytes(), ()) for e in corners))
        elif step == 1:
            found = pool.climb(best[-1], centre) | pool.jump(centre)
        else:
            share, starts = SEARCHES[step - 2]
            for e in (centre,) if starts else (centre, *corners):
                found |= pool.settled(best[-1], e, t + share * (bound - t), starts)
        if found - tried:
            tried |= found
            t, best = _best(pool, corners, tried)
    for e in corners:
        pool.beside.setdefault(e.tobytes(), set()).update(best)
    far = sorted(tried - set(best), key=lambda i: -pool.reach(i, centre)[0])
    return t, (*best, *far[:PASSED_ON])


def _shrunk(hull: Sets, share: float) -> Sets:
    """Returns sets whose ranges of thrust and angles are less by `share` of each at both ends."""
    rows = hull.rows.copy()
    for at, row in enumerate(hull.rows):
        p0, p1, t0, t1, side = row[13:18]
        ends = [p0, p1, t0, t1, row[11], row[12]]
        for k in (0, 2, 4):
            whole = k == 0 and row[2] <= -1.0
            step = 0.0 if whole else share * (ends[k + 1] - ends[k])
            ends[k], ends[k + 1] = ends[k] + step, ends[k + 1] - step
        rows[at] = patch_row(np.array([*ends, side]), 1.0)
    return hull._replace(rows=rows)


def branch(hull: Sets, hover: Floats, bounds: Floats, twists: Floats) -> None:
    """Brings the bounds (3, 2) of force and torque of one posture nearer to each other, scaled.

    Args:
        hull: the sets' hulls.
        hover: (6,) scaled.
        bounds: of `kernels.limited_margins`, updated.
        twists: (3, 6), updated where a ray lowers an upper bound.
    """
    up = np.tile(hover[:3], (hull.faces.size, 1))
    anchors = holding_anchors(hull, hover, [up])
    if not anchors:
        return
    if np.isnan(bounds[1, 0]):  # pieces that hold hover were not known yet
        bounds[:, 0] = 0.0
    for k, part in ((1, slice(0, 3)), (2, slice(3, 6))):
        if bounds[k, 1] - bounds[k, 0] <= ENOUGH * bounds[k, 1]:
            continue
        cover = begin_cover(hull, hover, part, anchors)
        if cover is None:
            continue
        worst = twists[k, part] / max(float(np.linalg.norm(twists[k, part])), 1e-300)
        for rays in RAYS:
            weakest = raise_lower(cover, bounds[k], rays)
            for e in (*weakest, worst):
                lower_upper(hull, hover, part, e, bounds[k], twists[k])
            if bounds[k, 1] - bounds[k, 0] <= WIDE * bounds[k, 1]:
                break


def _best(pool: Pool, corners: Floats, indices: Iterable[int]) -> tuple[float, tuple[int, ...]]:
    """Returns how far products reach in all of a triangle of directions, and their indices.

    The first one holds hover; another goes on from it where it begins, along all three corners,
    no farther out than the ones before it reach.
    """
    spans = {i: np.array([pool.span(i, e) for e in corners]) for i in indices}
    spans = {i: s for i, s in spans.items() if np.isfinite(s).all()}
    chain: tuple[int, ...] = ()
    covered, reached = np.full(3, HELD), 0.0
    reach = {
        i: triangle_distance(s[:, 1:] * corners) for i, s in spans.items() if s[:, 1].min() > 0.0
    }
    while True:
        able = [i for i in reach if (spans[i][:, 0] <= covered).all()]
        best = max(able, key=lambda i: reach[i], default=-1)
        if best < 0 or reach[best] <= reached * (1.0 + 1e-9):
            return reached, chain or (min(spans, default=0),)
        covered, reached, chain = spans[best][:, 1], reach[best], (*chain, best)
