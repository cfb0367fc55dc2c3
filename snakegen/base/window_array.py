"""Arrays of one row a tick whose rows behind a window are given back to the system.

A long flight writes and reads each row once, in order. An array of all rows in private memory
takes pages only where it is written, and `drop` gives back those of the rows that are over: the
index stays that of the tick, the memory that of the window.
"""

import math
import mmap

import numpy as np

from snakegen.base.geometry import Floats

_DROPS = hasattr(mmap, "MAP_PRIVATE") and hasattr(mmap, "MADV_DONTNEED")


class WindowArray:
    """An array of float64, zero where it was never written.

    Attributes:
        values: the array; rows before the last `drop` are undefined.
    """

    def __init__(self, shape: tuple[int, ...]) -> None:
        size = 8 * math.prod(shape)
        self._row = size // max(shape[0], 1)
        self._dropped = 0
        self._memory: mmap.mmap | None = None
        if size > mmap.PAGESIZE and _DROPS:
            self._memory = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
            self.values: Floats = np.frombuffer(self._memory, np.float64).reshape(shape)
        else:
            self.values = np.zeros(shape)

    def drop(self, before: int) -> None:
        """Gives back the memory of rows before `before`, as far as whole pages go."""
        end = before * self._row // mmap.PAGESIZE * mmap.PAGESIZE
        if self._memory is not None and end > self._dropped:
            self._memory.madvise(mmap.MADV_DONTNEED, self._dropped, end - self._dropped)
            self._dropped = end
