"""Tables of sweeps as files: their formats, their size, and what a damaged one says."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from snakegen.errors import AnalysisError
from snakegen.robot.robot import Robot, load
from snakegen.sweep import estimate
from snakegen.sweep import run as running
from snakegen.sweep.batch import Body, columns
from snakegen.sweep.run import sweep
from snakegen.sweep.samples import KINDS, draw, sampling
from snakegen.sweep.store import FORMAT, KEY, identity_of, read_columns
from snakegen.sweep.worst import refine, worst_rows

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


@pytest.mark.parametrize("kind", KINDS)
def test_samples_do_not_depend_on_the_size_of_blocks(kind: str) -> None:
    low, high = np.array([-1.0, 0.2]), np.array([0.5, 0.9])
    drawn = sampling(kind, 1500, 7, low, high)
    whole = np.concatenate([rows for _, rows in drawn.blocks(5000)])
    parts = list(drawn.blocks(64))
    assert [i for i, _ in parts] == list(range(len(parts)))
    assert np.array_equal(np.concatenate([rows for _, rows in parts]), whole)
    assert len(whole) == drawn.count


def test_a_disk_too_small_is_refused_before_the_first_part(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(estimate, "free_bytes", lambda folder: 1_500_000)
    low, high, _ = robot.limits(robot.chain_joints)
    many = sampling("random", 10_000, 0, low, high)
    monkeypatch.setattr(running, "PART", 16384)
    with pytest.raises(AnalysisError, match=r"10000 postures need .* MB of disk; 1.5 MB are free"):
        sweep(robot, robot.chain_joints, many, tmp_path / "s.parquet", workers=1)
    assert list(tmp_path.iterdir()) == []


def test_the_estimate_of_the_disk_is_an_upper_limit(robot: Robot, tmp_path: Path) -> None:
    running.PART = 10
    path, most = tmp_path / "s.parquet", 0

    def look(done: int, total: int) -> None:
        nonlocal most
        parts = path.with_name("s.parquet.parts").glob("part-*")
        most = max(most, sum(p.stat().st_size for p in parts))

    run(robot, path, 7, progress=look)
    bound = estimate.disk_bytes(ROWS, 3, len(robot.chain_joints))
    assert 0 < most <= bound and path.stat().st_size <= bound + 2 * len(robot.urdf)


def test_formats_of_sweeps(robot: Robot, tmp_path: Path) -> None:
    """The format before had no number: it is read; a later one is refused."""
    path = run(robot, tmp_path / "s.parquet", 7)
    assert identity_of(path)["format"] == FORMAT
    table = pq.read_table(path)
    for told, reads in (("{}", True), (f'{{"format": {FORMAT + 1}}}', False)):
        pq.write_table(table.replace_schema_metadata({KEY: told.encode()}), path)
        if reads:
            assert identity_of(path) == {}
        else:
            with pytest.raises(AnalysisError, match=f"formats up to {FORMAT} are read"):
                identity_of(path)


def test_a_flipped_bit_never_changes_what_is_read(robot: Robot, tmp_path: Path) -> None:
    path = run(robot, tmp_path / "s.parquet", 7)
    names = columns(Body.of(robot, robot.chain_joints, np.eye(3), 1e-3))
    good, rows = path.read_bytes(), read_columns(path, names)
    assert rows.num_rows == ROWS
    rng, refused = np.random.default_rng(0), 0
    pages = len(good) // 3  # before the footer, which holds the URDF
    for at in rng.integers(4, pages, 200):
        content = bytearray(good)
        content[at] ^= 1 << rng.integers(8)
        path.write_bytes(content)
        try:
            assert read_columns(path, names).equals(rows)
        except AnalysisError:
            refused += 1
    assert refused > 50


def test_the_worst_rows_are_those_of_the_whole_table(robot: Robot, tmp_path: Path) -> None:
    path = run(robot, tmp_path / "s.parquet", 7)
    body = Body.of(robot, robot.chain_joints, np.eye(3), 1e-3)
    column = "torque_margin"
    found = worst_rows(body, path, column)
    least = np.sort(pq.read_table(path)[column].to_numpy())[:8]
    assert np.array_equal(found[column].to_numpy(), least)
    whole, few = refine(body, pq.read_table(path), column), refine(body, found, column)
    assert not whole.feasible and -0.01 < whole.wrench < -0.001  # it ends where hover is lost
    for name in ("angles", "lower", "upper", "wrench", "sampled", "postures"):
        np.testing.assert_array_equal(getattr(few, name), getattr(whole, name), name)


def test_parts_are_bounded_however_wide_a_row() -> None:
    for joints in (6, 126, 20_000):
        rows = estimate.part_rows(joints, 16384)
        assert 1 <= rows <= 16384 and rows * estimate.row_bytes(joints) <= 2**25
