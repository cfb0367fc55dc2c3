"""Traction of screw drives: against closed forms, another solver and contact."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from snakegen.analysis import traction
from snakegen.errors import AnalysisError, MissionError
from snakegen.robot.robot import load
from snakegen.screw_drive.geometry import drive_geometry
from snakegen.screw_drive.ground_stance import stance
from snakegen.screw_drive.load_sharing import resting_loads
from snakegen.screw_drive.traction_limits import downhill, gravity_on, largest_pull, steepest_slope
from snakegen.screw_drive.traction_program import held_load, upper_bound
from snakegen.simulation.drive.load import load_metrics
from snakegen.simulation.flight.run import run
from snakegen.simulation.recording.recording import Recording, channel
from snakegen.spec.loading import load_spec

ARC = {"joint1_yaw": 0.5, "joint2_yaw": 0.5, "joint3_yaw": 0.5}
DOWN = np.array([0.0, 0.0, -9.81])


@pytest.fixture(scope="module")
def screw4():
    return load("screw4")


@pytest.fixture(scope="module")
def straight(screw4):
    return stance(screw4, screw4.configuration())


@pytest.fixture(scope="module")
def quick():
    return load(load_spec("screw4", overrides=["screw_drive.rollers=ball"]))


@pytest.mark.parametrize("posture", [{}, ARC, {"joint2_pitch": 0.02, "joint3_pitch": -0.04}])
def test_forces_balance_the_whole_body(screw4, posture):
    """Sum and moment of weight and contact forces, from places alone, at the limit."""
    body = stance(screw4, screw4.configuration(posture))
    direction = downhill(body, "nose_up")
    held = steepest_slope(body, direction, 0.4)
    gravity = gravity_on(held.value, direction)
    up, at = np.array([0.0, 0.0, 1.0]), held.at
    forces = [
        n * up + f * c.axle for n, f, c in zip(at.normal, at.along, body.contacts, strict=True)
    ]
    # rolling friction: a force across the axle, at the height of the wheel's centre
    across = [g * np.cross(up, c.axle) for g, c in zip(at.across, body.contacts, strict=True)]
    assert np.abs(at.across).max() > 0.05
    cog = np.zeros(3)
    for i, mass in enumerate(screw4.tree.mass):
        cog += mass / screw4.mass * body.place(i, screw4.tree.com[i])
    moment = np.cross(cog, screw4.mass * gravity)
    for force, contact in zip(forces, body.contacts, strict=True):
        moment = moment + np.cross(contact.point, force)
    for force, contact in zip(across, body.contacts, strict=True):
        moment = moment + np.cross(contact.point + 0.012 * up, force)
    assert np.abs(np.sum([*forces, *across], axis=0) + screw4.mass * gravity).max() < 0.02
    assert np.abs(moment).max() < 0.01  # the bisection stops at 1e-5 rad
    drums, c = body.drums, 0.0003 / 0.012
    normal = at.normal[drums] + 1e-7
    assert (np.hypot(at.along[drums] / 0.4, at.across[drums] / c) <= normal).all()
    assert held.at.normal.min() > -1e-9 and held.value <= held.upper


def test_axles_are_those_of_the_no_slip_rows(screw4):
    """Rows of force along axles in the plane are HA's no-slip rows transposed."""
    body = stance(screw4, screw4.configuration(ARC))
    g = drive_geometry(screw4)
    rows = body.along[body.drums][:, [0, 1, 5]]
    assert np.allclose(rows, g.rows([0.5, 0.5, 0.5]), atol=1e-9)


@pytest.mark.parametrize("play", [0.0, 2e-4, 0.0058])
def test_resting_loads_are_the_minimum_of_energy(straight, play):
    """Bends of pitch servos and contacts, minimized by another solver with the forces kept ≥ 0.

    Without play its four drums share as beams do; with much, as hinged links.
    """
    straight = replace(straight, play=play)
    soft = np.flatnonzero(np.isfinite(straight.stiffness))
    index = [2, 3, 4, *(6 + soft)]
    load_ = (straight.gravity @ DOWN)[index]
    J, K, eps = straight.normal[:, index], straight.stiffness[soft], 5e-6

    def energy(x):
        press = np.minimum(straight.gap + J @ x, 0.0)
        bend = np.sign(x[3:]) * np.maximum(np.abs(x[3:]) - play / 2, 0.0)
        value = 0.5 * K @ bend**2 + 0.5 * (press @ press) / eps - load_ @ x
        slope = np.concatenate([np.zeros(3), K * bend]) + J.T @ press / eps - load_
        return value, slope

    found = minimize(energy, np.zeros(len(index)), jac=True, method="BFGS", options={"gtol": 1e-9})
    force = -np.minimum(straight.gap + J @ found.x, 0.0) / eps
    mine = resting_loads(straight, straight.gravity @ DOWN)
    assert np.allclose(mine, force, atol=0.05) and mine.sum() == pytest.approx(78.48, abs=0.01)


def test_bounds_are_certified_and_in_order(straight):
    rising = straight.gravity @ [9.81, 0.0, 0.0]
    fixed = straight.gravity @ DOWN
    for friction in (0.2, 0.8):
        inner = held_load(straight, fixed, rising, friction)
        outer = upper_bound(straight, fixed, rising, friction)
        assert inner.certified == pytest.approx(inner.factor, abs=1e-9)
        assert outer.certified == pytest.approx(outer.factor, abs=1e-9)
        assert 0 < inner.factor <= outer.factor + 1e-12


