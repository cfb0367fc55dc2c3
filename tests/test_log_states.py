"""The timeline of states of a log: mode, limits by name, verdict, and that rerun holds it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_run import ROTORS, flight

from snakegen.log import states, write
from snakegen.simulation.recording import signals
from snakegen.simulation.recording.metrics import metrics
from snakegen.simulation.recording.recording import Recording, channel
from snakegen.simulation.recording.worst_place import judged_verdict


@pytest.fixture
def run() -> Recording:
    """Rotors 2 and 3 at their limit for a while, once more for a tick; the torque too."""
    whole = flight(4.0)
    time, thrust = whole.time, np.full((len(whole.time), 4), 8.0)
    thrust[(time >= 1.0) & (time < 1.5), 1] = 16.0
    thrust[(time >= 1.2) & (time < 1.5), 2] = 16.0
    thrust[300, 0] = 0.0  # at 1.5 s, the least thrust: a limit too
    thrust[310, 1] = 16.0
    torque = np.where((time >= 3.0)[:, None], -6.99, 1.0)
    channels = whole.channels | {
        "thrust_command": channel("thrust_command", thrust, ROTORS),
        "joint_torque": channel("joint_torque", torque, ("joint1_yaw",)),
    }
    meta = whole.meta | {
        "mode": "dual_rotor",
        "mode_changes": [[1.0, "virtual_single_rotor"], [3.0, "dual_rotor"]],
    }
    run = replace(whole, channels=channels, meta=meta)
    found = metrics(run)
    asked = {"saturation_share": {"at_most": 0.05}, "joint_torque_use": {"at_most": 1.0}}
    return run.judged(found, judged_verdict(run, found, asked))


def _at(lane: states.Lane) -> list[tuple[float, str]]:
    return list(zip(lane.times, lane.states, strict=True))


def test_lanes_name_what_is_at_its_limit(run: Recording) -> None:
    found = {lane.name: _at(lane) for lane in states.lanes(run)}
    assert found["mode"] == [
        (0.0, "dual rotor"), (1.0, "virtual single rotor"), (3.0, "dual rotor")
    ]  # fmt: skip
    assert found["rotor thrust"] == [
        (0.0, "free"), (1.0, "rotor1_2"), (1.2, "rotor1_2, rotor2_1"), (1.5, "rotor1_1"),
        (1.55, "rotor1_2"), (1.555, "free"),
    ]  # fmt: skip
    assert found["joint torque"] == [(0.0, "free"), (3.0, "joint1_yaw")]
    assert [state for _, state in found["gimbal torque"]] == ["free"]
    assert found["verdict"][-1][1] == "failed"
    marks = found["saturation_share"]
    assert marks[0] == (0.0, "ok") and marks[1] == (1.0, "beyond its bound: rotor1_2")
    assert "joint_torque_use" not in found


def test_lanes_do_not_depend_on_the_pieces(run: Recording, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = states.lanes(run)
    monkeypatch.setattr(signals, "PIECE", 37)
    assert states.lanes(run) == whole


def test_a_lane_that_flickers_is_calmed() -> None:
    """A limit cycle of a tick on, a tick off is one stretch; real pauses stay."""
    times = [0.0, *(1.0 + 0.005 * np.arange(400)), 4.0, 4.005]
    kinds = ["free", *(("rotor1", "free") * 200), "rotor1", "free"]
    lane = states._calmed("rotor thrust", times, kinds, "free")
    assert lane.times == (0.0, 1.0, pytest.approx(2.995), 4.0, 4.005)
    busy = [f"rotor{k % 7}" for k in range(50_000)]
    many = states._calmed("rotor thrust", list(np.arange(50_000) * 0.005), busy, "free")
    assert 2 < len(many.times) <= states.MOST


def test_rerun_holds_the_lanes(run: Recording, tmp_path: Path) -> None:
    from rerun.chunk import RrdReader

    reader = RrdReader(write(run, tmp_path / "f.rrd"))
    found: dict[str, list[str]] = {}
    for chunk in reader.store().stream():
        batch = chunk.to_record_batch()
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            if name == "StateChange:state" or name.endswith(":StateChange:state"):
                values = [v for row in column.to_pylist() for v in row]
                found.setdefault(chunk.entity_path.strip("/"), []).extend(values)
    assert found["state/mode"] == ["dual rotor", "virtual single rotor", "dual rotor"]
    assert set(found["state/joint_torque"]) == {"free", "joint1_yaw"}
    assert "state/saturation_share" in found
