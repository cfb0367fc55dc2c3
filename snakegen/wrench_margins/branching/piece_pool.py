"""Products of convex pieces of a posture's force sets, and how far each reaches (THEORY A4)."""

from dataclasses import dataclass, field

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.kernels.margins.convex_pieces import pieces_into
from snakegen.kernels.margins.force_sets import Sets
from snakegen.kernels.margins.limited_margins import empty_pieces, ray
from snakegen.kernels.margins.settle_forces import settle, wrench_inverse
from snakegen.kernels.margins.slice_program import maximise, new_basis, start
from snakegen.wrench_margins.branching.excluded_wrenches import GAP
from snakegen.wrench_margins.force_sets import patch_row

HELD = 1e-9  # scaled, by which hover may be missed
SETTLE = 200  # projections on the way to forces that give a wrench
BACK = 1e-7  # share of a reach that is left out where the beginning is shot from there
HELD_FORCES = 1e-7  # scaled, by which those may miss it
SHRUNK = (0.1, 0.02, 0.0)  # of the sets' ranges, within which those are looked for first


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
