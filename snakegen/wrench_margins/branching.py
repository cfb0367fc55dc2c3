"""Closer bounds of one posture's force and torque margins, by branching (THEORY A4).

From below: the sphere of directions is split into triangles, each covered from hover outwards
by products of convex pieces: one that holds hover and the wrenches it reaches along three corners
holds the simplex between, one that begins within what is covered goes on from there. From above: a
margin is no more than the reach along one ray, and that no more than the farthest of the hulls of
parts that the sets are split into.
"""

import heapq
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from numpy.typing import NDArray

from snakegen.kernels.margins.convex_pieces import pieces_into
from snakegen.kernels.margins.force_sets import PATCH, Sets
from snakegen.kernels.margins.limited_margins import empty_pieces, ray
from snakegen.kernels.margins.slice_program import maximise, new_basis, start
from snakegen.wrench_margins.force_sets import patch_row

Floats = NDArray[np.float64]
RAYS = 8000  # of one slice from below: up to half a second
PARTS = 40  # of the sets from above, along one ray
GAP = 1e-4  # relative, of one ray
ENOUGH = 3e-3  # relative gap at which branching stops
HELD = 1e-9  # scaled, by which hover may be missed


@dataclass(eq=False)
class Pool:
    """Products of convex pieces, and how far each reaches along directions."""

    hull: Sets
    hover: Floats
    part: slice
    products: list[Sets] = field(default_factory=list)
    known: dict[tuple[int, bytes], tuple[float, Floats]] = field(default_factory=dict)
    rays: int = 0

    def reach(self, index: int, e: Floats) -> tuple[float, Floats]:
        """Returns (t, forces): how far product `index` reaches along e (3,), -inf where not."""
        key = (index, e.tobytes())
        if key not in self.known:
            self.known[key] = self._shoot(self.products[index], e)
        return self.known[key]

    def span(self, index: int, e: Floats) -> tuple[float, float]:
        """Returns the least and the largest t with ``hover + t e`` in product `index`."""
        return -self.reach(index, -e)[0], self.reach(index, e)[0]

    def _shoot(self, sets: Sets, e: Floats) -> tuple[float, Floats]:
        u, twist, forces = np.zeros(6), np.empty(6), np.empty((sets.faces.size, 3))
        u[self.part] = e
        self.rays += 1
        low, _ = ray(u, sets, self.hover, GAP, forces, twist)
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
            held = self.reach(index, -e)[1]
            found = {self.add(forces, e), self.add(forces + held, e)} - {-1}
            met |= found
            index = max(met, key=lambda i: self.reach(i, e)[0])
            if self.reach(index, e)[0] <= t * (1.0 + 1e-3) + 1e-9:
                break
        return met

    def jump(self, e: Floats) -> set[int]:
        """Adds the product near the forces whose mixture reaches farthest along e."""
        return {self.add(self._shoot(self.hull, e)[1], e)} - {-1}


def holding_anchors(
    hull: Sets, hover: Floats, first: list[Floats], tries: int = 12
) -> list[Floats]:
    """Returns forces (n, 3) whose convex pieces hold hover: moved to the forces that pieces gave.

    Args:
        hull: the sets.
        hover: (6,) scaled.
        first: forces to begin with; random ones follow.
        tries: starts.
    """
    rng, out = np.random.default_rng(0), []
    n = hull.faces.size
    sets, twist, free = empty_pieces(hull), np.empty(6), np.zeros(6)
    for k in range(tries):
        near = first[k].copy() if k < len(first) else rng.normal(size=(n, 3)) + 2.0 * hover[:3]
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


def raise_lower(
    hull: Sets, hover: Floats, part: slice, anchors: list[Floats], bounds: Floats
) -> Floats:
    """Raises the lower one of a slice's `bounds` (2,); returns the direction (3,) of its limit."""
    pool = Pool(hull, hover, part)
    axes = np.vstack([np.eye(3), -np.eye(3)])
    for anchor in anchors:
        for e in axes:
            pool.add(anchor, e)
    if not pool.products:
        return axes[2]
    heap: list[tuple[float, int, Floats, tuple[int, ...]]] = []
    for x, y, z in product((0, 3), (1, 4), (2, 5)):
        corners = axes[[x, y, z]]
        t, best = _best(pool, corners, range(len(pool.products)))
        heap.append((t, len(heap), corners, best))
    heapq.heapify(heap)
    count = len(heap)
    while pool.rays < RAYS and heap[0][0] < bounds[1] * (1.0 - ENOUGH):
        _, _, corners, chain = heapq.heappop(heap)
        i, k = max(((0, 1), (1, 2), (2, 0)), key=lambda p: -corners[p[0]] @ corners[p[1]])
        middle = corners[i] + corners[k]
        middle /= np.linalg.norm(middle)
        for at in (i, k):
            half = corners.copy()
            half[at] = middle
            centre = half.sum(axis=0) / np.linalg.norm(half.sum(axis=0))
            tried = {*chain, *pool.climb(chain[-1], middle), *pool.climb(chain[-1], centre)}
            t, best = _best(pool, half, tried | pool.jump(centre))
            count += 1
            heapq.heappush(heap, (t, count, half, best))
    bounds[0] = max(bounds[0], min(heap[0][0], bounds[1]))
    weakest = heap[0][2].sum(axis=0)
    return np.asarray(weakest / np.linalg.norm(weakest))


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
        weakest = raise_lower(hull, hover, part, anchors, bounds[k])
        worst = twists[k, part] / max(float(np.linalg.norm(twists[k, part])), 1e-300)
        for e in (weakest, worst):
            u = np.zeros(6)
            u[part] = e
            reach = lower_upper(hull, hover, u, bounds[k, 1], bounds[k, 0] * (1.0 + ENOUGH))
            if reach < bounds[k, 1]:
                bounds[k, 1], twists[k] = reach, u


