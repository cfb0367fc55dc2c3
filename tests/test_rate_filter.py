"""The low-pass on body rates: its law, its lag in the poles, and the elastic flight it saves."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter, lfilter_zi
from test_control_allocation import controller_of
from test_control_flight import Rigid, at_rest, bent_angles, snake, target_at

from snakegen.analysis import control
from snakegen.base.geometry import rotation_from_rpy
from snakegen.control.gains import Gains
from snakegen.control.poles import loops
from snakegen.errors import SpecError
from snakegen.kernels.control.low_pass import low_pass
from snakegen.kernels.control.types import VIRTUAL
from snakegen.robot.robot import load
from snakegen.simulation.flight.run import run
from snakegen.simulation.recording.recording import Recording, channel
from snakegen.simulation.recording.vibration_metrics import shaking
from snakegen.spec.loading import load_spec


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
    """A jump of rate and velocity reaches the wrench by the filter's first step alone."""
    robot = snake(4, offset=0.037)
    c = controller_of(robot).with_law(rate_filter=20.0)
    angles, target = bent_angles(robot), target_at(np.zeros(3))
    measured = at_rest(robot, angles)
    state, _ = c.tick(measured, target, c.start(), 0.005)
    _, still = c.tick(measured, target, state, 0.005)
    fast = measured._replace(angular=np.array([0.0, 0.0, 0.3]), linear=np.array([0.2, 0.1, 0.3]))
    _, some = c.tick(fast, target, state, 0.005)
    _, all_of_it = c.with_law(rate_filter=0.0).tick(fast, target, state, 0.005)
    b, _ = butter(2, 20.0, fs=200.0)
    jump = all_of_it.wanted - still.wanted
    assert jump[5] < -0.1 and np.all(np.abs(jump[:3]) > 0.1)
    for k in (0, 1, 2, 5):
        assert some.wanted[k] - still.wanted[k] == pytest.approx(b[0] * jump[k], rel=1e-3)


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
        low = w**2 / (s**2 + np.sqrt(2.0) * w * s + w**2)
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


@pytest.fixture(scope="module")
def elastic():
    """Returns flights of dragon3 on its own tubes without a low-pass, with 30 Hz, as it comes."""
    return [
        run(load(load_spec("dragon3", overrides=[*TUBES, *more])), "hover", options=HOVER)
        for more in (["control.rate_filter=0"], ["control.rate_filter=30"], [])
    ]


def ringing(recording):
    """Returns the mode of the tube that rotors answer [Hz]."""
    modes = np.array(recording.meta["modal_frequencies_hz"])
    return modes[np.argmin(np.abs(modes - 73.0))]


def test_dragon3_flies_on_its_own_tubes_with_it_and_not_without(elastic):
    """Rotors answer the rates of a tube that rings near 73 Hz by the torque of their own spin."""
    shaken, steady, usual = elastic
    assert not shaken.verdict.passed
    assert steady.verdict.passed, steady.verdict.summary()
    assert usual.verdict.passed and usual.meta["rate_filter_hz"] == 10.0
    assert ringing(shaken) == pytest.approx(72.8, abs=0.4)
    assert shaken.metrics["body_rate_peak_hz"] == pytest.approx(ringing(shaken), abs=4)
    ripple = [r.metrics["body_rate_ripple_rad_s"] for r in elastic]
    assert ripple[2] < ripple[1] < 0.05 * ripple[0]


def test_the_report_says_which_frequency_matters(elastic):
    shaken, _, usual = elastic
    assert "no low-pass" in shaken.report and f"{ringing(shaken):.2f} Hz" in shaken.report
    peak = usual.metrics["body_rate_peak_hz"]
    left = 100.0 / np.sqrt(1.0 + (peak / 10.0) ** 4)
    assert f"at {peak:.1f} Hz" in usual.report
    assert f"low-pass of 10 Hz leaves {left:.0f} %" in usual.report