def test_a_straight_body_is_the_closed_form(straight):
    """Helices of ±45°, loads free to share: tan β = (c + √(μ² − c²)) cos 45°."""
    slope = steepest_slope(straight, downhill(straight, "nose_up"), 0.3).upper
    exact = (0.025 + math.sqrt(0.3**2 - 0.025**2)) * math.cos(math.pi / 4)
    assert math.tan(slope) == pytest.approx(exact, rel=5e-3) and math.tan(slope) >= exact
    free = replace(straight, rolling=0.0)
    slope = steepest_slope(free, downhill(free, "nose_up"), 0.3).upper
    assert math.tan(slope) == pytest.approx(0.3 * math.cos(math.pi / 4), rel=1e-3)


def test_rolling_friction_holds_more_and_never_less(straight):
    """The more friction wheels roll against, the steeper, but never beyond sliding all ways."""
    held = [
        steepest_slope(replace(straight, rolling=c), downhill(straight, "nose_up"), 0.2).value
        for c in (0.0, 0.02, 0.2)
    ]
    assert held[0] < held[1] < held[2] and math.tan(held[2]) < 0.2


@pytest.mark.parametrize("friction", [1e-4, 0.01, 0.025])
def test_no_slope_beyond_the_angle_of_friction_is_held(straight, friction):
    """On ice wheels slide before they roll, whatever they rub against."""
    for side in ("nose_up", "left_down"):
        held = steepest_slope(straight, downhill(straight, side), friction)
        assert math.tan(held.value) <= friction * (1 + 1e-6) + 1e-9
        assert 0.3 * friction < math.tan(held.upper) <= 1.006 * friction + 3e-5


def test_weak_motors_limit_what_grip_allows(screw4):
    weak = load(load_spec("screw4", overrides=["screw_drive.effort=0.2"]))
    strong, poor = (stance(r, r.configuration()) for r in (screw4, weak))
    pull = [largest_pull(b, downhill(b, "nose_up"), 0.8) for b in (strong, poor)]
    assert pull[1].value < 0.6 * pull[0].value
    assert any(text.startswith("torque of screw") for text in pull[1].at.limits)
    # each screw carries F r sin α − G (r − r_w) cos α, of 0.2 N·m at most
    f, g = np.abs(pull[1].at.along), np.abs(pull[1].at.across)
    assert ((0.075 * f - 0.063 * g) * math.sin(math.pi / 4) <= 0.2 + 1e-6).all()


def test_the_page_says_which_drums_carry(screw4):
    found = traction.analyze(screw4, screw4.configuration(), friction="0.2,0.8")
    data = found.to_json()
    assert sum(data["load_n"].values()) == pytest.approx(9.81 * screw4.mass, abs=0.01)
    little, much = data["frictions"]
    assert little["slope_deg"]["nose_up"] < 10 < 20 < much["slope_deg"]["nose_up"]
    assert much["slope_deg"]["left_down"] < 20  # it rolls over
    assert little["pull_n"] < much["pull_n"] <= much["pull_upper_n"]
    assert data["tip_over_deg"]["left_down"] < 30 < data["tip_over_deg"]["nose_up"]
    assert not data["narrow_stance"] and "narrow stance" not in dict(found.rows())
    zigzag = screw4.configuration({f"joint{i}_yaw": 0.6 * (-1) ** i for i in (1, 2, 3)})
    narrow = traction.analyze(screw4, zigzag, friction="0.8")
    assert narrow.to_json()["narrow_stance"] and "narrow stance" in dict(narrow.rows())
    for text in ("x", "-1", "nan"):
        with pytest.raises(AnalysisError, match="friction"):
            traction.analyze(screw4, screw4.configuration(), friction=text)
    with pytest.raises(AnalysisError, match="slope"):
        traction.analyze(screw4, screw4.configuration(), slope=95.0)


def test_contact_lets_go_where_the_program_says(quick):
    """Ball drums; benchmarks/traction.py has every wheel, three frictions, ten cases."""
    slope = run(quick, "slope", options={"slow": 12.0})
    assert slope.verdict.passed, slope.verdict.summary()
    assert 0.9 < slope.metrics["ratio"] < 1.15 and slope.metrics["lost"] is not None
    tow = run(quick, "tow", options={"slow": 12.0, "posture": ARC})
    assert tow.verdict.passed, tow.verdict.summary()
    with pytest.raises(MissionError, match="nose_up, nose_down"):
        run(quick, "slope", options={"side": "up"})
    with pytest.raises(MissionError, match="joint1_pitch is bent"):
        run(quick, "slope", options={"posture": {"joint1_pitch": 0.01}})


def test_a_drive_with_less_grip_than_believed_fails():
    """The prediction of μ = 0.8 is not reached on ground of half of it."""
    time = np.arange(0.0, 20.0, 0.01)
    facts = {"load_time_s": [0, 10, 20], "load_value": [0, 0.0, 1.0], "predicted": 0.8}
    away = np.where(time < 14.0, 0.0, 0.1 * (time - 14.0))[:, None]
    error = np.hstack([away, np.zeros((len(time), 2))])[: 1 + np.searchsorted(time, 14.51)]
    now = time[: len(error)]
    turned = np.tile([0.0, 0.0, 0.0, 1.0], (len(now), 1))
    signals = {
        "state_error": channel("state_error", error, ["x", "y", "heading"]),
        "attitude": channel("attitude", turned),
    }
    facts["predicted_upper"] = None
    found = load_metrics(Recording(now, signals, meta={"facts": facts}))
    assert found["lost"] == pytest.approx(0.4, abs=0.01)  # lost at 14 s, not when 50 mm away
    assert found["ratio"] == pytest.approx(0.5, abs=0.02) and "bound_ratio" not in found
