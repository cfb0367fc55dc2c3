"""Samples of a long run on disk: written block by block, read as arrays through a memory map.

Each column lies in one piece, so that a signal of an hour can be read column by column, or a few
rows at a time. What was read is given back to the system by `release`. The file has no name: it
goes when the process does, however that ends.
"""

import mmap
import os
import tempfile
import weakref
from pathlib import Path

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.errors import SnakegenError


class Columns:
    """Space for `width` columns of `rows` numbers; `first` is where they begin [bytes]."""

    def __init__(self, rows: int, width: int, first: int) -> None:
        self.rows, self.width, self.first = rows, width, first


class SampleStore:
    """Columns of float64 in a nameless file.

    Args:
        folder: where the file lies; the system's folder for temporary files if not given.
    """

    def __init__(self, folder: str | Path | None = None) -> None:
        self.folder = Path(folder or tempfile.gettempdir())
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
        count = columns.rows * columns.width
        flat = np.frombuffer(self._maps[-1], np.float64, count, columns.first)
        return flat.reshape(columns.width, columns.rows)[:, :rows].T

    def release(self) -> None:
        """Gives back the memory of what was read."""
        for each in self._maps:
            if hasattr(mmap, "MADV_DONTNEED"):
                each.madvise(mmap.MADV_DONTNEED)

    def _refusal(self, error: OSError, size: int) -> SnakegenError:
        reason = error.strerror or str(error)
        return SnakegenError(
            f"{self.folder}{os.sep} has no room for {(self._size + size) / 1e6:.3g} MB of samples "
            f"({reason})."
        )
