"""Random bodies whose vectored apparatuses drag, and what linear programs and searches say."""

from types import SimpleNamespace

import numpy as np
from margin_robots import LENGTH
from scipy.optimize import linprog, minimize

from snakegen.wrench_margins.vectored import apparatus_sets, set_margins

F0 = 80.0
SCALES = {"force_scale": F0, "torque_scale": F0 * LENGTH}
SLICES = {"force": slice(0, 3), "torque": slice(3, 6)}


def random_body(rng, count, size=0.5, drag=0.05):
    """A cloud of apparatuses, hovering a little off balance."""
    points = size * rng.normal(size=(count, 3))
    limits = rng.uniform(1.0, 2.5, count) * F0 / count
    drags = drag * rng.normal(size=count)
    up = rng.normal(size=3)
    hover = np.r_[0.4 * F0 * up / np.linalg.norm(up), 0.3 * rng.normal(size=3)]
    return SimpleNamespace(
        points=points - points.mean(axis=0), limits=limits, drag=drags, hover=hover
    )


def margins_of(b, gimbal_limits=None, **options):
    sets = apparatus_sets(b.points, b.limits, b.drag, gimbal_limits=gimbal_limits)
    return set_margins(sets, b.hover, **SCALES, **options)


def wrench_of(b, force):
    """Wrench of forces (n, 3): each with the torque of its point and of its drag."""
    torque = np.cross(b.points, force) + b.drag[:, None] * force
    return np.r_[force.sum(axis=0), torque.sum(axis=0)]


def matrix(b):
    n = len(b.limits)
    return np.array([wrench_of(b, e.reshape(n, 3)) for e in np.eye(3 * n)]).T


def reach(b, u):
    """Largest t with hover + t u in the set: a linear program, its balls cut by planes as needed.

    The cuts leave the set inside, so this bounds t from above, by less than 1e-6 of the limits.
    """
    n, planes, sides = len(b.limits), [], []
    box = [*((-m, m) for m in np.repeat(b.limits, 3)), (None, None)]
    for _ in range(100):
        found = linprog(
            np.r_[np.zeros(3 * n), -1.0],
            A_ub=np.array(planes) if planes else None,
            b_ub=sides or None,
            A_eq=np.c_[matrix(b), -u],
            b_eq=b.hover,
            bounds=box,
        )
        if found.x is None:
            return np.nan
        force = found.x[:-1].reshape(n, 3)
        size = np.linalg.norm(force, axis=1)
        passed = np.flatnonzero(size > b.limits * (1.0 + 1e-7))
        if not len(passed):
            return found.x[-1]
        for j in passed:
            plane = np.zeros((n + 1, 3))
            plane[j] = force[j] / size[j]
            planes.append(plane.ravel()[: 3 * n + 1])
            sides.append(b.limits[j])
    raise AssertionError("the cuts did not settle")


def height(b, d):
    """h(d) - d·w0, every force pushed its best way."""
    speed = d[:3] + np.cross(d[3:], b.points) + b.drag[:, None] * d[3:]
    return (b.limits * np.linalg.norm(speed, axis=1)).sum() - d @ b.hover


def searched(b, part, rng, starts=4):
    """Least ``(h(d) - d·w0)/‖d_part‖`` that BFGS, then Nelder and Mead, find from random twists."""

    def ratio(d):
        size = np.linalg.norm(d[part])
        return height(b, d) / size if size > 1e-9 else 1e9

    best = np.inf
    for _ in range(starts):
        first = minimize(ratio, rng.normal(size=6), method="BFGS", options={"maxiter": 80})
        options = {"maxfev": 500, "fatol": 1e-9}
        best = min(best, minimize(ratio, first.x, method="Nelder-Mead", options=options).fun)
    return best
