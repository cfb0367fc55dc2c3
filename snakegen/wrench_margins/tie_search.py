"""Directions that may tie with a margin's known one: where its other pieces are looked for."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from snakegen.kernels.margins.inner_radius import radius, work_space
from snakegen.wrench_margins.saddle_point import force_jacobians
from snakegen.wrench_margins.vectored import STARTS
from snakegen.wrench_margins.vectored_result import VectoredMargins
from snakegen.wrench_margins.wrench_search import fall, start_directions

Floats = NDArray[np.float64]
ROWS = {"wrench": 0, "force": 1, "torque": 2}
NEARLY = 1.02  # of the least support: a direction from which Newton's method may find a tie
APART = 0.2  # directions nearer than this lead to one optimum
SCATTERED = 24  # starts for other directions
ROUNDINGS = (1e-1, 1e-3)  # of the norms of a fall, scaled


def other_starts(
    m: VectoredMargins, kind: str, unit: Floats, problem: tuple[Floats, ...]
) -> list[Floats]:
    """Returns twists (6,) near every other direction that may tie with the known one.

    A certified search cannot close before it has asked for the support near each of them: those
    are the directions it asked for whose support is nearly the least. Of wrench margins of balls
    the falls of `wrench_search` are taken; of other convex sets falls of the support from
    scattered twists, and of sets that are not convex the scattered twists themselves.

    Args:
        m: the margins of one posture.
        kind: "wrench", "force" or "torque".
        unit: (6,) 1 at the rows that the margin keeps.
        problem: points and drags (n, 4), spans (n, 3, 3), low, high (n,), hover (6,), all scaled.
    """
    twist = m.twists[ROWS[kind]]
    if not m.sets.balls.all():
        scattered = np.random.default_rng(0).standard_normal((SCATTERED, 6))
        scattered /= np.sqrt((scattered**2 * unit).sum(axis=1, keepdims=True))
        known = twist / np.sqrt(twist**2 @ unit)
        starts = list(np.where(unit > 0.0, scattered, known))
        return starts if m.hull else _fallen([-known, *starts], unit, problem)
    placed, _, _, limit, hover = problem
    if kind == "wrench":
        return _falls(m, placed, limit, hover)
    work, torque = work_space(), kind == "torque"
    _, above, used = radius(torque, placed, limit, hover, np.eye(3), 1e-3, work, np.empty(6))
    order = [work[2], work[1]] if torque else [work[1], work[2]]
    twists = np.hstack([x[:used] for x in order])
    speed = np.einsum("jck,ik->ijc", force_jacobians(placed), twists)
    support = np.linalg.norm(speed, axis=2) @ limit - twists @ hover
    out: list[Floats] = []
    for i in np.argsort(support):
        if support[i] > above * NEARLY:
            break
        if all(np.abs((twists[i] - d) * unit).max() > APART for d in out):
            out.append(twists[i])
    return out


def _falls(m: VectoredMargins, p: Floats, limit: Floats, hover: Floats) -> list[Floats]:
    """Returns where falls of the wrench bound end, the deepest ones."""
    ends: list[tuple[float, Floats]] = []
    for start in start_directions(STARTS, m.twists):
        bounds, twists = np.full((3, 2), np.inf), np.empty((3, 6))
        fall(start, p, limit, hover, bounds, twists)
        if all(np.abs(twists[0] - d).max() > 0.1 * APART for _, d in ends):
            ends.append((float(bounds[0, 1]), twists[0]))
    least = min((value for value, _ in ends), default=0.0)
    return [d for value, d in ends if value <= least * NEARLY]


def _fallen(starts: list[Floats], unit: Floats, problem: tuple[Floats, ...]) -> list[Floats]:
    """Returns the twists where falls of the support of convex sets end, the deepest ones.

    Balls, discs and segments: ``Σ a_j ‖S_jᵀ B_j d‖ + b_j s_j · B_j d - d · w0`` over the size of
    the rows that the margin keeps, norms rounded ever less.
    """
    points, spans, low, high, hover = problem
    line = (spans**2).sum(axis=(1, 2)) < 1.5
    half = np.where(line, 0.5 * (high - low), high)
    middle = np.where(line, 0.5 * (high + low), 0.0)
    inside = np.einsum("jca,jck->jak", spans, force_jacobians(points))
    tilt = np.einsum("j,jk->k", middle, inside[:, 0]) - hover

    def value(d: Floats, smooth: float) -> tuple[float, Floats]:
        speed = inside @ d
        length = np.sqrt((speed**2).sum(axis=1) + smooth**2)
        size = float(np.sqrt(d**2 @ unit))
        total = (float(half @ length) + float(tilt @ d)) / size
        slope = np.einsum("j,ja,jak->k", half / length, speed, inside) + tilt
        return total, (slope - total * unit * d / size) / size

    ends: list[tuple[float, Floats]] = []
    for d in starts:
        for smooth in ROUNDINGS:
            d = np.asarray(minimize(value, d, (smooth,), jac=True, method="BFGS").x)
            d = d / np.sqrt(d**2 @ unit)
        if all(np.abs((d - o) * unit).max() > APART for _, o in ends):
            ends.append((value(d, 0.1 * ROUNDINGS[-1])[0], d))
    least = min(v for v, _ in ends)
    return [d for v, d in ends if v <= least + (NEARLY - 1.0) * abs(least)]
