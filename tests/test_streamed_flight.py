"""Long flights in bounded memory: noise, rows, samples, metrics and worst places come in pieces.

Each piece is held against the whole, bit for bit where nothing is summed.
"""

import mmap
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from snakegen.base import sample_store
from snakegen.control.controller import flight_controller
from snakegen.errors import SnakegenError
from snakegen.log import plots, read, write
from snakegen.log.skeleton import angles_of, rotations_from_xyzw
from snakegen.robot.robot import load
from snakegen.simulation.flight.bounds.error_budget import lags
from snakegen.simulation.flight.plant import Imperfections, NoiseStream, draw
from snakegen.simulation.flight.run import prepare, run
from snakegen.simulation.flight.trim import trimmed
from snakegen.simulation.missions import planned
from snakegen.simulation.recording import blocks, signals
from snakegen.simulation.recording.metrics import metrics
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.recording.worst_place import judged_verdict


def test_noise_drawn_in_pieces_is_that_drawn_at_once() -> None:
    what, sizes = Imperfections(turbulence=0.3, wind_speed=1.0), (20_001, 8, 17)
    more = {"hinges": [1.0, 0.5], "servos": 3}
    first, second = np.random.default_rng(5), np.random.default_rng(5)
    whole, stream = draw(what, first, *sizes, **more), NoiseStream(what, second, *sizes, **more)
    assert first.random() == second.random(), "what is drawn later stays the same"
    ends = [0, 1, 200, 201, 17_000, 20_001]
    parts = [stream.rows(a, b) for a, b in pairwise(ends)]
    for name in ("attitude", "position", "velocity", "gyro", "wind", "hinges"):
        joined = np.concatenate([getattr(p, name) for p in parts])
        assert joined.tobytes() == np.ascontiguousarray(getattr(whole, name)).tobytes(), name
        assert np.ptp(joined) > 0.0
    for name in ("thrust_factor", "angles", "torques"):
        assert np.array_equal(getattr(stream, name), getattr(whole, name))
    with pytest.raises(ValueError, match="comes next"):
        stream.rows(0, 10)


@pytest.fixture(scope="module", params=["gust", "switch", "fail", "ring"])
def pair(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory):
    """A flight with wind, a change of mode, a lost rotor, or a pluck: by blocks and at once."""
    options = {
        "gust": {"duration": 3.2, "speed": 3.0, "trim": 0.0},
        "switch": {"duration": 6.0},
        "fail": {"lost": "apparatus2", "at": 1.2, "duration": 2.0},
        "ring": {"duration": 2.2},
    }[request.param]
    robot = load("dragon4")
    ready = prepare(robot, request.param, options=options)
    found = []
    with pytest.MonkeyPatch.context() as patch:
        for seconds in (0.7, 1e3):
            patch.setattr(blocks, "BLOCK", seconds)
            rng, folder = np.random.default_rng(3), tmp_path_factory.mktemp("samples")
            found.append(ready.flown(ready.world(), ready.imperfections, rng, 3, folder=folder))
    return found


def test_a_flight_recorded_by_blocks_is_the_one_recorded_at_once(pair: list[Recording]) -> None:
    parts, whole = pair
    assert parts.channels.keys() == whole.channels.keys()
    for name, c in parts.channels.items():
        other = whole.channels[name]
        np.testing.assert_allclose(c.values, other.values, rtol=1e-13, atol=1e-15, err_msg=name)
        assert c.labels == other.labels
        assert np.array_equal(parts.times(name), whole.times(name))
    assert parts.events == whole.events
    assert parts.metrics.keys() == whole.metrics.keys()
    for check, other in zip(parts.verdict.checks, whole.verdict.checks, strict=True):
        assert (check.metric, check.passed) == (other.metric, other.passed)


def test_metrics_and_worst_places_do_not_depend_on_the_pieces(
    pair: list[Recording], monkeypatch: pytest.MonkeyPatch
) -> None:
    run = pair[1]
    asked = run.verdict.thresholds()
    at_once = metrics(run)
    monkeypatch.setattr(signals, "PIECE", 37)
    found = metrics(run)
    assert found.keys() == at_once.keys()
    for key, value in at_once.items():
        if value is None or (isinstance(value, list) and None in value):
            assert found[key] == value, key
        else:
            assert found[key] == pytest.approx(value, rel=1e-12), key
    again = judged_verdict(run, at_once | {"completed": True}, asked)
    monkeypatch.setattr(signals, "PIECE", 10**6)
    for one, other in zip(
        again.checks, judged_verdict(run, at_once | {"completed": True}, asked).checks, strict=True
    ):
        assert one == other


