"""A flight by whole seconds: each is a recording as soon as it is flown, for a journal."""

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np

from snakegen.control.controller import Controller
from snakegen.simulation.flight.loop import Flown
from snakegen.simulation.flight.plan import Plan
from snakegen.simulation.flight.world import World
from snakegen.simulation.recording.record import record
from snakegen.simulation.recording.recording import Recording


class Blocks:
    """Hands on the whole seconds of a flight, without margins, which cost more than the rest.

    Args:
        world, plan, controller: as `fly` got them.
        meta: of the run's recording.
        keep: called with the recording of the seconds flown since the last call.
    """

    def __init__(
        self,
        world: World,
        plan: Plan,
        controller: Controller,
        meta: dict[str, Any],
        keep: Callable[[Recording], Any],
    ) -> None:
        self.world, self.plan, self.controller, self.keep = world, plan, controller, keep
        self.meta = meta | {"stopped": "no end in the journal"}
        self.done = 0
        ticks = len(plan.time)
        self.second = round(1.0 / float(plan.time[1] - plan.time[0])) if ticks > 1 else 1

    def flown(self, ticks: int, rows: Callable[[int, int], Flown]) -> None:
        """Hands on the whole seconds among the first `ticks` that it has not handed on yet."""
        whole = ticks - ticks % self.second
        if whole > self.done:
            part = part_of(self.plan, self.done, whole)
            flown = rows(self.done, whole)
            window = [float(part.time[0]), float(part.time[-1])]
            meta = self.meta | {"metrics_window_s": window}
            self.keep(record(self.world, part, self.controller, flown, meta, margins=False))
            self.done = whole


def part_of(plan: Plan, first: int, last: int) -> Plan:
    """Returns ticks `first` … `last` − 1 of a plan; what is not sampled by ticks stays."""
    count = len(plan.time)
    cut = {
        f.name: getattr(plan, f.name)[first:last]
        for f in fields(plan)
        if isinstance(getattr(plan, f.name), np.ndarray)
        and f.name != "start"
        and len(getattr(plan, f.name)) == count
    }
    return replace(plan, **cut)
