"""Two logs compared: equal runs, runs that differ, and metrics equal up to round-off."""

import dataclasses
from pathlib import Path

import pytest
from synthetic_run import flight

from snakegen.log import compare, write
from snakegen.simulation.recording.metrics import metrics
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.recording.verdict import FLIGHT_THRESHOLDS, verdict
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


def test_compare_two_runs(run: Recording, log: Path, tmp_path: Path):
    other = write(_judged(flight(3.0, seed=5)), tmp_path / "other.rrd")
    rows = {r.metric: r for r in compare(log, other)}
    row = rows["position_rmse_m"]
    assert row.a == run.metrics["position_rmse_m"] and row.b != row.a
    assert row.difference == [b - a for a, b in zip(row.a, row.b, strict=True)]
    assert rows["finite"].difference is None


def test_two_runs_are_told_apart(run: Recording, log: Path, tmp_path: Path):
    import json

    from click.testing import CliRunner

    from snakegen.cli.inspect import inspect as command

    meta = run.meta | {"robot": "worm", "seed": 7}
    other = write(dataclasses.replace(run, meta=meta), tmp_path / "other.rrd")
    page = CliRunner().invoke(command, [str(log), str(other)])
    head = [line.split() for line in page.stdout.splitlines()[:4]]
    mine = [str(run.meta.get(k, "unknown")) for k in ("robot", "mission", "seed")]
    assert head[0] == ["file", str(log), str(other)]
    assert head[1] == ["robot", mine[0], "worm"] and head[3] == ["seed", mine[2], "7"]
    assert page.stderr.startswith(f"note: the robots differ ({mine[0]}, worm)")
    data = json.loads(CliRunner().invoke(command, [str(log), str(other), "--json"]).stdout)
    assert data["runs"]["b"]["seed"] == 7 and data["runs"]["a"]["robot"] == mine[0]
    assert data["runs_differ_in"] == ["robot"]
    assert data["position_max_m"]["difference"] == 0.0
    assert data["runs"]["a"]["verdict"] == run.verdict.summary()  # type: ignore[union-attr]
    strict = verdict(run.metrics, {"position_max_m": {"at_most": 0.0}})
    meta = run.meta | {"allocator": "constrained", "options": {"height": 2.0}}
    failed = dataclasses.replace(run, verdict=strict, meta=meta)
    page = CliRunner().invoke(command, [str(log), str(write(failed, tmp_path / "failed.rrd"))])
    rows = {line.split()[0]: line.split()[1:] for line in page.stdout.splitlines()}
    assert rows["allocator"][-1] == "constrained" and rows["options"] == ["unknown", "height=2.0"]
    assert rows["verdict"][-5:] == ["failed", "1", "of", "1", "checks"]
    same = CliRunner().invoke(command, [str(log), str(log)])
    assert same.exit_code == 0 and same.stderr == ""


def test_round_off_of_metrics_is_no_difference_but_a_digit_is() -> None:
    from snakegen.log.compare import _same

    assert _same([0.0, 0.19513521099517359], [1e-17, 0.1951352109951736])
    assert _same(float("nan"), float("nan")) and _same(None, None) and _same(True, True)
    assert not _same(0.1951, 0.1952) and not _same([1.0], [1.0, 2.0]) and not _same(True, False)
    assert not _same(0.0, 1e-12) and not _same(float("nan"), 0.0)