def test_a_log_is_the_same_from_a_store_and_from_memory(
    pair: list[Recording], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Samples, and curves that are worked out for the plots."""
    run = pair[0]
    inside = plots.series(run)
    second = read(write(run, tmp_path / "1.rrd"))
    monkeypatch.setattr(sample_store, "LONG", 100)
    monkeypatch.setattr(sample_store, "PIECE", 37)
    for one, other in zip(plots.series(run), inside, strict=True):
        assert np.array_equal(one.values, other.values, equal_nan=True), one.name
    first = read(write(run, tmp_path / "0.rrd"))
    for name, c in run.channels.items():
        assert np.array_equal(first.channels[name].values, c.values, equal_nan=True)
        assert np.array_equal(second.channels[name].values, c.values, equal_nan=True)


def test_a_journal_takes_the_same_flight() -> None:
    """Recorded behind the flight, second by second: the samples are those recorded in its loop."""
    ready = prepare(load("dragon4"), "hover", options={"duration": 2.5, "trim": 0.0})
    kept: list[Recording] = []

    def flown(**more) -> Recording:
        return ready.flown(ready.world(), ready.imperfections, np.random.default_rng(3), 3, **more)

    inside, behind = flown(), flown(keep=kept.append)
    assert [len(block.time) for block in kept] == [200, 200] and "q" in kept[0]
    for name, c in behind.channels.items():
        np.testing.assert_allclose(
            c.values, inside.channels[name].values, rtol=1e-13, atol=1e-15, err_msg=name
        )

    def full(block: Recording) -> None:
        raise SnakegenError("the disk is full")

    with pytest.raises(SnakegenError, match="the disk is full"):
        flown(keep=full)


def test_a_long_drive_is_the_short_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its rows lie on the disk, and give the same recording, metrics and places."""
    options = {"duration": 0.6}
    short = run(load("screw4"), "square", options=options)
    monkeypatch.setattr(sample_store, "LONG", 40)
    monkeypatch.setattr(sample_store, "PIECE", 17)
    long = run(load("screw4"), "square", options=options, folder=tmp_path)
    assert isinstance(_owner(long["state_error"]), mmap.mmap) and not list(tmp_path.iterdir())
    for name, c in short.channels.items():
        assert np.array_equal(long[name], c.values, equal_nan=True), name
        assert np.array_equal(long.times(name), short.times(name))
    assert long.metrics.keys() == short.metrics.keys()
    for key, value in short.metrics.items():
        np.testing.assert_allclose(
            np.array(long.metrics[key], float), np.array(value, float), rtol=1e-12, err_msg=key
        )
    assert [c.passed for c in long.verdict.checks] == [c.passed for c in short.verdict.checks]


def test_turns_are_unwrapped_across_pieces(
    pair: list[Recording], monkeypatch: pytest.MonkeyPatch
) -> None:
    time = pair[0].time
    yaw = np.linspace(0.0, 14.0, len(time))
    attitude = np.column_stack([0 * yaw, 0 * yaw, np.sin(yaw / 2), np.cos(yaw / 2)])
    like = pair[0].channels["attitude"]
    turning = replace(pair[0], channels={"attitude": replace(like, values=attitude)})
    monkeypatch.setattr(sample_store, "LONG", 100)
    monkeypatch.setattr(sample_store, "PIECE", 50)
    found = next(s for s in plots.series(turning) if s.name == "attitude").values
    np.testing.assert_allclose(found[:, 2], yaw, atol=1e-9)
    np.testing.assert_allclose(found, angles_of(rotations_from_xyzw(attitude)), atol=1e-9)


@pytest.mark.parametrize("mission", ["transform", "path"])
def test_a_long_plan_is_the_short_one(
    mission: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rows made in pieces and kept on a disk are those made at once."""
    robot, options = load("dragon4"), {}
    if mission == "path":
        file = tmp_path / "way.yaml"
        file.write_text(
            "waypoints:\n- {time: 0, position: [0, 0, 1.5]}\n"
            "- {time: 3, position: [0.5, 0, 1.5], rpy: [0, 0, 0.4], joints: {joint1_yaw: 0.3}}\n"
            "- {time: 6, position: [0, 0.2, 1.7], rpy: [0.05, 0, 0]}\n",
            encoding="utf-8",
        )
        options = {"file": str(file)}
    short = trimmed(planned(mission, robot, 200.0, **options), 1.0)
    monkeypatch.setattr(sample_store, "LONG", 100)
    monkeypatch.setattr(sample_store, "PIECE", 333)
    with sample_store.samples_in(tmp_path):
        long = trimmed(planned(mission, robot, 200.0, **options), 1.0)
    for name in ("position", "velocity", "acceleration", "rotation", "angular", "joints"):
        one, other = getattr(short, name), getattr(long, name)
        np.testing.assert_allclose(other, one, rtol=0, atol=1e-15, err_msg=name)
    assert isinstance(_owner(long.joints), mmap.mmap), "in memory"
    what = Imperfections()
    c = flight_controller(robot)
    assert np.allclose(lags(c, long, what, 40.0), lags(c, short, what, 40.0), rtol=1e-12, atol=0)


def _owner(values: np.ndarray) -> object:
    """Returns what holds the memory of an array."""
    while isinstance(values, np.ndarray):
        values = values.base
    return getattr(values, "obj", values)
