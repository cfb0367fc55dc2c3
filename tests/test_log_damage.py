"""Damaged and hostile logs are one kind of error; a log on a full disk is one line and no file."""

import errno
import hashlib
import io
import json
import os
import resource
import secrets
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
import rerun as rr
from synthetic_run import flight

from snakegen.errors import LogError
from snakegen.log import inspect, read, write
from snakegen.log.store import decode, encode
from snakegen.log.write import identity
from snakegen.simulation.recording.metrics import metrics
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.recording.verdict import FLIGHT_THRESHOLDS
from snakegen.simulation.recording.worst_place import judged_verdict


@pytest.fixture(scope="module")
def run() -> Recording:
    made = flight(1.0)
    numbers = metrics(made)
    return made.judged(numbers, judged_verdict(made, numbers, FLIGHT_THRESHOLDS))


@pytest.fixture(scope="module")
def log(run: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(run, tmp_path_factory.mktemp("log") / "flight.rrd")


WRONG = [None, True, -1, 10**9, 1e400, "", "text", [], [1], ["a", "b"], {}, {"a": 1}, [[[]]]]


def mutations(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yields the places of a header that are changed: one of each kind of entry."""
    if path:
        yield path
    if isinstance(value, dict):
        for key in list(value)[:8]:
            if key != "urdf":
                yield from mutations(value[key], (*path, key))
    elif isinstance(value, list) and value:
        yield from mutations(value[0], (*path, 0))


def changed(header: dict[str, Any], path: tuple[Any, ...], *wrong: Any) -> dict[str, Any]:
    """Returns a copy with the entry at `path` replaced, or removed where nothing is given."""
    copy = json.loads(json.dumps(header))
    within = copy
    for key in path[:-1]:
        within = within[key]
    if wrong:
        within[path[-1]] = wrong[0]
    else:
        del within[path[-1]]
    return copy


def test_a_hostile_header_is_a_log_error_or_a_recording(run: Recording) -> None:
    text, files = encode(run)
    header, tried, refused = json.loads(text), 0, 0
    rng = np.random.default_rng(0)
    for path in mutations(header):
        choices = [(), *((WRONG[i],) for i in rng.choice(len(WRONG), 2, replace=False))]
        for wrong in choices:
            tried += 1
            try:
                decode(json.dumps(changed(header, path, *wrong)), files)
            except LogError as error:
                refused += 1
                assert "\n" not in str(error)
    assert tried > 250 and refused > 150


@pytest.mark.parametrize(
    "text", ["", "{", "[]", "null", '"a"', "[" * 100_000, "{}", '{"format": 1}']
)
def test_a_header_that_is_none_is_a_log_error(run: Recording, text: str) -> None:
    with pytest.raises(LogError):
        decode(text, encode(run)[1])


@pytest.mark.parametrize(
    ("path", "wrong"),
    [
        (("meta", "limits"), {"thrust_max": "high"}),
        (("meta", "limits"), {"thrust_max": [1.0] * 99}),
        (("meta", "metrics_window_s"), ["a", "b"]),
        (("meta", "rotors"), 7),
        (("channels", "position", "labels"), ["x"]),
        (("verdict", "checks"), [{"metric": "m"}]),
    ],
)
def test_a_hostile_log_is_inspected_in_one_line(
    run: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, path: Any, wrong: Any
) -> None:
    """A whole .rrd whose header does not fit its samples, the digests matching."""
    text, files = encode(run)
    bad = json.dumps(changed(json.loads(text), path, wrong))
    given = [io.BytesIO(data) for data in files]
    module = sys.modules[write.__module__]
    monkeypatch.setattr(module, "encode_into", lambda recording, new_file: (bad, given))
    file = write(run, tmp_path / "bad.rrd")
    try:
        inspect(file)
    except LogError as error:
        assert "bad.rrd" in str(error) and "\n" not in str(error)


def test_a_flipped_bit_is_refused_before_rerun_decodes_it(log: Path, tmp_path: Path) -> None:
    """rerun's decoder aborts the process on some of these."""
    good, damaged = log.read_bytes(), tmp_path / "damaged.rrd"
    rng = np.random.default_rng(1)
    sealed = good.index(b"=SHA256=")
    places = [*rng.integers(4, len(good), 60), sealed + 3, sealed + 20, len(good) - 1]
    for at in places:
        content = bytearray(good)
        content[at] ^= 1 << rng.integers(8)
        damaged.write_bytes(content)
        with pytest.raises(LogError, match="checksum"):
            read(damaged)


def old_log(path: Path, header: str, files: list[bytes], *, sealed: bool) -> Path:
    """Writes a log as formats 1 and 2 were: samples in one component, 2 with a checksum."""
    mark = b"=SHA256=" + secrets.token_hex(32).encode()
    rec = rr.RecordingStream("snakegen", recording_id=identity(header))
    stream = rr.binary_stream(rec)
    parts = {"header": [header], "columns": pa.array(files, pa.large_binary())}
    rec.log("checksum", rr.DynamicArchetype("a", components={"sum": [mark.decode()]}), static=True)
    rec.log("recording", rr.DynamicArchetype("a", components=parts), static=True)
    content = stream.read(flush=True)
    rec.disconnect()
    if content.count(mark) != 1:  # compressed: one time in thirty
        return old_log(path, header, files, sealed=sealed)
    if sealed:
        blank = content.replace(mark, b"=SHA256=" + b"0" * 64)
        mark, content = b"0" * 64, blank
        new = hashlib.sha256(blank).hexdigest().encode()
    else:
        new = b"=SHA000=" + b"0" * 64
    path.write_bytes(content.replace(mark, new, 1))
    return path


def test_logs_of_the_formats_before_are_read(run: Recording, tmp_path: Path) -> None:
    """Format 1 had no checksum of the whole file, 2 its samples in one piece."""
    text, files = encode(run)
    for number, sealed in ((1, False), (2, True)):
        old = text.replace('"format": 3', f'"format": {number}', 1)
        assert old != text
        found = read(old_log(tmp_path / f"{number}.rrd", old, files, sealed=sealed))
        assert found.metrics == run.metrics
        for name, c in run.channels.items():
            assert np.array_equal(found.channels[name].values, c.values, equal_nan=True)
    with pytest.raises(LogError, match="its checksum is missing"):
        read(old_log(tmp_path / "new.rrd", text, files, sealed=False))


def test_samples_in_many_parts_are_read_and_a_missing_part_is_noticed(
    run: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = sys.modules[write.__module__]
    monkeypatch.setattr(module, "PART", 5000)
    path = write(run, tmp_path / "parts.rrd")
    assert path.read_bytes().count(b"recording/samples") > 10
    for name, c in read(path).channels.items():
        assert np.array_equal(c.values, run.channels[name].values, equal_nan=True)
    whole = module.encode_into

    def one_short(recording: Recording, new_file: Any) -> Any:
        header, files = whole(recording, new_file)
        files[0].truncate(files[0].tell() - 5000)
        return header, files

    monkeypatch.setattr(module, "encode_into", one_short)
    with pytest.raises(LogError, match="samples have changed"):
        read(write(run, path))


def test_a_changed_header_is_refused(run: Recording, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(sys.modules[write.__module__], "identity", lambda header: "0" * 32)
    with pytest.raises(LogError, match="header has changed"):
        read(write(run, tmp_path / "changed.rrd"))


def test_a_full_disk_is_one_line_and_no_file(run: Recording, tmp_path: Path) -> None:
    """A real write that fails half-way: the size of files of this process is limited."""
    code = (
        "import resource, signal, sys\n"
        "sys.path.insert(0, 'tests')\n"
        "from pathlib import Path\n"
        "from synthetic_run import flight\n"
        "from snakegen.log import write\n"
        "from snakegen.errors import LogError\n"
        "run = flight(1.0)\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (65536, 65536))\n"
        "try:\n    write(run, Path(sys.argv[1]))\n"
        "except LogError as error:\n    print(error)\n"
    )
    path = tmp_path / "full.rrd"
    path.write_bytes(b"earlier")
    done = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True,
        cwd=Path(__file__).parent.parent,
    )  # fmt: skip
    assert done.stdout == f"{path}: cannot be written ({os.strerror(errno.EFBIG)}).\n"
    assert done.stderr == ""
    assert [p.name for p in tmp_path.iterdir()] == ["full.rrd"]
    assert path.read_bytes() == b"earlier"
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] != 65536
