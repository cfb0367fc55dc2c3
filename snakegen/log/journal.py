"""The journal of a flight: what was flown so far, readable whenever the process is killed.

A file ``.NAME.journal`` beside the log that will be written. Each block is a recording as
`store.encode` makes it, with its length and SHA-256; a block that is cut short ends the journal.
The log is written once the flight is over, and the journal removed.
"""

from __future__ import annotations

import hashlib
import struct
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from snakegen.errors import LogError
from snakegen.log.store import decode, encode
from snakegen.simulation.recording.recording import Recording

MAGIC = b"snakegen journal 1\n"
_LENGTH = struct.Struct("<Q")
_CHECKSUM = 32  # bytes


def journal_of(log: str | Path) -> Path:
    """Returns the journal of the flight that writes `log`."""
    log = Path(log)
    return log.with_name(f".{log.name}.journal")


class Journal:
    """Appends blocks; a disk that is full ends the journal with a note, not the flight."""

    def __init__(self, log: str | Path) -> None:
        self.path = journal_of(log)
        self._begun = self._failed = False

    def keep(self, block: Recording) -> None:
        """Appends a recording and hands it to the system."""
        if self._failed:
            return
        header, files = encode(replace(block, meta={}) if self._begun else block)
        parts = [header.encode(), *files]
        payload = b"".join(
            [_LENGTH.pack(len(parts)), *(_LENGTH.pack(len(p)) for p in parts), *parts]
        )
        framed = _LENGTH.pack(len(payload)) + hashlib.sha256(payload).digest() + payload
        try:
            with self.path.open("ab" if self._begun else "wb") as file:
                file.write(framed if self._begun else MAGIC + framed)
            self._begun = True
        except OSError as error:
            self._failed = True
            print(f"note: {self.path}: no journal ({error.strerror or error})", file=sys.stderr)

    def remove(self) -> None:
        """Removes the journal: the log is there, or nothing was flown."""
        self.path.unlink(missing_ok=True)


def is_journal(path: Path) -> bool:
    """Tells whether a file begins as a journal does."""
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def read_journal(path: Path) -> Recording:
    """Returns all whole blocks of a journal as one recording without verdict.

    Raises:
        LogError: there is no whole block.
    """
    blocks = list(_blocks(path))
    if not blocks:
        raise LogError(f"{path} holds no whole second of a flight")
    first = blocks[0]
    channels = {}
    for name, c in first.channels.items():
        same = [b.channels[name] for b in blocks if name in b.channels]
        time = (
            None if c.time is None else np.concatenate([b.time for b in same if b.time is not None])
        )
        channels[name] = replace(c, values=np.concatenate([b.values for b in same]), time=time)
    time = np.concatenate([b.time for b in blocks])
    end = float(time[-1])
    window = [first.meta["metrics_window_s"][0], end]
    meta = first.meta | {"stopped": f"killed after {end:.2f} s", "metrics_window_s": window}
    events = tuple(e for b in blocks for e in b.events)
    return Recording(time, {k: c for k, c in channels.items() if _whole(c, time)}, events, meta)


def _whole(c: object, time: np.ndarray) -> bool:
    """Tells whether a channel was in every block."""
    own = getattr(c, "time", None)
    return len(getattr(c, "values", ())) == len(time if own is None else own)


def _blocks(path: Path) -> Iterator[Recording]:
    try:
        with path.open("rb") as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise LogError(f"{path} is no journal of a flight")
            while True:
                head = file.read(_LENGTH.size + _CHECKSUM)
                if len(head) < _LENGTH.size + _CHECKSUM:
                    return
                payload = file.read(min(_LENGTH.unpack(head[: _LENGTH.size])[0], 1 << 30))
                if hashlib.sha256(payload).digest() != head[_LENGTH.size :]:
                    return  # cut short by a kill, or damaged: what comes before holds
                yield _recording(payload)
    except OSError as error:
        raise LogError(f"{path} cannot be read: {error.strerror or error}") from None


def _recording(payload: bytes) -> Recording:
    count = _LENGTH.unpack_from(payload)[0]
    sizes = [_LENGTH.unpack_from(payload, _LENGTH.size * (1 + i))[0] for i in range(count)]
    at, parts = _LENGTH.size * (1 + count), []
    for size in sizes:
        parts.append(payload[at : at + size])
        at += size
    return decode(parts[0].decode(), parts[1:])
