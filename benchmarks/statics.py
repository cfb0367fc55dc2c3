"""Joint torques: agreement with Pinocchio, cost against other methods, and ZS24's figures.

    OPENBLAS_NUM_THREADS=1 python benchmarks/statics.py

The paper (its eq 26) compares ``Sᵀ w`` with inverting a structure matrix. Here every way solves the
same problem, static torques of a chain of n joints under gravity: the dense inverse that the paper
names, the same equations solved as the band that they are, Pinocchio's RNEA one call at a time, and
this package's kernel in a sweep.
"""

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
from scipy.linalg import solve_banded

import snakegen
from snakegen.analysis import cables, reach
from snakegen.analysis.statics import joint_torques
from snakegen.base.geometry import skew
from snakegen.errors import AnalysisError
from snakegen.kernels.core.types import Tree
from snakegen.kernels.dynamics.inverse_dynamics import NO_LOADS, torques_batch
from snakegen.kernels.dynamics.torque_terms import DEPTHS, torque_terms, torque_terms_batch
from snakegen.kernels.kinematics.chain import forward
from snakegen.simulation.flight.run import run

GRAVITY = np.array([0.0, 0.0, -9.81])
LENGTH = 0.1
TABLE_5 = 1e-3 * np.array(
    [
        *(2818.09, 2876.88, 2119.55, 2075.67, 1424.83, 1454.34),
        *(847.05, 829.45, 390.11, 397.99, 90.21, 88.25),
    ]
)


def chain(n: int, seed: int = 0) -> Tree:
    """Returns n links on a fixed base, joints about y and z in turn, random inertias."""
    rng = np.random.default_rng(seed)
    axis = np.array([[0.0, 1, 0], [0, 0, 1]])[np.arange(n + 1) % 2]
    points = rng.normal(size=(n + 1, 6, 3)) * 0.05
    squares = np.einsum("nij,nij->n", points, points)[:, None, None] * np.eye(3)
    inertia = squares - np.einsum("nki,nkj->nij", points, points)
    step = np.tile([LENGTH, 0.0, 0.0], (n + 1, 1))
    mass = np.r_[0.0, rng.uniform(0.5, 1.5, n)]
    return Tree(
        np.arange(-1, n), np.zeros(n + 1, np.int64), np.tile(np.eye(3), (n + 1, 1, 1)), step,
        axis, mass, 0.5 * step, inertia,
    )  # fmt: skip


def in_pinocchio(tree: Tree, floating: bool) -> tuple[pin.Model, pin.Data]:
    """Returns the same chain built joint by joint in Pinocchio."""
    model, parent = pin.Model(), 0
    for i in range(0 if floating else 1, len(tree.parent)):
        place = pin.SE3(tree.rotation[i], tree.translation[i] if i else np.zeros(3))
        kind = pin.JointModelRevoluteUnaligned(tree.axis[i]) if i else pin.JointModelFreeFlyer()
        parent = model.addJoint(parent, kind, place, f"j{i}")
        body = pin.Inertia(tree.mass[i], tree.com[i], tree.inertia[i])
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
    return model, model.createData()


def agreement(states: int = 1000) -> None:
    """Prints the worst relative error of `full` over random states of 1 to 64 links."""
    rng = np.random.default_rng(1)
    worst = 0.0
    for k in range(states):
        n, floating = int(rng.integers(1, 65)), bool(k % 2)
        tree = chain(n, k)
        if floating:
            tree = tree._replace(mass=np.r_[1.0, tree.mass[1:]])
        model, data = in_pinocchio(tree, floating)
        q = pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq))
        v, a = rng.normal(size=(2, model.nv))
        want = pin.rnea(model, data, q, v, a)
        first, base = (7, pin.Quaternion(q[3:7]).matrix()) if floating else (0, np.eye(3))
        pad = np.zeros(0 if floating else 6)
        rows = torque_terms(
            tree, np.zeros(n), np.arange(n + 1), GRAVITY, base, q[first:],
            np.r_[pad, v], np.r_[pad, a], np.zeros((n + 1, 6)),
        )  # fmt: skip
        got = rows[list(DEPTHS["full"])].sum(axis=0)[len(pad) :]
        worst = max(worst, float(np.max(np.abs(got - want)) / np.max(np.abs(want))))
    print(
        f"full against Pinocchio RNEA, {states} states, 1-64 links, fixed and floating: {worst:.1e}"
    )


