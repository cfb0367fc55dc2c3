"""How a verification run is made, whatever its mission."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

ARM_STEP = 0.001  # s, of an arm's simulation and of its servos' commands


@dataclass(frozen=True)
class RunSettings:
    """Settings of a run that are no options of its mission.

    Attributes:
        seed: of noise and mismatch.
        ideal: perfect sensors and actuators.
        progress: called with steps done and steps in all.
        draw: of an arm, the ranges and the generator from which its hardware is drawn instead of
            the seed (`arm.trials`); of a drive, what a trial draws besides (`drive.hardware`).
    """

    seed: int = 0
    ideal: bool = False
    progress: Callable[[int, int], Any] | None = None
    draw: Any = None


NOMINAL = RunSettings()
