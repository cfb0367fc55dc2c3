"""The journal of a flight: what was flown so far, readable whenever the process is killed.

A file ``.NAME.journal`` next to the log that will be written. Each block is a recording as
`store.encode` makes it, with its length and SHA-256; a block that is cut short ends the journal.
The log is written once the flight is over, and the journal removed.
"""

from __future__ import annotations

import hashlib
import struct
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.base.sample_store import LONG, Columns, SampleStore
from snakegen.errors import LogError
from snakegen.log.store import decode, encode
from snakegen.simulation.recording.recording import Channel, Event, Recording

MAGIC = b"snakegen journal 2\n"
_BEFORE = b"snakegen journal 1\n"  # its tables are Parquet files
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
        header, files = encode(replace(block, meta={}) if self._begun else block, quick=True)
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
        return file.read(len(MAGIC)) in (MAGIC, _BEFORE)


def read_journal(path: Path) -> Recording:
    """Returns all whole blocks of a journal as one recording without verdict.

    Raises:
        LogError: there is no whole block.
    """
    counts, ticks, first = Counter[str](), 0, None
    for block in _blocks(path):
        counts.update({name: len(c.values) for name, c in block.channels.items()})
        ticks, first = ticks + len(block.time), first or block
    if first is None:
        raise LogError(f"{path} holds no whole second of a flight")
    rows = _Rows(first, counts, ticks)
    events: list[Event] = []
    for block in _blocks(path):
        rows.add(block)
        events += block.events
    time, channels = rows.joined()
    end = float(time[-1])
    window = [first.meta["metrics_window_s"][0], end]
    meta = first.meta | {"stopped": f"killed after {end:.2f} s", "metrics_window_s": window}
    return Recording(time, channels, tuple(events), meta)


class _Rows:
    """The rows of all blocks, on a disk where they are many.

    Args:
        first: block, which names the channels.
        counts: rows of each.
        ticks: rows in all.
    """

    def __init__(self, first: Recording, counts: Mapping[str, int], ticks: int) -> None:
        self.like = {
            n: c for n, c in first.channels.items() if c.time is not None or counts[n] == ticks
        }
        self.store = SampleStore() if ticks > LONG else None
        self.times: dict[str, list[Floats]] = {
            n: [] for n, c in self.like.items() if c.time is not None
        }
        self.ticks: list[Floats] = []
        self.at = dict.fromkeys(self.like, 0)
        self.values: dict[str, Floats] = {}
        self.columns: dict[str, Columns] = {}
        for name, c in self.like.items():
            if self.store is None:
                self.values[name] = np.empty((counts[name], len(c.labels)))
            else:
                self.columns[name] = self.store.reserve(counts[name], len(c.labels))

    def add(self, block: Recording) -> None:
        """Appends a block."""
        self.ticks.append(block.time)
        for name, c in block.channels.items():
            if name not in self.like:
                continue
            if name in self.times and c.time is not None:
                self.times[name].append(c.time)
            first = self.at[name]
            if self.store is None:
                self.values[name][first : first + len(c.values)] = c.values
            else:
                self.store.put(self.columns[name], first, c.values)
            self.at[name] += len(c.values)

    def joined(self) -> tuple[Floats, dict[str, Channel]]:
        """Returns the time axis and the channels."""
        channels = {}
        for name, c in self.like.items():
            own = np.concatenate(self.times[name]) if name in self.times else None
            values = (
                self.values[name]
                if self.store is None
                else self.store.array(self.columns[name], self.at[name])
            )
            channels[name] = replace(c, values=values, time=own)
        return np.concatenate(self.ticks), channels


def _blocks(path: Path) -> Iterator[Recording]:
    try:
        with path.open("rb") as file:
            magic = file.read(len(MAGIC))
            if magic not in (MAGIC, _BEFORE):
                raise LogError(f"{path} is no journal of a flight")
            while True:
                head = file.read(_LENGTH.size + _CHECKSUM)
                if len(head) < _LENGTH.size + _CHECKSUM:
                    return
                payload = file.read(min(_LENGTH.unpack(head[: _LENGTH.size])[0], 1 << 30))
                if hashlib.sha256(payload).digest() != head[_LENGTH.size :]:
                    return  # cut short by a kill, or damaged: what comes before holds
                yield _recording(payload, quick=magic == MAGIC)
    except OSError as error:
        raise LogError(f"{path} cannot be read: {error.strerror or error}") from None


def _recording(payload: bytes, *, quick: bool) -> Recording:
    count = _LENGTH.unpack_from(payload)[0]
    sizes = [_LENGTH.unpack_from(payload, _LENGTH.size * (1 + i))[0] for i in range(count)]
    at, parts = _LENGTH.size * (1 + count), []
    for size in sizes:
        parts.append(payload[at : at + size])
        at += size
    return decode(parts[0].decode(), parts[1:], quick=quick)
