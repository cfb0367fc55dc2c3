"""Closer bounds of one posture's force and torque margins, by branching (THEORY A4).

From below: the sphere of directions is split into triangles, each covered from hover outwards
by products of convex pieces: one that holds hover and the wrenches it reaches along three corners
holds the simplex between, one that begins within what is covered goes on from there. Where products
near those known do not reach, forces of the sets that give a wrench farther out are searched for
and the pieces about them are added. From above: see `excluded_wrenches`.
"""

import heapq
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.kernels.margins.force_sets import Sets
from snakegen.wrench_margins.branching.excluded_wrenches import ENOUGH, lower_upper
from snakegen.wrench_margins.branching.piece_pool import HELD, Pool, holding_anchors
from snakegen.wrench_margins.branching.triangle import triangle_distance

RAYS = (12_000, 60_000)  # of one slice from below: a second, and five where bounds stay apart
WIDE = 0.01  # relative gap that is worth five
# share of the way to the upper bound at which forces are looked for; random forces to begin with
SEARCHES = ((0.02, 0), (0.3, 0), (1.0, 0), (0.02, 6), (-0.1, 6), (0.3, 6), (1.0, 6))
PASSED_ON = 12  # products that reach far, which parts of a triangle begin with too


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
