"""What a log shows: kinematics against Pinocchio, ghost, colours, thinning, pictures."""

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from synthetic_run import JOINTS, ROTORS, URDF, flight

from snakegen.errors import LogError
from snakegen.log import skeleton as sk
from snakegen.log import snapshot, write
from snakegen.log.body import drawable
from snakegen.log.scene import scene
from snakegen.log.style import frames, saturation_colors, standing_out, stride_for
from snakegen.simulation.recording.metrics import metrics
from snakegen.simulation.recording.recording import Recording, channel
from snakegen.simulation.recording.verdict import FLIGHT_THRESHOLDS, verdict


@pytest.fixture(scope="module")
def run() -> Recording:
    made = flight(3.0)
    numbers = metrics(made)
    return made.judged(numbers, verdict(numbers, FLIGHT_THRESHOLDS, made.recorded))


@pytest.fixture(scope="module")
def log(run: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(run, tmp_path_factory.mktemp("log") / "flight.rrd")


def test_roll_pitch_yaw_are_scipys():
    turn = Rotation.from_euler("ZYX", np.random.default_rng(3).uniform(-1.4, 1.4, (50, 3)))
    got = sk.angles_of(sk.rotations_from_xyzw(turn.as_quat()))
    np.testing.assert_allclose(got, turn.as_euler("ZYX")[:, ::-1], atol=1e-12)


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
    index, kept = standing_out(values, 7)
    assert np.array_equal(kept, values[index], equal_nan=True)
    assert {0, 437, 851, 999} <= set(index.tolist()) and index.size < 160
    assert np.all(np.diff(index) > 0)
    assert frames(np.arange(0, 10, 0.005))[1] == 10 and frames(np.array([0.0])).tolist() == [0]


def test_a_spike_survives_the_first_thinning_wherever_it_is():
    """Of two ticks neither stands out, so three is the least that is thinned by."""
    strides = [stride_for(n) for n in range(0, 2_000_000, 10_000)]
    assert strides[0] == 1 and 2 not in strides and 3 in strides and strides[-1] > 3
    for at in range(1200, 1206):
        values = np.zeros((2400, 1))
        values[at] = 8.0
        assert at in standing_out(values, 3)[0]


def test_saturation_is_red():
    low, high = saturation_colors(np.array([0.3, 0.995])).astype(int)
    assert low[1] > 2 * low[0] and high[0] > 4 * high[1]


def test_drawable_urdf_has_colours_and_absolute_meshes(tmp_path: Path):
    urdf = URDF.replace('<box size="0.05 0.05 0.03"/>', '<mesh filename="meshes/fan.stl"/>')
    assert "fan.stl" not in drawable(urdf, tmp_path)  # rerun would warn of a file that is nowhere
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "fan.stl").touch()
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
    for time in (float("nan"), -0.1, 3.2):
        with pytest.raises(LogError, match=f"no time {time:g} s; it goes from 0 to 2.995 s"):
            snapshot(log, png, time=time)
    with pytest.raises(LogError, match=r"d\.jpg: a picture's name must end in \.png"):
        snapshot(log, tmp_path / "d.jpg")
    assert not (tmp_path / "d.jpg").exists()


def test_inspect_names_the_picture(log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    from click.testing import CliRunner

    from snakegen.cli.inspect import inspect

    monkeypatch.setattr(sys, "executable", "/bin/false")  # the viewer ends before it answers
    png = tmp_path / "end.png"
    found = CliRunner().invoke(inspect, [str(log), "--png", str(png), "--time", "3"])
    assert found.stderr == f"{png} (drawn by matplotlib)\n" and png.is_file()


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


def test_what_is_recorded_seldom_is_plotted_whole(tmp_path: Path):
    """The curves of a long run are thinned; ten points a second show each."""
    from rerun.chunk import RrdReader

    run = flight(30.0)
    rows: dict[str, int] = {}
    for chunk in RrdReader(write(run, tmp_path / "a.rrd")).store().stream():
        if not chunk.is_static:
            rows[chunk.entity_path] = rows.get(chunk.entity_path, 0) + chunk.num_rows
    slow = run.times("force_margin").size
    assert slow < 1000 and rows["/plot/margins/force_margin"] == slow
    assert rows["/plot/thrust/thrust"] < run.time.size / 2


def test_a_picture_has_the_solids_near_the_body(run: Recording):
    from matplotlib.figure import Figure

    from snakegen.log.plain_solids import draw_solids

    middle = run.held("position", np.array([1.0]))[0]
    aside, away = np.array([0.0, 0.5, 0.0]), np.array([90.0, 0.0, 0.0])
    wall = {"centre": (middle + aside).tolist(), "half": [5.0, 0.02, 5.0]}
    far = {"centre": (middle + away).tolist(), "half": [0.1, 0.1, 0.1]}
    column = {"kind": "cylinder", "centre": middle.tolist(), "size": [0.05, 0.4]}
    seen = dataclasses.replace(run, meta={**run.meta, "obstacles": [wall, far, column]})
    axes = Figure().add_subplot(projection="3d")
    corners, rims, floor = draw_solids(axes, seen, scene(run), 1.0)
    assert len(axes.collections) == 2  # the third solid would make the body small
    assert np.allclose(np.ptp(np.abs(corners[:, 1] - middle[1] - 0.5)), 0.0, atol=1e-12)
    assert np.ptp(corners[:, 0]) < 10.0
    assert np.allclose(np.linalg.norm(rims[:, :2] - middle[:2], axis=1), 0.05)
    assert floor[0].tolist() == [middle[0], middle[1], 0.0] and len(axes.lines) > 10


def test_the_names_of_curves_stand_beside_them(
    run: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    import matplotlib.figure

    from snakegen.log import plain_picture

    figures = []

    class Kept(matplotlib.figure.Figure):
        def __init__(self, *args: object, **options: object):
            super().__init__(*args, **options)
            figures.append(self)

    monkeypatch.setattr("matplotlib.figure.Figure", Kept)
    plain_picture.draw(run, tmp_path / "picture.png", 1.0, (800, 500))
    for axes in figures[0].axes[1:]:
        names = axes.get_legend().get_window_extent(figures[0].canvas.get_renderer())
        assert names.x0 >= axes.get_window_extent().x1 - 1.0


def test_two_dozen_curves_have_colours_of_their_own():
    from snakegen.log.style import color

    assert len({color(index) for index in range(24)}) == 24
