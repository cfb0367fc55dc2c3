"""A sweep's file holds its own rows or does not exist: locks, parts, orphans, lost clusters."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from snakegen.base import atomic_io
from snakegen.base.file_lock import InUseError, exclusive
from snakegen.errors import AnalysisError
from snakegen.robot.robot import Robot, load
from snakegen.sweep import executors
from snakegen.sweep import run as running
from snakegen.sweep.batch import Body, evaluate
from snakegen.sweep.run import sweep
from snakegen.sweep.samples import draw
from snakegen.sweep.store import Store

ROWS = 25


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load("dragon4")


@pytest.fixture(autouse=True)
def small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "PART", 10)


def some(robot: Robot, seed: int, count: int = ROWS) -> np.ndarray:
    low, high, _ = robot.limits(robot.chain_joints)
    return draw("random", count, seed, low, high)


def run(robot: Robot, path: Path, seed: int, **options) -> Path:
    return sweep(robot, robot.chain_joints, some(robot, seed), path, workers=1, **options)


def assert_rows_of(robot: Robot, path: Path, seed: int) -> None:
    """Holds the file bit for bit against its samples evaluated here."""
    wanted = evaluate(Body.of(robot, robot.chain_joints, np.eye(3), 1e-3), some(robot, seed))
    assert pq.read_table(path).replace_schema_metadata(None).equals(wanted)


class Stopped(Exception):
    """Ends a sweep after its first part, as a kill would."""


def stopped(done: int, total: int) -> None:
    raise Stopped


def interrupted(robot: Robot, path: Path, seed: int) -> Path:
    """Runs a sweep up to its first part; returns the folder of its parts."""
    with pytest.raises(Stopped):
        run(robot, path, seed, progress=stopped)
    return path.with_name(path.name + ".parts")


def test_a_second_sweep_into_the_same_file_is_refused(robot: Robot, tmp_path: Path) -> None:
    path, refusals = tmp_path / "s.parquet", []

    def meanwhile(done: int, total: int) -> None:
        with pytest.raises(InUseError, match=f"process {os.getpid()} of ") as caught:
            run(robot, path, 8)
        refusals.append(str(caught.value))

    run(robot, path, 7, progress=meanwhile)
    assert len(refusals) == 3 and str(path) in refusals[0]
    assert_rows_of(robot, path, 7)
    assert [p.name for p in tmp_path.iterdir()] == ["s.parquet"]


def test_a_lock_ends_with_its_process_but_not_with_its_host(tmp_path: Path) -> None:
    target, lock = tmp_path / "s.parquet", tmp_path / ".s.parquet.lock"
    code = (
        "import sys, time, pathlib; from snakegen.base.file_lock import exclusive\n"
        f"with exclusive(pathlib.Path({str(target)!r})):\n"
        "    print('held', flush=True); time.sleep(60)"
    )
    holder = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE)
    assert holder.stdout is not None and holder.stdout.readline() == b"held\n"
    with pytest.raises(InUseError, match=f"process {holder.pid} "), exclusive(target):
        pass
    holder.kill()
    holder.wait()
    assert lock.exists()
    with exclusive(target):
        pass
    assert not lock.exists()
    lock.write_text('{"pid": 1, "host": "elsewhere", "user": "ann", "since": "2026-01-01"}')
    with (
        pytest.raises(
            InUseError, match=r"process 1 of ann on elsewhere .* if it has ended, remove"
        ),
        exclusive(target),
    ):
        pass


@pytest.mark.parametrize("stamp", ["kept", "removed", "cut"])
@pytest.mark.parametrize("resume", [False, True])
def test_stale_parts_of_another_sweep_are_never_joined(
    robot: Robot, tmp_path: Path, stamp: str, resume: bool
) -> None:
    path = tmp_path / "s.parquet"
    parts = interrupted(robot, path, 7)
    if stamp == "removed":
        (parts / "sweep.json").unlink()
    elif stamp == "cut":
        (parts / "sweep.json").write_text('{"seed": 7')
    if resume and stamp == "kept":
        with pytest.raises(AnalysisError, match="belongs to another sweep"):
            run(robot, path, 8, resume=True)
        return
    run(robot, path, 8, resume=resume)
    assert_rows_of(robot, path, 8)


def test_a_foreign_part_stops_the_join(robot: Robot, tmp_path: Path) -> None:
    """A part that was exchanged behind the sweep's back: no file, and a resume repairs it."""
    other = interrupted(robot, tmp_path / "other.parquet", 8)
    path = tmp_path / "s.parquet"

    def exchange(done: int, total: int) -> None:
        if done == total:
            first = "part-000000.parquet"
            (path.with_name("s.parquet.parts") / first).write_bytes((other / first).read_bytes())

    with pytest.raises(AnalysisError, match=r"part-000000.parquet belongs to another sweep"):
        run(robot, path, 7, progress=exchange)
    assert not path.exists()
    run(robot, path, 7, resume=True)
    assert_rows_of(robot, path, 7)


