"""Margins against pycapacity and two hull iterations: both sides in one run, on one core.

Run: ``python benchmarks/margins.py``. The hyperplane shift of pycapacity and the hull iteration on
the conic solver Clarabel are timed where these are installed (``pip install -e .[bench]``).

The conic hull iteration is the vectored mode as one would write it with a solver at hand: a
polytope of points of the slice grows by its weakest facet until the bounds agree, and every point
is one second-order cone program, ``max e·x`` over forces ‖f_j‖ ≤ L_j that hold the rest.
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
from snakegen.kernels.margins.posture_batch import dual_postures
from snakegen.robot.posture import hover_gimbals
from snakegen.robot.robot import GRAVITY, load
from snakegen.wrench_margins.inner_ball import inner_ball


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


def dual(rng):
    for n, m in ((8, 20000), (16, 500)):
        q, hover = thrust_sets(rng, m, n)
        scales = {"force_scale": 1.0, "torque_scale": 1.0}
        each = timed(thrust_margins, q, 0, 1, hover, **scales) / m
        line(f"dual, {n} rotors of rank 6, all four margins given Q", each)
        if n == 8:
            compare_shift(q, hover, each)


def postures(rng):
    """Dual margins of dragon4 from joint and gimbal angles: kinematics, Q and all four margins.

    Joints anywhere within ±1.5 rad, every gimbal up to 0.3 rad from where its thrust is vertical.
    Margins are round the wrench of random thrusts: with gimbals that no controller chose the
    weight alone is seldom within reach, and what is outside takes another way.
    """
    robot, m = load("dragon4"), 3000
    angles = np.empty((m, len(robot.joint_names)))
    gimbals = [name in robot.gimbal_names for name in robot.joint_names]
    for i in range(m):
        joints = dict(zip(robot.chain_joints, rng.uniform(-1.5, 1.5, 6), strict=True))
        angles[i] = hover_gimbals(robot, robot.configuration(joints))[7:]
    angles[:, gimbals] += rng.uniform(-0.3, 0.3, (m, sum(gimbals)))
    scales = {"force_scale": robot.force_scale, "torque_scale": robot.torque_scale}
    dual, hover = np.empty((m, 6, robot.rotors.body.size)), np.empty((m, 6))
    lower, upper = robot.rotors.thrust_min, robot.rotors.thrust_max

    def maps():
        dual_postures(robot.tree, robot.rotors, np.eye(3), angles, GRAVITY, dual, hover)

    def whole():
        maps()
        return thrust_margins(dual, lower, upper, held, **scales)

    line("dual, dragon4: kinematics and Q alone", timed(maps) / m)
    held = dual @ (lower + (upper - lower) * rng.uniform(0.35, 0.65, upper.size))
    found = whole()
    line(
        "dual, dragon4: kinematics, Q and all four margins",
        timed(whole) / m,
        f"{found.feasible.mean():.0%} within reach, rank {found.rank.min()} to {found.rank.max()}",
    )


def compare_shift(q, hover, each):
    try:
        from pycapacity.algorithms import hyper_plane_shift_method
    except ImportError:
        print("  hyperplane shift: no pycapacity, see pip install -e .[bench]")
        return

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


def conic_iteration(points, limit, hover, tolerance):
    """Returns force and torque margins by cone programs, and how many were solved."""
    import clarabel
    from scipy.sparse import csc_matrix

    n = len(points)
    skews = [np.cross(np.eye(3), p).T * -1.0 for p in points]  # p × f = skew f
    maps = np.vstack([np.tile(np.eye(3), n), np.hstack(skews)])
    cones = [clarabel.ZeroConeT(3)] + [clarabel.SecondOrderConeT(4)] * n
    ball = np.vstack([np.zeros((1, 3)), -np.eye(3)])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    out, solved = [], 0
    for part, held in ((slice(0, 3), slice(3, 6)), (slice(3, 6), slice(0, 3))):
        rows = csc_matrix(np.vstack([maps[held], np.kron(np.eye(n), ball)]))
        right = np.concatenate([hover[held], np.tile([limit, 0.0, 0.0, 0.0], n)])

        def support(e, part=part, rows=rows, right=right):
            nonlocal solved
            solved += 1
            nothing = csc_matrix((3 * n, 3 * n))
            found = clarabel.DefaultSolver(
                nothing, -(e @ maps[part]), rows, right, cones, settings
            ).solve()
            point = maps[part] @ np.array(found.x) - hover[part]
            return float(e @ point), point

        out.append(inner_ball(support, tolerance)[1])
    return (*out, solved)


def compare_conic(points, hover, found, each):
    """One hull iteration on cone programs to the same tolerance, where the solver is found."""
    try:
        import clarabel  # noqa: F401
    except ImportError:
        print("  hull iteration on cone programs: no Clarabel, see pip install -e .[bench]")
        return
    few, gaps, programs = 20, [], 0
    conic_iteration(points[0], 64.0, hover, 1e-3)
    start = time.process_time()
    for i in range(few):
        force, torque, solved = conic_iteration(points[i], 64.0, hover, 1e-3)
        programs += solved
        gaps += [abs(1 - force / found.force[i]), abs(1 - torque / found.torque[i])]
    other = (time.process_time() - start) / few
    line(
        f"  hull iteration on {programs / few:.0f} cone programs to 1e-3",
        other,
        f"apart by up to {max(gaps):.1e}",
        other / each,
    )


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
            compare_conic(points, hover, found, each)
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
    argparse.ArgumentParser(description=__doc__).parse_args()
    rng = np.random.default_rng(0)
    print(f"load before: {' '.join(f'{x:.2f}' for x in os.getloadavg())} on {os.cpu_count()} cores")
    dual(rng)
    postures(rng)
    vectored(rng)


if __name__ == "__main__":
    main()
