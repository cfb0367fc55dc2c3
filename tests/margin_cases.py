"""Random thrust sets for the margins, and what linear programs and hulls say of them."""

from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog, lsq_linear
from scipy.spatial import ConvexHull


class Case(NamedTuple):
    q: np.ndarray  # (6, n)
    lower: np.ndarray
    upper: np.ndarray
    hover: np.ndarray
    force_scale: float
    torque_scale: float


def random_case(rng, most=8):
    """A set of rank 3 to 6: parallel columns, dead and locked rotors, hovers in and out of it."""
    rank = int(rng.integers(3, 7))
    n = int(rng.integers(rank, most + 1))
    q = rng.normal(size=(6, rank)) @ rng.normal(size=(rank, n))
    if rng.random() < 0.3:  # a rotor parallel to another, either way
        a, b = rng.choice(n, 2, replace=False)
        q[:, a] = q[:, b] * rng.choice([-1.0, 0.5, 1.0])
    upper = rng.uniform(0.5, 3.0, n)
    lower = np.where(rng.random(n) < 0.5, 0.0, rng.uniform(0.0, 0.5, n))
    if rng.random() < 0.3:
        dead = rng.integers(n)
        lower[dead] = upper[dead] = 0.0 if rng.random() < 0.5 else upper[dead]
    share = rng.uniform(0.2, 0.8, n)
    hover = q @ (lower + share * (upper - lower))
    if rng.random() < 0.25:  # out of the set, or off its subspace
        hover = hover + rng.normal(size=6) * rng.choice([0.1, 5.0])
    return Case(q, lower, upper, hover, float(rng.uniform(0.5, 5)), float(rng.uniform(0.2, 3)))


def scaled(case):
    """Returns the scaled map and hover."""
    s = np.repeat([case.force_scale, case.torque_scale], 3)
    return case.q / s[:, None], case.hover / s


def hull_margins(a, w, lower, upper):
    """Wrench, force and torque margins (scaled) by qhull over all vertices, in the own subspace.

    For `a` (d, n), d = 6 or 4 (then force and torque mean nothing); nan where w is outside.
    """
    live = upper > lower
    corners = np.array(list(product((0.0, 1.0), repeat=int(live.sum()))))
    thrust = np.tile(lower, (len(corners), 1))
    thrust[:, live] += corners * (upper - lower)[live]
    vertices = thrust @ a.T
    u, s, _ = np.linalg.svd((a * (upper - lower))[:, live], full_matrices=True)
    rank = int((s > 1e-6 * s[0]).sum()) if s.size else 0
    basis, lost = u[:, :rank], u[:, rank:]
    middle = vertices.mean(axis=0)
    # directions below the rank tolerance are thin, not always without width
    thickness = 0.5 * np.abs(lost.T @ (a * (upper - lower))).sum(axis=1)
    if (np.abs(lost.T @ (w - middle)) > thickness + 1e-9).any():
        return np.full(3, np.nan), rank
    flat, at = (vertices - middle) @ basis, (w - middle) @ basis
    if rank == 1:
        planes = np.array([[1.0, -flat.max()], [-1.0, flat.min()]])
    else:
        planes = ConvexHull(flat).equations
    slack = -(planes[:, :-1] @ at + planes[:, -1])
    if slack.min() < -1e-9:  # qhull's own rounding on thin sets
        return np.full(3, np.nan), rank
    slack = slack.clip(0.0)
    normals = planes[:, :-1] @ basis.T
    out = [slack.min() if rank == len(a) else 0.0]
    for part in (slice(0, 3), slice(3, 6)):
        tilt = np.linalg.norm(normals[:, part], axis=1)
        kept = tilt > 1e-9
        full = np.abs(lost[part]).max(initial=0.0) < 1e-9
        out.append((slack[kept] / tilt[kept]).min() if full else 0.0)
    return np.array(out), rank


def distance(a, w, lower, upper):
    """Scaled distance from w to the set, by bounded least squares."""
    live = upper > lower
    rest = w - a[:, ~live] @ lower[~live]
    found = lsq_linear(
        a[:, live], rest, (lower[live], upper[live]), method="bvls", tol=1e-15, max_iter=1000
    )
    return float(np.sqrt(2.0 * found.cost))


def ray(case, u):
    """Largest t with hover + t u in the set, by a linear program; nan where there is none."""
    n = len(case.lower)
    found = linprog(
        np.r_[np.zeros(n), -1.0],
        A_eq=np.c_[case.q, -np.asarray(u)],
        b_eq=case.hover,
        bounds=[*zip(case.lower, case.upper, strict=True), (None, None)],
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    return -found.fun if found.status == 0 else np.nan


def disagreement(case, margins, rng):
    """Returns the worst difference between `margins` and hulls, least squares, linear programs."""
    a, w = scaled(case)
    worst = 0.0
    found = np.array([margins.wrench, margins.force / case.force_scale])
    found = np.append(found, margins.torque / case.torque_scale)
    expected, rank = hull_margins(a, w, case.lower, case.upper)
    assert rank == margins.rank
    if np.isnan(expected[0]):
        expected[0] = -distance(a, w, case.lower, case.upper)
    assert (np.isnan(expected) == np.isnan(found)).all(), (expected, found)
    worst = max(worst, np.nanmax(np.abs(expected - found)))
    flat, _ = hull_margins(a[2:], w[2:], case.lower, case.upper)
    if np.isnan(flat[0]):
        flat[0] = -distance(a[2:], w[2:], case.lower, case.upper)
    worst = max(worst, abs(flat[0] - margins.attitude_altitude))
    u = rng.normal(size=6)
    if margins.rank < 6:  # along the set itself, else the answer is 0
        u = case.q @ (rng.normal(size=len(case.lower)) * (case.upper - case.lower))
    t, reference = margins.directional(u), ray(case, u)
    if margins.feasible:
        worst = max(worst, abs(t - reference) / (1.0 + abs(reference)))
    return worst
