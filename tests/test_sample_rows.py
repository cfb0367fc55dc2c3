"""Rows of samples in stores and windows: added one by one, given back, bounded in memory."""

import mmap
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from snakegen.base import sample_store
from snakegen.base.sample_store import SampleStore
from snakegen.base.window_array import WindowArray
from snakegen.control.controller import flight_controller
from snakegen.errors import SnakegenError
from snakegen.robot.robot import load
from snakegen.simulation.flight.flown import Flown
from snakegen.simulation.flight.loop import fly
from snakegen.simulation.flight.plan import Failure
from snakegen.simulation.flight.plant import Imperfections, NoiseStream, draw
from snakegen.simulation.flight.world import make_world
from snakegen.simulation.missions import planned


def _owner(values: np.ndarray) -> object:
    """Returns what holds the memory of an array."""
    while isinstance(values, np.ndarray):
        values = values.base
    return getattr(values, "obj", values)


def test_rows_added_one_by_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=250), rng.normal(size=(250, 3))

    def filled(most: int) -> dict[str, np.ndarray]:
        rows = sample_store.RowStore(most)
        for k in range(250):
            rows.add(a=a[k], b=b[k])
        return rows.arrays()

    inside = filled(300)
    monkeypatch.setattr(sample_store, "LONG", 100)
    monkeypatch.setattr(sample_store, "PIECE", 50)
    with sample_store.samples_in(tmp_path):
        outside = filled(300)
    for found in (inside, outside):
        assert np.array_equal(found["a"], a) and np.array_equal(found["b"], b)
    assert isinstance(_owner(outside["b"]), mmap.mmap) and not list(tmp_path.iterdir())


def test_rows_that_were_taken_are_given_back() -> None:
    """The loop keeps what its watcher has not taken; delays and failures reach across looks."""
    robot = load("dragon4")
    world, what = make_world(robot), Imperfections(delay=0.02)
    plan = replace(
        planned("hover", robot, 200.0, duration=3.0), failures=(Failure(1.99, 2.2, (2,)),)
    )
    sizes = (len(plan.time), len(world.rotors), len(world.qpos))
    taken: list[Flown] = []

    def watch(ticks: int, rows) -> int:
        first = sum(part.ticks for part in taken)
        taken.append(rows(first, ticks))
        return ticks

    def flight(noise, **more) -> Flown:
        return fly(world, plan, flight_controller(robot), noise, what, **more)

    whole = flight(draw(what, np.random.default_rng(0), *sizes))
    copies: list[np.ndarray] = []

    def copying(ticks: int, rows) -> int:
        done = watch(ticks, rows)
        copies.append(np.hstack([taken[-1].qpos, taken[-1].command]))
        return done

    rest = flight(NoiseStream(what, np.random.default_rng(0), *sizes), watch=copying)
    assert rest.ticks == 0 and rest.first == whole.ticks and whole.first == 0
    assert np.concatenate(copies).tobytes() == np.hstack([whole.qpos, whole.command]).tobytes()
    assert rest.events == whole.events


def test_a_window_holds_the_memory_of_its_rows() -> None:
    array = WindowArray((1_000_000, 8))  # 64 MB

    def resident() -> int:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    before = resident()
    for first in range(0, 1_000_000, 10_000):
        array.values[first : first + 10_000] = first
        array.drop(first)
    assert resident() - before < 8e6
    assert np.all(array.values[-10_000:] == 990_000)


def test_a_store_keeps_columns_and_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, rng = SampleStore(tmp_path), np.random.default_rng(0)
    values, more = rng.normal(size=(1000, 3)), rng.normal(size=(50, 2))
    columns = store.reserve(1000, 3)
    for first in (0, 400):
        store.put(columns, first, values[first : first + 600])
    early = store.array(columns, 700)
    other = store.reserve(60, 2)
    store.put(other, 0, more)
    store.release()
    assert np.array_equal(early, values[:700]) and np.array_equal(store.array(other, 50), more)
    assert not list(tmp_path.iterdir())

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(SnakegenError, match=r"has no room for 8\.\d+ MB of samples \(No space"):
        store.reserve(1_000_000, 1)
