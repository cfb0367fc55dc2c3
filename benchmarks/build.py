"""Times `snakegen.build` without imports and without the picture, stage by stage.

    python benchmarks/build.py [LINKS …]

The first build of a process loads libraries and compiled kernels and is not counted; each figure
is the best of three. `cpu` leaves out what other programs took of the machine.
"""

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import snakegen
from snakegen.description.mjcf import decorate, files
from snakegen.linter import lint
from snakegen.pipeline import equivalence
from snakegen.robot import robot
from snakegen.spec import urdf
from snakegen.spec.loading import load_spec

STAGES = {
    "xacro": (urdf, "expand"),
    "lint": (lint, "lint"),
    "read": (robot, "from_urdf_text"),
    "MJCF": (decorate, "decorate"),
    "write": (files, "write"),
    "load": (files, "load_model"),
    "gate": (equivalence, "compare"),
}
BARS = {4: 0.5, 64: 4.0}  # s


def timed(function: Callable[..., Any], spent: dict[str, float], stage: str) -> Callable[..., Any]:
    """Returns `function` with its time added to spent[stage]."""

    def run(*args: Any, **options: Any) -> Any:
        start = time.perf_counter()
        try:
            return function(*args, **options)
        finally:
            spent[stage] = spent.get(stage, 0.0) + time.perf_counter() - start

    return run


def main() -> None:
    """Prints a row a size."""
    spent: dict[str, float] = {}
    for stage, (module, name) in STAGES.items():
        setattr(module, name, timed(getattr(module, name), spent, stage))
    counts = [int(a) for a in sys.argv[1:]] or [4, 16, 64]
    print(
        f"{'links':>5} {'wall s':>7} {'cpu s':>7} " + " ".join(f"{s:>6}" for s in STAGES) + "   bar"
    )
    with tempfile.TemporaryDirectory() as folder:
        for links in (2, 50):  # one robot for Pinocchio's gate, one for the kernels'
            warm = load_spec("dragon4", links=links)
            snakegen.build(warm, Path(folder) / "warm", picture=False)
        for links in counts:
            spec = load_spec("dragon4", links=links)
            best: tuple[float, float, dict[str, float]] = (float("inf"), float("inf"), {})
            for _ in range(3):
                spent.clear()
                wall, cpu = time.perf_counter(), time.process_time()
                snakegen.build(spec, Path(folder) / f"n{links}", picture=False)
                row = (time.perf_counter() - wall, time.process_time() - cpu, dict(spent))
                best = min(best, row, key=lambda r: r[0])
            stages = " ".join(f"{best[2].get(s, 0.0):6.3f}" for s in STAGES)
            bar = f"{BARS[links]:.1f} s" if links in BARS else ""
            print(f"{links:>5} {best[0]:7.3f} {best[1]:7.3f} {stages}   {bar}")


if __name__ == "__main__":
    main()
