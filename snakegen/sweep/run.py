"""Running a sweep: parts to workers, results to Parquet, nothing lost when a worker dies."""

import multiprocessing
import os
from collections.abc import Callable
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from pathlib import Path
from typing import Any

import numpy as np

from snakegen import __version__
from snakegen.errors import AnalysisError
from snakegen.geometry import Floats, rotation_from_rpy
from snakegen.robot import Robot
from snakegen.sweep.batch import Body, table
from snakegen.sweep.store import Store
from snakegen.sweep.worker import Task, work

PART = 16384  # postures a task: about a second of work
RETRIES = 3  # how often a broken pool is made anew


def sweep(
    robot: Robot,
    joints: tuple[str, ...],
    samples: Floats,
    path: Path,
    *,
    base_rpy: tuple[float, float, float] = (0.0, 0.0, 0.0),
    tolerance: float = 1e-3,
    identity: dict[str, Any] | None = None,
    resume: bool = False,
    workers: int | None = None,
    cluster: str | None = None,
    progress: Callable[[int, int], Any] | None = None,
) -> Path:
    """Evaluates margins at `samples` and writes them to the Parquet file `path`.

    Args:
        robot: with apparatuses and a free base.
        joints: names of the columns of `samples`.
        samples: (m, k) rad.
        path: to write; parts stand beside it until all are done.
        base_rpy: rad, attitude of the root link for all postures.
        tolerance: of the certified margins.
        identity: more to store (seed, sampling, spec).
        resume: keep the parts of an earlier, interrupted run of the same sweep.
        workers: processes; all cores by default; 1 runs in this process.
        cluster: address of a Dask scheduler instead.
        progress: called with postures done and in all.

    Raises:
        AnalysisError: parts of another sweep, a cluster that is not there, or workers that keep
            dying; the parts done so far are kept.
    """
    body = Body.of(robot, tuple(joints), rotation_from_rpy(base_rpy), tolerance)
    said = {
        "snakegen": __version__,
        "robot": robot.name,
        "urdf_sha256": robot.urdf_hash,
        "joints": list(joints),
        "base_rpy": list(base_rpy),
        "tolerance": tolerance,
        "postures": len(samples),
        "samples_sha256": _digest(samples),
        "urdf": robot.urdf,
    } | (identity or {})
    store = Store(path, said, resume=resume)
    count = -(-len(samples) // PART)
    todo = [i for i in range(count) if not store.has(i)]
    if todo:
        _run(body, samples, store, todo, count, workers, cluster, progress)
    store.join(count)
    return path


def _digest(samples: Floats) -> str:
    import hashlib

    return hashlib.sha256(np.ascontiguousarray(samples).tobytes()).hexdigest()


def _rows(samples: Floats, index: int) -> Floats:
    return samples[index * PART : (index + 1) * PART]


def _run(
    body: Body,
    samples: Floats,
    store: Store,
    todo: list[int],
    count: int,
    workers: int | None,
    cluster: str | None,
    progress: Callable[[int, int], Any] | None,
) -> None:
    done = len(samples) - sum(len(_rows(samples, i)) for i in todo)

    def keep(index: int, numbers: Floats) -> None:
        nonlocal done
        rows = _rows(samples, index)
        store.put(index, table(body.joints, rows, numbers))
        done += len(rows)
        if progress is not None:
            progress(done, len(samples))

    number = workers or os.cpu_count() or 1
    if cluster is None and (number == 1 or len(todo) == 1):
        for i in todo:
            keep(i, work(body.task, _rows(samples, i)))
        return
    if cluster is not None:
        _on_cluster(cluster, body.task, samples, todo, keep)
        return
    for attempt in range(RETRIES + 1):
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(number, mp_context=context) as pool:
            try:
                # the first compile is paid once, by one worker, and cached for the others
                pool.submit(work, body.task, _rows(samples, todo[0])[:2]).result()
                _drain(pool, body.task, samples, todo, keep, 2 * number)
                return
            except BrokenExecutor:
                todo = [i for i in todo if not store.has(i)]
                if attempt == RETRIES:
                    break
    raise AnalysisError(
        f"workers died {RETRIES + 1} times; {len(todo)} of {count} parts are missing: "
        "run again with --resume, perhaps with fewer --workers."
    )


def _on_cluster(
    address: str, task: Task, samples: Floats, todo: list[int], keep: Callable[[int, Floats], None]
) -> None:
    try:
        from distributed import Client
    except ImportError:
        raise AnalysisError(
            "--cluster needs Dask distributed: install snakegen[cluster]."
        ) from None
    try:
        client = Client(address, timeout="10s")
    except (OSError, ValueError) as error:
        raise AnalysisError(f"no Dask scheduler answers at {address} ({error}).") from None
    try:
        with client.get_executor(pure=False, retries=RETRIES) as pool:
            number = max(1, sum(client.nthreads().values()))
            _drain(pool, task, samples, todo, keep, 2 * number)
    finally:
        client.close()


def _drain(
    pool: Executor,
    task: Task,
    samples: Floats,
    todo: list[int],
    keep: Callable[[int, Floats], None],
    ahead: int,
) -> None:
    """Keeps `ahead` parts in flight until all of `todo` are kept: memory stays bounded."""
    waiting = list(reversed(todo))
    flying: dict[Future[Floats], int] = {}
    try:
        while waiting or flying:
            while waiting and len(flying) < ahead:
                index = waiting.pop()
                flying[pool.submit(work, task, _rows(samples, index))] = index
            ready, _ = wait(flying, return_when=FIRST_COMPLETED)
            for future in ready:
                keep(flying.pop(future), future.result())
    except KeyboardInterrupt:
        for future in flying:
            future.cancel()
        raise
