"""Margins against pycapacity and a hull iteration: both sides in one run, on one core.

Run: ``python benchmarks/margins.py``. The hyperplane shift of pycapacity is timed where that
package is installed (``--pycapacity FOLDER`` adds a folder of packages to look in).
"""

import argparse
import os
import sys
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from margin_robots import LENGTH, MASS
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from snakegen.analysis.wrench_margin import thrust_margins, vectored_margins
from snakegen.margins.inner_ball import inner_ball


def timed(function, *arguments, repeats=5, **options):
    """Returns the least processor time of several runs, s, after one to warm up."""
    function(*arguments, **options)
    times = []
    for _ in range(repeats):
        start = time.process_time()
        function(*arguments, **options)
        times.append(time.process_time() - start)
    return min(times)


def thrust_sets(rng, m, n):
    q = rng.normal(size=(m, 6, n))
    return q, q @ rng.uniform(0.35, 0.65, n)


def bodies(rng, m, n):
    """Returns (m, n, 3) points of random chains, joints within ±1.5 rad."""
    out = np.empty((m, n, 3))
    for i in range(m):
        at, turn = np.zeros(3), np.eye(3)
        for j in range(n):
            out[i, j], at = at + turn @ [LENGTH / 2, 0, 0], at + turn @ [LENGTH, 0, 0]
            turn = turn @ Rotation.from_euler("YZ", rng.uniform(-1.5, 1.5, 2)).as_matrix()
    return out - out.mean(axis=1, keepdims=True)


def line(what, seconds, other="", ratio=None):
    gain = f"{ratio:10.0f} x" if ratio else ""
    print(f"{what:58s} {seconds * 1e6:12.1f} µs  {other:34s} {gain}")


def dual(rng, folder):
    for n, m in ((8, 20000), (16, 500)):
        q, hover = thrust_sets(rng, m, n)
        scales = {"force_scale": 1.0, "torque_scale": 1.0}
        each = timed(thrust_margins, q, 0, 1, hover, **scales) / m
        line(f"dual, {n} rotors of rank 6, all four margins", each)
        if n == 8 and folder:
            compare_shift(q, hover, each, folder)


def compare_shift(q, hover, each, folder):
    sys.path.append(folder)
    from pycapacity.algorithms import hyper_plane_shift_method

    few = 20
    worst = 0.0

    def shift():
        nonlocal worst
        for i in range(few):
            h, d = hyper_plane_shift_method(q[i], np.zeros(8), np.ones(8))
            h, d = np.asarray(h), np.asarray(d).ravel()
            size = np.linalg.norm(h, axis=1)
            margin = ((d - h @ hover[i]) / size).min()
            own = thrust_margins(q[i], 0, 1, hover[i], force_scale=1, torque_scale=1).wrench
            worst = max(worst, abs(margin - own))

    def only():
        for i in range(few):
            hyper_plane_shift_method(q[i], np.zeros(8), np.ones(8))

    shift()
    other = timed(only, repeats=3) / few
    line(
        "pycapacity's hyperplane shift, wrench margin alone",
        other,
        f"largest gap {worst:.1e}",
        other / each,
    )


def polytope(points, limit, faces):
    """A hull iteration on linear programs: each ball of forces as a polytope of `faces` points."""
    k = np.arange(faces) + 0.5
    tilt, turn = np.arccos(1 - 2 * k / faces), np.pi * (1 + 5**0.5) * k
    ball = np.c_[np.cos(turn) * np.sin(tilt), np.sin(turn) * np.sin(tilt), np.cos(tilt)] * limit
    columns, owner = [], []
    for j, p in enumerate(points):
        columns.append(np.hstack([ball, np.cross(p, ball)]))
        owner += [j] * faces
    columns, owner = np.vstack(columns).T, np.array(owner)
    weights = (owner == np.arange(len(points))[:, None]).astype(float)
    return columns, weights


def hull_iteration(points, limit, hover, tolerance, faces=60):
    columns, weights = polytope(points, limit, faces)
    out = []
    for part, held in ((slice(0, 3), slice(3, 6)), (slice(3, 6), slice(0, 3))):

        def support(e, part=part, held=held):
            found = linprog(
                -(e @ columns[part]),
                A_eq=np.vstack([columns[held], weights]),
                b_eq=np.r_[hover[held], np.ones(len(points))],
            )
            point = columns[part] @ found.x - hover[part]
            return float(e @ point), point

        out.append(inner_ball(support, tolerance)[1])
    return out


def vectored(rng):
    for n in (4, 8):
        m = 4000
        points, weight = bodies(rng, m, n), n * MASS * 9.81
        hover = np.array([0, 0, weight, 0, 0, 0])
        scales = {"force_scale": weight, "torque_scale": weight * LENGTH}
        found = vectored_margins(points, 64.0, hover, **scales)
        each = timed(vectored_margins, points, 64.0, hover, **scales) / m
        line(
            f"vectored, {n} apparatuses, force and torque to 1e-3",
            each,
            f"{found.closed.mean():.2%} closed, most {found.calls.sum(axis=1).max()} calls",
        )
        slowest = int(np.argmax(found.calls.sum(axis=1)))
        line(
            "  its slowest posture alone",
            timed(vectored_margins, points[slowest : slowest + 1], 64.0, hover, **scales),
        )
        if n == 4:
            few = 3
            start = time.process_time()
            gaps = []
            for i in range(few):
                force, torque = hull_iteration(points[i], 64.0, hover, 1e-2)
                gaps.append(max(1 - force / found.force[i], 1 - torque / found.torque[i]))
            other = (time.process_time() - start) / few
            line(
                "  hull iteration on linear programs to 1e-2",
                other,
                f"short by up to {max(gaps):.1%}",
                other / each,
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pycapacity", default="", help="folder that holds the package")
    options = parser.parse_args()
    rng = np.random.default_rng(0)
    dual(rng, options.pycapacity)
    vectored(rng)


if __name__ == "__main__":
    main()
