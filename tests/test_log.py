"""Logs: bit for bit there and back, rerun's own verification, pictures, and damaged files."""

import dataclasses
import os
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from synthetic_run import JOINTS, ROTORS, URDF, flight

from snakegen.errors import LogError
from snakegen.log import compare, inspect, read, snapshot, write
from snakegen.log import skeleton as sk
from snakegen.log.body import drawable
from snakegen.log.scene import scene
from snakegen.log.store import decode, encode
from snakegen.log.style import frames, saturation_colors, standing_out
from snakegen.verify.metrics import metrics
from snakegen.verify.recording import Recording, channel
from snakegen.verify.verdict import FLIGHT_THRESHOLDS, verdict


def _judged(run: Recording) -> Recording:
    numbers = metrics(run)
    return run.judged(numbers, verdict(numbers, FLIGHT_THRESHOLDS))


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
        decode(header.replace('"format": 1', '"format": 99', 1), files)


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

    def full(self: Path, target: Path) -> Path:
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr(Path, "replace", full)
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


def test_compare_two_runs(run: Recording, log: Path, tmp_path: Path):
    other = write(_judged(flight(3.0, seed=5)), tmp_path / "other.rrd")
    rows = {r.metric: r for r in compare(log, other)}
    row = rows["position_rmse_m"]
    assert row.a == run.metrics["position_rmse_m"] and row.b != row.a
    assert row.difference == [b - a for a, b in zip(row.a, row.b, strict=True)]
    assert rows["finite"].difference is None


def test_kinematics_agree_with_pinocchio(run: Recording):
    import pinocchio as pin

    model = pin.buildModelFromXML(URDF, pin.JointModelFreeFlyer())
    assert tuple(model.names)[2:] == JOINTS
    data = model.createData()
    labels, q = run.channel("q").labels, run.channel("q").values[::97]
    poses = sk.skeleton(URDF).poses(sk.base_poses(labels, q), sk.joint_angles(labels, q))
    for i, row in enumerate(q):
        pin.framesForwardKinematics(model, data, row)
        for link in ("link2", "pitch1", *ROTORS):
            place = data.oMf[model.getFrameId(link)]
            rotation, position = poses[link]
            np.testing.assert_allclose(position[i], place.translation, atol=1e-12)
            np.testing.assert_allclose(rotation[i], place.rotation, atol=1e-12)


def test_cosine_and_sine_make_an_angle():
    turn = np.linspace(-3.0, 3.0, 7)
    q = np.column_stack([np.cos(turn), np.sin(turn), 0.1 * turn])
    angles = sk.joint_angles(("screw:cos", "screw:sin", "yaw"), q)
    np.testing.assert_allclose(angles["screw"], turn, atol=1e-15)
    assert set(angles) == {"screw", "yaw"} and angles["yaw"] is not None


def test_the_ghost_is_the_robot_where_it_follows_exactly(run: Recording):
    exact = {
        "position_target": run.channel("position"),
        "attitude_target": run.channel("attitude"),
        "joint_command": run.channel("joint_angle"),
    }
    view = scene(dataclasses.replace(run, channels={**run.channels, **exact}))
    assert view.skeleton is not None
    body = view.skeleton.body_line(view.base, view.angles)
    np.testing.assert_allclose(view.ghost, body, atol=1e-12)
    assert body.shape[1] == 3  # link1, link2, its tip
    np.testing.assert_allclose(np.linalg.norm(body[:, 2] - body[:, 1], axis=1), 0.42, atol=1e-12)
    # a target that is the actual pose moved as one body moves the ghost in the same way
    shift, step = Rotation.from_euler("ZYX", [1.1, 0.4, -0.3]), np.array([0.5, -1.0, 2.0])
    at, turn = run.channel("position").values, Rotation.from_quat(run.channel("attitude").values)
    moved = exact | {
        "position_target": channel("position_target", shift.apply(at) + step),
        "attitude_target": channel("attitude_target", (shift * turn).as_quat()),
    }
    away = scene(dataclasses.replace(run, channels={**run.channels, **moved}))
    expected = shift.apply(body.reshape(-1, 3)).reshape(body.shape) + step
    np.testing.assert_allclose(away.ghost, expected, atol=1e-12)


def test_a_spike_survives_thinning():
    values = np.sin(np.arange(1000) / 50.0)[:, None] * np.ones((1, 3))
    values[437, 1] += 5.0
    values[851, 2] = np.nan
    index = standing_out(values, 7)
    assert {0, 437, 851, 999} <= set(index.tolist()) and index.size < 160
    assert np.all(np.diff(index) > 0)
    assert frames(np.arange(0, 10, 0.005))[1] == 10 and frames(np.array([0.0])).tolist() == [0]


def test_saturation_is_red():
    low, high = saturation_colors(np.array([0.3, 0.995])).astype(int)
    assert low[1] > 2 * low[0] and high[0] > 4 * high[1]


def test_drawable_urdf_has_colours_and_absolute_meshes(tmp_path: Path):
    urdf = URDF.replace('<box size="0.05 0.05 0.03"/>', '<mesh filename="meshes/fan.stl"/>')
    text = drawable(urdf, tmp_path)
    assert str(tmp_path / "meshes" / "fan.stl") in text
    assert text.count("<visual>") == text.count("<material")


def test_plain_picture_shows_the_run(log: Path, tmp_path: Path):
    from matplotlib.image import imread

    png = tmp_path / "plain.png"
    assert snapshot(log, png, time=1.5, renderer="matplotlib", size=(900, 600)) == "matplotlib"
    picture = imread(png)
    assert picture.shape[:2] == (600, 900)
    left = picture[:, :500, :3].reshape(-1, 3)
    red = (left[:, 0] > 0.9) & (left[:, 1] < 0.3) & (left[:, 2] < 0.3)
    assert red.sum() > 50  # rotor2_2 flies at its limit: its arrow is red
    with pytest.raises(LogError, match="no folder"):
        snapshot(log, tmp_path / "no" / "a.png")
    with pytest.raises(LogError, match="there are auto, viewer, matplotlib"):
        snapshot(log, png, renderer="crayon")


def test_viewer_draws_the_log_or_says_what_it_needs(log: Path, tmp_path: Path):
    from matplotlib.image import imread

    png = tmp_path / "viewer.png"
    try:
        snapshot(log, png, time=1.5, renderer="viewer", size=(1200, 800))
    except LogError as error:
        assert "mesa-vulkan-drivers" in str(error)
        pytest.skip("no Vulkan driver here")
    picture = imread(png)[..., :3]
    assert picture.shape[:2] == (800, 1200)
    world = picture[60:560, :700].reshape(-1, 3)
    grey = (world.min(axis=1) > 0.55) & (np.ptp(world, axis=1) < 0.1)
    red = (world[:, 0] > 0.6) & (world[:, 1] < 0.25) & (world[:, 2] < 0.25)
    assert grey.sum() > 500  # the links: there, and not black
    assert red.sum() > 30  # the saturated rotor's arrow
    plots = picture[60:700, 720:].reshape(-1, 3)
    assert (np.ptp(plots, axis=1) > 0.3).sum() > 1000  # coloured curves


def test_importing_the_package_does_not_import_rerun():
    code = "import sys, snakegen.log; sys.exit('rerun' in sys.modules or 'pyarrow' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
