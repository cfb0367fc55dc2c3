"""Logs: bit for bit there and back, rerun's own verification, pictures, and damaged files."""

import dataclasses
import os
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from synthetic_run import JOINTS, ROTORS, URDF, flight

from snakegen.errors import LogError
from snakegen.log import inspect, read, snapshot, write
from snakegen.log.checksum import Sealed
from snakegen.log.scene import scene
from snakegen.log.store import decode, encode
from snakegen.simulation.recording.metrics import metrics
from snakegen.simulation.recording.recording import Recording, channel
from snakegen.simulation.recording.verdict import FLIGHT_THRESHOLDS
from snakegen.simulation.recording.worst_place import judged_verdict


def _judged(run: Recording) -> Recording:
    numbers = metrics(run)
    return run.judged(numbers, judged_verdict(run, numbers, FLIGHT_THRESHOLDS))


@pytest.fixture(scope="module")
def run() -> Recording:
    return _judged(flight(3.0))


@pytest.fixture(scope="module")
def log(run: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(run, tmp_path_factory.mktemp("log") / "flight.rrd")


def _same(a: Recording, b: Recording) -> None:
    assert a.time.tobytes() == b.time.tobytes()
    assert list(a.channels) == list(b.channels)
    for name, c in a.channels.items():
        d = b.channels[name]
        assert (c.unit, c.labels, c.group, c.meaning) == (d.unit, d.labels, d.group, d.meaning)
        assert c.values.shape == d.values.shape and c.values.tobytes() == d.values.tobytes()
        assert (c.time is None) == (d.time is None)
        assert c.time is None or c.time.tobytes() == d.time.tobytes()
    for part in ("events", "meta", "report", "metrics", "verdict"):
        assert getattr(a, part) == getattr(b, part)


def test_read_returns_every_bit(run: Recording, log: Path):
    back = read(log)
    _same(run, back)
    assert metrics(back) == run.metrics
    again = inspect(log)
    assert again.metrics == run.metrics and again.differing == ()
    assert again.verdict == run.verdict


def test_awkward_numbers_survive(tmp_path: Path):
    odd = np.array([np.nan, -0.0, 5e-324, np.inf, 1 / 3, -np.pi])
    run = Recording(np.cumsum([0.1] * 6), {"odd": channel("odd", odd)}, meta={"robot": "θ, ∅"})
    _same(run, read(write(run, tmp_path / "odd.rrd")))


@pytest.mark.parametrize("lost", [["q"], ["attitude", "position"], ["thrust", "joint_command"]])
def test_a_run_that_diverged_can_be_logged(run: Recording, tmp_path: Path, lost: list[str]):
    channels = dict(run.channels)
    for name in lost:
        values = channels[name].values.copy()
        values[400:] = np.nan
        channels[name] = dataclasses.replace(channels[name], values=values)
    broken = dataclasses.replace(run, channels=channels)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        path = write(_judged(broken), tmp_path / "broken.rrd")
        snapshot(path, tmp_path / "broken.png", renderer="matplotlib", size=(900, 600))
    back = read(path)
    assert back.verdict is not None and not back.verdict.passed
    assert np.isnan(back.channel(lost[0]).values[450:]).all()


def test_a_run_of_one_tick_can_be_logged(run: Recording, tmp_path: Path):
    first = {
        k: dataclasses.replace(c, values=c.values[:1], time=None if c.time is None else c.time[:1])
        for k, c in run.channels.items()
    }
    short = _judged(dataclasses.replace(run, time=run.time[:1], channels=first))
    _same(short, read(write(short, tmp_path / "short.rrd")))


def test_a_log_that_states_other_numbers_is_told(run: Recording, tmp_path: Path):
    lie = run.metrics | {"position_max_m": 0.001}
    path = write(dataclasses.replace(run, metrics=lie), tmp_path / "lie.rrd")
    assert inspect(path).differing == ("position_max_m",)


def test_equal_columns_are_stored_once(run: Recording):
    _, files = encode(run)
    own = {k: c for k, c in run.channels.items() if k not in ("joint_angle", "gimbal_angle")}
    _, fewer = encode(dataclasses.replace(run, channels=own))
    assert len(files) == 2  # ticks and margins
    assert [len(f) for f in files] == [len(f) for f in fewer]


def test_changed_samples_are_refused(run: Recording):
    header, files = encode(run)
    with pytest.raises(LogError, match="changed"):
        decode(header, [files[0][:-9] + b"x" + files[0][-8:], *files[1:]])
    with pytest.raises(LogError, match="format 99"):
        decode(header.replace('"format": 3', '"format": 99', 1), files)


def test_rerun_verifies_the_log(log: Path):
    done = subprocess.run(
        [sys.executable, "-m", "rerun", "rrd", "verify", str(log)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "without error" in done.stdout + done.stderr


def test_what_rerun_sees(run: Recording, log: Path):
    """Entities, rates and values as any rerun program finds them."""
    from rerun.chunk import RrdReader

    reader = RrdReader(log)
    assert len(reader.blueprints()) == 1
    chunks = [c for c in reader.store().stream() if not c.is_static]
    by_path = {c.entity_path: c for c in chunks}
    assert {f"/world/motion/{j}" for j in JOINTS} <= by_path.keys()
    assert {f"/world/thrust/{r}" for r in ROTORS} <= by_path.keys()
    assert {"/world/motion/base", "/world/target/ghost", "/world/disturbance"} <= by_path.keys()
    assert all(c.timeline_names == ["time"] for c in chunks)
    filled = [c for c in reader.store().stream() if "/visual_geometries/" in c.entity_path]
    solid = [c for c in filled if any("fill_mode" in n for n in c.to_record_batch().schema.names)]
    assert len(solid) == URDF.count("<visual>")  # else rerun draws primitives as wires
    # 3 s fit the plots' budget: every tick is plotted, as the float64 that was recorded
    batch = by_path["/plot/thrust/thrust"].to_record_batch()
    scalars = batch.column(batch.schema.names.index("Scalars:scalars"))
    values = np.array(scalars.to_pylist())
    assert values.tobytes() == run.channel("thrust").values.tobytes()


def test_arrows_point_where_the_force_acts(run: Recording, log: Path):
    from rerun.chunk import RrdReader

    view = scene(run)
    thrust = run.held("thrust", view.time)
    for c in RrdReader(log).store().stream():
        kind, _, name = c.entity_path.strip("/").rpartition("/")
        batch = c.to_record_batch()
        if kind == "world/thrust" and "CoordinateFrame:frame" in batch.schema.names:
            column = batch.column(batch.schema.names.index("CoordinateFrame:frame"))
            assert column.to_pylist() == [[name]]  # rotors' links have the rotors' names here
        if kind == "world/thrust" and not c.is_static:
            arrows = np.array(
                batch.column(batch.schema.names.index("Arrows3D:vectors")).to_pylist()
            )[:, 0]
            expected = thrust[:, ROTORS.index(name)] * view.newton
            np.testing.assert_allclose(arrows[:, 2], expected, rtol=1e-6)
            assert np.all(arrows[:, :2] == 0) and np.all(arrows[:, 2] > 0.05)
        if c.entity_path == "/world/disturbance" and not c.is_static:
            push = np.array(batch.column(batch.schema.names.index("Arrows3D:vectors")).to_pylist())[
                :, 0
            ]
            assert push[:, 1].max() == pytest.approx(6.0 * view.newton) and push[0, 1] == 0


def test_motion_is_the_recorded_one(run: Recording, log: Path):
    from rerun.chunk import RrdReader

    view = scene(run)
    for c in RrdReader(log).store().stream():
        if c.entity_path == "/world/motion/joint1_yaw":
            batch = c.to_record_batch()
            names = [n.rsplit(":", 1)[-1] for n in batch.schema.names]
            ends = {
                k: batch.column(names.index(k)).to_pylist() for k in ("parent_frame", "child_frame")
            }
            assert ends["parent_frame"][0] == ["link1"] and ends["child_frame"][-1] == ["link2"]
            turn = np.array(batch.column(names.index("quaternion")).to_pylist())[:, 0]
            half = 0.5 * view.angles["joint1_yaw"]
            np.testing.assert_allclose(
                turn[:, 2:], np.column_stack([np.sin(half), np.cos(half)]), atol=1e-6
            )
            return
    pytest.fail("joint1_yaw does not move")


def test_joints_with_a_frame_of_their_own_are_not_static(log: Path):
    """Two entities with one static child frame make the viewer drop the joint."""
    from rerun.chunk import RrdReader

    for c in RrdReader(log).store().stream():
        if c.entity_path.startswith("/world/motion"):
            assert not c.is_static


def test_size_of_a_minute(tmp_path: Path):
    path = write(_judged(flight(60.0)), tmp_path / "minute.rrd")
    assert path.stat().st_size < 10e6
    assert read(path).time.size == 12000


def test_nothing_is_left_when_writing_fails(run: Recording, tmp_path: Path, monkeypatch):
    with pytest.raises(LogError, match="no folder"):
        write(run, tmp_path / "missing" / "a.rrd")
    with pytest.raises(LogError, match="is a folder"):
        write(run, tmp_path)
    path = tmp_path / "kept.rrd"
    path.write_bytes(b"earlier")

    def full(self: Sealed, content: bytes) -> int:
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr(Sealed, "write", full)
    with pytest.raises(LogError, match="No space left"):
        write(run, path)
    assert path.read_bytes() == b"earlier" and [p.name for p in tmp_path.iterdir()] == ["kept.rrd"]


@pytest.mark.parametrize("share", [0.0, 0.001, 0.2, 0.6, 0.9, 0.9999])
def test_a_truncated_log_is_one_clear_line(log: Path, tmp_path: Path, share: float):
    cut = tmp_path / "cut.rrd"
    data = log.read_bytes()
    cut.write_bytes(data[: int(share * len(data))])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(LogError) as caught:
            read(cut)
    assert "cut.rrd" in str(caught.value) and "\n" not in str(caught.value)


def test_foreign_files_are_told_apart(tmp_path: Path):
    import rerun as rr

    foreign = tmp_path / "foreign.rrd"
    rec = rr.RecordingStream("someone_else")
    rec.save(foreign)
    rec.log("a", rr.TextLog("hello"))
    rec.flush()
    rec.disconnect()
    with pytest.raises(LogError, match="snakegen did not write it"):
        read(foreign)
    (tmp_path / "text.rrd").write_text("<robot/>")
    with pytest.raises(LogError, match="not a rerun log"):
        read(tmp_path / "text.rrd")
    with pytest.raises(LogError, match="there is no log"):
        read(tmp_path / "none.rrd")


def test_importing_the_package_does_not_import_rerun():
    code = "import sys, snakegen.log; sys.exit('rerun' in sys.modules or 'pyarrow' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
