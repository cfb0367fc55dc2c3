"""Where the parts of a sweep are computed: this process, worker processes, or a Dask cluster."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from contextlib import contextmanager

from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError
from snakegen.sweep.worker import Task, work

RETRIES = 3  # how often a broken pool is made anew
PATIENCE = 10.0  # s, for the answer of a scheduler
Parts = Callable[[], Iterator[tuple[int, Floats]]]  # the parts still missing, with their samples
Keep = Callable[[int, Floats, Floats], None]  # index, samples, margins


class WorkersLostError(AnalysisError):
    """Workers or a scheduler that died; the parts computed before are kept."""


def run_here(task: Task, parts: Parts, keep: Keep) -> None:
    """Computes all parts in this process."""
    for index, samples in parts():
        keep(index, samples, work(task, samples))


def run_in_processes(task: Task, parts: Parts, keep: Keep, number: int) -> None:
    """Computes all parts in `number` worker processes; a dead worker's parts are repeated.

    Raises:
        WorkersLostError: workers died more than `RETRIES` times.
    """
    context = multiprocessing.get_context("spawn")
    for attempt in range(RETRIES + 1):
        with ProcessPoolExecutor(number, context, initializer=end_with_parent) as pool:
            try:
                # the first compile is paid once, by one worker, and cached for the others
                _, first = next(parts())
                with interrupts_blocked():
                    began = pool.submit(work, task, first[:2])
                began.result()
                _drain(pool, task, parts(), keep, 2 * number)
                return
            except BrokenExecutor:
                if attempt == RETRIES:
                    break
    raise WorkersLostError(f"workers died {RETRIES + 1} times: fewer at a time need less memory.")


@contextmanager
def interrupts_blocked() -> Iterator[None]:
    """Blocks SIGINT in this thread: workers started meanwhile inherit it and import in silence."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def run_on_cluster(address: str, task: Task, parts: Parts, keep: Keep) -> None:
    """Computes all parts on the Dask cluster whose scheduler is at `address`.

    Raises:
        WorkersLostError: the scheduler died, or a part's workers died again and again.
        AnalysisError: Dask is not installed, or no scheduler answers.
    """
    try:
        from distributed import Client
        from distributed.scheduler import KilledWorker
    except ImportError:
        raise AnalysisError(
            "a cluster needs Dask distributed: install snakegen[cluster]."
        ) from None
    try:
        client = Client(address, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        raise AnalysisError(f"no Dask scheduler answers at {address} ({error}).") from None
    lost = (CancelledError, KilledWorker, RuntimeError, OSError)
    pool = client.get_executor(pure=False, retries=RETRIES)
    try:
        _drain(pool, task, parts(), keep, 2 * max(1, sum(client.nthreads().values())))
    except lost as error:
        raise WorkersLostError(
            f"the Dask cluster at {address} was lost ({str(error) or type(error).__name__})."
        ) from None
    finally:
        pool.shutdown(wait=False)
        client.close(timeout=2)


def end_with_parent() -> None:
    """Starts a thread in a worker that ends the worker as soon as its parent is gone.

    Ctrl-C is left to the parent, which keeps what is finished.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_exit_after, args=(parent.sentinel,), daemon=True).start()


def _exit_after(sentinel: int) -> None:
    from multiprocessing.connection import wait as wait_for

    wait_for([sentinel])
    os._exit(1)


def _drain(
    pool: Executor, task: Task, parts: Iterator[tuple[int, Floats]], keep: Keep, ahead: int
) -> None:
    """Keeps `ahead` parts in flight until all are kept: memory stays bounded."""
    flying: dict[Future[Floats], tuple[int, Floats]] = {}
    try:
        while True:
            while len(flying) < ahead:
                index, samples = next(parts, (-1, None))
                if samples is None:
                    break
                flying[pool.submit(work, task, samples)] = index, samples
            if not flying:
                return
            ready, _ = wait(flying, return_when=FIRST_COMPLETED)
            for future in ready:
                keep(*flying.pop(future), future.result())
    except BaseException:  # Ctrl-C, a full disk
        for future in flying:
            future.cancel()
        raise
