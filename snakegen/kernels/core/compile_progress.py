"""Shows which kernels are being compiled: a bar on a terminal, a line every ten seconds elsewhere.

Numba announces every function that it compiles; one found in the cache is not announced. How many
there will be is read from the names that kernels use.
"""

import sys
import threading
import time
from types import CodeType
from typing import Any, TextIO

from numba.core import event
from numba.core.dispatcher import Dispatcher

SILENT = 1.0  # s, of compilation that nobody needs to be told about
WIDTH = 24  # of the bar


def called_kernels(kernel: Any) -> set[Any]:
    """Returns `kernel` and all kernels that it calls, directly or through others."""
    found, waiting = {kernel}, [kernel]
    while waiting:
        function = waiting.pop().py_func
        for name in _names(function.__code__):
            other = function.__globals__.get(name)
            if isinstance(other, Dispatcher) and other not in found:
                found.add(other)
                waiting.append(other)
    return found


def _names(code: CodeType) -> set[str]:
    inner = [c for c in code.co_consts if isinstance(c, CodeType)]
    return set(code.co_names).union(*(_names(c) for c in inner))


class CompileProgress(event.Listener):
    """Reports compilation on a stream while it lasts.

    Attributes:
        seconds: spent on compiling so far.
    """

    def __init__(self, stream: TextIO, *, every: float | None = None) -> None:
        """`every`: s between two reports; by default 0.2 on a terminal and 10 elsewhere."""
        self._stream, self._terminal = stream, stream.isatty()
        self._every = (0.2 if self._terminal else 10.0) if every is None else every
        self._depth, self._done, self._expected = 0, 0, 1
        self._outer, self._inner, self._start, self._told = "", "", 0.0, False
        self._rest = threading.Event()
        self.seconds = 0.0

    def on_start(self, event: Any) -> None:
        """Called where the compilation of a function begins, inside that of its callers."""
        kernel = event.data["dispatcher"]
        self._inner = kernel.py_func.__name__
        if self._depth == 0:
            self._outer, self._start, self._done = self._inner, time.perf_counter(), 0
            self._expected = sum(not k.overloads for k in called_kernels(kernel))
            self._rest = threading.Event()
            threading.Thread(target=self._report, args=(self._rest,), daemon=True).start()
        self._depth += 1

    def on_end(self, event: Any) -> None:
        """Called where it ends."""
        self._depth -= 1
        self._done += event.data["dispatcher"].py_func.__module__.startswith("snakegen")
        if self._depth == 0:
            self._rest.set()
            self.seconds += time.perf_counter() - self._start
            if self._told and self._terminal:
                print("\r\x1b[K", end="", file=self._stream, flush=True)
            self._told = False

    def text(self) -> str:
        """Returns what is being compiled now, as a bar."""
        share = min(self._done / max(self._expected, 1), 1.0)
        bar = "#" * int(WIDTH * share)
        spent = self.seconds + time.perf_counter() - self._start
        return (
            f"compiling, once: [{bar:-<{WIDTH}}] {self._outer}, {self._done} of about "
            f"{max(self._expected, self._done)} kernels, now {self._inner}; {spent:.0f} s"
        )

    def _report(self, rest: threading.Event) -> None:
        if rest.wait(min(SILENT, self._every)):
            return
        while not rest.wait(self._every):
            self._told = True
            start, end = ("\r", "\x1b[K") if self._terminal else ("", "\n")
            print(start + self.text()[:118], end=end, file=self._stream, flush=True)


_shown: list[CompileProgress] = []


def show_compilation() -> None:
    """Reports on stderr what this process compiles from now on."""
    if not _shown:
        _shown.append(CompileProgress(sys.stderr))
        event.register("numba:compile", _shown[0])
