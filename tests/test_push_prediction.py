"""Predictions of a push: loads, rays to the limits, and joints, against independent forms."""

import numpy as np
import pytest

from snakegen import load
from snakegen.analysis.allocation import allocation
from snakegen.control.controller import flight_controller
from snakegen.control.frame import cog_frame
from snakegen.errors import SnakegenError
from snakegen.kernels.allocation.ball_allocation import ball_allocation
from snakegen.kernels.allocation.box_allocation import box_within
from snakegen.kernels.allocation.gimbals import joint_order
from snakegen.kernels.core.types import Body
from snakegen.kernels.dynamics.joint_loads import JointLoads, force_loads
from snakegen.kernels.kinematics.chain import centre_of_gravity, forward
from snakegen.simulation.flight.postures import bent, place
from snakegen.simulation.flight.run import prepare
from snakegen.simulation.push.prediction import forecast
from snakegen.spec.loading import load_spec
from snakegen.statics.joint_loads import joint_loads
from snakegen.statics.joint_torques import joint_torques
from snakegen.wrench_margins.controller import vectored_controller
from snakegen.wrench_margins.rays import Bounds, inverse_ray, thrust_ray, vectored_ray
from snakegen.wrench_margins.thrust import thrust_margins

AXES = ("roll", "pitch")


@pytest.fixture(scope="module")
def robot():
    return load("dragon4")


@pytest.fixture(scope="module")
def hover(robot):
    return place(robot, bent(robot), np.array([0.0, 0.0, 1.0]))


def force_map(a):
    return np.hstack([np.vstack([np.eye(3), np.cross(p, np.eye(3)).T]) for p in a.thrust_points])


@pytest.mark.parametrize("link", ["link1", "link3"])
def test_loads_are_those_of_the_law(robot, hover, link):
    rng = np.random.default_rng(3)
    loads = joint_loads(robot, hover, link)
    thrust, push = rng.uniform(0, 10, 8), rng.standard_normal(6)
    rotation, position = forward(robot.tree, *robot.base_pose(hover), robot.angles(hover))
    _, cog = centre_of_gravity(robot.tree, rotation, position)
    body, _, origin = robot.body_of_link(link)
    lever = cog - position[body] - rotation[body] @ origin
    wrench = np.r_[push[:3], push[3:] + np.cross(lever, push[:3])]
    law = joint_torques(robot, hover, terms="static", thrust=thrust, wrenches={link: wrench})[6:]
    rows = [robot.joint_names.index(n) for n in loads.names]
    mine = loads.bias + loads.rotors @ thrust + loads.disturbance @ push
    np.testing.assert_allclose(mine, law[rows], atol=1e-12)
    assert np.any(np.abs(loads.disturbance) > 1e-3) == (link != "link1")


def test_kernel_and_law_give_the_same_loads(robot, hover):
    c = flight_controller(robot, allocator="constrained")
    base, origin = robot.base_pose(hover)
    rotation, position = forward(robot.tree, base, origin, robot.angles(hover))
    frame = cog_frame(c, robot.angles(hover), base, origin)
    turns = np.array(
        [
            [robot.angles(hover)[b - 1] for b in pair]
            for pair in zip(robot.gimbals.roll_body, robot.gimbals.pitch_body, strict=True)
        ]
    )
    kernel = force_loads(
        robot.tree, c.gimbals, Body(rotation, position, frame.cog, frame.axes), frame.mounts,
        joint_order(frame.mounts, turns), 9.81, c.law.joints, c.law.joint_limit,
    )  # fmt: skip
    law = joint_loads(robot, hover)
    np.testing.assert_allclose(kernel.rows, law.forces.reshape(6, -1), atol=1e-10)
    np.testing.assert_allclose(kernel.bias, law.bias, atol=1e-10)


def test_rays_meet_the_zonotope_and_the_controller_margin(robot, hover):
    a, rng = allocation(robot, hover), np.random.default_rng(5)
    scale = {"force_scale": robot.force_scale, "torque_scale": robot.torque_scale}
    q = rng.standard_normal((6, 9))
    w0 = q @ np.full(9, 5.0)
    margins = thrust_margins(q, 0.0, 10.0, w0, force_scale=50.0, torque_scale=10.0)
    for _ in range(5):
        u = rng.standard_normal(6)
        assert thrust_ray(q, 0.0, 10.0, w0, -u).t == pytest.approx(margins.directional(u), rel=1e-6)
    whole = vectored_controller(
        a.thrust_points, robot.gimbals.limit, a.hover_wrench, weights=np.ones(4), **scale
    )
    inverse = np.linalg.pinv(force_map(a))
    reaches = [
        inverse_ray(
            inverse, a.hover_wrench, np.r_[e / np.linalg.norm(e), 0, 0, 0], 0.0,
            robot.gimbals.limit, balls=True,
        ).t
        for e in rng.standard_normal((2000, 3))
    ]  # fmt: skip
    assert whole.force <= min(reaches) * (1 + 1e-9) and min(reaches) < 1.02 * whole.force