def test_ripple_and_peak_are_those_of_a_known_signal():
    time = np.arange(0.0, 8.0, 0.005)
    rate = np.zeros((len(time), 3))
    rate[:, 0] = 0.3 * np.sin(2.0 * np.pi * 40.0 * time) + 2.0 * np.sin(2.0 * np.pi * 0.5 * time)
    rate[:, 2] = 0.4 * np.cos(2.0 * np.pi * 12.0 * time)
    recording = Recording(time, {"angular_velocity": channel("angular_velocity", rate)}, (), {})
    told = shaking(recording, 0.0, 10.0)
    assert told["body_rate_peak_hz"] == pytest.approx(12.0, abs=0.1)
    assert told["body_rate_ripple_rad_s"] == pytest.approx(0.5 / np.sqrt(2.0), rel=0.01)


def test_a_changing_body_on_its_own_tubes_keeps_gimbals_off_their_limit():
    """Wobble of the root passed for velocity of the CoG, and gimbals answered it at 40 Hz."""
    flown = [
        run(load(load_spec("dragon4", overrides=[*TUBES, *more])), "transform", options=NEAR)
        for more in (["control.rate_filter=0"], [])
    ]
    share = [r.metrics["gimbal_torque_limit_share"] for r in flown]
    assert share[0] > 0.03 and share[1] == 0.0
    assert flown[1].verdict.passed, flown[1].verdict.summary()
    assert flown[0].metrics["body_rate_peak_hz"] == pytest.approx(40.0, abs=2.0)


def test_sixteen_links_fly_on_table_5_and_chatter_at_the_far_end_without():
    """A gyro's noise, times an arm of metres, passed for velocity of the CoG."""
    servo = "joint.servo={stiffness: 400, damping: 20, armature: 0.005}"
    calm, noisy = (
        run(
            load(load_spec("dragon4", links=16, overrides=[servo, *more])),
            "hover",
            options={"duration": 2.0, "height": 3.0, "trim": 0.0},
        )
        for more in ([], ["control.rate_filter=0"])
    )
    assert calm.verdict.passed, calm.verdict.summary()
    assert calm.metrics["gimbal_torque_limit_share"] < 0.002
    assert noisy.metrics["gimbal_torque_limit_share"] > 0.02
    torque = noisy.channel("gimbal_torque")
    worst = torque.labels[int(np.argmax(np.mean(np.abs(torque.values) > 2.97, axis=0)))]
    assert worst == "gimbal16_roll"


HOVER, NEAR = {"duration": 1.0, "trim": 0.0}, {"trim": 0.0}
TUBES = ["plant.link_stiffness=1300"]


def test_it_is_on_where_links_bend_or_are_many_and_off_where_told():
    def cutoff(*overrides, links=None):
        spec = load_spec("dragon4", links=links, overrides=list(overrides))
        return spec.resolved()["control"]["rate_filter"]

    assert cutoff() == 0.0 and cutoff(links=8) == 0.0
    assert cutoff(*TUBES) == 10.0 and cutoff(links=9) == 10.0
    assert cutoff(*TUBES, "control.rate_filter=0") == 0.0
    assert cutoff("control.rate_filter=25", links=12) == 25.0
    assert cutoff(*TUBES, "control.attitude_rate=20", "control.position_rate=20") == 5.0


def test_control_analysis_tells_it_and_nonsense_is_refused():
    told = control.analyze(load(load_spec("dragon3", overrides=["control.rate_filter=30"])))
    assert told.rate_filter == 30.0 and told.to_json()["rate_filter_hz"] == 30.0
    assert ("low-pass on rates", "30 Hz") in told.rows()
    plain = control.analyze(load("dragon3"))
    assert all("low-pass" not in label for label, _ in plain.rows())
    pairs = zip(*(x.loops["tuned", "dual_rotor"] for x in (told, plain)), strict=True)
    for late, early in pairs:
        assert late.delay_margin < early.delay_margin - 0.004, late.axis
    with pytest.raises(SpecError, match="below 100 Hz, half the attitude_rate"):
        load_spec("dragon3", overrides=["control.rate_filter=100"])
