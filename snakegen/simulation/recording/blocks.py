"""A flight by pieces: for its recording in a store, and for a journal by whole seconds.

What is recorded of a piece is written to the store at once, so that memory holds the rows of one
piece, not of the flight. With a journal it is done by a thread behind the flight (`Behind`): the
flight's compiled loop holds no lock meanwhile.
"""

from collections.abc import Callable
from dataclasses import fields, replace
from queue import Queue
from threading import Thread
from typing import Any

import mujoco
import numpy as np

from snakegen.base.geometry import Floats
from snakegen.base.sample_store import Columns, SampleStore, in_pieces
from snakegen.control.controller import Controller
from snakegen.simulation.flight.flown import Flown
from snakegen.simulation.flight.plan import Plan
from snakegen.simulation.flight.world import World
from snakegen.simulation.recording.bending_signals import (
    angle_channel,
    bending,
    energy_channel,
    modal_energy,
    recorded_modes,
)
from snakegen.simulation.recording.record import (
    flight_channels,
    flight_meta,
    flown_bends,
    is_elastic,
    margin_channels,
    slow_stride,
)
from snakegen.simulation.recording.recording import Channel, Event, Recording

BLOCK = 10.0  # s, recorded together
SECOND = 1.0  # s, handed on together


class Recorder:
    """Records a flight piece by piece, and hands on its whole seconds.

    Args:
        world, plan, controller: as `fly` got them.
        store: for the samples.
        meta: of the run's recording, as far as it is known before.
        windy: whether there is wind.
        margins: record those along the run.
        keep: called with the recording of each second, without margins, which cost more than the
            rest.
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
        keep: Callable[[Recording], Any] | None = None,
    ) -> None:
        self.world, self.plan, self.controller, self.store = world, plan, controller, store
        self.windy, self.margins, self.keep = windy, margins, keep
        self.meta = meta | {"stopped": "no end in the journal"}
        self.bends = BendRecorder(world, plan, store) if is_elastic(world, plan, meta) else None
        self.stride = slow_stride(plan.time)
        ticks = len(plan.time)
        step = float(plan.time[1] - plan.time[0]) if ticks > 1 else BLOCK
        self.block, self.piece = (
            max(1, round(seconds / step / self.stride)) * self.stride
            for seconds in (BLOCK, BLOCK if keep is None else SECOND)
        )
        self.done = 0
        self._torque = store.reserve(ticks, 3)
        self._shapes: dict[str, dict[str, tuple[Channel, Columns]]] = {"flight": {}, "margins": {}}
        self._postures: list[Floats] = []  # at which margins are still to be computed
        self._judged = 0  # ticks whose margins are recorded

    def whole(self, ticks: int) -> int:
        """Returns how many of the first `ticks` are whole pieces."""
        return ticks - ticks % self.piece

    def add(self, flown: Flown) -> None:
        """Records the ticks that follow those recorded before."""
        first, last = self.done, self.done + flown.ticks
        part = part_of(self.plan, first, last)
        found = flight_channels(self.world, part, self.controller, flown, self.windy)
        self.store.put(self._torque, first, flown.wanted[:, 3:])
        self._put("flight", found, first, last)
        if self.bends is not None:
            self.bends.add(first, flown)
        if self.keep is not None and last % self.piece == 0:
            if self.bends is not None:
                found |= flown_bends(self.world, part, flown)
            window = [float(part.time[0]), float(part.time[-1])]
            meta = flight_meta(self.world, self.meta | {"metrics_window_s": window})
            self.keep(Recording(part.time, found, (), meta))
        if self.margins:
            self._postures.append(np.array(flown.qpos[:: self.stride]))
        self.done = last
        if last - self._judged >= self.block:
            self._add_margins()

    def finish(self, rest: Flown) -> None:
        """Records the ticks after the last piece."""
        if rest.ticks:
            self.add(rest)
        self._add_margins()

    def _add_margins(self) -> None:
        """Records the margins of the ticks since the last time."""
        first, last = self._judged, self.done
        if self._postures and last > first:
            part, rows = part_of(self.plan, first, last), np.arange(0, last - first, self.stride)
            postures = np.concatenate(self._postures)
            found = margin_channels(self.world, part, self.controller, rows, postures)
            self._put("margins", found, first, last)
        self._postures, self._judged = [], last

    def wanted_torque(self) -> Floats:
        """Returns the torque (T, 3) [N·m] that the control law asked for at the ticks recorded."""
        return self.store.array(self._torque, self.done)

    def recording(self, events: list[tuple[float, str, str]], meta: dict[str, Any]) -> Recording:
        """Returns the recording of all ticks recorded, its samples in the store."""
        time, slow = self.plan.time[: self.done], self.plan.time[: self.done : self.stride]
        channels = {}
        for name, (like, columns) in (self._shapes["flight"] | self._shapes["margins"]).items():
            rows = self.done if like.time is None else len(slow)
            values = self.store.array(columns, rows)
            own = None if like.time is None else slow
            channels[name] = replace(like, values=values, time=own)
        if self.bends is not None:
            channels |= self.bends.channels(self.done)
        marks = tuple(Event(*e) for e in events)
        return Recording(time, channels, marks, flight_meta(self.world, meta))

    def _put(self, group: str, found: dict[str, Channel], first: int, last: int) -> None:
        """Writes the channels of ticks `first` … `last` − 1; what a group lacks is undefined."""
        shapes, slow = self._shapes[group], -(-len(self.plan.time) // self.stride)
        for name, c in found.items():
            rows, at = (
                (len(self.plan.time), first) if c.time is None else (slow, first // self.stride)
            )
            if name not in shapes:
                columns = self.store.reserve(rows, len(c.labels))
                shapes[name] = replace(c, values=c.values[:0]), columns
                self._undefined(shapes[name], 0, at)
            self.store.put(shapes[name][1], at, c.values)
        for name, shape in shapes.items():
            if name not in found:
                each = 1 if shape[0].time is None else self.stride
                self._undefined(shape, first // each, -(-last // each))

    def _undefined(self, shape: tuple[Channel, Columns], first: int, last: int) -> None:
        """Fills rows of a channel that a piece does not have: margins of another mode."""
        like, columns = shape
        if last > first:
            self.store.put(columns, first, np.full((last - first, len(like.labels)), np.nan))


class BendRecorder:
    """Records what bends in a flight: deflections block by block, energies once all are there.

    Args:
        world, plan: as `fly` got them.
        store: for the samples.
    """

    def __init__(self, world: World, plan: Plan, store: SampleStore) -> None:
        self.world, self.store, self.ticks = world, store, len(plan.time)
        self.dt = float(plan.time[1] - plan.time[0]) if self.ticks > 1 else 1.0
        data = mujoco.MjData(world.model)
        world.set_state(data, plan.start)
        self.start = np.array(data.qpos)
        self.modes = recorded_modes(world, self.start)
        self.before = np.empty(0)  # command of the tick before
        self._columns: list[Columns] = []

    def add(self, first: int, flown: Flown) -> None:
        """Records the ticks of `flown`, which begin with tick `first`."""
        command = flown.command[:, self.world.servos]
        before = self.before if first else command[0]
        found = bending(self.modes, flown.qpos, flown.qvel, command, before, self.dt)
        if not self._columns:
            self._columns = [self.store.reserve(self.ticks, v.shape[1]) for v in found]
        angle = found[0].astype(np.float32).astype(float)  # as other channels that follow
        for columns, values in zip(self._columns, (angle, *found[1:]), strict=True):
            self.store.put(columns, first, values)
        self.before = command[-1]

    def channels(self, done: int) -> dict[str, Channel]:
        """Returns the channels of the first `done` ticks."""
        modes = self.modes
        angle, place, speed = (self.store.array(c, done) for c in self._columns)

        def rows(part: slice) -> tuple[Floats]:
            found = modal_energy(modes, place, speed, self.dt, part)
            return (found.astype(np.float32).astype(float),)

        energy = in_pieces(done, rows)[0]
        bent, swings = angle_channel(modes, angle[:0]), energy_channel(modes, energy[:0])
        return {
            "elastic_angle": replace(bent, values=angle),
            "modal_energy": replace(swings, values=energy),
        }


class Behind:
    """Does some work on pieces in order; leaving its block waits for it.

    Args:
        work: on a piece.
        aside: whether a thread of its own does it, while at most two pieces wait.
    """

    def __init__(self, work: Callable[[Flown], Any], *, aside: bool) -> None:
        self._work, self._error = work, list[BaseException]()
        self._waiting: Queue[Flown | None] = Queue(maxsize=2)
        self._thread = Thread(target=self._run, daemon=True) if aside else None

    def __enter__(self) -> "Behind":
        if self._thread is not None:
            self._thread.start()
        return self

    def put(self, piece: Flown) -> None:
        """Hands over a piece; raises what the work on an earlier one raised."""
        if self._thread is None:
            self._work(piece)
            return
        if self._error:
            raise self._error[0]
        self._waiting.put(copied(piece))

    def __exit__(self, kind: object, *_: object) -> None:
        if self._thread is not None:
            self._waiting.put(None)
            self._thread.join()
        if self._error and kind is None:
            raise self._error[0]

    def _run(self) -> None:
        while (piece := self._waiting.get()) is not None:
            if not self._error:
                try:
                    self._work(piece)
                except BaseException as error:  # raised again in the flight's thread
                    self._error.append(error)


def copied(flown: Flown) -> Flown:
    """Returns rows that stay when the loop gives their memory back."""
    arrays: dict[str, Any] = {
        f.name: np.array(getattr(flown, f.name))
        for f in fields(flown)
        if isinstance(getattr(flown, f.name), np.ndarray)
    }
    return replace(flown, **arrays)


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
