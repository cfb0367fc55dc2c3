"""Ctrl-C while the command line is still being imported: one line and exit code 130.

Importing this module sets the handler; `restore` puts back the one before. Another handler than
Python's own, or another thread than the main one, is left alone.
"""

import os
import signal
import threading
from types import FrameType

_OURS = threading.current_thread() is threading.main_thread() and (
    signal.getsignal(signal.SIGINT) is signal.default_int_handler
)


def _leave(signum: int, frame: FrameType | None) -> None:
    os.write(2, b"Error: interrupted; files are as they were.\n")
    os._exit(130)


def restore() -> None:
    """Puts Python's own handler back."""
    if _OURS and threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.default_int_handler)


if _OURS:
    signal.signal(signal.SIGINT, _leave)
