"""Bounds that can fail: what each planted fault does to a verdict, and what a bound scales with."""

import copy
from dataclasses import replace

import numpy as np
import pytest

from snakegen.kernels.kinematics.chain import centre_of_gravity, forward
from snakegen.robot.robot import load
from snakegen.simulation.flight.bounds.error_budget import (
    expected_errors,
    integral_limits,
    lags,
    sources,
)
from snakegen.simulation.flight.bounds.flight_bounds import TABLES, TRIM
from snakegen.simulation.flight.plant import Imperfections, bounded_normal, draw
from snakegen.simulation.flight.run import prepare
from snakegen.spec.loading import load_spec

SHORT = {"duration": 3.0, "trim": 10.0}


@pytest.fixture(scope="module")
def hover():
    return prepare(load("dragon4"), "hover", options=SHORT)


def flown(ready, seed=0, world=None, what=None):
    rng = np.random.default_rng(seed)
    plant = what or ready.imperfections
    return ready.flown(world or ready.world(), plant, rng, seed, margins=False)


def failed(recording):
    return {c.metric: c for c in recording.verdict.failed}


def test_a_good_flight_passes(hover):
    for seed in (0, 3):
        assert flown(hover, seed).verdict.passed, flown(hover, seed).verdict.summary()


def test_a_rotor_that_turns_the_wrong_way_is_trimmed_out_but_seen(hover):
    """Its drag torque has the other sign: 2 κ λ about z, which only the yaw integral shows."""
    world = hover.world()
    model = copy.copy(world.model)
    model.actuator_gear[world.rotors[0], 5] *= -1.0
    checks = failed(flown(hover, 0, replace(world, model=model)))
    assert set(checks) == {"trim_sigmas", "hover_sigmas"}
    assert checks["hover_sigmas"].worst.part == "yaw"
    assert checks["trim_sigmas"].worst.part == "yaw"
    held = flown(hover, 0, replace(world, model=model)).meta["trim"]["torque_integral_rad_s2"][2]
    usual = flown(hover, 0).meta["trim"]["torque_integral_rad_s2"][2]
    q = hover.plan.start
    inertia = load("dragon4").model  # yaw inertia from Pinocchio, not from the code under test
    import pinocchio as pin

    data = inertia.createData()
    yaw = pin.ccrba(inertia, data, q, np.zeros(inertia.nv)) is not None and data.Ig.inertia[2, 2]
    expected = 2.0 * 0.0125 * 8.0 * 9.81 / 8.0 / yaw
    assert abs(held - usual) == pytest.approx(expected, rel=0.15)


def test_it_is_seen_without_a_trim_as_well():
    ready = prepare(load("dragon4"), "hover", options={"duration": 4.0})
    world = ready.world()
    model = copy.copy(world.model)
    model.actuator_gear[world.rotors[0], 5] *= -1.0
    for seed in (0, 1):
        assert flown(ready, seed).verdict.passed
        turned = failed(flown(ready, seed, replace(world, model=model)))
        assert turned["hover_sigmas"].worst.part == "yaw"


@pytest.mark.parametrize("mission", ["hover", "transform"])
def test_fifteen_per_cent_of_mismatch_fail(mission):
    robot = load(load_spec("dragon4", overrides=["plant.thrust_mismatch=0.15"]))
    ready = prepare(robot, mission)
    bounds = prepare(load("dragon4"), mission).plan.thresholds
    assert ready.plan.thresholds == bounds, "what a plant declares does not move its bounds"
    assert failed(flown(ready, 1)).keys() & {"attitude_rmse_norm_rad", "trim_sigmas"}


def test_an_imu_off_by_a_twentieth_of_a_radian_fails_and_names_the_axis(hover):
    what = replace(hover.imperfections, attitude_bias=0.05 / 1.5)
    seed = next(s for s in range(200) if _bias(s)[0] > 1.4 and max(_bias(s)[1:]) < 0.7)
    checks = failed(flown(hover, seed, what=what))
    assert checks["attitude_rmse_rad"].worst.part == "roll"


def _bias(seed):
    rng = np.random.default_rng(seed)
    rng.standard_normal(8)
    return np.abs(bounded_normal(rng, 3))


