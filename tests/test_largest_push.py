"""Statics of bodies whose gimbals turn, and the largest push by least forces."""

from dataclasses import replace

import numpy as np
import pytest

from snakegen.analysis import wrench_margin
from snakegen.analysis.allocation import allocation
from snakegen.analysis.push_margins import servo_bounds
from snakegen.robot.posture import hover_gimbals, set_angle
from snakegen.robot.robot import load
from snakegen.simulation.flight.postures import place
from snakegen.simulation.push.informed import true_points
from snakegen.statics.joint_torques import joint_torques
from snakegen.statics.largest_push import largest_push
from snakegen.statics.vectored_body import vectored_body, with_draw
from snakegen.wrench_margins.inputs import force_map
from snakegen.wrench_margins.rays import vectored_ray

ODD = {
    "joint1_pitch": -0.23, "joint1_yaw": 0.92, "joint2_pitch": 0.22,
    "joint2_yaw": -1.07, "joint3_pitch": -0.22, "joint3_yaw": -0.91,
}  # fmt: skip
PUSH = np.array([3.0, -1.0, 2.0, 0.2, 0.4, -0.3])


@pytest.fixture(scope="module")
def robot():
    return load("dragon4")


@pytest.fixture(scope="module")
def hover(robot):
    return hover_gimbals(robot, robot.configuration(ODD))


def settings(body, seed):
    """Returns random thrusts and gimbal angles."""
    rng = np.random.default_rng(seed)
    x = body.start()
    x[:4] = rng.uniform(5.0, 30.0, 4)
    x[4:] += rng.uniform(-1.0, 1.0, 8)
    return x


def turned(robot, body, q, x):
    """Returns q with the gimbals of settings x."""
    out = np.array(q)
    for joint, angle in zip(body.moved, x[4:], strict=True):
        set_angle(robot, out, robot.joint_names[joint], float(angle))
    return out


def test_wrench_and_torques_are_those_of_the_turned_body(robot, hover):
    """Against the allocation map and the general law at gimbals far from the hover's."""
    body = vectored_body(robot, hover, PUSH, "link3")
    for seed in range(3):
        x = settings(body, seed)
        q = turned(robot, body, hover, x)
        wrench, torque, pushed = body.balance(x)
        thrust = np.repeat(x[:4] / 2.0, 2)
        a = allocation(robot, q)
        made = a.dual @ thrust - a.hover_wrench
        base = robot.base_pose(q)[0]
        assert np.r_[base.T @ wrench[:3], base.T @ wrench[3:]] == pytest.approx(made, abs=1e-9)
        rows = [robot.joint_names.index(n) for n in body.joints]
        law = joint_torques(robot, q, terms="static", thrust=thrust)[6:][rows]
        assert torque == pytest.approx(law, abs=1e-9)
        bounds, names = servo_bounds(robot, q, "link3", True)
        assert list(body.joints) == names
        assert pushed == pytest.approx(bounds.wrench @ PUSH, abs=1e-9)


def test_slopes_are_finite_differences(robot, hover):
    body = vectored_body(robot, hover, PUSH, "link1")
    x, way = settings(body, 4), np.random.default_rng(5).standard_normal(12)
    by_wrench, by_torque = body.slopes(x)
    ends = [body.balance(x + s * 1e-5 * way) for s in (1.0, -1.0)]
    for k, slope in ((0, by_wrench), (1, by_torque)):
        assert slope @ way == pytest.approx((ends[0][k] - ends[1][k]) / 2e-5, abs=1e-5)


def test_the_largest_push_is_held_and_a_larger_one_is_not(robot, hover):
    """Held: by the statics of another module. The gimbals have turned, and it matters."""
    found = wrench_margin.analyze(robot, hover, allocator="constrained")
    margin = found.push["virtual_single_rotor"].prediction("torque", "constrained")[1]
    push = np.array(margin.push)
    body = vectored_body(robot, hover, push, "link1")
    end = largest_push(body, margin.value)
    assert end.t == pytest.approx(margin.followed, rel=2e-3)
    q = turned(robot, body, hover, end.x)
    a = allocation(robot, q)
    made = a.dual @ np.repeat(end.x[:4] / 2.0, 2)
    assert made == pytest.approx(a.hover_wrench - end.t * push, abs=1e-3)
    assert np.all(end.x[:4] <= 32.0 * (1 + 1e-9))
    assert np.abs(end.x[4:] - body.start()[4:]).max() > 0.2
    frozen = vectored_ray(
        force_map(a.thrust_points, a.drag), robot.gimbals.limit, a.hover_wrench, push
    ).t
    assert end.t <= frozen * (1 + 1e-6), "points of the end: a linear program holds no less"
    assert abs(end.t / margin.value - 1.0) > 0.02


def test_narrow_gimbals_and_weak_servos_hold_less(robot, hover):
    margin = wrench_margin.analyze(robot, hover).push["virtual_single_rotor"].kinds["force"]
    push, guess = np.array(margin["exact_servo"].push), margin["exact_servo"].value
    body = vectored_body(robot, hover, push, "link1")
    free = largest_push(body, guess).t
    weak = replace(body, least=0.7 * body.least, most=0.7 * body.most)
    low, high = body.lower.copy(), body.upper.copy()
    low[4:], high[4:] = body.start()[4:] - 0.2, body.start()[4:] + 0.2
    narrow = replace(body, lower=low, upper=high)
    assert largest_push(weak, guess).t < 0.9 * free
    assert 0.0 < largest_push(narrow, guess).t < 0.98 * free


def test_a_body_without_hover_holds_nothing(robot, hover):
    body = vectored_body(robot, hover, PUSH, "link1")
    heavy = replace(body, upper=np.concatenate([np.full(4, 10.0), body.upper[4:]]))
    assert np.isnan(largest_push(heavy, 1.0).t)


def test_the_draw_moves_thrust_points_and_limits(robot, hover):
    body, rng = vectored_body(robot, hover, PUSH, "link1"), np.random.default_rng(2)
    factors = rng.uniform(0.9, 1.1, 8)
    offsets = np.full(len(body.most), 0.5)
    drawn = with_draw(body, factors, offsets)
    points, drag = true_points(robot, allocation(robot, hover), factors)
    x = body.start()
    thrust = (x[:4] / 2.0)[robot.rotors.apparatus] * factors
    made = allocation(robot, hover).dual @ thrust - allocation(robot, hover).hover_wrench
    base = robot.base_pose(hover)[0]
    wrench = drawn.balance(x)[0]
    assert np.r_[base.T @ wrench[:3], base.T @ wrench[3:]] == pytest.approx(made, abs=1e-9)
    assert points.shape == (4, 3) and drawn.drag == pytest.approx(drag)
    assert drawn.most == pytest.approx(body.most - 0.5) and drawn.least == pytest.approx(body.least)
    nominal = with_draw(body, np.ones(8), np.zeros(0))
    assert nominal.balance(x)[0] == pytest.approx(body.balance(x)[0], abs=1e-12)
    assert nominal.upper == pytest.approx(body.upper)


def test_the_page_names_the_prediction_that_the_push_takes(robot):
    start = place(robot, np.array([ODD[n] for n in sorted(ODD)]), np.array([0.0, 0.0, 4.0]))
    found = wrench_margin.analyze(robot, start, allocator="constrained")
    rows = dict(found.rows())
    assert "as gimbals follow, margin" in rows["prediction for push"]
    out = found.to_json()["prediction"]
    assert out["torque"]["followed"] != pytest.approx(out["torque"]["value"], rel=1e-3)
    assert "followed" not in wrench_margin.analyze(robot, start).to_json()["prediction"]["torque"]
