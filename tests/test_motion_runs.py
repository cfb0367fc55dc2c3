"""Motions of arms in MuJoCo: servos, inverse dynamics and the law agree; logs and verdicts."""

import numpy as np
import pytest
from published_arms import TABLE_5

import snakegen
from snakegen.errors import AnalysisError, MissionError
from snakegen.inverse_kinematics.friction import Friction
from snakegen.log import inspect, write
from snakegen.simulation.arm import loop as arm_loop
from snakegen.simulation.flight.run import run


@pytest.fixture(scope="module")
def arm():
    return snakegen.load("arm6")


@pytest.fixture(scope="module")
def flown(arm):
    return run(arm, "table3", ideal=True)


def test_servos_and_inverse_dynamics_agree_with_the_law(flown):
    m = flown.metrics
    assert flown.verdict.passed
    assert m["torque_gap_share"] < 0.01  # the bar of the comparison with ADAMS
    assert m["inverse_gap_share"] < 1e-10
    assert m["made_gap_share"] < 1e-9
    peak = np.abs(flown.channel("joint_torque").values).max(axis=0)
    assert np.max(np.abs(peak[:10] / TABLE_5[:10] - 1)) < 0.026
    assert m["joint_torque_rms_n_m"][0] == pytest.approx(2.04, rel=0.01)


def test_a_wrong_law_is_seen(arm, monkeypatch):
    """The servos led by the law of the paper's eq 24 alone, or by one that is 5 % off."""
    honest = arm_loop.Along.torque

    def scaled(self, depth="full"):
        return 1.05 * honest(self, depth)

    monkeypatch.setattr(arm_loop.Along, "torque", scaled)
    m = run(arm, "table3", ideal=True, options={"duration": 1.0}).metrics
    assert m["torque_gap_share"] > 0.03
    assert m["inverse_gap_share"] > 0.03
    assert m["made_gap_share"] < 1e-9  # MuJoCo's motion is honest whatever leads it

    monkeypatch.setattr(arm_loop.Along, "torque", lambda self: honest(self, "quasi_static"))
    assert (
        run(arm, "table3", ideal=True, options={"duration": 1.0}).metrics["torque_gap_share"] > 0.9
    )


def test_friction_is_a_switch_that_explains_the_gap(arm):
    rec = run(arm, "table3", ideal=True, options={"duration": 2.0, "friction": "0.1,0.06"})
    m, c = rec.metrics, rec.channels
    assert m["made_gap_share"] < 1e-9  # servos + friction = the law of the motion made
    rate, rub = c["joint_rate"].values, c["joint_friction"].values
    assert np.all(rub * rate <= 0.0)  # it never pushes
    moving = np.abs(rate) > 0.2
    np.testing.assert_allclose(np.abs(rub[moving]), 0.06, rtol=1e-3)
    # Static friction shows where a joint turns round, sliding friction at full speed as well.
    assert 0.09 < m["friction_gap_turning_n_m"] < 0.15
    assert 0.05 < m["friction_gap_moving_n_m"] < 0.09
    assert Friction(0.1, 0.06).torque(np.array([0.4]))[0] == pytest.approx(0.06)


def test_a_run_of_a_table_and_its_log(arm, tmp_path):
    path = tmp_path / "m.csv"
    path.write_text("time,joint1_pitch,joint3_yaw\n0,0,0\n1,0.2,0.1\n2,-0.1,0.3\n")
    rec = run(arm, "motion", ideal=True, options={"file": str(path)})
    assert rec.verdict.passed, rec.verdict.summary()
    log = write(rec, tmp_path / "m.rrd")
    found = inspect(log)
    assert found.differing == ()
    assert found.metrics["torque_gap_share"] == rec.metrics["torque_gap_share"]
    with pytest.raises(MissionError, match="needs a file"):
        run(arm, "motion", ideal=True)
    with pytest.raises(AnalysisError, match="outside its limits"):
        run(arm, "table3", ideal=True, options={"amplitude": 0.8})
    with pytest.raises(MissionError, match="needs an arm"):
        run(snakegen.load("dragon3"), "table3")


def test_the_tip_follows_its_path_in_mujoco(arm):
    rec = run(arm, "tip_path", ideal=True, options={"duration": 4.0})
    assert rec.verdict.passed, rec.verdict.summary()
    assert rec.metrics["ik_error_max_m"] < 1e-4  # the bar: 50 mm circle within 0.1 mm
    assert rec.metrics["position_max_m"] < 1e-4
    path = rec.channel("position_target").values
    assert np.linalg.norm(path - path[0], axis=1).max() == pytest.approx(0.1, rel=1e-3)
    with pytest.raises(MissionError, match=r"missed by|is lost after"):
        run(arm, "tip_path", ideal=True, options={"radius": 3.0, "duration": 2.0})


def test_the_body_enters_a_port_in_mujoco(arm):
    given = {"port": "1.25,0.08,0.08,1,0,0,0.09", "depth": 0.25, "duration": 25.0, "dt": 0.025}
    rec = run(arm, "tip_path", ideal=True, options=given)
    assert rec.verdict.passed, rec.verdict.summary()
    assert rec.metrics["port_clearance_m"] > 0.04  # a link's radius
    tip = rec.channel("position").values
    assert tip[0, 0] < 1.25 < tip[-1, 0]  # in from before the plane to beyond it
    np.testing.assert_allclose(tip[-1], [1.5, 0.08, 0.08], atol=1e-4)
