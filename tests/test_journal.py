"""A flight that is killed can be read up to its last whole second."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from synthetic_run import flight

from snakegen.base.sample_store import samples_in
from snakegen.cli.inspect import inspect as command
from snakegen.errors import LogError
from snakegen.log import Journal, journal_of, read, write
from snakegen.log import journal as module
from snakegen.log.journal import MAGIC
from snakegen.log.store import encode
from snakegen.robot.robot import load
from snakegen.simulation.flight.run import run
from snakegen.simulation.recording.recording import Recording

SECONDS = 3


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Recording, Path]:
    """A flight of three seconds and its journal, as a kill just before the end leaves it."""
    log = tmp_path_factory.mktemp("journal") / "f.rrd"
    journal = Journal(log)
    options = {"duration": float(SECONDS), "trim": 0.0}
    return run(load("dragon4"), "hover", options=options, keep=journal.keep), journal.path


def test_a_journal_is_the_flight_so_far(flown: tuple[Recording, Path]) -> None:
    whole, path = flown
    found = read(path.with_name("f.rrd"))  # the log is not there, its journal is
    ticks = len(found.time)
    assert ticks == 200 * SECONDS and np.array_equal(found.time, whole.time[:ticks])
    for name, c in found.channels.items():
        rows = len(c.values)
        assert np.array_equal(c.values, whole.channels[name].values[:rows], equal_nan=True), name
    assert {"q", "thrust", "position", "floor_distance"} <= found.channels.keys()
    assert found.meta["robot"] == "dragon4" and found.meta["stopped"].startswith("killed after")
    assert found.verdict is None


def test_a_journal_of_the_format_before_is_read(
    flown: tuple[Recording, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its tables are Parquet files."""
    now = read(flown[1])
    monkeypatch.setattr(module, "MAGIC", module._BEFORE)
    monkeypatch.setattr(module, "encode", lambda block, quick: encode(block))
    Journal(tmp_path / "f.rrd").keep(now)
    monkeypatch.undo()
    found = read(tmp_path / "f.rrd")
    for name, c in now.channels.items():
        assert np.array_equal(found.channels[name].values, c.values, equal_nan=True), name


def test_a_long_journal_is_read_into_a_file(
    flown: tuple[Recording, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    inside = read(flown[1])
    monkeypatch.setattr(module, "LONG", 100)
    with samples_in(tmp_path):
        outside = read(flown[1])
    for name, c in inside.channels.items():
        assert np.array_equal(outside.channels[name].values, c.values, equal_nan=True), name
        assert np.array_equal(outside.times(name), inside.times(name))


@pytest.mark.parametrize("share", np.linspace(0.0, 0.999, 12))
def test_a_journal_cut_anywhere_holds_its_whole_seconds(
    flown: tuple[Recording, Path], tmp_path: Path, share: float
) -> None:
    content = flown[1].read_bytes()
    ends = [len(MAGIC)]
    while ends[-1] < len(content):
        ends.append(ends[-1] + 40 + int.from_bytes(content[ends[-1] : ends[-1] + 8], "little"))
    assert len(ends) == SECONDS + 1 and ends[-1] == len(content)
    cut = int(share * len(content))
    journal_of(tmp_path / "f.rrd").write_bytes(content[:cut])
    seconds = sum(end <= cut for end in ends[1:])
    if seconds == 0:
        with pytest.raises(LogError):
            read(tmp_path / "f.rrd")
        return
    assert len(read(tmp_path / "f.rrd").time) == 200 * seconds


def test_a_damaged_block_ends_the_journal(flown: tuple[Recording, Path], tmp_path: Path) -> None:
    content = bytearray(flown[1].read_bytes())
    content[-100] ^= 1
    journal_of(tmp_path / "f.rrd").write_bytes(content)
    assert len(read(tmp_path / "f.rrd").time) == 200 * (SECONDS - 1)


def test_inspect_reads_a_journal_and_says_so(flown: tuple[Recording, Path], tmp_path: Path) -> None:
    log = tmp_path / "f.rrd"
    journal_of(log).write_bytes(flown[1].read_bytes())
    found = CliRunner().invoke(command, [str(log)])
    assert found.exit_code == 0 and found.stderr.startswith(f"note: {log} was not written; read")
    assert "ended early: killed after" in found.stdout
    write(flight(1.0), log)
    found = CliRunner().invoke(command, [str(log)])
    assert "a later flight into" in found.stderr
    again = read(journal_of(log))
    assert len(read(write(again, tmp_path / "kept.rrd")).time) == 200 * SECONDS


def test_a_full_disk_ends_the_journal_not_the_flight(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    journal = Journal(tmp_path / "f.rrd")

    def full(self: Path, mode: str) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "open", full)
    for _ in range(2):
        journal.keep(flight(1.0))
    assert capsys.readouterr().err.count("no journal (No space left on device)") == 1


@pytest.mark.slow
def test_a_killed_flight_is_readable(tmp_path: Path) -> None:
    """A real kill -9, of the real command."""
    log = tmp_path / "f.rrd"
    words = ["analyze", "flight", "dragon4", "--duration", "600", "-o", str(log)]
    child = subprocess.Popen(
        [sys.executable, "-m", "snakegen", *words], stdout=subprocess.DEVNULL, cwd=tmp_path
    )
    until = time.monotonic() + 240
    while not journal_of(log).exists() or journal_of(log).stat().st_size < 300_000:
        assert time.monotonic() < until and child.poll() is None
        time.sleep(0.02)
    child.send_signal(signal.SIGKILL)
    child.wait()
    found = read(log)
    assert len(found.time) % 200 == 0 and len(found.time) >= 200
    assert np.isfinite(found.channel("q").values).all()
