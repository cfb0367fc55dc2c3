"""The low-pass on body rates: its law, its lag in the poles, and the elastic flight it saves."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter, lfilter_zi
from test_control_allocation import controller_of
from test_control_flight import Rigid, at_rest, bent_angles, snake, target_at

from snakegen.analysis import control
from snakegen.control.gains import Gains
from snakegen.control.poles import loops
from snakegen.errors import SpecError
from snakegen.geometry import rotation_from_rpy
from snakegen.kernels.control_types import VIRTUAL
from snakegen.kernels.low_pass import low_pass
from snakegen.robot import load
from snakegen.spec_file import load_spec
from snakegen.verify.run import run


@pytest.mark.parametrize("cutoff", [3.0, 30.0, 90.0])
def test_it_is_the_butterworth_filter_of_second_order(cutoff):
    signal = np.random.default_rng(0).normal(size=(300, 3)) + np.array([0.0, 1.0, -5.0])
    b, a = butter(2, cutoff, fs=200.0)
    begun = lfilter_zi(b, a)[:, None] * signal[0]
    expected, _ = lfilter(b, a, signal, axis=0, zi=begun)
    memory, found = np.full((2, 3), np.nan), signal.copy()
    for row in found:
        low_pass(row, memory, cutoff, 0.005)
    np.testing.assert_allclose(found, expected, atol=1e-10)


def test_the_tick_damps_filtered_rates():
    """A jump of the body rate reaches the torque by the filter's first step alone."""
    robot = snake(4, offset=0.037)
    c = controller_of(robot).with_law(rate_filter=20.0)
    angles, target = bent_angles(robot), target_at(np.zeros(3))
    measured = at_rest(robot, angles)
    state, still = c.tick(measured, target, c.start(), 0.005)
    fast = measured._replace(angular=np.array([0.0, 0.0, 0.3]))
    _, some = c.tick(fast, target, state, 0.005)
    _, all_of_it = c.with_law(rate_filter=0.0).tick(fast, target, state, 0.005)
    b, _ = butter(2, 20.0, fs=200.0)
    jump = all_of_it.wanted[5] - still.wanted[5]
    assert jump < -0.1
    assert some.wanted[5] - still.wanted[5] == pytest.approx(b[0] * jump, rel=1e-3)


@pytest.mark.parametrize("cutoff", [8.0, 30.0])
def test_delay_margin_counts_the_filter(cutoff):
    """Phase margin over crossover of the loop with L(s) written out."""
    gains = Gains()
    for i, loop in enumerate(loops(gains, VIRTUAL, lag=0.035, rate_filter=cutoff)):
        rows = [gains.force_p, gains.force_i, gains.force_d] if i < 3 else [
            gains.torque_p, gains.torque_i, gains.torque_d]  # fmt: skip
        p, k, d = (row[i % 3] for row in rows)
        s = 1j * np.geomspace(0.3, 30, 200001)
        w = 2.0 * np.pi * cutoff
        low = w**2 / (s**2 + np.sqrt(2.0) * w * s + w**2) if i >= 3 else 1.0
        open_loop = (p + k / s + d * s * low) / (s**2 * (1 + 0.035 * s))
        last = np.flatnonzero(np.abs(open_loop) > 1)[-1]
        phase = np.pi + np.unwrap(np.angle(open_loop))[last]
        assert loop.delay_margin == pytest.approx((phase % (2 * np.pi)) / s.imag[last], rel=2e-3)


def test_a_simulated_loop_loses_stability_between_the_delay_margins():
    robot, cutoff = snake(4, offset=0.037), 3.0
    found = loops(Gains(), VIRTUAL, lag=0.035, rate_filter=cutoff)
    margin = min(loop.delay_margin for loop in found)
    assert 1.2 * margin < min(x.delay_margin for x in loops(Gains(), VIRTUAL, lag=0.035))
    target = target_at(np.zeros(3), rotation_from_rpy([0.02, 0.0, 0.0]))
    ends = []
    for delay in (0.8 * margin, 1.2 * margin):
        c = controller_of(robot).with_law(rate_filter=cutoff)
        body = Rigid(robot, c, bent_angles(robot), VIRTUAL)
        body.fly(target, 10.0, lag=0.035, delay=delay)
        ends.append(np.linalg.norm(body.w))
    assert ends[0] < 0.005 < 0.05 < ends[1]


def test_dragon3_flies_on_its_own_tubes_with_it_and_not_without():
    """Rotors answer the rates of a tube that rings near 73 Hz by the torque of their own spin."""
    elastic = ["plant.link_stiffness=1300"]
    flown = [
        run(load(load_spec("dragon3", overrides=[*elastic, *more])), "hover", options=HOVER)
        for more in ([], ["control.rate_filter=30"])
    ]
    shaken, steady = flown
    assert not shaken.verdict.passed
    assert steady.verdict.passed, steady.verdict.summary()
    near = np.abs(np.array(shaken.meta["modal_frequencies_hz"]) - 72.67)
    assert near.min() < 0.01 and shaken.metrics["body_rate_peak_hz"] == pytest.approx(72.7, abs=4)
    ripple = [r.metrics["body_rate_ripple_rad_s"] for r in flown]
    assert ripple[1] < 0.05 * ripple[0]
    assert "no low-pass" in shaken.report and "72.67 Hz" in shaken.report
    assert "low-pass of 30 Hz" in steady.report


HOVER = {"duration": 1.0}


def test_control_analysis_tells_it_and_nonsense_is_refused():
    told = control.analyze(load(load_spec("dragon3", overrides=["control.rate_filter=30"])))
    assert told.rate_filter == 30.0 and told.to_json()["rate_filter_hz"] == 30.0
    assert ("low-pass on body rates", "30 Hz") in told.rows()
    plain = control.analyze(load("dragon3"))
    assert all("low-pass" not in label for label, _ in plain.rows())
    pairs = zip(*(x.loops["tuned", "dual_rotor"] for x in (told, plain)), strict=True)
    for late, early in pairs:
        if late.axis in ("roll", "pitch", "yaw"):
            assert late.delay_margin < early.delay_margin - 0.005
    with pytest.raises(SpecError, match="below 100 Hz, half the attitude_rate"):
        load_spec("dragon3", overrides=["control.rate_filter=100"])
