"""Scores of many designs: known ones from the journal, others in worker processes or a cluster."""

import hashlib
import json
import multiprocessing
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from snakegen import __version__
from snakegen.base.atomic_io import write_atomically, writing
from snakegen.base.geometry import Floats
from snakegen.design_search.evaluate import Score, evaluate
from snakegen.design_search.problem import Problem
from snakegen.design_search.study import StudyError
from snakegen.errors import AnalysisError
from snakegen.sweep.executors import WorkersLostError, end_with_parent, interrupts_blocked

CHUNK = 6  # designs a task
BLOCK = 8  # designs certified between two looks at the clock
T = TypeVar("T")
Progress = Callable[[int], None]


class OutOfTimeError(Exception):
    """The time that the search was given is over."""


def score_many(problem: Problem, rows: Floats, final: bool = False) -> list[Score]:
    """Returns the scores of design vectors (m, d); what a worker runs."""
    return [evaluate(problem, x, final=final) for x in rows]


@contextmanager
def workers(number: int, cluster: str | None = None) -> Iterator[Executor | None]:
    """Yields an executor: None to stay in this process, worker processes, or a Dask cluster.

    Raises:
        AnalysisError: Dask is not installed, or no scheduler answers.
    """
    if cluster is not None:
        try:
            from distributed import Client
        except ImportError:
            raise AnalysisError(
                "a cluster needs Dask distributed: pip install 'snakegen[cluster]'."
            ) from None
        try:
            client = Client(cluster, timeout="10s")
        except (OSError, ValueError) as error:
            raise AnalysisError(f"no Dask scheduler answers at {cluster} ({error}).") from None
        try:
            yield client.get_executor(pure=False)
        finally:
            client.close(timeout=2)
        return
    if number == 1:
        yield None
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(number, context, initializer=end_with_parent) as pool:
        try:
            yield pool
        finally:
            pool.shutdown(cancel_futures=True)


class Scorer:
    """Scores design vectors, each once; keeps them in a journal, which a search goes on from.

    Attributes:
        problem: the study.
        known: scores by design vector, in the order in which they were asked for.
        deadline: `time.monotonic` at which to stop, None for never.
        fresh: how many were computed, not read.
    """

    def __init__(
        self,
        problem: Problem,
        pool: Executor | None,
        journal: Path | None,
        progress: Progress,
        deadline: float | None = None,
    ) -> None:
        self.problem, self.known, self.deadline = (
            problem,
            dict[tuple[float, ...], Score](),
            deadline,
        )
        self.fresh = 0
        self._stored = dict[tuple[float, ...], Score]()
        self._pool, self._journal, self._progress = pool, journal, progress

    def resume(self, seed: int) -> None:
        """Reads the journal of the same study and seed.

        Raises:
            StudyError: it is of another study, seed or version.
        """
        if self._journal is None or not self._journal.is_file():
            return
        lines = self._journal.read_text(encoding="utf-8", errors="replace").splitlines()
        try:
            head = json.loads(lines[0]) if lines else {}
        except ValueError:  # damaged
            head = {}
        if head != header(self.problem, seed):
            raise StudyError(
                f"{self._journal}: is of another study, seed or version of snakegen; leave "
                "--resume out to start anew."
            )
        for line in lines[1:]:
            try:
                row = json.loads(_verified(line))
                values = {k: -np.inf if v is None else v for k, v in row["values"].items()}
                self._stored[tuple(row["x"])] = Score(values, row["violated"])
            except (ValueError, KeyError, TypeError, AttributeError):
                continue  # the line that a kill or a full disk cut off, or damage

    def begin(self, seed: int) -> None:
        """Starts a journal, or keeps the one that was read."""
        if self._journal is not None and not self._stored:
            write_atomically(self._journal, json.dumps(header(self.problem, seed)) + "\n")

    def many(self, rows: Floats) -> list[Score]:
        """Returns the scores of (m, d) design vectors.

        Raises:
            OutOfTimeError: at the deadline; what was scored is kept.
        """
        rows = np.round(rows, 9)
        keys = [tuple(float(v) for v in x) for x in rows]
        for key in keys:
            if key in self._stored:
                self.known.setdefault(key, self._stored[key])
        asked = list(dict.fromkeys(k for k in keys if k not in self.known))
        chunks = [asked[i : i + CHUNK] for i in range(0, len(asked), CHUNK)]
        if chunks and self.deadline is not None and time.monotonic() > self.deadline:
            raise OutOfTimeError
        for chunk, scores in zip(chunks, self._scores(chunks), strict=True):
            self.known |= dict(zip(chunk, scores, strict=True))
            self.fresh += len(chunk)
            self._write(chunk, scores)
            self._progress(len(self.known))
        return [self.known[key] for key in keys]

    def final(self, rows: Floats, deadline: float | None = None) -> list[Score]:
        """Returns the scores of (m, d) design vectors over the certifying postures.

        Those of the first ones where a `deadline` [`time.monotonic`] ends it, one block at least.
        """
        out: list[Score] = []
        while len(out) < len(rows):
            if out and deadline is not None and time.monotonic() > deadline:
                break
            block = rows[len(out) : len(out) + BLOCK]
            chunks = [[tuple(float(v) for v in x)] for x in block]
            out += [s for scores in self._scores(chunks, final=True) for s in scores]
        return out

    def each(self, work: Callable[..., T], tasks: list[tuple[Any, ...]]) -> list[T]:
        """Returns ``work(problem, *task)`` of each task, by the workers."""
        return list(self._run(work, tasks))

    def _scores(
        self, chunks: list[list[tuple[float, ...]]], final: bool = False
    ) -> Iterator[list[Score]]:
        yield from self._run(score_many, [(np.array(chunk), final) for chunk in chunks])

    def _run(self, work: Callable[..., T], tasks: list[tuple[Any, ...]]) -> Iterator[T]:
        if self._pool is None:
            yield from (work(self.problem, *task) for task in tasks)
            return
        try:
            with interrupts_blocked():
                futures = [self._pool.submit(work, self.problem, *task) for task in tasks]
            yield from (future.result() for future in futures)
        except BrokenExecutor:
            raise WorkersLostError(
                "workers died: fewer at a time need less memory; what was scored is kept for "
                "--resume."
            ) from None

    def _write(self, chunk: list[tuple[float, ...]], scores: list[Score]) -> None:
        if self._journal is None:
            return
        with writing(self._journal), self._journal.open("a", encoding="utf-8") as file:
            for x, s in zip(chunk, scores, strict=True):
                values = {k: v if np.isfinite(v) else None for k, v in s.values.items()}
                row = {"x": list(x), "values": values, "violated": s.violated}
                text = json.dumps(row)
                file.write(f"{_checksum(text)} {text}\n")


def _checksum(text: str) -> str:
    """Returns the first 16 digits of a line's SHA-256."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _verified(line: str) -> str:
    """Returns a journal's line without its checksum.

    Raises:
        ValueError: they disagree.
    """
    digits, _, text = line.partition(" ")
    if digits != _checksum(text):
        raise ValueError(line)
    return text


def header(problem: Problem, seed: int) -> dict[str, object]:
    """Returns what a journal must agree in with the search that goes on from it."""
    text = problem.study.model_dump_json()
    shape = json.dumps([t.data for t in problem.topologies.values()], sort_keys=True)
    digest = hashlib.sha256((text + shape).encode()).hexdigest()
    return {"journal": 2, "study": digest, "seed": seed, "version": __version__}