def _best(pool: Pool, corners: Floats, indices: Iterable[int]) -> tuple[float, tuple[int, ...]]:
    """Returns how far products reach in all of a triangle of directions, and their indices.

    The first one holds hover; another goes on from it where it begins, along all three corners,
    no farther out than the ones before it reach.
    """
    spans = {i: np.array([pool.span(i, e) for e in corners]) for i in indices}
    spans = {i: s for i, s in spans.items() if np.isfinite(s).all()}
    chain: tuple[int, ...] = ()
    covered, reached = np.full(3, HELD), 0.0
    while True:
        able = [i for i, s in spans.items() if (s[:, 0] <= covered).all() and s[:, 1].min() > 0.0]
        reach = {i: _distance(spans[i][:, 1:] * corners) for i in able}
        best = max(reach, key=lambda i: reach[i], default=-1)
        if best < 0 or reach[best] <= reached * (1.0 + 1e-9):
            return reached, chain or (min(spans, default=0),)
        covered, reached, chain = spans[best][:, 1], reach[best], (*chain, best)


def _distance(corners: Floats) -> float:
    """Returns the distance from the origin to a triangle (3, 3)."""
    a, b, c = corners
    normal = np.cross(b - a, c - a)
    inside = [normal @ np.cross(x, y) for x, y in ((a, b), (b, c), (c, a))]
    if min(inside) >= 0.0 or max(inside) <= 0.0:
        size = np.linalg.norm(normal)
        return float(abs(normal @ a) / size) if size > 0.0 else 0.0
    edges = []
    for x, y in ((a, b), (b, c), (c, a)):
        step = y - x
        share = np.clip(-(x @ step) / max(step @ step, 1e-300), 0.0, 1.0)
        edges.append(float(np.linalg.norm(x + share * step)))
    return min(edges)


def lower_upper(hull: Sets, hover: Floats, u: Floats, bound: float, goal: float) -> float:
    """Returns an upper bound of the reach along u (6,), at most `bound`, no closer than `goal`.

    The part whose hull reaches farthest is split: the apparatus whose mixture lies farthest out of
    its set, by patch, then by half its range of φ, or of θ where that is wider and a least thrust
    is in the way.
    """
    whole = [hull.rows[a:b] for a, b in zip(hull.first, hull.first[1:], strict=False)]
    above, forces = _mixture(hull, hover, u, whole)
    heap = [(-above, 0, whole, forces)]
    for count in range(1, PARTS):
        reach, _, rows, forces = heap[0]
        if -reach <= goal:
            break
        j = _worst_mixture(hull, rows, forces)
        if j < 0:
            break
        heapq.heappop(heap)
        for k, part in enumerate(_split(rows[j])):
            parts = [*rows[:j], part, *rows[j + 1 :]]
            above, forces = _mixture(hull, hover, u, parts)
            heapq.heappush(heap, (max(-above, reach), 10 * count + k, parts, forces))
    return min(bound, -heap[0][0])


def _mixture(hull: Sets, hover: Floats, u: Floats, rows: list[Floats]) -> tuple[float, Floats]:
    first = np.concatenate([[0], np.cumsum([len(r) for r in rows])]).astype(np.int64)
    sets = hull._replace(rows=np.ascontiguousarray(np.vstack(rows)), first=first)
    forces, twist = np.empty((len(rows), 3)), np.empty(6)
    return ray(u, sets, hover, GAP, forces, twist)[1], forces


def _worst_mixture(hull: Sets, rows: list[Floats], forces: Floats) -> int:
    """Returns the apparatus whose force lies farthest out of its patches; -1 where all lie in."""
    out = np.zeros(len(rows))
    for j, (part, f) in enumerate(zip(rows, forces, strict=True)):
        local = hull.frames[j].T @ f
        flat = float(np.hypot(local[1], local[2]))
        gaps = []
        for row in part:
            slope = np.clip(np.arctan2(local[0], flat), row[15], row[16])
            phi, width = (
                (np.arctan2(-local[1], local[2]) - row[13]) % (2.0 * np.pi),
                row[14] - row[13],
            )
            if phi > width:  # to the nearer end
                phi = width if phi - width < 2.0 * np.pi - phi else 0.0
            phi += row[13]
            u = np.array([np.sin(slope), -np.sin(phi) * np.cos(slope), np.cos(phi) * np.cos(slope)])
            thrust = np.clip(local @ u, row[11], row[12])
            gaps.append(float(np.linalg.norm(local - thrust * u)))
        out[j] = min(gaps)
    at = int(np.argmax(out))
    return at if out[at] > 1e-6 else -1


def _split(rows: Floats) -> list[Floats]:
    """Returns the parts of one set: its patches, or two halves of one."""
    if len(rows) > 1:
        return [row[None] for row in rows]
    row = rows[0]
    low, high, side = row[11], row[12], row[17]
    p0, p1, t0, t1 = row[13:17]
    if p1 - p0 >= (t1 - t0 if low > 0.0 else 0.0):
        middle = 0.5 * (p0 + p1)
        ranges = ((p0, middle, t0, t1), (middle, p1, t0, t1))
    else:
        middle = 0.5 * (t0 + t1)
        ranges = ((p0, p1, t0, middle), (p0, p1, middle, t1))
    halves = [patch_row(np.array([*r, low, high, side]), 1.0) for r in ranges]
    return [half.reshape(1, PATCH) for half in halves]
