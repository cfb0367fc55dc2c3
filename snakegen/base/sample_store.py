"""Samples of a long run on disk: written block by block, read as arrays through a memory map.

Each column lies in one piece, so that a signal of an hour can be read column by column, or a few
rows at a time. What was read is given back to the system by `release`. The file has no name: it
goes when the process does, however that ends. `in_pieces` makes arrays of a long run so, those of a
short one in memory.
"""

import math
import mmap
import os
import tempfile
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from threading import Lock

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.geometry import Floats
from snakegen.errors import SnakegenError

LONG = 1 << 16  # rows of a run whose arrays do not stay in memory: 5.5 min at 200 Hz
PIECE = 1 << 14  # rows made together
_folder: ContextVar[Path | None] = ContextVar("folder of samples", default=None)
_live: "weakref.WeakSet[mmap.mmap]" = weakref.WeakSet()  # the maps of all stores
_lock = Lock()


@contextmanager
def samples_in(folder: str | Path | None) -> Iterator[None]:
    """Lets stores of the block lie in `folder`, unless they name another."""
    token = _folder.set(None if folder is None else Path(folder))
    try:
        yield
    finally:
        _folder.reset(token)


def release_all() -> None:
    """Gives back the memory of what was read of any store."""
    with _lock:
        maps = list(_live)
    for each in maps:
        _give_back(each)


def slices(count: int) -> Iterator[slice]:
    """Yields `count` rows in pieces; what was read of stores is given back after each."""
    for first in range(0, count, PIECE):
        yield slice(first, min(first + PIECE, count))
        if count > LONG:
            release_all()


def in_pieces(count: int, make: Callable[[slice], tuple[Floats, ...]]) -> tuple[Floats, ...]:
    """Returns the arrays (count, …) whose rows `make` gives; long ones lie in a nameless file.

    Args:
        count: rows.
        make: from a slice of rows to those rows of each array.
    """
    if count <= LONG:
        return make(slice(0, count))
    store, columns, shapes = SampleStore(), list[Columns](), list[tuple[int, ...]]()
    for part in slices(count):
        found = make(part)
        if not columns:
            shapes = [np.shape(values)[1:] for values in found]
            columns = [store.reserve(count, math.prod(shape)) for shape in shapes]
        for column, values in zip(columns, found, strict=True):
            store.put(column, part.start, np.reshape(values, (len(values), -1)))
    return tuple(
        store.array(column, count).reshape(count, *shape)
        for column, shape in zip(columns, shapes, strict=True)
    )


def _give_back(pages: mmap.mmap) -> None:
    if hasattr(mmap, "MADV_DONTNEED"):
        pages.madvise(mmap.MADV_DONTNEED)


class Columns:
    """Space for `width` columns of `rows` numbers; `first` is where they begin [bytes]."""

    def __init__(self, rows: int, width: int, first: int) -> None:
        self.rows, self.width, self.first = rows, width, first


class SampleStore:
    """Columns of float64 in a nameless file.

    Args:
        folder: where the file lies; if not given that of `samples_in`, else the system's folder for
            temporary files.
    """

    def __init__(self, folder: str | Path | None = None) -> None:
        self.folder = Path(folder or _folder.get() or tempfile.gettempdir())
        self._size = 0
        self._maps: list[mmap.mmap] = []
        try:
            self._file = tempfile.TemporaryFile(dir=self.folder, buffering=0)  # noqa: SIM115
        except OSError as error:
            raise self._refusal(error, 0) from None
        weakref.finalize(self, self._file.close)

    def reserve(self, rows: int, width: int) -> Columns:
        """Returns space for `width` columns of `rows` numbers.

        Raises:
            SnakegenError: the disk has no room for them.
        """
        found = Columns(rows, width, self._size)
        size = 8 * rows * width
        try:
            if size and hasattr(os, "posix_fallocate"):
                os.posix_fallocate(self._file.fileno(), self._size, size)
        except OSError as error:
            raise self._refusal(error, size) from None
        self._size += size
        return found

    def put(self, columns: Columns, first: int, values: Floats) -> None:
        """Writes rows `first` … of `values` (n, width).

        Raises:
            SnakegenError: the disk is full.
        """
        for i in range(columns.width):
            at = columns.first + 8 * (i * columns.rows + first)
            data = np.ascontiguousarray(values[:, i])
            try:
                while len(data):
                    written = os.pwrite(self._file.fileno(), data.data, at)
                    at, data = at + written, data[written // 8 :]
            except OSError as error:
                raise self._refusal(error, data.nbytes) from None

    def array(self, columns: Columns, rows: int) -> Floats:
        """Returns the first `rows` rows of columns, (rows, width), read-only."""
        if not columns.width or not rows:
            return np.zeros((rows, columns.width))
        if not self._maps or len(self._maps[-1]) < self._size:
            new = mmap.mmap(self._file.fileno(), self._size, access=mmap.ACCESS_READ)
            self._maps.append(new)
            with _lock:
                _live.add(new)
        count = columns.rows * columns.width
        flat = np.frombuffer(self._maps[-1], np.float64, count, columns.first)
        return flat.reshape(columns.width, columns.rows)[:, :rows].T

    def release(self) -> None:
        """Gives back the memory of what was read."""
        for each in self._maps:
            _give_back(each)

    def _refusal(self, error: OSError, size: int) -> SnakegenError:
        reason = error.strerror or str(error)
        return SnakegenError(
            f"{self.folder}{os.sep} has no room for {(self._size + size) / 1e6:.3g} MB of samples "
            f"({reason})."
        )


class RowStore:
    """Rows of several arrays, added one by one; those of a long run lie in a nameless file.

    Args:
        most: rows that may come.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._block = most if most <= LONG else PIECE
        self._held: dict[str, Floats] = {}  # rows since the last block
        self._count = 0
        self._store: SampleStore | None = None
        self._columns: dict[str, Columns] = {}

    def add(self, **values: ArrayLike) -> None:
        """Adds a row of every array, numbers or (k,)."""
        at = self._count % self._block
        if at == 0 and self._count:
            self._flush()
        for name, value in values.items():
            if name not in self._held:
                self._held[name] = np.empty((self._block, *np.shape(value)))
            self._held[name][at] = value
        self._count += 1

    def arrays(self) -> dict[str, Floats]:
        """Returns all rows added, (T,) or (T, k), by name."""
        if self._store is None:
            return {name: rows[: self._count] for name, rows in self._held.items()}
        self._flush()
        store, count = self._store, self._count
        return {
            name: store.array(self._columns[name], count).reshape(count, *rows.shape[1:])
            for name, rows in self._held.items()
        }

    def _flush(self) -> None:
        """Writes the rows since the last block."""
        first = (self._count - 1) // self._block * self._block
        if self._store is None:
            self._store = SampleStore()
        for name, rows in self._held.items():
            flat = rows[: self._count - first].reshape(self._count - first, -1)
            if name not in self._columns:
                self._columns[name] = self._store.reserve(self._most, flat.shape[1])
            self._store.put(self._columns[name], first, flat)
        self._store.release()
