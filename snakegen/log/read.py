"""Reading a log back: the recording from the .rrd alone, or one line that says why not."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

from snakegen.errors import LogError
from snakegen.log.checksum import is_sealed
from snakegen.log.journal import is_journal, journal_of, read_journal
from snakegen.log.store import decode, format_of
from snakegen.log.write import ENTITY, SAMPLES, identity
from snakegen.simulation.recording.recording import Recording


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
        raise LogError(f"there is no log {path}")
    if is_journal(path):
        return read_journal(path)
    with path.open("rb") as file:
        magic = file.read(4)
    if magic not in (b"RRF2", b"RRIO"):
        raise LogError(f"{path} is not a rerun log (.rrd)")
    sealed = is_sealed(path)
    header, files, stated = _stored(path)
    try:
        if not sealed and format_of(header) > 1:
            raise LogError("its checksum is missing")
        if stated != identity(header):
            raise LogError("its header has changed since it was written")
        return decode(header, files)
    except LogError as error:
        raise LogError(f"{path} cannot be read: {error}") from None


def _stored(path: Path) -> tuple[str, list[bytes], str]:
    """Returns header, Parquet files and the recording's id."""
    from rerun.chunk import RrdReader

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a missing end is said in the error below
            reader = RrdReader(path)
            stated = [entry.recording_id for entry in reader.recordings()]
            chunks = list(reader.store().stream())
    # rerun raises what its decoder meets, even its own panics: the file is not whole.
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt | SystemExit | MemoryError):
            raise
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        if "without footer" in reason:  # rerun takes it for a file of an old version
            reason = "its end is missing"
        raise LogError(f"{path} is cut short or damaged: {reason}") from None
    header, files = None, None
    parts: dict[tuple[int, int], bytes] = {}
    for chunk in chunks:
        place = chunk.entity_path.strip("/")
        if place != ENTITY and not place.startswith(f"{SAMPLES}/"):
            continue
        try:
            found = _components(chunk.to_record_batch())
            if place == ENTITY:
                header, files = found.get("header", header), found.get("columns", files)
            elif "bytes" in found:
                axis, part = place.split("/")[-2:]
                parts[int(axis), int(part)] = found["bytes"][0]
        except (TypeError, IndexError, ValueError) as error:
            raise LogError(f"{path} is cut short or damaged: {error}") from None
    if header is None:
        raise LogError(f"{path} is a rerun log, but snakegen did not write it")
    if files is None:  # from format 3 on
        files = [
            b"".join(parts[key] for key in sorted(parts) if key[0] == axis)
            for axis in sorted({key[0] for key in parts})
        ]
    return header[0], files, stated[0]


def _components(batch: Any) -> dict[str, list[Any]]:
    """Returns the components of the log's own that a chunk has: header, columns or bytes."""
    fields = {name.rsplit(":", 1)[-1]: i for i, name in enumerate(batch.schema.names)}
    out: dict[str, list[Any]] = {}
    for name in ("header", "columns", "bytes"):
        if name in fields:
            out[name] = batch.column(fields[name])[0].as_py()
    return out
