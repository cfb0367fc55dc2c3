"""Support of a section of a wrench set, by column generation over its apparatuses' forces.

With forces drawn from convex sets, ``max c · (w - w0) subject to H w = H w0`` is a linear program
of k + n rows (k held rows, a mixture for each apparatus) and endless columns. The simplex method
asks the sets' closed-form support for the columns to enter; the same question bounds the optimum
from above, for every twist d = c - Hᵀ y gives ``Σ h_j(d) - d · w0``. Slices hold three rows, a ray
five.
Only c changes from one direction to the next, so the last basis is a feasible start.
"""

from typing import NamedTuple

import numpy as np

from snakegen.kernels.core.inverse import invert
from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.types import Floats, Ints
from snakegen.kernels.margins.force_sets import farthest, wrench_into

PENALTY = 1e3  # of a held wrench that the columns found so far cannot hold, to begin with
STEEPER = 1e3  # times it, once: in thin sets a held torque has a price of one by the drag
ROUNDS = 200  # of pricing, for one direction
TINY = 1e-11  # a pivot or a reduced cost below this is rounding
MISSED = 1e-8  # share of the largest wrench that a held row may miss, and shares of a mixture
REPAIRS = 4  # of a basis that rounding spoilt, for one direction


class Basis(NamedTuple):
    """Columns of the linear program in use, and its work space; r = k + n."""

    forces: Floats  # (r, 3)
    wrenches: Floats  # (r, 6)
    owner: Ints  # (r,) apparatus; -1: a held row that nothing gives yet
    inverse: Floats  # (r, r) of the basis matrix: the held rows first, then the mixtures
    share: Floats  # (r,)
    cost: Floats  # (r,)
    prices: Floats  # (r,)
    step: Floats  # (r,)
    entering: Floats  # (n, 9) force and wrench of each apparatus' candidate
    value: Floats  # (n,) its product with the twist
    row: Floats  # (6,)
    wrench: Floats  # (6,)
    twist: Floats  # (6,)


@bare
def _along(row, wrench):
    """Returns the product of two rows (6,)."""
    total = 0.0
    for c in range(6):
        total += row[c] * wrench[c]
    return total


@jit
def new_basis(rows, n):
    """Returns work space for `rows` held rows and n apparatuses."""
    r = rows + n
    return Basis(
        np.zeros((r, 3)),
        np.zeros((r, 6)),
        np.full(r, -1),
        np.zeros((r, r)),
        np.zeros(r),
        np.zeros(r),
        np.zeros(r),
        np.zeros(r),
        np.zeros((n, 9)),
        np.zeros(n),
        np.zeros(6),
        np.zeros(6),
        np.zeros(6),
    )


@jit
def start(held, sets, hover, b):
    """Fills the first basis: a force of each apparatus along hover, and artificial rows.

    Args:
        held: H, (k, 6).
        sets: of the apparatuses.
        hover: w0, (6,).
        b: from `new_basis`.
    """
    n, k = sets.faces.size, held.shape[0]
    d, u, f = np.empty(3), np.empty(3), np.empty(3)
    for c in range(6):
        b.twist[c] = hover[c] if c < 3 else 0.0
    b.inverse[:] = 0.0
    for j in range(n):
        farthest(j, b.twist, sets, d, u, f)
        b.forces[k + j] = f
        wrench_into(j, f, sets, b.wrenches[k + j])
        b.owner[k + j] = j
        b.inverse[k + j, k + j] = 1.0
    for i in range(k):
        rest = _along(held[i], hover)
        for j in range(n):
            rest -= _along(held[i], b.wrenches[k + j])
        sign = 1.0 if rest >= 0.0 else -1.0
        b.owner[i] = -1
        b.wrenches[i] = 0.0
        b.wrenches[i, i] = sign  # of the row that it fills
        b.inverse[i, i] = sign
        for j in range(n):
            b.inverse[i, k + j] -= sign * _along(held[i], b.wrenches[k + j])


@bare
def _price(cost, held, hover, sets, b, d, u, f):
    """Asks each apparatus for its farthest force along the prices' twist; (above, reached)."""
    n, k, r = sets.faces.size, held.shape[0], b.share.size
    _prices(b)
    reached = 0.0
    for i in range(r):
        reached += b.cost[i] * b.share[i]
    above = 0.0
    for c in range(6):
        b.twist[c] = cost[c]
        for i in range(k):
            b.twist[c] -= held[i, c] * b.prices[i]
        above -= b.twist[c] * hover[c]
        reached -= cost[c] * hover[c]
    for j in range(n):
        b.value[j] = farthest(j, b.twist, sets, d, u, f)
        wrench_into(j, f, sets, b.entering[j, 3:])
        for c in range(3):
            b.entering[j, c] = f[c]
        above += b.value[j]
    return above, reached


@bare
def _prices(b):
    """Brings the prices (r,) of the rows up to date."""
    r = b.share.size
    for i in range(r):
        total = 0.0
        for k in range(r):
            total += b.cost[k] * b.inverse[k, i]
        b.prices[i] = total


