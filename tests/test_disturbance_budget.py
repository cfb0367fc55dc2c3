"""Linear responses to pushes and wind: against integration, against flights, and as bounds."""

from dataclasses import replace

import numpy as np
import pytest

from snakegen.control.controller import flight_controller
from snakegen.control.gain_sets import gain_set
from snakegen.control.poles import compliances
from snakegen.robot.robot import load
from snakegen.simulation.flight.bounds.linear_response import accelerations, drag_errors, response
from snakegen.simulation.flight.plant import Imperfections
from snakegen.simulation.flight.run import prepare, run
from snakegen.simulation.recording.signals import position_error


@pytest.fixture(scope="module")
def dragon4():
    return load("dragon4")


def test_a_loop_without_lag_moves_as_its_equation_says(dragon4):
    """``e'' + K_d e' + K_p e + K_i ∫e = a``, integrated by small steps."""
    c, gains = flight_controller(dragon4), gain_set(dragon4)
    poles, parts = compliances(c, gains, c.mode, lag=0.0)[2]
    p, i, d = (float(row[2]) for row in c.law.force)
    dt, e, v, whole = 1e-4, 0.0, 0.0, 0.0
    for _ in range(15000):
        v += dt * (1.0 - d * v - p * e - i * whole)
        e += dt * v
        whole += dt * e
    linear = np.sum(parts / poles * (np.exp(poles * 1.5) - 1.0)).real
    assert e == pytest.approx(linear, rel=1e-3)


def test_a_push_accelerates_as_newton_says(dragon4):
    plan = prepare(dragon4, "gust", options={"force": 16.0, "duration": 4.0}).plan
    found = accelerations(dragon4, plan, Imperfections())
    assert found[:, 1].max() == pytest.approx(16.0 / dragon4.mass, rel=1e-6)
    assert np.abs(found[:, 3:]).max() < 1e-9


@pytest.mark.parametrize("options", [{"force": 16.0}, {"speed": 8.0}])
def test_an_ideal_flight_is_displaced_as_much(dragon4, options):
    """With air: a gust of wind moves the body by what the forces on rotors and links say."""
    options = options | {"duration": 4.5, "trim": 0.0}
    ready = prepare(dragon4, "gust", options=options)
    still = {"position_noise": 0.0, "velocity_noise": 0.0, "attitude_bias": 0.0}
    quiet = {"thrust_mismatch": 0.0, "attitude_noise": 0.0, "gyro_noise": 0.0, "joint_noise": 0.0}
    plant = replace(ready.imperfections, battery_energy=0.0, **still, **quiet)
    recording = ready.flown(ready.world(), plant, np.random.default_rng(0), 0, margins=False)
    linear = response(dragon4, ready.controller, gain_set(dragon4), ready.plan, Imperfections())
    flown = np.abs(position_error(recording)[:, 1]).max()
    assert flown == pytest.approx(np.abs(linear[:, 1]).max(), rel=0.1)


def test_bounds_hold_a_good_flight_and_not_a_weak_one(dragon4):
    """A third of the stiffness is displaced beyond what the gains in use allow."""
    options = {"duration": 6.0}
    ready = prepare(dragon4, "gust", options=options)
    bound = ready.plan.thresholds["position_max_m"]["at_most"]
    good = run(dragon4, "gust", options=options)
    assert good.verdict.passed and bound < 3.0 * good.metrics["position_max_m"]
    weak = ready.controller.with_law(force=ready.controller.law.force / 3.0)
    rng = np.random.default_rng(0)
    bad = replace(ready, controller=weak).flown(
        ready.world(), ready.imperfections, rng, 0, margins=False
    )
    assert "position_max_m" in {c.metric for c in bad.verdict.failed}


def test_a_ring_that_is_still_plucked_is_judged_and_a_moving_one_is_not(dragon4):
    found = prepare(dragon4, "ring").plan.thresholds
    assert 0.0 < found["position_max_m"]["at_most"] < 0.2
    assert (
        "position_max_m" not in prepare(dragon4, "ring", options={"moving": True}).plan.thresholds
    )


def test_air_leaves_an_error_behind_what_moves_and_none_behind_what_stays(dragon4):
    """A steady 1 m/s of an eased path: its error is that of the drag over K_p, or less."""
    ready = prepare(dragon4, "gust", options={"force": 16.0, "duration": 4.5})
    c, gains, usual = ready.controller, gain_set(dragon4), Imperfections()
    speed = np.zeros((len(ready.plan.time), 3))
    assert not drag_errors(dragon4, c, gains, replace(ready.plan, velocity=speed), usual).any()
    speed[:, 1] = 1.0
    moved = drag_errors(dragon4, c, gains, replace(ready.plan, velocity=speed), usual)
    blown = replace(ready.plan, wind=-speed, disturbance=None)
    drag = np.abs(accelerations(dragon4, blown, usual)[0, 1])
    assert 0.5 * drag < moved[1] * c.law.force[0, 1] < 1.05 * drag
