"""Sweeps: batch against single, determinism, resuming, dead workers, a cluster, bad tables."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from snakegen.analysis import wrench_margin as margin
from snakegen.base.geometry import rotation_from_rpy
from snakegen.errors import AnalysisError
from snakegen.kernels.margins.posture_batch import segment_distance
from snakegen.robot.posture import hover_gimbals
from snakegen.robot.robot import Robot, from_urdf_text, load
from snakegen.sweep import executors
from snakegen.sweep import run as running
from snakegen.sweep.batch import Body, evaluate
from snakegen.sweep.run import sweep
from snakegen.sweep.samples import KINDS, draw
from snakegen.sweep.store import identity_of
from snakegen.sweep.worker import Task, work


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load("dragon4")


@pytest.fixture(scope="module")
def body(robot: Robot) -> Body:
    return Body.of(robot, robot.chain_joints, np.eye(3), 1e-3)


def some(robot: Robot, count: int, seed: int = 0) -> np.ndarray:
    low, high, _ = robot.limits(robot.chain_joints)
    return draw("random", count, seed, low, high)


def test_a_row_is_what_the_analysis_of_one_posture_says(robot: Robot, body: Body) -> None:
    samples = some(robot, 6)
    table = evaluate(body, samples)
    for i, row in enumerate(samples):
        angles = dict(zip(robot.chain_joints, row, strict=True))
        q = hover_gimbals(robot, robot.configuration(angles))
        one = margin.analyze(robot, q)
        for name in ("force", "torque"):
            low, high = one.vectored[name].bounds
            assert table[f"{name}_margin"][i].as_py() == pytest.approx(low, rel=2e-3)
            assert table[f"{name}_margin_upper"][i].as_py() == pytest.approx(high, rel=2e-3)
        dual = table["dual_attitude_altitude_margin"][i].as_py()
        assert dual == pytest.approx(one.dual["attitude_altitude"].value, rel=1e-9)


def test_a_tilted_base_turns_the_hover_wrench(robot: Robot) -> None:

    tilted = Body.of(robot, robot.chain_joints, rotation_from_rpy((0.4, -0.3, 0.2)), 1e-3)
    samples = some(robot, 3, seed=3)
    table = evaluate(tilted, samples)
    for i, row in enumerate(samples):
        angles = dict(zip(robot.chain_joints, row, strict=True))
        q = robot.configuration(angles, base_rpy=(0.4, -0.3, 0.2))
        one = margin.analyze(robot, hover_gimbals(robot, q)).vectored["torque"]
        assert table["torque_margin"][i].as_py() == pytest.approx(one.bounds[0], rel=2e-3)


def test_segment_distance_is_the_least_over_a_fine_grid() -> None:
    rng = np.random.default_rng(1)
    at = np.linspace(0.0, 1.0, 201)[:, None]
    for _ in range(50):
        a, b, c, d = rng.normal(size=(4, 3))
        first, second = a + at * (b - a), c + at * (d - c)
        brute = np.linalg.norm(first[:, None] - second[None], axis=2).min()
        found = segment_distance(a, b, c, d)
        assert found <= brute + 1e-12
        assert found == pytest.approx(brute, abs=2e-2)
    assert segment_distance(a, a, c, c) == pytest.approx(np.linalg.norm(a - c))


def test_folding_onto_itself_is_flagged(robot: Robot, body: Body) -> None:
    """Three right-angled yaws bring the fourth link's tip to the first link's start."""
    names = list(robot.chain_joints)
    square = np.array([[1.6 if n.endswith("_yaw") else 0.0 for n in names]])
    table = evaluate(body, np.vstack([square, np.zeros_like(square)]))
    assert table["self_distance"][0].as_py() < table["self_distance"][1].as_py()
    assert table["self_collision"].to_pylist() == [table["self_distance"][0].as_py() < 0, False]


@pytest.mark.parametrize("kind", KINDS)
def test_samples_stay_inside_and_repeat(kind: str) -> None:
    low, high = np.array([-1.0, 0.2]), np.array([0.5, 0.9])
    first, again = (draw(kind, 4096, 7, low, high) for _ in range(2))
    assert np.array_equal(first, again)
    assert np.all(first >= low - 1e-12) and np.all(first <= high + 1e-12)
    assert np.ptp(first, axis=0) == pytest.approx(high - low, rel=0.5)
    if kind != "grid":
        assert not np.array_equal(first, draw(kind, 4096, 8, low, high))


def test_workers_do_not_change_the_table(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    samples = some(robot, 50)
    whole = sweep(robot, robot.chain_joints, samples, tmp_path / "whole.parquet", workers=1)
    monkeypatch.setattr(running, "PART", 16)
    split = sweep(robot, robot.chain_joints, samples, tmp_path / "split.parquet", workers=1)
    assert pq.read_table(whole).equals(pq.read_table(split))
    said = identity_of(split)
    assert said["urdf_sha256"] == robot.urdf_hash and said["postures"] == 50


def test_an_interrupted_sweep_resumes(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(running, "PART", 10)
    samples, path = some(robot, 35), tmp_path / "s.parquet"
    calls = []

    def stops(task: Task, rows: np.ndarray) -> np.ndarray:
        calls.append(len(rows))
        if len(calls) == 3:
            raise KeyboardInterrupt
        return work(task, rows)

    monkeypatch.setattr(executors, "work", stops)
    with pytest.raises(KeyboardInterrupt):
        sweep(robot, robot.chain_joints, samples, path, workers=1)
    assert not path.exists()
    sweep(robot, robot.chain_joints, samples, path, workers=1, resume=True)
    assert calls == [10, 10, 10, 10, 5]  # two parts kept, the third and fourth made now
    assert pq.read_table(path).num_rows == 35
    assert not path.with_name("s.parquet.parts").exists()


def test_parts_of_another_sweep_are_refused(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(executors, "work", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
    path = tmp_path / "s.parquet"
    with pytest.raises(KeyboardInterrupt):
        sweep(robot, robot.chain_joints, some(robot, 5), path, workers=1)
    with pytest.raises(AnalysisError, match="another sweep: its samples_sha256 differ"):
        sweep(robot, robot.chain_joints, some(robot, 5, 1), path, workers=1, resume=True)


def test_parts_of_another_robot_are_refused(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same joints and samples, one link heavier: the URDF's hash tells the two apart."""
    path, samples = tmp_path / "s.parquet", some(robot, 25)
    monkeypatch.setattr(running, "PART", 10)
    heavier = from_urdf_text(robot.urdf.replace('<mass value="', '<mass value="1', 1), None)
    assert heavier.chain_joints == robot.chain_joints and heavier.urdf_hash != robot.urdf_hash

    def stop(done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(robot, robot.chain_joints, samples, path, workers=1, progress=stop)
    kept = sorted(path.with_name("s.parquet.parts").iterdir())
    with pytest.raises(AnalysisError, match="belongs to another sweep: its urdf_sha256 differ"):
        sweep(heavier, robot.chain_joints, samples, path, workers=1, resume=True)
    assert sorted(path.with_name("s.parquet.parts").iterdir()) == kept and not path.exists()
    sweep(robot, robot.chain_joints, samples, path, workers=1, resume=True)
    assert pq.read_table(path).num_rows == 25


def test_a_worker_does_without_the_heavy_libraries() -> None:
    """Each worker's memory: Pinocchio, pyarrow and scipy.optimize stay in the parent."""
    code = (
        "import sys, snakegen.sweep.worker as w; "
        "print([m for m in ('pinocchio', 'pyarrow', 'scipy.optimize', 'pydantic', 'matplotlib', "
        "'mujoco') if m in sys.modules], w.__name__)"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[] snakegen.sweep.worker"


def test_a_killed_worker_loses_nothing(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(running, "PART", 400)
    samples, path, killed = some(robot, 2000), tmp_path / "s.parquet", []

    def kill_one(done: int, total: int) -> None:
        if not killed:
            import multiprocessing

            child = multiprocessing.active_children()[0]
            killed.append(child.pid)
            os.kill(child.pid, signal.SIGKILL)  # type: ignore[arg-type]

    sweep(robot, robot.chain_joints, samples, path, workers=2, progress=kill_one)
    assert killed
    assert_same_sweep(robot, samples, path)


def assert_same_sweep(robot: Robot, samples: np.ndarray, path: Path) -> None:
    """Holds a sweep's file, bit for bit, against its samples evaluated in this process."""
    wanted = evaluate(Body.of(robot, robot.chain_joints, np.eye(3), 1e-3), samples)
    found = pq.read_table(path)
    assert found.equals(wanted.replace_schema_metadata(found.schema.metadata))


def test_a_cluster_runs_the_same_sweep_and_survives_a_dead_worker(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(running, "PART", 400)
    samples, path, killed = some(robot, 2000), tmp_path / "s.parquet", []
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:

        def kill_one(done: int, total: int) -> None:
            if not killed:
                killed.append(next(iter(cluster.workers.values())).pid)
                os.kill(killed[0], signal.SIGKILL)

        sweep(
            robot, robot.chain_joints, samples, path,
            workers=cluster.scheduler_address, progress=kill_one,
        )  # fmt: skip
    assert killed
    assert_same_sweep(robot, samples, path)


def test_a_cluster_that_is_not_there_is_one_line(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("snakegen.sweep.executors.PATIENCE", 0.5)
    with pytest.raises(AnalysisError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9"):
        sweep(
            robot, robot.chain_joints, some(robot, 4), tmp_path / "s.parquet",
            workers="tcp://127.0.0.1:9",
        )  # fmt: skip
