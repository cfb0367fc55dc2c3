"""Cables along a chain: lengths, moment arms, and the tensions that balance joint torques.

A cable is a polyline through holes that are fixed in bodies. Its length l(θ) gives its moment arms,
``τ = A t`` with ``A = -(∂l/∂θ)ᵀ`` (virtual work: a pull shortens), in any posture and for any
routing; the textbook ``r [-sin φ, cos φ]`` is the straight posture's value.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog

from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.mat3 import cross_into, turn_into
from snakegen.kernels.core.types import Floats, Ints, Tree
from snakegen.kernels.kinematics.chain import forward_into


class Holes(NamedTuple):
    """c cables; cable k runs through holes first[k] … first[k + 1] - 1, base to tip."""

    first: Ints  # (c + 1,)
    body: Ints  # (h,) the body that holds each hole
    point: Floats  # (h, 3) m, in that body's frame


@jit
def lengths_and_rates(
    tree: Tree, base_rotation: Floats, angles: Floats, holes: Holes
) -> tuple[Floats, Floats]:
    """Returns cable lengths (c,) [m] and ∂l/∂θ (c, n-1) [m/rad].

    Args:
        tree: the robot's n bodies.
        base_rotation: (3, 3) attitude of body 0 in the world.
        angles: (n-1,) rad.
        holes: the routing.
    """
    n, cables = tree.parent.shape[0], holes.first.shape[0] - 1
    parent, prismatic, axes = tree.parent, tree.prismatic, tree.axis
    R, p, e, arm = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, 3)), np.empty(3)
    forward_into(tree, base_rotation, np.zeros(3), angles, R, p)
    for i in range(n):
        turn_into(R[i], axes[i], e[i])
    x = np.empty((holes.body.shape[0], 3))
    for h in range(x.shape[0]):
        turn_into(R[holes.body[h]], holes.point[h], x[h])
        x[h] += p[holes.body[h]]
    length, rates, moved = np.zeros(cables), np.zeros((cables, n - 1)), np.empty(3)
    for c in range(cables):
        for h in range(holes.first[c], holes.first[c + 1] - 1):
            piece = x[h + 1] - x[h]
            size = np.sqrt(piece[0] ** 2 + piece[1] ** 2 + piece[2] ** 2)
            length[c] += size
            if size == 0.0:
                continue
            for end in range(2):  # the piece's far end lengthens it, its near end shortens it
                sign = 1.0 if end == 1 else -1.0
                i = holes.body[h + end]
                while i > 0:
                    for k in range(3):
                        arm[k] = x[h + end, k] - p[i, k]
                        moved[k] = e[i, k]
                    if not prismatic[i]:
                        cross_into(e[i], arm, moved)
                    for k in range(3):
                        rates[c, i - 1] += sign * piece[k] * moved[k] / size
                    i = parent[i]
    return length, rates


def balance(
    A: Floats, torque: Floats, minimum: float, maximum: float = np.inf
) -> tuple[Floats, Floats]:
    """Returns the least tensions with ``A t = τ``, ``minimum ≤ t ≤ maximum``, and the shortage.

    Three cables whose null vector is positive (120° apart: all ones) have the closed form
    ``t = A⁺τ + λ n`` with the smallest λ that keeps all t ≥ minimum; any other set is the linear
    program ``min Σt``. Where no tensions do, they come as near as they can (least Σ|τ - A t|).

    Args:
        A: (j, c) m, moment arms of c cables about j joints.
        torque: (j,) N·m, wanted of the cables.
        minimum, maximum: N.

    Returns:
        tensions (c,) N, shortage (j,) N·m: what is left of τ, zero where they balance.
    """
    closed = _closed_form(A, torque, minimum)
    if closed is not None and np.all(closed <= maximum):
        return closed, np.zeros(len(torque))
    j, c = A.shape
    bounds = [(minimum, None if np.isinf(maximum) else maximum)] * c
    found = linprog(np.ones(c), A_eq=A, b_eq=torque, bounds=bounds, method="highs")
    if found.status == 0:
        return np.asarray(found.x), np.zeros(j)
    # τ = A t + plus - minus: the smallest plus + minus is the shortage.
    cost = np.concatenate([np.full(c, 1e-9), np.ones(2 * j)])
    rows = np.hstack([A, np.eye(j), -np.eye(j)])
    slack = linprog(
        cost, A_eq=rows, b_eq=torque, bounds=bounds + [(0, None)] * (2 * j), method="highs"
    )
    t = np.asarray(slack.x[:c])
    return t, torque - A @ t


def _closed_form(A: Floats, torque: Floats, minimum: float) -> Floats | None:
    """Returns ``A⁺τ + λ n`` where A is 2 x 3 with a positive null vector n, else None."""
    if A.shape != (2, 3):
        return None
    null = np.cross(A[0], A[1])
    size = np.linalg.norm(null)
    if size <= 1e-9 * max(float(np.sum(A * A)), 1e-300):
        return None
    null *= np.sign(null.sum()) / size
    if np.any(null <= 1e-6):
        return None
    t = np.linalg.pinv(A) @ torque
    return np.asarray(t + np.max((minimum - t) / null) * null)


def back_substitute(
    A: Floats,
    torque: Floats,
    rows: list[Ints],
    columns: list[Ints],
    minimum: float,
    maximum: float = np.inf,
) -> tuple[Floats, Floats]:
    """Returns tensions of coupled segments: tip first, ``Σ_{k≥i} A_ik t_k = τ_i`` (THEORY C).

    Each segment's own cables take what the cables that pass through it on their way outwards
    leave. Arguments as in `balance`; `rows` and `columns` give each segment's joints and cables.
    """
    t, shortage = np.zeros(A.shape[1]), np.zeros(len(torque))
    for own, cables in zip(reversed(rows), reversed(columns), strict=True):
        # Cables nearer the base do not reach this far; those beyond have their tension already.
        rest = torque[own] - A[own] @ t
        t[cables], shortage[own] = balance(A[np.ix_(own, cables)], rest, minimum, maximum)
    return t, shortage
