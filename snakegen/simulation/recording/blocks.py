"""A flight by blocks of ticks: for a journal by whole seconds, and for its recording in a store.

What is recorded of a block is written to the store at once, so that memory holds the rows of one
block, not of the flight.
"""

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.base.sample_store import Columns, SampleStore
from snakegen.control.controller import Controller
from snakegen.simulation.flight.loop import Flown
from snakegen.simulation.flight.plan import Plan
from snakegen.simulation.flight.world import World
from snakegen.simulation.recording.record import (
    flight_channels,
    flight_meta,
    is_elastic,
    record,
    slow_stride,
)
from snakegen.simulation.recording.recording import Channel, Event, Recording

BLOCK = 10.0  # s, recorded together


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
        """Hands on the whole seconds among the first `ticks` that it has not handed on yet.

        `rows` returns ticks a … b − 1 as flown.
        """
        whole = ticks - ticks % self.second
        if whole > self.done:
            part = part_of(self.plan, self.done, whole)
            flown = rows(self.done, whole)
            window = [float(part.time[0]), float(part.time[-1])]
            meta = self.meta | {"metrics_window_s": window}
            self.keep(record(self.world, part, self.controller, flown, meta, margins=False))
            self.done = whole


class Recorder:
    """Records a flight block by block; elastic ones, whose modes need all rows, at the end.

    Args:
        world, plan, controller: as `fly` got them.
        store: for the samples.
        meta: of the run's recording, as far as it is known before.
        windy: whether there is wind.
        margins: record those along the run.
    """

    def __init__(
        self,
        world: World,
        plan: Plan,
        controller: Controller,
        store: SampleStore,
        meta: dict[str, Any],
        *,
        windy: bool,
        margins: bool,
    ) -> None:
        self.world, self.plan, self.controller, self.store = world, plan, controller, store
        self.windy, self.margins = windy, margins
        self.elastic = is_elastic(world, plan, meta)
        self.stride = slow_stride(plan.time)
        ticks = len(plan.time)
        step = float(plan.time[1] - plan.time[0]) if ticks > 1 else BLOCK
        whole = max(1, round(BLOCK / step / self.stride)) * self.stride
        self.block = ticks + 1 if self.elastic else whole  # never full: `finish` has all rows
        self.done = 0
        self._torque = store.reserve(ticks, 3)
        self._shapes: dict[str, tuple[Channel, Columns]] = {}

    def flown(self, ticks: int, rows: Callable[[int, int], Flown]) -> int:
        """Records the whole blocks among the first `ticks`; returns the first tick left."""
        while ticks - self.done >= self.block:
            self._add(rows(self.done, self.done + self.block))
        return self.done

    def wanted_torque(self) -> Floats:
        """Returns the torque (T, 3) [N m] that the control law asked for at the ticks recorded."""
        return self.store.array(self._torque, self.done)

    def finish(self, rest: Flown) -> None:
        """Records the ticks after the last block."""
        if rest.ticks:
            self._add(rest)

    def recording(self, events: list[tuple[float, str, str]], meta: dict[str, Any]) -> Recording:
        """Returns the recording of all ticks recorded, its samples in the store."""
        time, slow = self.plan.time[: self.done], self.plan.time[: self.done : self.stride]
        channels = {}
        for name, (like, columns) in self._shapes.items():
            rows = self.done if like.time is None else len(slow)
            values = self.store.array(columns, rows)
            own = None if like.time is None else slow
            channels[name] = replace(like, values=values, time=own)
        told = tuple(Event(*e) for e in events)
        return Recording(time, channels, told, flight_meta(self.world, meta), store=self.store)

    def _add(self, flown: Flown) -> None:
        """Records the ticks of `flown`, which follow those recorded before."""
        first, last = self.done, self.done + flown.ticks
        part = part_of(self.plan, first, last)
        found = flight_channels(
            self.world, part, self.controller, flown, self.elastic, self.windy, margins=self.margins
        )
        self.store.put(self._torque, first, flown.wanted[:, 3:])
        slow = -(-len(self.plan.time) // self.stride)
        for name, c in found.items():
            rows, at = (
                (len(self.plan.time), first) if c.time is None else (slow, first // self.stride)
            )
            if name not in self._shapes:
                columns = self.store.reserve(rows, len(c.labels))
                self._shapes[name] = replace(c, values=c.values[:0]), columns
                self._undefined(name, 0, at)
            self.store.put(self._shapes[name][1], at, c.values)
        for name, (like, _) in self._shapes.items():
            if name not in found:
                each = 1 if like.time is None else self.stride
                self._undefined(name, first // each, -(-last // each))
        self.done = last

    def _undefined(self, name: str, first: int, last: int) -> None:
        """Fills rows of a channel that a block does not have: margins of another mode."""
        like, columns = self._shapes[name]
        if last > first:
            self.store.put(columns, first, np.full((last - first, len(like.labels)), np.nan))


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
