"""The proved bound on the hardest posture: never below any posture, close to the hardest found."""

import numpy as np
import pytest

from snakegen.analysis.statics import joint_torques
from snakegen.base.geometry import rotation_about
from snakegen.kernels.margins import sublinear
from snakegen.robot.robot import load
from snakegen.spec.loading import load_spec
from snakegen.statics.worst import worst_posture
from snakegen.statics.worst_bound import use_bound

POINTS = np.random.default_rng(0).normal(size=(12, 3))


def support(d):
    """Support function of a dozen points: kinks everywhere."""
    return np.max(d @ POINTS.T, axis=-1)


def unit(rng, count):
    d = rng.normal(size=(count, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


@pytest.mark.parametrize("m", [1, 5, 40])
def test_a_table_is_never_below_its_function(m):
    table = support(sublinear.grid(m))
    d = unit(np.random.default_rng(1), 2000)
    read = np.array([sublinear.read_table(table, *x) for x in d])
    assert (read - support(d)).min() > -1e-12
    widest = np.linalg.norm(POINTS[:, None] - POINTS, axis=-1).max()
    assert (read - support(d)).max() < widest / m  # half a cell's width, at a kink
    on = sublinear.grid(m).reshape(-1, 3)
    np.testing.assert_allclose(
        [sublinear.read_table(table, *x) for x in on], support(on), atol=1e-12
    )
    far = sublinear.read_table(table, *(3.0 * d[0]))
    assert far == pytest.approx(3.0 * sublinear.read_table(table, *d[0]), rel=1e-12)


@pytest.mark.parametrize("step", [0.6, 0.02])
def test_the_largest_over_a_joint_is_never_below_a_dense_sweep(step):
    """Plain NumPy beside the kernel; at a coarse step the polygon about the arc must do it."""
    rng = np.random.default_rng(2)
    table = support(sublinear.grid(60))
    for _ in range(20):
        mount = rotation_about(unit(rng, 1)[0], rng.uniform(0, 3))
        axis, d = unit(rng, 2)
        low, high = np.sort(rng.uniform(-3, 3, 2))
        turns = [mount @ rotation_about(axis, t) for t in np.linspace(low, high, 400)]
        dense = max(float(support(R.T @ d)) for R in turns)
        found = sublinear.highest(table, d, mount, axis, low, high, step)
        assert found >= dense - 1e-12
        if step < 0.1:
            assert found <= dense + 0.01 * np.linalg.norm(POINTS, axis=1).max()


def random_use(robot, q, count, wrenches, gravity, seed=3):
    """Returns the largest use over random postures by the law of statics itself."""
    names = robot.chain_joints
    low, high, limit = robot.limits(names)
    at = [6 * robot.floating + robot.joint_names.index(n) for n in names]
    rng, best = np.random.default_rng(seed), 0.0
    for k in range(count):
        share = rng.random(len(names)) if k % 2 else rng.integers(0, 2, len(names))  # corners too
        angles = low + share * (high - low)
        there = robot.configuration(dict(zip(names, angles, strict=True)))
        there[: 7 * robot.floating] = q[: 7 * robot.floating]
        tau = joint_torques(robot, there, wrenches=wrenches, gravity=gravity, terms="static")
        best = max(best, float(np.max(np.abs(tau[at]) / limit)))
    return best


DOWN = (0.0, 0.0, -9.81)
CASES = {
    "narrow limits": ("arm6", ["joint.upper=0.3"], None, DOWN),
    "a load along gravity": ("arm6", [], "link7=0,0,-5,0,0,0", DOWN),
    "loads aside": ("arm6", ["joint.upper=0.5"], "link7=2,1,-3,0.2,0,0.1; link4=0,4,0,0,0,0", DOWN),
    "no gravity": ("arm6", [], "link7=3,0,-5,0,0,0", (0.0, 0.0, 0.0)),
    "gravity aside": ("screw4", [], None, (3.0, -2.0, -9.0)),
    "gimbals held": ("dragon4", ["joint.upper=0.4"], None, DOWN),
}


@pytest.mark.parametrize("case", CASES)
def test_no_posture_is_worse_than_the_bound(case):
    preset, overrides, wrenches, gravity = CASES[case]
    robot = load(load_spec(preset, overrides=overrides))
    tilt = {"base_rpy": (0.3, -0.5, 0.7)} if robot.floating else {}
    q = robot.configuration(tilt)
    given = {"wrenches": wrenches, "gravity": gravity}
    bound = use_bound(robot, q, **given)
    assert random_use(robot, q, 400, wrenches, gravity) <= bound
    found = worst_posture(robot, q, hold="base", samples=256, starts=6, **given)
    assert found["use"] <= bound == found["use_bound"]
    if case == "loads aside":
        assert bound < 1.5 * found["use"]  # levers know nothing of the posture
    else:
        assert bound < 1.003 * found["use"]


def test_the_bound_tightens_with_its_grid_and_knows_the_stretched_arm():
    robot = load("arm6")
    q = robot.configuration()
    level = np.max(np.abs(joint_torques(robot, q, terms="static")) / 40.0)
    coarse, fine = (use_bound(robot, q, spacing=m, step=s) for m, s in ((8, 0.3), (60, 0.02)))
    assert level <= fine < coarse
    assert fine == pytest.approx(level, rel=6e-4)


def test_hover_has_no_bound():
    robot = load("dragon4")
    found = worst_posture(robot, robot.configuration(), samples=16, starts=1)
    assert found["support"] == "hover" and found["use_bound"] is None
