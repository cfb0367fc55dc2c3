"""A log beside measurements: differences by column, and what does not fit is one line."""

from pathlib import Path

import numpy as np
import pytest

import snakegen
from snakegen.errors import AnalysisError, LogError
from snakegen.log.measured import against
from snakegen.simulation.recording.recording import Recording


@pytest.fixture(scope="module")
def flight() -> Recording:
    return snakegen.simulate("dragon4", "hover", duration=2.0, seed=1, trim=0.0)


def _table(path: Path, columns: dict[str, np.ndarray]) -> Path:
    rows = np.column_stack(list(columns.values()))
    text = ",".join(columns) + "\n" + "\n".join(",".join(f"{v:.9g}" for v in r) for r in rows)
    path.write_text(text, encoding="utf-8")
    return path


def test_known_offsets_are_found(flight: Recording, tmp_path: Path) -> None:
    time = np.linspace(0.2, 1.8, 50)
    own = flight.times("position")
    x = np.interp(time, own, flight.channel("position").values[:, 0])
    joints = flight.channel("joint_angle")
    yaw = np.interp(time, flight.times("joint_angle"), joints.values[:, 1])
    bump = np.where(np.arange(50) == 20, 0.3, 0.0)
    table = _table(
        tmp_path / "m.csv",
        {"time": time - 5.0, "x": x + 0.02, joints.labels[1]: yaw + bump, "noise": x},
    )
    found = {d.name: d for d in against(flight, table, shift=5.0)}
    assert set(found) == {"x", joints.labels[1]}
    assert found["x"].rmse == pytest.approx(0.02, abs=1e-6) and found["x"].unit == "m"
    assert found["x"].bias == pytest.approx(0.02, abs=1e-6)
    assert found[joints.labels[1]].largest == pytest.approx(0.3, abs=1e-6)
    assert found[joints.labels[1]].time == pytest.approx(time[20])


def test_attitude_is_compared_over_the_turn(flight: Recording, tmp_path: Path) -> None:
    time = np.linspace(0.2, 1.8, 20)
    quaternion = flight.held("attitude", time)
    yaw = np.arctan2(
        2 * (quaternion[:, 3] * quaternion[:, 2] + quaternion[:, 0] * quaternion[:, 1]),
        1 - 2 * (quaternion[:, 1] ** 2 + quaternion[:, 2] ** 2),
    )
    table = _table(tmp_path / "m.csv", {"time": time, "yaw": yaw + 2 * np.pi})
    (found,) = against(flight, table)
    assert found.rmse < 1e-3


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"time": np.arange(5.0), "a": np.zeros(5)}, "none of the log's columns"),
        ({"time": np.arange(5.0) + 100, "x": np.zeros(5)}, "0 of its 5 times"),
        ({"time": np.zeros(5), "x": np.zeros(5)}, "do not increase"),
        ({"x": np.zeros(5)}, "no column 'time'"),
    ],
)
def test_what_does_not_fit_is_said(
    flight: Recording, tmp_path: Path, columns: dict[str, np.ndarray], message: str
) -> None:
    with pytest.raises((LogError, AnalysisError), match=message):
        against(flight, _table(tmp_path / "m.csv", columns))
