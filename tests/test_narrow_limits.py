"""Narrow gimbals bound what attitude, along and the worst posture of a sweep print, by as much as
a linear program over sampled forces says."""

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

import snakegen
from snakegen.analysis import along, attitude
from snakegen.analysis.allocation import allocation
from snakegen.robot.posture import hover_gimbals
from snakegen.spec.loading import load_spec
from snakegen.sweep.batch import Body, evaluate
from snakegen.sweep.worst import refine

BENT = {"joint1_yaw": 1.0, "joint2_yaw": 1.0, "joint3_yaw": 1.0}
LIMIT = 0.2


def limited(limit):
    fields = [f"vectoring_apparatus.{k}_limit={limit}" for k in ("roll", "pitch")]
    return snakegen.load(load_spec("dragon4", overrides=fields))


@pytest.fixture(scope="module")
def robots():
    return {limit: limited(limit) for limit in (LIMIT, np.pi)}


def columns(robot, q, limit):
    """Returns wrenches (6, k) at full thrust of sampled gimbal angles, and their apparatus."""
    a = allocation(robot, q)
    if limit > 3.0:  # any direction
        units = Rotation.random(800, random_state=0).as_matrix()[:, 2]
    else:
        phi, theta = (x.ravel() for x in np.meshgrid(*[np.linspace(-limit, limit, 13)] * 2))
        units = np.array([np.sin(theta), -np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)])
        units = units.T
    out, owner = [], []
    for j, point in enumerate(a.thrust_points):
        f = robot.gimbals.limit[j] * units @ a.link_axes[j].T
        out.append(np.hstack([f, np.cross(point, f)]))
        owner += [j] * len(f)
    return np.vstack(out).T, np.array(owner), a.hover_wrench


def force_margin(robot, q, limit, starts=10):
    """Returns the radius of the force ball: from spread directions to the facets that they hit.

    A facet hit along e with normal d, d · e = 1, lies t / ‖d‖ away along d.
    """
    wrenches, owner, hover = columns(robot, q, limit)
    share = np.eye(owner.max() + 1)[owner].T
    rng, best = np.random.default_rng(0), np.inf
    for e in rng.normal(size=(starts, 3)):
        before = np.inf
        for _ in range(8):
            push = np.r_[e / np.linalg.norm(e), 0, 0, 0]
            found = linprog(
                np.r_[np.zeros(len(owner)), -1.0],
                A_eq=np.column_stack([wrenches, -push]),
                b_eq=hover,
                A_ub=np.column_stack([share, np.zeros(len(share))]),
                b_ub=np.ones(len(share)),
            )
            t, e = found.x[-1], found.eqlin.marginals[:3]
            best = min(best, t)
            if t >= before * (1.0 - 1e-6):
                break
            before = t
    return best


def at(robot, posture, rpy=(0.0, 0.0, 0.0)):
    return hover_gimbals(robot, robot.configuration(posture, base_rpy=rpy))


@pytest.mark.parametrize("limit", [LIMIT, np.pi])
def test_the_best_attitude_counts_them(robots, limit):
    robot = robots[limit]
    found = attitude.analyze(robot, at(robot, BENT), margin="force_margin", samples=4)
    expected = force_margin(robot, at(robot, BENT), limit)
    # sampled balls are smaller than balls, sampled sectors' hulls larger than sectors
    assert found.level == pytest.approx(expected, rel=0.02 if limit < 1.0 else 0.04)
    assert (20.0 > found.level > 15.0) if limit < 1.0 else (found.level > 44.0)
    tilted = force_margin(robot, at(robot, BENT, found.rpy), limit)
    assert found.best == pytest.approx(tilted, rel=0.02 if limit < 1.0 else 0.04)


def test_margins_along_a_motion_count_them(robots, tmp_path):
    table = tmp_path / "way.csv"
    table.write_text("joint1_yaw,joint2_yaw,joint3_yaw\n1.0,1.0,1.0\n0.5,1.0,1.2\n")
    ends = (BENT, {"joint1_yaw": 0.5, "joint2_yaw": 1.0, "joint3_yaw": 1.2})
    for limit, robot in robots.items():
        found = along.analyze(robot, at(robot, BENT), table=str(table), step=0.5)
        values = found.values["force_margin"][[0, -1]]
        expected = [force_margin(robot, at(robot, p), limit) for p in ends]
        np.testing.assert_allclose(values, expected, rtol=0.02 if limit < 1.0 else 0.04)


def test_the_worst_posture_of_a_sweep_counts_them(robots, monkeypatch):
    """The least margin of a few neighbours of a bend, found with and without the limits.

    Not down the slope: at its end the margin is near 0, where sampled sectors are too coarse.
    """
    monkeypatch.setattr("snakegen.sweep.worst.POLISH", 0)
    rows = np.tile([0.0, 1.0], (3, 3)) + np.array([[0.0], [0.05], [-0.05]])
    worst = {}
    for limit, robot in robots.items():
        assert [n.endswith("pitch") for n in robot.chain_joints] == [True, False] * 3
        body = Body.of(robot, robot.chain_joints, np.eye(3), 1e-3)
        worst[limit] = refine(body, evaluate(body, rows), "force_margin", rounds=2)
        posture = dict(zip(worst[limit].joints, worst[limit].angles, strict=True))
        if worst[limit].feasible:
            expected = force_margin(robot, at(robot, posture), limit)
            assert worst[limit].upper == pytest.approx(expected, rel=0.03)
            assert worst[limit].lower <= worst[limit].upper <= worst[limit].sampled
        else:  # the program agrees that hover itself is out of reach
            wrenches, owner, hover = columns(robot, at(robot, posture), limit)
            share = np.eye(owner.max() + 1)[owner].T
            no = linprog(np.zeros(len(owner)), A_ub=share, b_ub=np.ones(len(share)),
                         A_eq=wrenches, b_eq=hover)  # fmt: skip
            assert no.status == 2 and worst[limit].wrench < 0.0
    assert worst[np.pi].lower > 30.0 and not worst[LIMIT].lower > 20.0
