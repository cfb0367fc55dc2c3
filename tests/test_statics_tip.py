"""What the tip of an arm can carry, how it yields, and where it carries least."""

import numpy as np
import pytest
from scipy.optimize import linprog

import snakegen
from snakegen.analysis import statics
from snakegen.analysis.statics import analyze, joint_torques
from snakegen.kernels.margins import tip_polytope
from snakegen.statics.tip import find_tip, tip_pose

ROBOTS = ("arm6", "grasper3", "dragon4", "dragon3")


@pytest.fixture(scope="module")
def robots():
    return {name: snakegen.load(name) for name in ROBOTS}


def test_tip_polytope_against_linear_programs(robots):
    robot = robots["arm6"]
    q = np.random.default_rng(8).uniform(-0.5, 0.5, 12)
    result = analyze(robot, q)
    tip = find_tip(robot)
    J = tip_pose(robot, q, tip).jacobian[:3]
    limit, load = result.limit, result.tip_load
    rng = np.random.default_rng(9)
    directions = rng.normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    t = tip_polytope.capacity(J, result.torque, limit, directions)
    assert np.all(t >= load.force_radius - 1e-9)
    toward = tip_polytope.capacity(J, result.torque, limit, load.force_direction[None])[0]
    assert toward == pytest.approx(load.force_radius)
    A, b = np.vstack([-J.T, J.T]), np.r_[limit - result.torque, limit + result.torque]
    for u, got in zip(directions[:20], t, strict=False):
        column = (A @ u)[:, None]
        want = linprog([-1.0], A_ub=column, b_ub=b, bounds=[(0, None)])
        assert got == pytest.approx(-want.fun)
        reach = linprog(-u, A_ub=A, b_ub=b, bounds=[(None, None)] * 3)
        assert np.max(load.corners @ u) == pytest.approx(-reach.fun, rel=1e-8)
    # Payload: hang it at the tip, and one servo stands exactly at its limit.
    weight = np.array([0, 0, -9.81 * load.payload])
    lever = tip_pose(robot, q, tip).rotation @ tip.point
    wrench = np.r_[weight, np.cross(lever, weight)]
    tau = joint_torques(robot, q, wrenches={"link7": wrench}, terms="static")
    assert np.max(np.abs(tau) / limit) == pytest.approx(1.0)


def test_stiffness_is_what_servos_yield(robots):
    robot = robots["arm6"]
    q = np.random.default_rng(10).uniform(-0.5, 0.5, 12)
    load = analyze(robot, q, gravity=(0, 0, 0)).tip_load
    J = tip_pose(robot, q, find_tip(robot)).jacobian
    w = np.array([1.0, -2.0, 0.5, 0.1, 0.2, -0.1])
    bend = J.T @ w / 2000.0  # the preset's servo stiffness
    h = 1e-3
    moved = tip_pose(robot, q + h * bend, find_tip(robot)).position
    back = tip_pose(robot, q - h * bend, find_tip(robot)).position
    np.testing.assert_allclose((load.compliance @ w)[:3], (moved - back) / (2 * h), rtol=1e-5)
    np.testing.assert_allclose(load.stiffness @ load.compliance @ w, w, rtol=1e-6)
    sag = analyze(robot, q).tip_load.sag
    assert sag[2] < 0  # it hangs


def test_straight_arm_feels_no_pull_along_itself(robots):
    robot = robots["arm6"]
    load = analyze(robot, np.zeros(12)).tip_load
    np.testing.assert_allclose(np.abs(load.free.T), [[1, 0, 0]], atol=1e-12)
    assert np.all(np.isinf(load.axes_force[:2])) and np.all(np.isfinite(load.axes_force[2:]))
    assert len(load.corners) >= 4


def test_worst_posture_is_worse_than_random_ones(robots):
    robot = robots["arm6"]
    straight = analyze(robot, np.zeros(12))
    worst = analyze(robot, np.zeros(12), worst=True).worst
    # Under gravity alone the stretched arm is the worst: level, its whole weight on joint 1.
    assert worst["use"] == pytest.approx(straight.use.max(), rel=1e-3)
    assert worst["joint"] == "joint1_pitch" and worst["agreeing"] >= 1
    pull = {"link7": [30.0, 0.0, 0.0, 0.0, 0.0, 0.0]}
    found = statics.worst_posture(robot, np.zeros(12), wrenches=pull, gravity=(0, 0, 0))
    limit = robot.limits(robot.joint_names)[1]
    rng = np.random.default_rng(11)
    best = 0.0
    for q in rng.uniform(-limit, limit, (2000, 12)):
        tau = joint_torques(robot, q, wrenches=pull, gravity=(0, 0, 0), terms="static")
        best = max(best, np.max(np.abs(tau) / 40.0))
    assert found["use"] >= best
    there = robot.configuration(found["posture"])
    tau = joint_torques(robot, there, wrenches=pull, gravity=(0, 0, 0), terms="static")
    assert np.max(np.abs(tau) / 40.0) == pytest.approx(found["use"], rel=1e-9)


def test_tip_bears_any_wrench_of_the_radius_and_no_more(robots):
    robot = robots["arm6"]
    q = 0.3 * np.sin(np.arange(12.0))
    load = analyze(robot, q).tip_load
    pose = tip_pose(robot, q, find_tip(robot))
    static = joint_torques(robot, q, terms="static")
    units = np.random.default_rng(5).normal(size=(4000, 6))
    units /= np.linalg.norm(units, axis=1)[:, None]
    scale = np.r_[np.ones(3), np.full(3, load.lever)]
    felt = np.abs(static - (load.wrench_radius * units * scale) @ pose.jacobian)
    assert np.max(felt) <= 40.0 + 1e-9
    joint = robot.joint_names.index(load.wrench_joint)
    row = pose.jacobian[:, joint] * scale
    worst = -np.sign(static[joint]) * row / np.linalg.norm(row)
    reached = static - (load.wrench_radius * worst * scale) @ pose.jacobian
    assert abs(reached[joint]) == pytest.approx(40.0, rel=1e-9)
    # Every corner of both sets brings joints to their limits, and none beyond.
    for corners, J in (
        (load.corners, pose.jacobian[:3]),
        (load.torque_corners, pose.jacobian[3:]),
    ):
        felt = np.abs(static - corners @ J)
        assert np.all(felt <= 40.0 + 1e-6)
        assert np.all(np.sum(felt > 40.0 - 1e-6, axis=1) >= 3)


def test_tip_polytopes_are_drawn(robots, tmp_path):
    from matplotlib.image import imread

    from snakegen.report.tip_chart import Set, tip_polytope_chart

    robot = robots["arm6"]
    for k, q in enumerate((np.zeros(12), 0.3 * np.sin(np.arange(12.0)))):
        load = analyze(robot, q).tip_load  # stretched out the sets are flat
        one = Set("force", "N", load.corners, load.force_radius, load.free)
        path = tip_polytope_chart(tmp_path / f"{k}.png", [one])
        picture = imread(path)[..., :3]
        blue = (picture[..., 2] > picture[..., 0] + 0.15).mean()
        assert blue > 0.005
        assert tip_polytope_chart(tmp_path / "again.png", [one]).read_bytes() == path.read_bytes()