def structure(tree: Tree, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns eq 26's A (6n, 6n), w (6n,) and joint axes: the equilibrium of every body.

    The unknowns are the wrenches that joints transmit; body i bears its own less the next one's.
    """
    n = len(tree.parent) - 1
    R, p = forward(tree, np.eye(3), np.zeros(3), angles)
    A, w, axes = np.eye(6 * n), np.zeros(6 * n), np.zeros((n, 3))
    for i in range(1, n + 1):
        rows = slice(6 * i - 6, 6 * i)
        arm = R[i] @ tree.com[i]
        force = -tree.mass[i] * GRAVITY
        w[rows] = np.r_[force, np.cross(arm, force)]
        axes[i - 1] = R[i] @ tree.axis[i]
        if i < n:
            carry = np.eye(6)
            carry[3:, :3] = skew(p[i + 1] - p[i])
            A[rows, 6 * i : 6 * i + 6] = -carry
    return A, w, axes


def banded(A: np.ndarray) -> np.ndarray:
    """Returns A, which has 8 diagonals above its own, in LAPACK's band form."""
    n, above = len(A), 8
    ab = np.zeros((above + 1, n))
    for k in range(above + 1):
        ab[above - k, k:] = np.diagonal(A, k)
    return ab


def microseconds(function: Callable[[], object], per: int = 1, least: float = 0.05) -> float:
    """Returns the best time of a call over `per` postures [µs] out of several rounds."""
    function()
    best, spent = np.inf, 0.0
    while spent < 5 * least:
        start = time.perf_counter()
        function()
        best = min(best, time.perf_counter() - start)
        spent += max(best, 1e-6)
    return 1e6 * best / per


def cost() -> None:
    """Prints the cost per posture of each method for growing chains."""
    head = ("joints", "sum", "8 terms", "RNEA call", "band", "dense inverse")
    print("\nstatic torques, µs a posture (band and inverse: solving alone, matrix given)")
    print("".join(f"{h:>14}" for h in head))
    for n in (12, 24, 60, 120, 240):
        tree, m = chain(n), max(200, 20000 // n)
        rng = np.random.default_rng(2)
        angles = rng.uniform(-0.5, 0.5, (m, n))
        v, a = rng.normal(size=(2, m, 6 + n))
        base = np.tile(np.eye(3), (m, 1, 1))
        state = (GRAVITY, base, angles, v, a)
        ours = microseconds(
            lambda s=state, t=tree: torques_batch(t, np.zeros(len(t.mass) - 1), *s, NO_LOADS), m
        )
        none = np.zeros((n + 1, 6))
        terms = microseconds(
            lambda s=state, t=tree, w=none: torque_terms_batch(
                t, np.zeros(len(w) - 1), np.arange(len(w)), *s, w
            ),
            m,
        )
        model, data = in_pinocchio(tree, False)
        q, rate = angles[0], v[0, 6:]
        call = microseconds(lambda x=model, d=data, q=q, r=rate: pin.rnea(x, d, q, r, r))
        A, w, axes = structure(tree, q)
        ab = banded(A)
        band = microseconds(lambda ab=ab, w=w: solve_banded((0, 8), ab, w, check_finite=False))
        dense = microseconds(lambda A=A, w=w: np.linalg.inv(A) @ w)
        f = solve_banded((0, 8), ab, w).reshape(n, 6)
        still = np.zeros((1, 6 + n))
        want = torques_batch(
            tree, np.zeros(n), GRAVITY, base[:1], angles[:1], still, still, NO_LOADS
        )
        miss = np.max(np.abs(np.sum(axes * f[:, 3:], axis=1) - want[0, 6:]))
        print(
            "".join(f"{x:14.2f}" for x in (n, ours, terms, call, band, dense)), f"  |Δτ| {miss:.0e}"
        )


def published() -> None:
    """Prints Table 5 side by side, and the circle drawn by the tip."""
    robot = snakegen.load("arm6")
    signs, peaks, short = np.tile([1.0, -1.0], 6), np.zeros(12), np.zeros(12)
    for t in np.linspace(0, 2, 401):
        q = 0.2 * np.sin(np.pi * t) * signs
        v, a = 0.2 * np.pi * np.cos(np.pi * t) * signs, -(np.pi**2) * q
        given = {"gravity": (0, 0, 0)}
        peaks = np.maximum(peaks, np.abs(joint_torques(robot, q, v, a, **given)))
        part = joint_torques(robot, q, v, a, terms="quasi_static", **given)
        short = np.maximum(short, np.abs(part))
    print(
        "\nZS24 Table 5, a reconstruction: peaks [N mm] of the full law, and of J β (eq 24) alone"
    )
    for i in range(12):
        off = 100 * (peaks[i] / TABLE_5[i] - 1)
        print(
            f"  joint {i + 1:2d}  paper {1e3 * TABLE_5[i]:8.2f}  full {1e3 * peaks[i]:8.2f} "
            f"({off:+5.2f} %)  J β {1e3 * short[i]:6.2f}"
        )
    for gain, corrections in ((0.0, 0), (10.0, 0), (10.0, 1)):
        options = reach.Options(gain=gain, corrections=corrections)
        error = reach.analyze(robot, np.zeros(12), duration=5.0, options=options).track.error
        what = f"gain {gain:g}/s, {corrections} corrections"
        print(f"circle of 50 mm in 5 s at 10 ms, {what}: {1e3 * error.max():.4f} mm at most")


def in_mujoco() -> None:
    """Prints Table 3's motion by MuJoCo's servos and inverse dynamics against the law."""
    robot = snakegen.load("arm6")
    print("\nTable 3's motion in MuJoCo: largest gap to the law as a share of each joint's peak")
    for lead in ("law", "speed", "none"):
        rec = run(robot, "table3", options={"lead": lead})
        m = rec.metrics
        print(
            f"  servos led by {lead:5s}  {100 * m['torque_gap_share']:8.3f} %  (law of the motion "
            f"made {m['made_gap_share']:.0e}, inverse dynamics {m['inverse_gap_share']:.0e}, "
            f"tracking {1e3 * m['joint_tracking_max_rad']:.3f} mrad)"
        )
    law = np.abs(run(robot, "table3").channel("joint_torque").values).max(axis=0)
    print("  servos' peaks [N mm]:", " ".join(f"{1e3 * x:.1f}" for x in law))
    rec = run(robot, "tip_path")
    tip, ik = rec.metrics["position_max_m"], rec.metrics["ik_error_max_m"]
    print(
        f"50 mm circle under gravity by the servos: tip {1e3 * tip:.4f} mm off, IK {1e3 * ik:.4f}"
    )


def friction() -> None:
    """Prints what dry friction makes of Table 3's torques, and whether it explains Table 5."""
    robot = snakegen.load("arm6")
    rec = run(robot, "table3", options={"friction": "0.1,0.06"})
    time, rate = rec.time, rec.channel("joint_rate").values
    gap = rec.channel("joint_torque").values - rec.channel("joint_torque_law").values
    print("\nfriction 0.1 N·m static, 0.06 sliding: servos less law [N mm], joints 1 and 12")
    for t in (0.25, 0.4, 0.48, 0.49, 0.51, 0.52, 0.6, 0.75):
        k = int(np.argmin(np.abs(time - t)))
        print(f"  t {t:4.2f} s  rate {rate[k, 0]:+.3f} rad/s  ", (1e3 * gap[k, [0, 11]]).round(1))
    plain = np.abs(run(robot, "table3").channel("joint_torque_law").values).max(axis=0)
    off = 1e3 * (TABLE_5 - plain)
    print("Table 5 less the law without friction [N mm]:", " ".join(f"{x:+.1f}" for x in off))
    print("the same as a share of the law [%]:", " ".join(f"{x:+.1f}" for x in off / plain / 10))


def tendons() -> None:
    """Prints what MuJoCo says of postures held by cables."""
    robot = snakegen.load("arm6")
    rng = np.random.default_rng(3)
    worst, held = np.zeros(3), 0
    with tempfile.TemporaryDirectory() as folder:
        for k in range(20):
            q = rng.uniform(-0.4, 0.4, 12)
            path = Path(folder) / f"{k}.xml"
            try:
                found = cables.analyze(robot, q, mjcf=path)
            except AnalysisError:
                continue
            held += 1
            torque = [found.held.torque[n] for n in found.joints]
            miss = np.max(np.abs(torque - found.torque))
            worst = np.maximum(worst, [miss, found.held.acceleration, found.held.drift])
    print(
        f"\ncables as MuJoCo tendons, {held} of 20 random postures under gravity can be held: "
        f"torque {worst[0]:.0e} N·m off, acceleration {worst[1]:.0e} rad/s², "
        f"drift in 1 s {worst[2]:.0e} rad"
    )


if __name__ == "__main__":
    agreement()
    cost()
    published()
    in_mujoco()
    friction()
    tendons()
