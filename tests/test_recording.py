"""Recording, metrics, verdict: against closed forms, SciPy, and runs with a fault planted."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from synthetic_run import ROTORS, flight

from snakegen.errors import LogError, MissionError
from snakegen.simulation.recording.metrics import metrics
from snakegen.simulation.recording.recording import STANDARD, Channel, Recording, channel
from snakegen.simulation.recording.signals import rotation_vectors
from snakegen.simulation.recording.verdict import FLIGHT_THRESHOLDS, Verdict, verdict


def _with(recording: Recording, **channels: Channel) -> Recording:
    return dataclasses.replace(recording, channels={**recording.channels, **channels})


def test_position_metrics_of_known_errors():
    time = np.arange(0.0, 20.0, 0.01)
    target = np.column_stack([time, 0 * time, 0 * time + 1.0])
    error = np.column_stack([0.3 * np.exp(-time), 0.1 * np.sin(2 * np.pi * time), 0 * time - 0.02])
    run = Recording(
        time,
        {
            "position": channel("position", target - error),
            "position_target": channel("position_target", target),
        },
    )
    m = metrics(run)
    assert m["position_rmse_m"][1] == pytest.approx(0.1 / math.sqrt(2), rel=1e-9)
    assert m["position_rmse_m"][2] == pytest.approx(0.02, rel=1e-12)
    assert m["position_rmse_settled_m"][0] < 1e-5 < m["position_rmse_m"][0]
    assert m["position_max_m"] == pytest.approx(np.linalg.norm(error, axis=1).max())
    assert m["position_end_m"] == pytest.approx(error[-1].tolist())
    assert "attitude_rmse_rad" not in m and "energy_j" not in m


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=40, deadline=None)
def test_attitude_error_is_scipys_rotation_vector(seed: int):
    rng = np.random.default_rng(seed)
    actual, target = Rotation.random(5, random_state=rng), Rotation.random(5, random_state=rng)
    expected = (actual.inv() * target).as_rotvec()
    flip = rng.choice([-1.0, 1.0], (5, 1))  # q and −q are one attitude
    got = rotation_vectors(flip * actual.as_quat(), target.as_quat())
    np.testing.assert_allclose(got, expected, atol=1e-10)


def test_small_attitude_errors_keep_their_digits():
    tiny = np.array([[1e-9, -2e-9, 3e-9], [0.0, 0.0, 0.0]])
    got = rotation_vectors(np.tile([0.0, 0, 0, 1.0], (2, 1)), Rotation.from_rotvec(tiny).as_quat())
    np.testing.assert_allclose(got, tiny, rtol=1e-9, atol=0)


def test_a_slower_target_is_held_not_interpolated():
    time = np.arange(0.0, 1.0, 0.005)
    slow = time[::5]
    run = Recording(
        time,
        {
            "position": channel("position", np.zeros((time.size, 3))),
            "position_target": channel(
                "position_target", np.column_stack([slow, slow, slow]), time=slow
            ),
        },
    )
    held = np.repeat(slow, 5)
    assert metrics(run)["position_rmse_m"][0] == pytest.approx(math.sqrt(np.mean(held**2)))


def test_saturation_headroom_and_torque_use():
    run = flight(2.0)
    thrust = np.full((run.time.size, 4), 8.0)
    thrust[:100, 2] = 16.0  # the upper limit, on a quarter of 400 ticks
    thrust[100:140, 0] = 0.0  # the lower one
    torque = np.zeros((run.time.size, 1))
    torque[7, 0] = -3.5
    channels = {k: v for k, v in run.channels.items() if k != "thrust_command"}
    run = dataclasses.replace(run, channels=channels)
    run = _with(
        run,
        thrust=channel("thrust", thrust, ROTORS),
        joint_torque=channel("joint_torque", torque, ("joint1_yaw",)),
    )
    m = metrics(run)
    assert m["saturation_share"] == pytest.approx(140 / 400)
    assert m["thrust_headroom"] == 0.0
    assert m["joint_torque_use"] == pytest.approx(0.5)


def test_energy_of_a_linear_power():
    time = np.linspace(0.0, 3.0, 61)
    run = Recording(time, {"power": channel("power", np.column_stack([100 * time, 50 + 0 * time]))})
    m = metrics(run)
    assert m["energy_j"] == pytest.approx(450.0 + 150.0)
    assert m["power_mean_w"] == pytest.approx(200.0)


def test_lying_on_the_floor_is_not_surviving():
    time = np.arange(0.0, 10.0, 0.05)
    fallen = np.where(time < 3.0, 0.5, 0.0)
    still = np.zeros((time.size, 3))
    run = Recording(
        time,
        {
            "position": channel("position", still),
            "position_target": channel("position_target", still),
            "floor_distance": channel("floor_distance", fallen),
        },
    )
    m = metrics(run)
    wanted = {k: FLIGHT_THRESHOLDS[k] for k in ("took_off", "floor_contact_after_takeoff_s")}
    assert m["floor_contact_after_takeoff_s"] == pytest.approx(7.0)
    assert [c.metric for c in verdict(m, wanted).failed] == ["floor_contact_after_takeoff_s"]
    never = _with(run, floor_distance=channel("floor_distance", np.zeros(time.size)))
    assert [c.metric for c in verdict(metrics(never), wanted).failed] == [
        "took_off",
        "floor_contact_after_takeoff_s",
    ]
    climbs = _with(run, floor_distance=channel("floor_distance", np.minimum(time, 1.0)))
    assert verdict(metrics(climbs), wanted).passed
    touch = np.zeros(time.size)
    touch[150] = 12.0  # one tick of contact force is enough
    bumped = _with(climbs, floor_contact=channel("floor_contact", touch))
    assert not verdict(metrics(bumped), wanted).passed


def test_take_off_is_seen_from_forces_alone():
    time = np.arange(0.0, 6.0, 0.01)
    bouncing = (time < 1.0) & (np.sin(40 * time) > 0)
    m = metrics(Recording(time, {"floor_contact": channel("floor_contact", 5.0 * bouncing)}))
    assert m["took_off"] and m["floor_contact_after_takeoff_s"] == 0.0
    fallen = bouncing | (time >= 4.0)
    m = metrics(Recording(time, {"floor_contact": channel("floor_contact", 5.0 * fallen)}))
    assert m["took_off"] and m["floor_contact_after_takeoff_s"] == pytest.approx(2.0)
    lying = np.ones_like(time)
    m = metrics(Recording(time, {"floor_contact": channel("floor_contact", lying)}))
    assert m["took_off"] is False and "floor_contact_after_takeoff_s" not in m
    in_air = np.zeros_like(time)
    m = metrics(Recording(time, {"floor_contact": channel("floor_contact", in_air)}))
    assert m["took_off"] and m["floor_contact_after_takeoff_s"] == 0.0


def test_what_is_not_finite_fails():
    run = flight(1.0)
    bad = run.channel("position").values.copy()
    bad[150, 1] = np.nan
    m = metrics(_with(run, position=channel("position", bad)))
    assert m["finite"] is False and m["position_rmse_m"][1] is None
    failed = {c.metric: c for c in verdict(m, FLIGHT_THRESHOLDS, run.recorded).failed}
    assert {"finite", "position_rmse_m", "position_max_m"} <= failed.keys()
    assert failed["position_max_m"].line() == "FAIL position_max_m = no value (≤ 0.5)"


def test_an_undefined_margin_does_not_hide_the_smallest():
    run = flight(1.0)
    slow = run.times("force_margin")
    margin = np.linspace(5.0, 3.0, slow.size)
    margin[-2] = np.nan
    m = metrics(_with(run, force_margin=channel("force_margin", margin, time=slow)))
    assert m["force_margin_min_n"] == 3.0 and m["finite"] is True
    scaled = np.where(np.isnan(margin), -0.1, 0.2)
    for wrench, least in ((scaled, 0.0), (np.abs(scaled), 3.0)):
        signed = channel("wrench_margin", wrench, time=slow)
        told = _with(run, force_margin=channel("force_margin", margin, time=slow))
        found = metrics(_with(told, wrench_margin=signed))
        assert found["force_margin_min_n"] == least, "out of reach: nothing is borne"


def test_window_limits_what_is_measured():
    run = flight(4.0)
    inside = dataclasses.replace(run, meta={**run.meta, "metrics_window_s": [1.0, 2.0]})
    error = (run.channel("position_target").values - run.channel("position").values)[200:401]
    expected = np.sqrt(np.mean(error**2, axis=0))
    np.testing.assert_allclose(metrics(inside)["position_rmse_m"], expected, rtol=1e-12)


def test_verdict_round_trip_and_kinds():
    m = {"a": 1.0, "b": [0.1, 0.3], "c": True, "d": None}
    thresholds = {
        "a": {"at_least": 1.0},
        "b": {"at_most": [0.2, 0.2]},
        "c": {"equals": True},
        "d": {"at_most": 1.0, "channel": "here"},
        "e": {"at_most": 1.0},
        "f": {"at_most": 1.0, "channel": "here"},
        "g": {"at_most": 1.0, "channel": "not recorded"},
    }
    v = verdict(m, thresholds, {"here"})
    assert [c.passed for c in v.checks] == [True, False, True, False, False, False]
    assert Verdict.from_json(v.to_json()) == v and verdict(m, v.thresholds()) == v
    assert "b" in v.summary() and not v.passed and not Verdict(()).passed
    with pytest.raises(MissionError, match="at_most, at_least"):
        verdict(m, {"a": {"below": 1.0}})
    with pytest.raises(MissionError, match="2 numbers"):
        verdict({"b": [1.0, 2.0, 3.0]}, {"b": {"at_most": [1.0, 2.0]}})


def test_bad_recordings_say_what_is_wrong():
    run = flight(0.5)
    with pytest.raises(LogError, match="Did you mean 'position'"):
        run.channel("positon")
    with pytest.raises(LogError, match=r"'thrust' is float64 \(100, 4\); 50 times and 4"):
        dataclasses.replace(run, time=run.time[:50], channels={"thrust": run.channel("thrust")})
    with pytest.raises(LogError, match="does not rise"):
        Recording(np.array([0.0, 0.1, 0.1]), {})
    with pytest.raises(LogError, match="cannot be JSON"):
        Recording(np.array([0.0]), {}, meta={"robot": object()})
    with pytest.raises(LogError, match=r"needs \(T,\) or \(T, k\)"):
        channel("thrust", np.zeros((2, 2, 2)))


def test_standard_channels_fill_in_their_labels():
    made = channel("position", np.zeros((3, 3)))
    assert (made.unit, made.labels, made.group) == ("m", ("x", "y", "z"), "position")
    assert channel("slip", np.zeros((3, 2))).labels == ("slip_1", "slip_2")
    assert channel("my own", np.zeros(3), unit="K").labels == ("my own",)
    assert all(s.meaning for s in STANDARD.values())