@pytest.mark.parametrize("damage", ["empty", "cut", "flipped", "garbage", "shorter"])
def test_a_damaged_part_is_computed_again(robot: Robot, tmp_path: Path, damage: str) -> None:
    path = tmp_path / "s.parquet"
    part = interrupted(robot, path, 7) / "part-000000.parquet"
    good = part.read_bytes()
    flipped = bytearray(good)
    flipped[len(good) // 4] ^= 1  # inside a column's page
    if damage == "shorter":
        table = pq.read_table(part)
        pq.write_table(table.slice(0, 9), part)
    else:
        part.write_bytes(
            {"empty": b"", "cut": good[:-9], "flipped": bytes(flipped), "garbage": b"x" * 999}[
                damage
            ]
        )
    run(robot, path, 7, resume=True)
    assert_rows_of(robot, path, 7)


def test_parts_and_file_reach_the_disk_before_their_names(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    order: list[tuple[str, str]] = []
    real_sync, real_replace = atomic_io.sync_file, os.replace
    monkeypatch.setattr(
        atomic_io, "sync_file", lambda p: (order.append(("sync", p.name)), real_sync(p))[1]
    )
    monkeypatch.setattr(
        os, "replace", lambda a, b: (order.append(("name", b.name)), real_replace(a, b))[1]
    )
    run(robot, tmp_path / "s.parquet", 7)
    for at, (what, name) in enumerate(order):
        if what == "name" and name.endswith(".parquet"):
            assert order[at - 1][0] == "sync" and name in order[at - 1][1]
            assert order[at + 1][0] == "sync"  # the folder
    assert sum(what == "name" and name.endswith(".parquet") for what, name in order) == 4


def test_workers_end_with_a_killed_parent(tmp_path: Path) -> None:
    script = tmp_path / "pool.py"
    script.write_text(
        "import multiprocessing, os, time\n"
        "from concurrent.futures import ProcessPoolExecutor\n"
        "from snakegen.sweep.executors import end_with_parent\n"
        "if __name__ == '__main__':\n"
        "    spawn = multiprocessing.get_context('spawn')\n"
        "    with ProcessPoolExecutor(2, spawn, initializer=end_with_parent) as pool:\n"
        "        print(*{pool.submit(os.getpid).result() for _ in range(4)}, flush=True)\n"
        "        pool.submit(time.sleep, 600).result()\n"
    )
    parent = subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    workers = [int(pid) for pid in parent.stdout.readline().split()]
    assert workers and all(Path(f"/proc/{pid}").exists() for pid in workers)
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    until = time.monotonic() + 10
    while any(_runs(pid) for pid in workers):
        assert time.monotonic() < until, "a worker outlived its parent by 10 s"
        time.sleep(0.05)


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.slow
def test_a_scheduler_that_dies_is_one_error_and_the_parts_are_kept(
    robot: Robot, tmp_path: Path
) -> None:
    pytest.importorskip("distributed")
    path, environment = (
        tmp_path / "s.parquet",
        os.environ | {"DASK_DISTRIBUTED__COMM__RETRY__COUNT": "0"},
    )
    contact = tmp_path / "scheduler.json"
    dask = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--no-dashboard"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": environment}
    scheduler = subprocess.Popen(
        [*dask, "--port", "0", "--host", "127.0.0.1", "--scheduler-file", str(contact)], **quiet
    )
    worker = None
    try:
        until = time.monotonic() + 30
        while not contact.exists() or not contact.read_text():
            assert time.monotonic() < until
            time.sleep(0.05)
        import json

        address = json.loads(contact.read_text())["address"]
        work = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--no-dashboard"]
        worker = subprocess.Popen([*work, "--no-nanny", "--nthreads", "1"], **quiet)
        with pytest.raises(executors.WorkersLostError, match="was lost"):
            sweep(
                robot, robot.chain_joints, some(robot, 7, 400), path, workers=address,
                progress=lambda done, total: scheduler.kill() if done >= 20 else None,
            )  # fmt: skip
    finally:
        for process in (scheduler, worker):
            if process is not None:
                process.kill()
                process.wait()
    assert len(list(path.with_name("s.parquet.parts").glob("part-*"))) >= 2
    sweep(robot, robot.chain_joints, some(robot, 7, 400), path, workers=1, resume=True)
    assert pq.read_metadata(path).num_rows == 400


def test_a_worker_of_another_version_computes_nothing(robot: Robot) -> None:
    from dataclasses import replace

    task = Body.of(robot, robot.chain_joints, np.eye(3), 1e-3).task
    with pytest.raises(AnalysisError, match="install one version"):
        executors.work(replace(task, version="0.0.0"), some(robot, 1))


def test_a_resumed_sweep_keeps_only_its_own_whole_parts(tmp_path: Path) -> None:
    table = pa.table({"a": np.arange(10.0)})
    Store(tmp_path / "s", {"seed": 1}, postures=20, part=10, resume=False).put(0, table)
    again = Store(tmp_path / "s", {"seed": 1}, postures=20, part=10, resume=True)
    assert again.has(0) and not again.has(1)
    os.rename(again.part(0), again.part(1))
    assert not again.has(1) and not again.part(1).exists()
