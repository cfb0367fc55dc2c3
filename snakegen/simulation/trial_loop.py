"""Trials of drives and arms, one after the other: the loop, its interruption, the worst run."""

from collections.abc import Callable
from typing import Any

import numpy as np

from snakegen.errors import MissionError
from snakegen.simulation.monte_carlo import MonteCarlo, Trial, badness, summary
from snakegen.simulation.recording.recording import Recording

Run = Callable[[np.random.Generator], Recording]
Judge = Callable[[Recording, int], Trial]


def run_trials(
    run: Run,
    judge: Judge,
    count: int,
    *,
    seed: int,
    spread: Any,
    progress: Callable[[int, int], Any] | None = None,
) -> tuple[MonteCarlo, Recording]:
    """Runs a mission `count` times; returns the outcome and the recording of its worst trial.

    Args:
        run: one run, what it draws taken from a generator of its own.
        judge: a recording and its number to a trial.
        count: of runs.
        seed: of the draws; run k draws from [seed, k].
        spread: the ranges that runs draw from, a dataclass.
        progress: called with runs done and runs in all.

    Raises:
        MissionError: fewer than one run.
        KeyboardInterrupt: interrupted before the first was finished; later, the finished count.
    """
    if count < 1:
        raise MissionError(f"{count} trials: at least 1 is needed.")
    trials: list[Trial] = []
    worst: tuple[Trial, Recording] | None = None
    for k in range(count):
        recording = run(np.random.default_rng([seed, k]))
        if str(recording.meta["stopped"]).startswith("interrupted"):
            break
        trial = judge(recording, k)
        trials.append(trial)
        if worst is None or badness(trial) < badness(worst[0]):
            worst = trial, recording
        if progress is not None:
            progress(k + 1, count)
    if worst is None:
        raise KeyboardInterrupt
    return summary(count, spread, trials), worst[1]
