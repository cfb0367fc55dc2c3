"""Every check of a verdict names its worst part and time: faults planted in known places."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from synthetic_run import flight

from snakegen.simulation.flight.run import run
from snakegen.simulation.recording.metrics import metrics
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.recording.verdict import FLIGHT_THRESHOLDS, Check, Verdict
from snakegen.simulation.recording.worst_place import judged_verdict


def changed(run: Recording, name: str, column: int, span: tuple[float, float], to: Any):
    """Returns the run with `to(values)` of one column of a channel over `span` s."""
    channel = run.channel(name)
    time = run.times(name)
    values = channel.values.copy()
    rows = (time >= span[0]) & (time <= span[1])
    values[rows, column] = to(values[rows, column])
    return replace(run, channels=run.channels | {name: replace(channel, values=values)})


def check(run: Recording, metric: str, bounds: dict[str, Any] | None = None) -> Check:
    found = judged_verdict(run, metrics(run), bounds or FLIGHT_THRESHOLDS)
    return next(c for c in found.checks if c.metric == metric)


@pytest.mark.parametrize(
    ("metric", "channel", "column", "part", "to"),
    [
        ("joint_torque_use", "joint_torque", 0, "joint1_yaw", lambda v: 0 * v - 7.0),
        ("gimbal_torque_limit_share", "gimbal_torque", 2, "gimbal2_roll", lambda v: 0 * v + 3.0),
        ("saturation_share", "thrust_command", 3, "rotor2_2", lambda v: 0 * v + 16.0),
        ("saturation_share", "thrust_command", 1, "rotor1_2", lambda v: 0 * v),
        ("position_rmse_m", "position", 1, "y", lambda v: v + 0.6),
        ("position_max_m", "position", 2, "z", lambda v: v - 0.9),
        ("min_self_distance_m", "self_distance", 0, "", lambda v: 0 * v - 0.001),
        ("finite", "joint_angle", 0, "joint_angle joint1_yaw", lambda v: 0 * v + np.nan),
    ],
)
def test_a_planted_fault_is_named_with_its_time(metric, channel, column, part, to):
    span = (1.6, 2.4)
    fine = changed(flight(), "thrust_command", 3, (0.0, 9.0), lambda v: v - 4.0)  # it saturates
    bad = changed(fine, channel, column, span, to)
    found = check(bad, metric)
    assert not found.passed and check(fine, metric).passed
    assert found.worst is not None and found.worst.part == part
    assert found.worst.from_s == pytest.approx(span[0], abs=0.06)
    assert found.worst.to_s == pytest.approx(span[1], abs=0.06)
    assert found.worst.from_s <= found.worst.time_s <= found.worst.to_s
    assert part in found.line() and f"{found.worst.from_s:.2f}" in found.line()


def test_two_loaded_servos_the_one_nearer_to_its_own_limit_is_named():
    """3 of 7 N·m at the joint are less than 2 of 3 at a gimbal; the longer stay decides a share."""
    run = changed(flight(), "gimbal_torque", 0, (1.0, 1.2), lambda v: 0 * v + 3.0)
    run = changed(run, "gimbal_torque", 3, (2.0, 3.0), lambda v: 0 * v - 3.0)
    found = check(run, "gimbal_torque_limit_share")
    assert found.worst.part == "gimbal2_pitch" and found.worst.from_s == pytest.approx(2.0)


def test_the_axis_farthest_beyond_its_own_bound_is_named():
    run = changed(flight(), "position", 0, (1.0, 3.0), lambda v: v + 0.30)
    run = changed(run, "position", 2, (1.0, 3.0), lambda v: v + 0.20)
    bounds = {"position_rmse_m": {"at_most": [0.2, 0.2, 0.02]}}
    assert check(run, "position_rmse_m", bounds).worst.part == "z"


def test_settled_errors_are_placed_after_their_start_error():
    import dataclasses

    long = flight(14.0)
    late = changed(long, "position", 0, (0.0, 4.0), lambda v: v + 0.5)
    late = changed(late, "position", 1, (11.0, 12.0), lambda v: v + 0.3)
    from snakegen.simulation.recording.worst_place import worst_place

    error = late.channel("position").values - late.channel("position_target").values
    channel = dataclasses.replace(
        late.channel("position"), values=error, labels=("x", "y", "heading")
    )
    drive = replace(late, channels=late.channels | {"state_error": channel})
    whole = worst_place(drive, "distance_rmse_m", 0.3, 0.01)
    settled = worst_place(drive, "distance_rmse_settled_m", 0.1, 0.05)
    assert whole.part == "x" and settled.part == "y" and 11.0 <= settled.from_s <= 11.05


def test_a_flight_names_the_joint_that_rests_at_its_limit():
    """0.3 N·m are less than the joints of a changing body need."""
    from snakegen.robot.robot import load
    from snakegen.spec.loading import load_spec

    weak = load(load_spec("dragon4", overrides=["joint.effort=0.3"]))
    flown = run(weak, "transform", seed=0)
    found = next(c for c in flown.verdict.failed if c.metric == "joint_torque_use")
    torque = np.abs(flown.channel("joint_torque").values)
    labels = flown.channel("joint_torque").labels
    inside = (flown.time >= found.worst.from_s) & (flown.time <= found.worst.to_s)
    assert found.worst.part in labels
    assert torque[inside][:, labels.index(found.worst.part)].min() >= 0.99 * 0.3
    again = Verdict.from_json(flown.verdict.to_json())
    assert again == flown.verdict


def test_verdicts_of_older_logs_are_read():
    old = {"metric": "a", "value": 1.0, "kind": "at_most", "bound": 2.0, "passed": True}
    assert Verdict.from_json({"checks": [old]}).checks[0].worst is None
