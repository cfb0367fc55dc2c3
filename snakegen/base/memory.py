"""What does not fit into memory is refused before it is begun, with what would fit."""

import contextlib
import ctypes
import os

from snakegen.errors import AnalysisError

_MMAP_THRESHOLD = -3  # of mallopt
_SHARE = 0.5  # of what is free: the caller holds copies


def available() -> int:
    """Returns the bytes of memory that are free now; a great many where that cannot be known."""
    try:
        with open("/proc/meminfo", encoding="ascii") as file:
            for line in file:
                if line.startswith("MemAvailable:"):
                    return int(line.split()[1]) * 1024
        return int(os.sysconf("SC_PAGE_SIZE")) * int(os.sysconf("SC_PHYS_PAGES"))
    except (OSError, ValueError, AttributeError):
        return 1 << 62


def room() -> float:
    """Returns the bytes that a command may take: half of the memory that is free."""
    return _SHARE * available()


def refuse_beyond(size: float, what: str, remedy: str) -> None:
    """Refuses what would take more than half of the memory that is free.

    Args:
        size: bytes needed.
        what: that needs them, as in "torques of 480 joints at 100001 instants".
        remedy: what would work.

    Raises:
        AnalysisError: too much, with both sizes and the remedy.
    """
    if size > room():
        raise AnalysisError(
            f"{what} would take {size / 1e9:.3g} GB; {available() / 1e9:.3g} GB are free: {remedy}."
        )


def map_large_arrays() -> None:
    """Lets the C library take arrays above 1 MB from the system, and give them back when freed.

    It does so by itself at first, then keeps what was freed among smaller blocks.
    """
    with contextlib.suppress(AttributeError, OSError):
        ctypes.CDLL(None).mallopt(_MMAP_THRESHOLD, 1 << 20)


def trim() -> None:
    """Gives the memory that was freed back to the system; the C library keeps some otherwise."""
    with contextlib.suppress(AttributeError, OSError):
        ctypes.CDLL(None).malloc_trim(0)
