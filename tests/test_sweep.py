"""Sweeps: batch against single, determinism, resuming, dead workers, a cluster, bad tables."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.linalg import block_diag
from scipy.optimize import minimize

from snakegen.analysis import wrench_margin as margin
from snakegen.analysis.allocation import allocation
from snakegen.base.geometry import rotation_from_rpy
from snakegen.errors import AnalysisError
from snakegen.kernels.margins.posture_batch import segment_distance
from snakegen.robot.posture import hover_gimbals
from snakegen.robot.robot import Robot, from_urdf_text, load
from snakegen.sweep import executors
from snakegen.sweep import run as running
from snakegen.sweep.batch import Body, evaluate
from snakegen.sweep.run import sweep
from snakegen.sweep.samples import KINDS, chosen_joints, draw, read_postures
from snakegen.sweep.store import identity_of
from snakegen.sweep.worker import Task, work
from snakegen.sweep.worst import refine


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
    from snakegen.base.geometry import rotation_from_rpy

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


def hover_error(robot: Robot, angles: np.ndarray) -> float:
    """Returns how far bounded apparatus forces stay from hover, scaled, by SLSQP."""
    posture = dict(zip(robot.chain_joints, angles, strict=True))
    a = allocation(robot, hover_gimbals(robot, robot.configuration(posture)))
    rows = np.repeat([1.0 / robot.force_scale, 1.0 / robot.torque_scale], 3)
    limit = robot.gimbals.limit
    Q, w = rows[:, None] * a.force * np.repeat(limit, 3), rows * a.hover_wrench
    found = minimize(
        lambda f: 1e6 * np.sum((Q @ f - w) ** 2),
        np.linalg.lstsq(Q, w, rcond=None)[0],
        jac=lambda f: 2e6 * Q.T @ (Q @ f - w),
        constraints={
            "type": "ineq",
            "fun": lambda f: 1.0 - np.sum(f.reshape(-1, 3) ** 2, axis=1),
            "jac": lambda f: -2.0 * block_diag(*f.reshape(-1, 1, 3)),
        },
        method="SLSQP",
        options={"ftol": 1e-10, "maxiter": 500},
    )
    assert found.success
    return float(1e-3 * np.sqrt(found.fun))


def test_the_worst_posture_is_out_of_reach_where_there_is_such_a_posture(
    robot: Robot, body: Body
) -> None:
    nearly_straight = np.array([0.33, 0.29, -0.28, -0.33, 0.23, 0.37])
    spread = 0.02 * np.random.default_rng(0).normal(size=(40, 6))
    table = evaluate(body, nearly_straight + spread)
    found = refine(body, table, "torque_margin", rounds=6)
    assert found.sampled == np.nanmin(table["torque_margin"].to_numpy()) > 0.0
    assert not found.feasible and np.isnan(found.lower) and found.wrench < -1e-3
    apart = -found.wrench  # hover is no farther out of reach
    assert hover_error(robot, found.angles) == pytest.approx(apart, rel=1e-2)
    with pytest.raises(AnalysisError, match="no margin 'torq' in the sweep"):
        refine(body, table, "torq")


def test_a_lost_motion_is_a_margin_of_zero_and_closed(robot: Robot, body: Body) -> None:
    """Straight, no thrust turns the body about its axis; the bounds agree on 0."""
    table = evaluate(body, np.vstack([np.zeros(6), some(robot, 3)]))
    found = refine(body, table, "torque_margin")
    assert found.closed and found.zero and found.feasible
    assert found.upper <= 1e-6 * robot.torque_scale
    np.testing.assert_array_equal(found.angles, 0.0)


def test_the_worst_posture_is_worse_than_the_samples_and_certified() -> None:
    """A body that hovers in every posture: the search ends at a margin whose bounds agree."""
    strong = load(Path(__file__).parent.parent / "generated/hybrid4/hybrid4.urdf")
    stiff = Body.of(strong, ("joint1_yaw", "joint2_yaw"), np.eye(3), 1e-3)
    low, high, _ = strong.limits(stiff.joints)
    table = evaluate(stiff, draw("random", 30, 0, low, high))
    found = refine(stiff, table, "force_margin")
    assert found.feasible and 0.0 < found.lower < found.sampled
    assert found.closed and found.upper - found.lower <= 1e-3 * found.upper
    again = evaluate(stiff, found.angles[None])
    assert again["force_margin"][0].as_py() == pytest.approx(found.lower)


def test_a_search_that_did_not_close_is_not_taken_for_the_worst(robot: Robot, body: Body) -> None:
    table = evaluate(body, some(robot, 20))
    lower = table["force_margin"].to_numpy().copy()
    lower[3] = 0.0  # its upper bound says nothing of the kind
    at = table.column_names.index("force_margin")
    table = table.set_column(at, "force_margin", pa.array(lower))
    assert refine(body, table, "force_margin", rounds=1).sampled > 0.0


def test_tables_of_a_person(robot: Robot, tmp_path: Path) -> None:
    names = robot.chain_joints
    low, high, _ = robot.limits(names)
    good = tmp_path / "good.csv"
    good.write_text(",".join(names) + "\n" + "\n".join("0.1,0.2,0.3,0.4,0.5,0.6" for _ in range(3)))
    assert read_postures(good, names, low, high).shape == (3, 6)
    cases = {
        "line 3: joint1_yaw is 'nan', not a finite number": "0,0,0,0,0,0\n0,nan,0,0,0,0",
        "line 2: joint1_pitch = 9 is outside": "9,0,0,0,0,0",
        "has no rows": "",
    }
    for message, rows in cases.items():
        bad = tmp_path / "bad.csv"
        bad.write_text(",".join(names) + "\n" + rows + "\n")
        with pytest.raises(AnalysisError, match=message):
            read_postures(bad, names, low, high)
    with pytest.raises(AnalysisError, match="has no column 'joint1_pitch'"):
        bad.write_text("a,b\n1,2\n")
        read_postures(bad, names, low, high)
    with pytest.raises(AnalysisError, match="no such file"):
        read_postures(tmp_path / "none.parquet", names, low, high)


def test_bad_requests_are_one_line(robot: Robot) -> None:
    with pytest.raises(AnalysisError, match="Did you mean 'joint1_yaw'"):
        chosen_joints(robot, "joint1_yav")
    with pytest.raises(AnalysisError, match="is a gimbal"):
        chosen_joints(robot, "gimbal1_roll")
    with pytest.raises(AnalysisError, match="between 1 and"):
        draw("sobol", 0, 0, np.zeros(2), np.ones(2))
    with pytest.raises(AnalysisError, match="needs rotors"):
        Body.of(load("arm6"), ("joint1_pitch",), np.eye(3), 1e-3)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--margin", "force_margn"], "Did you mean 'force_margin'"),
        (["--base-rpy", "nan,0,0"], "base_rpy: 'nan' is not a finite number"),
        (["--workers", "0"], "0 is not in the range"),
        (["--tolerance", "nan"], "tolerance is nan; it must be finite"),
        (["--samples", "0"], "between 1 and"),
        (["--joints", "joint1_yav"], "Did you mean 'joint1_yaw'"),
    ],
)
def test_bad_options_are_one_line_before_any_work(
    arguments: list[str], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from snakegen.cli import main

    out = tmp_path / "s.parquet"
    with pytest.raises(SystemExit) as left:
        main(["analyze", "sweep", "dragon4", "--samples", "4", "-o", str(out), *arguments])
    assert left.value.code in (1, 2)
    assert says in capsys.readouterr().err and not out.exists()


def test_joints_and_attitude_are_held(robot: Robot, tmp_path: Path) -> None:
    """A sweep of two joints with the others held is that of all joints with columns to match."""
    posture = robot.configuration(
        {"joint1_pitch": 0.3, "joint3_yaw": -0.7, "base_rpy": (0.2, 0, 0)}
    )
    names = chosen_joints(robot, None, posture.posture())
    assert set(names) == set(robot.chain_joints) - {"joint1_pitch", "joint3_yaw"}
    with pytest.raises(AnalysisError, match="cannot be varied too"):
        chosen_joints(robot, "joint1_pitch", posture.posture())
    rows = np.random.default_rng(3).uniform(-0.5, 0.5, (6, 2))
    chosen = ("joint1_yaw", "joint2_yaw")
    path = sweep(robot, chosen, rows, tmp_path / "held.parquet", posture=posture, workers=1)
    whole = np.zeros((6, len(robot.chain_joints)))
    for name, column in (
        *zip(chosen, rows.T, strict=True),
        ("joint1_pitch", 0.3),
        ("joint3_yaw", -0.7),
    ):
        whole[:, robot.chain_joints.index(name)] = column
    want = evaluate(
        Body.of(robot, robot.chain_joints, rotation_from_rpy((0.2, 0.0, 0.0)), 1e-3), whole
    )
    found = pq.read_table(path)
    for column in ("force_margin", "dual_torque_margin", "self_distance"):
        np.testing.assert_allclose(found[column], want[column], rtol=1e-12)
