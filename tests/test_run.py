"""A run from end to end: bits repeat, refusals name numbers, the report says what was flown."""

import numpy as np
import pytest

from snakegen import load
from snakegen.analysis import control
from snakegen.errors import MissionError
from snakegen.log.store import encode
from snakegen.simulation.flight.run import run
from snakegen.simulation.recording.metrics import metrics
from snakegen.spec.loading import load_spec

SHORT = {"duration": 1.0}


@pytest.fixture(scope="module")
def robot():
    return load("dragon4")


@pytest.fixture(scope="module")
def flown(robot):
    return run(robot, "hover", seed=4, options=SHORT)


def test_the_same_seed_gives_the_same_bits(robot, flown):
    again, other = (run(robot, "hover", seed=s, options=SHORT) for s in (4, 5))
    q = flown.channel("q").values
    assert np.array_equal(q, again.channel("q").values)
    assert not np.array_equal(q, other.channel("q").values)


def test_metrics_come_from_the_recording_alone(flown):
    again = metrics(flown)
    assert {k: flown.metrics[k] for k in again} == again


def test_states_are_exact_and_what_follows_from_them_is_short(robot, flown):
    """A minute's log is under 9 MB: 24 bits for torques and rates, 53 for states and commands."""
    for name in ("velocity", "angular_velocity", "joint_torque", "gimbal_torque", "roll_moment"):
        values = flown.channel(name).values
        np.testing.assert_array_equal(values, values.astype(np.float32))
        assert np.abs(values).max() > 1e-3
    for name in ("q", "position", "attitude", "thrust", "joint_angle", "gimbal_command"):
        values = flown.channel(name).values
        assert np.any(values != values.astype(np.float32)), name
    _, tables = encode(run(robot, "hover", options={"duration": 6.0}))
    assert len(tables[0]) / 1200 < 425  # bytes a tick; a fifth more if all are exact


def test_the_report_names_plant_checks_and_the_paper(robot, flown):
    assert "| ok | took_off" in flown.report and "thrust_mismatch" in flown.report
    assert "ZN23" not in flown.report
    lost = run(robot, "fail", options={"at": 0.2, "duration": 0.8})
    assert "cannot hover level" in lost.report and "apparatus 2 on link2" in lost.report


def test_a_robot_too_heavy_to_fly_is_refused_with_its_numbers():
    heavy = load(load_spec("dragon4", overrides=["chain.mass=5.0"]))
    with pytest.raises(MissionError, match="thrust to weight"):
        run(heavy, "hover", options=SHORT)


def test_printed_gains_of_table_3_are_unstable_and_fail():
    snake = load("dragon3")
    found = control.analyze(snake)
    lateral = found.loops["paper", "dual_rotor"][1]
    assert not lateral.stable and lateral.delay_margin == 0.0
    assert all(loop.stable for loop in found.loops["tuned", "dual_rotor"])
    recording = run(snake, "hover", gains="paper", options={"duration": 12.0})
    assert not recording.verdict.passed


def test_a_rotor_lost_gives_nothing_and_the_controller_asks_nothing_of_it(robot):
    recording = run(robot, "fail", options={"lost": "rotor2_1", "at": 0.3, "duration": 1.0})
    time = recording.time
    names = recording.channel("thrust").labels
    k = names.index("rotor2_1")
    late = time > 0.7
    assert recording.channel("thrust").values[late, k].max() < 0.01
    assert recording.channel("thrust_command").values[late, k].max() == 0.0
    assert recording.channel("thrust").values[time < 0.29, k].min() > 1.0


def test_a_hybrid_drives_and_then_flies_in_one_log():
    options = {"distance": 0.3, "climb": 3.0, "hover": 1.0, "height": 0.5}
    recording = run(load("hybrid4"), "drive_fly", options=options)
    assert recording.verdict.passed, recording.verdict.summary()
    height = recording.channel("position").values[:, 2]
    assert height[-1] > height[0] + 0.4
