"""Margins and σ_min in a log are those of the mode flown and the rotors that still turn."""

import numpy as np
import pytest

import snakegen
from snakegen.analysis.allocation import allocation
from snakegen.simulation.flight.run import run
from snakegen.simulation.missions.flight.fail import margin_without


def at(recording, name, time):
    """Returns the row of a channel nearest to a time."""
    return recording.channel(name).values[np.argmin(np.abs(recording.times(name) - time))]


@pytest.fixture(scope="module")
def lossy():
    robot = snakegen.load("dragon4")
    options = {"duration": 2.0, "at": 1.0, "delay": 0.3}
    return robot, run(robot, "fail", options=options)


def test_margins_count_the_lost_rotors_from_the_failure_on(lossy):
    robot, recording = lossy
    lost = (2, 3)  # the two rotors of apparatus 2
    for time, rotors in ((0.9, ()), (1.0, lost), (1.2, lost), (1.5, lost)):
        q = at(recording, "q", time)
        expected = margin_without(robot, q, rotors)
        assert at(recording, "wrench_margin", time)[0] == pytest.approx(expected, abs=0.005)
    assert recording.metrics["wrench_margin_min"] < 0.0
    assert np.isnan(at(recording, "force_margin", 1.2)[0]), "hover is out of reach"


def test_sigma_min_counts_them_before_the_controller_knows(lossy):
    """Against an SVD of the analysis' Jacobian at the state of the log."""
    robot, recording = lossy
    sigma = recording.channel("sigma_min").values[:, 0]
    time = recording.times("sigma_min")
    steps = np.abs(np.diff(sigma))
    assert time[1:][np.argmax(steps)] == pytest.approx(1.0, abs=1e-9)
    k = int(np.searchsorted(time, 1.0 - 1e-9))
    q = recording.channel("q").values[k].copy()
    names = list(recording.channel("q").labels)
    gimbals = recording.channel("gimbal_command")
    for label, value in zip(gimbals.labels, gimbals.values[k], strict=True):
        q[names.index(label)] = value
    pushes = recording.channel("thrust_command").values[k].reshape(4, 2).sum(axis=1)
    jacobian = allocation(robot, q, thrust=pushes).jacobian.reshape(6, 3, 4)
    rows = np.repeat([1.0 / robot.force_scale, 1.0 / robot.torque_scale], 3)
    columns = np.array([robot.gimbals.limit, np.ones(4), np.ones(4)])
    columns[:, 1] = 0.0
    scaled = (rows[:, None, None] * jacobian * columns).reshape(6, 12)
    expected = np.linalg.svd(scaled, compute_uv=False)[5]
    # the controller saw joints 0.1° off
    assert sigma[k] == pytest.approx(expected, rel=0.05)
    assert sigma[k] < 0.9 * sigma[k - 1]


def test_margins_follow_the_mode():
    recording = run(snakegen.load("dragon4"), "switch", options={"duration": 9.0})
    changes = recording.meta["facts"]["switches_s"]
    time = recording.times("force_margin")
    force = recording.channel("force_margin").values[:, 0]
    dual = (time >= changes[0]) & (time < changes[1])
    assert np.all(np.isnan(force[dual])) and np.all(force[~dual] > 0.0)
    assert np.all(np.isfinite(recording.channel("wrench_margin").values))
    wrench = recording.channel("wrench_margin").values[:, 0]
    assert wrench[dual].max() < 0.2 * wrench[~dual].min(), "yaw by drag alone is weak"
