"""Running a sweep: parts to workers, results to Parquet, nothing lost when a worker dies."""

import hashlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from snakegen import __version__
from snakegen.base.file_lock import exclusive
from snakegen.base.geometry import Floats, rpy_from_rotation
from snakegen.robot.configuration import Configuration
from snakegen.robot.robot import Robot
from snakegen.sweep import executors
from snakegen.sweep.batch import Body, table
from snakegen.sweep.estimate import check_disk, part_rows
from snakegen.sweep.samples import Samples, Table
from snakegen.sweep.store import Store

PART = 16384  # postures a task at most: about a second of work


def sweep(
    robot: Robot,
    joints: tuple[str, ...],
    samples: Samples | Floats,
    path: Path,
    *,
    posture: Configuration | None = None,
    tolerance: float = 1e-3,
    identity: dict[str, Any] | None = None,
    resume: bool = False,
    workers: int | str | None = None,
    progress: Callable[[int, int], Any] | None = None,
) -> Path:
    """Evaluates margins at `samples` and writes them to the Parquet file `path`.

    Memory does not grow with the number of postures: a part's samples are drawn when its turn
    comes and its rows are on the disk before the next but few begins.

    Args:
        robot: with apparatuses and a free base.
        joints: names of the columns of `samples`.
        samples: from `samples.sampling`, or (m, k) rad.
        path: to write; parts are kept in a folder of the same name until all are done.
        posture: attitude of the root link, and angles of joints that are not sampled; level and
            at 0 if absent. Gimbals point up in every posture.
        tolerance: of the certified margins.
        identity: more to store (seed, sampling, spec).
        resume: keep the parts of an earlier, interrupted run of the same sweep.
        workers: processes; all cores by default; 1 runs in this process; the address of a Dask
            scheduler runs there.
        progress: called with postures done and in all.

    Raises:
        InUseError: another process writes `path`.
        WorkersLostError: workers that keep dying, or a cluster that was lost; parts are kept.
        AnalysisError: parts of another sweep, a cluster that is not there, or a disk too small.
    """
    body = body_at(robot, tuple(joints), posture, tolerance)
    drawn = samples if isinstance(samples, Samples) else Table(np.asarray(samples, float))
    part = part_rows(len(joints), PART)
    with exclusive(path):
        if not resume:
            check_disk(path, drawn.count, part, 0, len(joints))
        known = {
            "snakegen": __version__,
            "robot": robot.name,
            "urdf_sha256": robot.urdf_hash,
            "joints": list(joints),
            "base_rpy": rpy_from_rotation(body.base).tolist(),
            "tolerance": tolerance,
            "postures": drawn.count,
            "samples_sha256": _digest(drawn, part),
            "urdf": robot.urdf,
        } | (identity or {})
        known |= {"held_rad": dict(body.held)} if body.held else {}
        store = Store(path, known, postures=drawn.count, part=part, resume=resume)
        done = {i for i in range(store.count) if resume and store.has(i)}
        if resume:
            check_disk(path, drawn.count, part, len(done), len(joints))
        if len(done) < store.count:
            _compute(body, drawn, store, done, workers, progress)
        store.join()
    return path


def body_at(
    robot: Robot, joints: tuple[str, ...], posture: Configuration | None, tolerance: float
) -> Body:
    """Returns the body of a sweep over `joints`; attitude and other joints are those of a posture.

    Raises:
        AnalysisError: as `Body.of`.
    """
    if posture is None:
        return Body.of(robot, joints, np.eye(3), tolerance)
    free = {*joints, *robot.gimbal_names}
    angles = zip(robot.joint_names, posture.angles.tolist(), strict=True)
    held = {name: angle for name, angle in angles if angle != 0.0 and name not in free}
    return Body.of(robot, joints, np.array(posture.base_rotation), tolerance, held)


def _digest(samples: Samples, part: int) -> str:
    digest = hashlib.sha256()
    for _, rows in samples.blocks(part):
        digest.update(np.ascontiguousarray(rows).tobytes())
    return digest.hexdigest()


def _compute(
    body: Body,
    samples: Samples,
    store: Store,
    done: set[int],
    workers: int | str | None,
    progress: Callable[[int, int], Any] | None,
) -> None:
    """Computes and stores the parts that are not in `done`, adding each to it."""
    sizes = {i: min(store.rows, store.postures - i * store.rows) for i in range(store.count)}
    finished = sum(sizes[i] for i in done)

    def keep(index: int, rows: Floats, numbers: Floats) -> None:
        nonlocal finished
        store.put(index, table(body.joints, rows, numbers))
        done.add(index)
        finished += len(rows)
        if progress is not None:
            progress(finished, store.postures)

    def parts() -> Iterator[tuple[int, Floats]]:
        yield from ((i, rows) for i, rows in samples.blocks(store.rows) if i not in done)

    if isinstance(workers, str):
        executors.run_on_cluster(workers, body.task, parts, keep)
        return
    number = workers or os.cpu_count() or 1
    if number == 1 or store.count - len(done) == 1:
        executors.run_here(body.task, parts, keep)
    else:
        executors.run_in_processes(body.task, parts, keep, number)