@bare
def _enter(j, cost, held, b):
    """Brings apparatus j's candidate into the basis if it pays; True where it does."""
    k, r = held.shape[0], b.share.size
    own = _along(cost, b.entering[j, 3:])
    gain = own - b.prices[k + j]
    for i in range(k):
        b.row[i] = _along(held[i], b.entering[j, 3:])
        gain -= b.prices[i] * b.row[i]
    if gain <= TINY * (1.0 + abs(b.prices[k + j])):
        return False
    leaves, least = -1, np.inf
    for q in range(r):
        total = b.inverse[q, k + j]
        for i in range(k):
            total += b.inverse[q, i] * b.row[i]
        b.step[q] = total
        if total > TINY and max(b.share[q], 0.0) / total < least:
            leaves, least = q, max(b.share[q], 0.0) / total
    if leaves < 0:
        return False
    unit = 1.0 / b.step[leaves]
    b.share[leaves] *= unit
    for i in range(r):
        b.inverse[leaves, i] *= unit
    for q in range(r):
        if q != leaves:
            b.share[q] -= b.step[q] * b.share[leaves]
            for i in range(r):
                b.inverse[q, i] -= b.step[q] * b.inverse[leaves, i]
    for c in range(3):
        b.forces[leaves, c] = b.entering[j, c]
    for c in range(6):
        b.wrenches[leaves, c] = b.entering[j, 3 + c]
    b.owner[leaves], b.cost[leaves] = j, own
    return True


@jit
def refresh(held, b):
    """Inverts the basis matrix anew, as pivots add up their rounding; False if it is singular."""
    k, r = held.shape[0], b.share.size
    a = np.zeros((r, r))
    for q in range(r):
        if b.owner[q] >= 0:
            a[k + b.owner[q], q] = 1.0
        for i in range(k):
            a[i, q] = _along(held[i], b.wrenches[q]) if b.owner[q] >= 0 else b.wrenches[q, i]
    return invert(a, b.inverse)


@bare
def _shares(cost, held, hover, penalty, b):
    """Fills shares and costs (r,) of the basis; returns its largest wrench and its least share."""
    k, r = held.shape[0], b.share.size
    size, least = 0.0, np.inf
    for q in range(r):
        b.share[q], b.cost[q] = 0.0, 0.0 if b.owner[q] >= 0 else -penalty
        for i in range(r):
            b.share[q] += b.inverse[q, i] * (_along(held[i], hover) if i < k else 1.0)
        least = min(least, b.share[q])
        if b.owner[q] >= 0:
            b.cost[q] = _along(cost, b.wrenches[q])
            for c in range(6):
                size = max(size, abs(b.wrenches[q, c]))
    return size, least


@bare
def _mixture(cost, held, hover, sets, most, b, forces):
    """Writes the forces (n, 3) that the shares mix; returns c · (w - w0) of their wrench w.

    -inf where they miss a held row, or the sum of an apparatus' shares misses 1, by over `most`.
    """
    k, r, n = held.shape[0], b.share.size, sets.faces.size
    missed = 0.0
    b.value[:] = 1.0  # left of each mixture
    forces[:] = 0.0
    for q in range(r):
        if b.owner[q] < 0:
            missed += abs(b.share[q])
            continue
        missed += max(-b.share[q], 0.0)
        b.value[b.owner[q]] -= b.share[q]
        for c in range(3):
            forces[b.owner[q], c] += b.share[q] * b.forces[q, c]
    for j in range(n):
        missed += abs(b.value[j])
    if not missed <= most:
        return -np.inf
    for c in range(6):
        b.row[c] = -hover[c]
    for j in range(n):
        wrench_into(j, forces[j], sets, b.wrench)
        for c in range(6):
            b.row[c] += b.wrench[c]
    for i in range(k):
        if abs(_along(held[i], b.row)) > most:
            return -np.inf
    return _along(cost, b.row)


@jit
def maximise(cost, held, hover, sets, gap, b, forces, twist):
    """Bounds ``max c · (w - w0)``, H w = H w0, from both sides, to a share `gap` of the bound.

    Pivots on columns that lie close to each other add up rounding until the mixture misses what
    it holds: then the basis is inverted anew, or begun anew where it holds nothing by then, and
    held rows that are missed cost more.

    Args:
        cost: c, (6,).
        held: H, (k, 6).
        hover: w0, (6,) scaled.
        sets: what the apparatuses push with.
        gap: relative, at which to stop.
        b: the basis, from `start` or the call before, updated.
        forces: (n, 3), filled: forces of the convex sets that reach the lower bound.
        twist: (6,), filled: that of the upper bound.

    Returns:
        (lower, upper); lower is -inf where the sets hold no wrench with H w = H w0 that was
        found, upper < 0 proves for a direction c that hover is out of reach.
    """
    n = sets.faces.size
    d, u, f = np.empty(3), np.empty(3), np.empty(3)
    upper, lower = np.inf, -np.inf
    size, _ = _shares(cost, held, hover, PENALTY, b)
    for again in range(REPAIRS + 1):
        entered = False
        for _ in range(ROUNDS):
            above, reached = _price(cost, held, hover, sets, b, d, u, f)
            if above < upper:
                upper = above
                twist[:] = b.twist
            if upper < 0.0 or upper - reached <= gap * upper:
                break
            moved = False
            for j in range(n):
                if _enter(j, cost, held, b):
                    moved = True
                    _prices(b)
            if not moved:
                break
            entered = True
        lower = _mixture(cost, held, hover, sets, MISSED * size, b, forces)
        if lower > -np.inf or upper < 0.0 or (again > 0 and not entered):
            break
        regular = refresh(held, b)
        if not regular or _shares(cost, held, hover, PENALTY * STEEPER, b)[1] < -MISSED:
            start(held, sets, hover, b)
            _shares(cost, held, hover, PENALTY * STEEPER, b)
    return lower, upper
