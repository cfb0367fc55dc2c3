"""A study from file to front: prepares, searches, certifies, proves, writes."""

import json
import os
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from snakegen.base.atomic_io import write_atomically
from snakegen.base.file_lock import exclusive
from snakegen.design_search.bound import Bound, provable, prove
from snakegen.design_search.evaluate import evaluate
from snakegen.design_search.executor import Scorer, workers
from snakegen.design_search.front import given_design, shown_designs
from snakegen.design_search.front_picture import draw_front
from snakegen.design_search.problem import Problem, prepare
from snakegen.design_search.report import StudyResult, best_by_choice
from snakegen.design_search.search import search
from snakegen.design_search.small_steps import small_steps
from snakegen.design_search.study import read_study
from snakegen.spec.loading import load_spec, save

JOURNAL, FRONT, PICTURE = "journal.jsonl", "front.json", "front.png"
SEARCHING = 0.5  # of the minutes, where a proof is asked for too
PROVING = 600.0  # s at most, where no minutes are given

Tell = Callable[[str], None]
Step = Callable[[int, int], None]


def run_study(
    path: Path,
    folder: Path,
    *,
    seed: int = 0,
    minutes: float | None = None,
    resume: bool = False,
    processes: int | None = None,
    cluster: str | None = None,
    tell: Tell = lambda _: None,
    step: Step = lambda _done, _total: None,
) -> StudyResult:
    """Runs a study and writes front.json, front.png and a spec a design into `folder`.

    Args:
        path: of the study.
        folder: of the results; made where absent.
        seed: of the search; the same seed gives the same front on one machine.
        minutes: after which the search ends with what it has; it ends by itself otherwise.
        resume: go on from the journal of an interrupted run.
        processes: workers; all cores if None.
        cluster: address of a Dask scheduler instead.
        tell: called with what is being done.
        step: called with designs scored and expected.

    Raises:
        StudyError: a mistake in the study, no feasible design, or a journal of another study.
        SnakegenError: the folder cannot be written, or another process writes it.
    """
    study = read_study(path)
    begun = time.monotonic()
    tell(f"{study.name}: reading {study.robot}")
    problem = prepare(study, path.parent)
    seconds = None if minutes is None else 60.0 * minutes
    proving = study.search.bound
    if proving:
        provable(problem)
    share = SEARCHING if proving else 0.7
    deadline = None if seconds is None else begun + share * seconds
    total = study.search.evaluations
    middle = 0.5 * (problem.low + problem.high)
    evaluate(
        problem, np.where(problem.whole, problem.low, middle)
    )  # compiles, once for all workers
    lock = folder / f".{JOURNAL}.lock"
    with exclusive(folder, lock), workers(processes or os.cpu_count() or 1, cluster) as pool:
        scorer = Scorer(
            problem, pool, folder / JOURNAL, lambda n: step(min(n, total), total), deadline
        )
        if resume:
            scorer.resume(seed)
        scorer.begin(seed)
        found = search(scorer, seed)
        step(total, total)
        took, bound = time.monotonic() - begun, None
        if proving:
            tell(f"{study.name}: {found.scored} designs scored; proving how good any can get")
            last = time.monotonic() + (PROVING if seconds is None else 0.0)
            bound = _proof(problem, found.front[0], max(last, begun + (seconds or 0.0)), tell)
            if bound.design not in found.front:  # found on the way
                found = replace(found, front=(bound.design, *found.front))
        tell(f"{study.name}: certifying the front")
        limit = None if seconds is None else max(begun + seconds, time.monotonic() + 1.0)
        front = shown_designs(problem, found, lambda rows: scorer.final(rows, limit), scorer.each)
        given = given_design(problem, path.parent)
        result = StudyResult(
            study, seed, tuple(front), given, bound, found.scored, took, found.complete,
            best_by_choice(problem, scorer.known),
        )  # fmt: skip
        pick = result.chosen
        steps = small_steps(problem, pick.x, pick.values, scorer.final)
        result = replace(result, steps=steps)
        _write(result, scorer, folder)
    return result


def _proof(problem: Problem, start: tuple[float, ...], deadline: float, tell: Tell) -> Bound:
    reported = [0.0]

    def progress(best: float, upper: float) -> None:
        if time.monotonic() - reported[0] > 10.0:
            reported[0] = time.monotonic()
            tell(f"found {best:.4g}, proved at most {upper:.4g}")

    return prove(problem, np.array(start), deadline, progress)


def _write(result: StudyResult, scorer: Scorer, folder: Path) -> None:
    for design in result.front:
        save(load_spec(design.spec), folder / f"{design.label}.spec.yaml")
    draw_front(result, list(scorer.known.values()), folder / PICTURE)
    write_front(folder, result.to_json())


def write_front(folder: Path, data: dict[str, Any]) -> None:
    """Writes what a study found, as plain data, into its folder."""
    write_atomically(folder / FRONT, json.dumps(data, indent=2, ensure_ascii=False) + "\n")
