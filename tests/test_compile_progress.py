"""What is told while kernels compile: names and counts, and nothing where all is cached."""

import io
import time

import numba
from numba.core import event

from snakegen.kernels.core.compile_progress import CompileProgress, called_kernels
from snakegen.kernels.flight.flight import fly_ticks


@numba.njit
def _inner(x: float) -> float:
    return x + 1.0


@numba.njit
def outer(x: float) -> float:
    return _inner(x) * 2.0


def test_kernels_are_counted() -> None:
    assert {k.py_func.__name__ for k in called_kernels(outer)} == {"outer", "_inner"}
    names = {k.py_func.__name__ for k in called_kernels(fly_ticks)}
    assert names >= {"fly_ticks", "decide", "pose_wrench", "point_thrust"} and len(names) > 100


def test_progress_names_what_compiles() -> None:
    stream = io.StringIO()
    progress = CompileProgress(stream, every=0.01)
    slow = [0]

    class Slow(event.Listener):
        """Makes a compilation last long enough to be told about."""

        def on_start(self, event: object) -> None:
            slow[0] += 1
            time.sleep(0.05)

        def on_end(self, event: object) -> None:
            pass

    with (
        event.install_listener("numba:compile", progress),
        event.install_listener("numba:compile", Slow()),
    ):
        outer(1.0)
    lines = stream.getvalue().splitlines()
    assert any("outer, 0 of about 2 kernels" in line for line in lines), lines
    assert progress.seconds > 0.05
    told = len(lines)
    with event.install_listener("numba:compile", progress):
        assert outer(1.0) == 4.0  # compiled already
    assert len(stream.getvalue().splitlines()) == told
