"""Best attitude: the present attitude counts, and what cannot hover is not a number."""

from pathlib import Path

import numpy as np
import pytest

import snakegen
from snakegen.analysis import attitude, wrench_margin
from snakegen.base.geometry import rpy_from_rotation
from snakegen.errors import AnalysisError
from snakegen.robot.posture import hover_gimbals
from snakegen.sensitivity.margin_gradient import margin_gradients

GENERATED = Path(__file__).parent.parent / "generated"
BENT = {"joint1_yaw": 1.0, "joint2_yaw": 1.0, "joint3_yaw": 1.0}


@pytest.fixture(scope="module")
def robots():
    return {n: snakegen.load(GENERATED / n / f"{n}.urdf") for n in ("dragon3", "dragon4")}


@pytest.mark.parametrize("rpy", [(0.0, 0.0, 0.0), (-1.557, 0.37, 0.0)])
def test_the_present_attitude_is_among_those_compared(robots, rpy):
    """Level, the bent body is near its weakest of all seen; on its side near its strongest."""
    robot = robots["dragon4"]
    q = hover_gimbals(robot, robot.configuration(BENT, base_rpy=rpy))
    found = attitude.analyze(robot, q, margin="force_margin", samples=4)
    level = wrench_margin.analyze(robot, q).vectored["force"].bounds[0]
    assert found.level == pytest.approx(level, rel=2e-3)
    assert found.worst <= found.level <= found.best
    if rpy[0] == 0.0:
        assert found.level * 0.99 < found.worst
    tilted = robot.configuration(BENT, base_rpy=found.rpy)
    again = wrench_margin.analyze(robot, hover_gimbals(robot, tilted)).vectored["force"].bounds[0]
    assert found.best == pytest.approx(again, rel=2e-3)


def test_attitudes_that_cannot_hover_are_counted_and_print_no_infinity(robots):
    robot = robots["dragon3"]
    found = attitude.analyze(robot, robot.configuration(), "dual_torque_margin", samples=40)
    assert 0 < found.infeasible < found.evaluated and np.isfinite(found.worst)
    assert f"hover out of reach in {found.infeasible}" in dict(found.rows())["worst attitude seen"]
    bent = robot.configuration({"joint1_yaw": 1.2, "joint2_yaw": 0.4})
    never = attitude.analyze(robot, bent, "torque_margin", samples=4)
    assert never.infeasible == never.evaluated
    assert "hover out of reach in every attitude" in never.rows()[0][1]
    assert not any("inf" in text or "nan" in text for _, text in never.rows() + found.rows())


@pytest.mark.parametrize("margin", ["closed", "self_collision"])
def test_a_flag_has_no_best_attitude(robots, margin):
    with pytest.raises(AnalysisError, match="true or false"):
        attitude.analyze(robots["dragon4"], robots["dragon4"].configuration(), margin)


def test_the_way_of_steepest_ascent_against_central_differences(robots):
    robot, step = robots["dragon4"], 1e-5
    q = robot.configuration({"joint1_yaw": 0.9, "joint2_pitch": 0.4, "joint3_yaw": -0.7})
    up = np.array([-0.1, 0.2, 1.0]) / np.linalg.norm([-0.1, 0.2, 1.0])
    way = attitude._steepest(robot, q, attitude._attitude(up), "torque_margin")

    def value(side):
        turned = attitude._attitude((up + side) / np.linalg.norm(up + side))
        tilted = robot.configuration(
            {"joint1_yaw": 0.9, "joint2_pitch": 0.4, "joint3_yaw": -0.7},
            base_rpy=rpy_from_rotation(turned),
        )
        return margin_gradients(robot, hover_gimbals(robot, tilted), "torque").value

    across = np.cross(up, way)
    rise, level = ((value(step * d) - value(-step * d)) / (2 * step) for d in (way, across))
    assert rise > 0.5 and abs(level) < 1e-5 * rise


def test_the_derivative_finds_attitudes_that_are_worse(robots, monkeypatch):
    robot = robots["dragon4"]
    q = robot.configuration({"joint1_yaw": 0.9, "joint2_pitch": 0.4, "joint3_yaw": -0.7})
    followed = attitude.analyze(robot, q, samples=8)
    monkeypatch.setattr(attitude, "_steepest", lambda *_: None)
    alone = attitude.analyze(robot, q, samples=8)
    assert followed.worst < 0.999 * alone.worst and followed.best >= alone.best
