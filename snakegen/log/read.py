"""Reading a log back: the recording from the .rrd alone, or one line that says why not."""

from __future__ import annotations

import warnings
from contextlib import ExitStack
from io import BytesIO
from pathlib import Path
from tempfile import SpooledTemporaryFile
from typing import IO, Any

from snakegen.base.bounded_text import what_is_there
from snakegen.errors import LogError
from snakegen.log.checksum import is_sealed
from snakegen.log.journal import is_journal, journal_of, read_journal
from snakegen.log.store import decode, format_of
from snakegen.log.write import ENTITY, SAMPLES, identity
from snakegen.simulation.recording.recording import Recording

_IN_MEMORY = 1 << 26  # bytes of samples


def read(path: str | Path) -> Recording:
    """Returns the recording that `snakegen.log.write` wrote to `path`, bit for bit.

    Where there is no such file but the journal of a flight that was to write it, whatever ended
    that flight, the recording is that of its whole seconds.

    Raises:
        LogError: there is no such file; it is no .rrd; it is cut short; snakegen did not write it.
    """
    path = Path(path)
    if not path.is_file() and journal_of(path).is_file():
        return read_journal(journal_of(path))
    if not path.is_file():
        raise LogError(f"there is no log {path}: {what_is_there(path)}")
    if is_journal(path):
        return read_journal(path)
    with path.open("rb") as file:
        magic = file.read(4)
    if magic not in (b"RRF2", b"RRIO"):
        raise LogError(f"{path} is not a rerun log (.rrd)")
    sealed = is_sealed(path)
    with ExitStack() as stack:
        return _verified(path, sealed, *_stored(path, stack))


def _verified(
    path: Path, sealed: bool, header: str, files: list[IO[bytes]], stated: str
) -> Recording:
    """Returns the recording of a header and its tables, their checksums verified."""
    try:
        if not sealed and format_of(header) > 1:
            raise LogError("its checksum is missing")
        if stated != identity(header):
            raise LogError("its header has changed since it was written")
        return decode(header, files)
    except LogError as error:
        raise LogError(f"{path} cannot be read: {error}") from None


def _stored(path: Path, stack: ExitStack) -> tuple[str, list[IO[bytes]], str]:
    """Returns header, tables (open until `stack` is left) and the recording's id.

    Those of a long run do not stay in memory: they go from rerun's chunks to temporary files.
    """
    from rerun.chunk import RrdReader

    header: list[str] | None = None
    files: list[IO[bytes]] | None = None
    parts: dict[tuple[int, int], tuple[int, int]] = {}  # where they stand, and how long they are
    heap = stack.enter_context(SpooledTemporaryFile(_IN_MEMORY))  # noqa: SIM115
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a missing end is said in the error below
            reader = RrdReader(path)
            stated = [entry.recording_id for entry in reader.recordings()]
            for chunk in reader.store().stream():
                place = chunk.entity_path.strip("/")
                if place != ENTITY and not place.startswith(f"{SAMPLES}/"):
                    continue
                found = _components(chunk.to_record_batch())
                if place == ENTITY:
                    header = found.get("header", header)
                    if "columns" in found:  # up to format 2
                        files = [BytesIO(data) for data in found["columns"]]
                elif "bytes" in found:
                    axis, part = place.split("/")[-2:]
                    data = found["bytes"][0]
                    parts[int(axis), int(part)] = heap.tell(), len(data)
                    heap.write(data)
    except OSError as error:
        raise LogError(f"{path} cannot be read: {error.strerror or error}") from None
    # rerun raises what its decoder meets, even its own panics: the file is not whole.
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt | SystemExit | MemoryError):
            raise
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        if "without footer" in reason:  # rerun takes it for a file of an old version
            reason = "its end is missing"
        raise LogError(f"{path} is cut short or damaged: {reason}") from None
    if header is None:
        raise LogError(f"{path} is a rerun log, but snakegen did not write it")
    if files is None:
        files = []
        for number in sorted({key[0] for key in parts}):
            files.append(stack.enter_context(SpooledTemporaryFile(_IN_MEMORY)))  # noqa: SIM115
            for key in sorted(key for key in parts if key[0] == number):
                heap.seek(parts[key][0])
                files[-1].write(heap.read(parts[key][1]))
    return header[0], files, stated[0]


def _components(batch: Any) -> dict[str, list[Any]]:
    """Returns the components of the log's own that a chunk has: header, columns or bytes."""
    fields = {name.rsplit(":", 1)[-1]: i for i, name in enumerate(batch.schema.names)}
    out: dict[str, list[Any]] = {}
    for name in ("header", "columns", "bytes"):
        if name in fields:
            out[name] = batch.column(fields[name])[0].as_py()
    return out