def test_sources_are_what_moving_one_thing_does():
    """A column of thrust and one of tilt against finite differences of the whole body's wrench."""
    robot = load("dragon4")
    ready = prepare(robot, "hover", options=SHORT)
    found = sources(robot, ready.controller, ready.plan.joints[0], Imperfections())
    q = ready.plan.start
    poses = forward(robot.tree, *robot.base_pose(q), robot.angles(q))
    _, cog = centre_of_gravity(robot.tree, *poses)
    # the rotors together carry the weight straight up, each about an eighth of it
    lift = found.acceleration[2, :8]
    np.testing.assert_allclose(lift, 0.03 * 9.81 / 8.0, rtol=0.1)
    assert lift.sum() == pytest.approx(0.03 * 9.81)
    assert cog[2] == pytest.approx(1.5)
    # an IMU off by b about x or y: g b sideways, nothing about z
    tilt = found.acceleration[:2, -3:]
    np.testing.assert_allclose(np.abs(tilt), 9.81 * 0.00698 * np.eye(3)[[1, 0]], atol=1e-9)
    np.testing.assert_allclose(found.unseen[3:, -3:], 0.00698 * np.eye(3))


def test_bounds_follow_the_body_and_its_gains():
    """Half the position gain: twice the error of a tilt; no table of another robot is looked up."""
    robot = load("dragon4")
    soft = load(load_spec("dragon4", overrides=["control.gain_sets.paper.force_p=[1.8,1.8,2.8]"]))
    errors = []
    for one in (robot, soft):
        ready = prepare(one, "hover", options={"duration": 3.0})
        errors.append(expected_errors(one, ready.controller, ready.plan, Imperfections()))
    assert errors[1][0] / errors[0][0] == pytest.approx(2.0, rel=0.05)
    assert errors[1][2] == pytest.approx(errors[0][2])


def test_the_papers_figure_holds_where_it_is_smaller():
    bounds = prepare(load("dragon4"), "transform").plan.thresholds
    table = np.array(TABLES["transform", "virtual_single_rotor"][1])
    got = np.array([*bounds["position_rmse_m"]["at_most"], *bounds["attitude_rmse_rad"]["at_most"]])
    assert np.all(got <= table) and got[3] == table[3]
    assert bounds["trim_sigmas"] == {"at_most": TRIM}


def test_clamps_are_three_deviations_and_at_least_the_gain_sets(hover):
    force, torque = integral_limits(hover.robot, hover.controller, hover.plan, hover.imperfections)
    spread = np.linalg.norm(
        sources(
            hover.robot, hover.controller, hover.plan.joints[0], hover.imperfections
        ).acceleration,
        axis=1,
    )
    law = hover.controller.law
    np.testing.assert_allclose(force[:2] * law.force[1, :2], 3.0 * spread[:2])
    assert force[2] == 2.0 and np.all(torque >= 2.0)
    none = integral_limits(hover.robot, hover.controller, hover.plan, Imperfections().ideal())
    assert np.all(np.array(none) >= 2.0) and np.all(none[0] <= force)


def test_a_motion_lags_by_what_is_known_late():
    """At 1 m/s, 5 ms of delay and half of 25 ms: 17.5 mm."""
    ready = prepare(load("dragon4"), "hover", options={"duration": 1.0})
    plan = replace(ready.plan, velocity=ready.plan.velocity + np.array([1.0, 0, 0]))
    found = lags(ready.controller, plan, Imperfections(), 40.0)
    np.testing.assert_allclose(found, [0.0175, 0, 0, 0, 0, 0], atol=1e-12)


def test_sensors_stay_within_the_bounds_that_the_paper_states():
    noise = draw(Imperfections(), np.random.default_rng(0), 4000, 8, 14)
    angle = np.arccos(np.clip((np.trace(noise.attitude, axis1=1, axis2=2) - 1) / 2, -1, 1))
    assert np.abs(noise.position).max() < 0.001  # motion capture < 1 mm
    assert 0.0003 < noise.position.std() < 0.0005
    axes = [np.abs(noise.attitude[:, i, j]).max() for i, j in ((2, 1), (0, 2), (1, 0))]
    assert max(axes) < np.deg2rad(1.0) and angle.max() < np.sqrt(3) * np.deg2rad(1.0)
    many = bounded_normal(np.random.default_rng(1), 100_000)
    assert np.abs(many).max() < 2.0 and many.std() == pytest.approx(0.8796, abs=0.01)
