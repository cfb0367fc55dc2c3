"""Closer upper bounds of a slice's margin: wrenches that parts of the sets prove out of reach.

A margin is no more than the length of a push that no forces give. Sets that are not convex are
split until the hull of every combination of parts misses the wrench (THEORY A4).
"""

import numpy as np
from numpy.typing import NDArray

from snakegen.kernels.margins.force_sets import PATCH, Sets
from snakegen.kernels.margins.limited_margins import ray
from snakegen.wrench_margins.force_sets import patch_row

Floats = NDArray[np.float64]
PARTS = 150  # of the sets, for one wrench
ABOVE = (0.0, 0.03, 0.07, 0.15, 0.3, 0.5, 0.75, 0.95)  # of the way from lower to upper bound
HALVINGS = 3  # between the lowest one out of reach and the one before it
GAP = 1e-4  # relative, of one ray
MISSED = 1e-9  # scaled, by which a ray must miss
ENOUGH = 3e-3  # relative gap of a margin at which branching stops


def lower_upper(
    hull: Sets, hover: Floats, part: slice, e: Floats, bounds: Floats, twist: Floats
) -> None:
    """Lowers the upper one of a slice's `bounds` to a wrench along e that is out of reach.

    Args:
        hull: the sets.
        hover: (6,) scaled.
        part: rows of the slice.
        e: (3,) unit.
        bounds: (2,), updated.
        twist: (6,), updated to e where the bound falls.
    """
    u = np.zeros(6)
    u[part] = e
    near = bounds[0] * (1.0 + ENOUGH)  # not proved to be out of reach, yet
    if near >= bounds[1]:
        return
    first, high = near, float(bounds[1])
    for share in ABOVE:  # a gap in what is in reach may be narrow: the lowest one counts
        at = first + share * (high - first)
        if out_of_reach(hull, hover + at * u, u):
            bounds[1], twist[:] = at, u
            break
        near = at
    for _ in range(HALVINGS if near < bounds[1] < high else 0):
        at = 0.5 * (near + bounds[1])
        if out_of_reach(hull, hover + at * u, u):
            bounds[1], twist[:] = at, u
        else:
            near = at


def out_of_reach(hull: Sets, wrench: Floats, u: Floats) -> bool:
    """Tells whether no forces of the sets give `wrench` (6,), proved by parts of them; u any ray.

    Each part's hull ends before or behind the wrench along u, or is split: the apparatus whose
    mixture lies farthest out of its set, by patch, then by half its range of φ, or of θ where that
    is wider and a least thrust is in the way.
    """
    parts = [[hull.rows[a:b] for a, b in zip(hull.first, hull.first[1:], strict=False)]]
    for _ in range(PARTS):
        rows = parts.pop()
        ahead, far = _mixture(hull, wrench, u, rows)
        if ahead >= -MISSED:
            behind, near = _mixture(hull, wrench, -u, rows)
            if behind >= -MISSED:
                share = max(behind, MISSED) / (max(ahead, MISSED) + max(behind, MISSED))
                j = _worst_mixture(hull, rows, share * far + (1.0 - share) * near)
                if j < 0:
                    return False
                parts += [[*rows[:j], part, *rows[j + 1 :]] for part in _split(rows[j])]
        if not parts:
            return True
    return False


def _mixture(hull: Sets, hover: Floats, u: Floats, rows: list[Floats]) -> tuple[float, Floats]:
    """Returns an upper bound of the reach of parts' hulls along u, and the forces (n, 3) there."""
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