def test_the_ray_of_balls_is_where_bounded_allocation_ends(robot, hover):
    a, loads = allocation(robot, hover), joint_loads(robot, hover)
    q, rows = force_map(a), 1.0 / np.repeat([robot.force_scale, robot.torque_scale], 3)
    rng = np.random.default_rng(1)
    flat = loads.forces.reshape(len(loads.limit), -1)
    kernel = JointLoads(flat, loads.bias, loads.limit)
    for _ in range(3):
        push = np.r_[rng.standard_normal(3), 0.1 * rng.standard_normal(3)]
        bounds = Bounds(flat, loads.bias, loads.disturbance, loads.limit)
        t = vectored_ray(q, robot.gimbals.limit, a.hover_wrench, push, bounds).t
        free = vectored_ray(q, robot.gimbals.limit, a.hover_wrench, push).t
        assert 0 < t <= free * (1 + 1e-6)
        for share, reached in ((0.98, True), (1.03, False)):
            wanted = a.hover_wrench - share * t * push
            f = ball_allocation(q, wanted, rows, robot.gimbals.limit, kernel)
            met = np.linalg.norm(rows * (q @ f - wanted)) < 1e-4
            torque = np.abs(loads.bias + flat @ f)
            assert (met and np.all(torque <= loads.limit * (1 + 1e-3))) == reached


def test_a_box_with_joints_keeps_both_bounds():
    """A wrench that some thrusts within both kinds of limits give is given, within both."""
    rng = np.random.default_rng(2)
    for _ in range(5):
        q, rows, scale = rng.standard_normal((4, 8)), rng.standard_normal((2, 8)), np.ones(4)
        known = rng.uniform(2, 8, 8)
        wanted = q @ known
        limit = np.abs(rows @ known) + 0.2
        loads = JointLoads(rows, np.zeros(2), limit)
        x = box_within(q, wanted, scale, np.full(8, 10.0), np.zeros(8), np.full(8, 10.0), loads)
        assert np.all(x >= 0) and np.all(x <= 10)
        assert q @ x == pytest.approx(wanted, abs=1e-5)
        assert np.all(np.abs(rows @ x) <= limit + 1e-5)


def test_the_joint_limit_is_part_of_the_forecast(robot, hover):
    paper = forecast(robot, flight_controller(robot), hover)
    bounded = forecast(robot, flight_controller(robot, allocator="constrained"), hover)
    assert paper.held < paper.thrust_only and "joint1_yaw" in paper.stopped
    assert bounded.thrust_only * (1 + 1e-6) >= bounded.printed_margin > paper.held
    with pytest.raises(SnakegenError, match="link"):
        forecast(robot, flight_controller(robot), hover, link="link9")


def test_narrow_gimbals_have_both_sides_of_a_prediction(robot, hover):
    """Past its first gimbal at a limit the pseudo-inverse goes on, never past what any forces hold.

    A linear program allows 4.66 N in the weakest direction of this body.
    """
    narrow = load(
        load_spec("dragon4", overrides=[f"vectoring_apparatus.{a}_limit=0.05" for a in AXES])
    )
    bent = {f"joint{i}_yaw": 1.0 for i in (1, 2, 3)}
    options = {"posture": bent, "slow": 40.0}
    for allocator in ("paper", "constrained"):
        plan = prepare(narrow, "push", ideal=True, allocator=allocator, options=options).plan
        found, bounds = plan.facts["forecast"], plan.thresholds["ratio"]
        if allocator == "paper":
            beyond = found["any_forces"] / found["held"]
            assert 1.2 < beyond < 1.4 and bounds["at_most"] == pytest.approx(1.05 * beyond)
            assert found["any_forces"] == pytest.approx(4.7, rel=0.05)
        else:
            assert found["any_forces"] is None and bounds["at_most"] == 1.05
    free = forecast(robot, flight_controller(robot), hover)
    assert np.isnan(free.any_forces)
