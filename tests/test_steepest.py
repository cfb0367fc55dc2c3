"""Exact derivatives in the search of the worst posture: the slope, and what following it finds."""

import numpy as np
import pytest

from snakegen.robot.robot import load
from snakegen.sweep import worst
from snakegen.sweep.batch import Body, evaluate
from snakegen.sweep.steepest import slope, steps_down

BENT = np.array([0.4, -0.8, 0.3, 0.9, -0.2, 0.7])


@pytest.fixture(scope="module")
def body() -> Body:
    robot = load("dragon4")
    return Body.of(robot, robot.chain_joints, np.eye(3), 1e-3)


def test_slopes_against_differences_of_swept_margins() -> None:
    """Gimbals follow the joints: exact margins of dual-rotor mode change with both."""
    column = "dual_attitude_altitude_margin"
    robot = load("dragon3")
    body = Body.of(robot, robot.chain_joints, np.eye(3), 1e-3)
    bent = BENT[: len(robot.chain_joints)]
    step = 1e-5 * np.eye(len(bent))
    found = slope(body, column, bent)
    table = evaluate(body, np.vstack([bent + step, bent - step]))
    up, down = np.split(table[column].to_numpy(), 2)
    assert found is not None and np.abs(found).max() > 1e-3
    np.testing.assert_allclose(found, (up - down) / 2e-5, atol=2e-5 * np.abs(found).max())


def test_what_has_no_derivative_has_no_slope(body: Body) -> None:
    assert slope(body, "self_distance", BENT) is None
    assert steps_down(body, "torque_margin", np.zeros(6)) is None  # straight: the margin is 0


def test_the_slope_leads_to_a_worse_posture_than_the_search_alone(
    body: Body, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = evaluate(body, BENT + 0.05 * np.random.default_rng(0).normal(size=(4, 6)))
    lowered = worst.refine(body, table, "force_margin", rounds=1)
    monkeypatch.setattr(worst, "POLISH", 0)
    alone = worst.refine(body, table, "force_margin", rounds=1)
    assert 0.0 <= lowered.upper < 0.99 * alone.upper
    again = evaluate(body, lowered.angles[None])  # a certified margin of that very posture
    assert again["force_margin"][0].as_py() == pytest.approx(lowered.lower, rel=1e-9)
