"""Ctrl-C that waits for compiled code: raised between stretches of flight, never inside a call.

Numba builds named tuples by calling Python; an exception raised there by the signal's handler
would crash the process. So the handler only takes a note while a flight is on.
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class Interrupts:
    """Whether Ctrl-C was pressed since the flight began."""

    def __init__(self) -> None:
        self.pressed = False

    def check(self) -> None:
        """Raises KeyboardInterrupt if Ctrl-C was pressed."""
        if self.pressed:
            raise KeyboardInterrupt


@contextmanager
def noted() -> Iterator[Interrupts]:
    """Takes note of Ctrl-C instead of raising; in other threads than the main one it does nothing.

    The handler that stood before is put back at the end.
    """
    found = Interrupts()
    if threading.current_thread() is not threading.main_thread():
        yield found
        return

    def note(_: int, __: FrameType | None) -> None:
        found.pressed = True

    before = signal.signal(signal.SIGINT, note)
    try:
        yield found
    finally:
        signal.signal(signal.SIGINT, before)
