"""Two runs of one robot, one after the other, as one recording."""

import numpy as np

from snakegen.errors import LogError
from snakegen.simulation.recording.recording import Channel, Event, Recording


def join(first: Recording, second: Recording) -> Recording:
    """Returns `second` put behind `first`, one tick later; meta of both, that of `second` on top.

    A channel that only one of them has keeps its samples on a time axis of its own.

    Raises:
        LogError: a channel of both whose columns differ.
    """
    step = float(first.time[-1] - first.time[-2]) if len(first.time) > 1 else 0.01
    shift = float(first.time[-1]) + step - float(second.time[0])
    channels = {}
    for name in [*first.channels, *(n for n in second.channels if n not in first.channels)]:
        parts = [
            (run.times(name) + late, run.channels[name])
            for run, late in ((first, 0.0), (second, shift))
            if name in run.channels
        ]
        if len({part.labels for _, part in parts}) > 1:
            raise LogError(f"the runs cannot be joined: '{name}' has other columns in each.")
        one = parts[0][1]
        channels[name] = Channel(
            np.concatenate([part.values for _, part in parts]),
            one.unit,
            one.labels,
            one.group,
            one.meaning,
            np.concatenate([time for time, _ in parts]),
        )
    time = np.concatenate([first.time, second.time + shift])
    for name, c in channels.items():
        if c.time is not None and np.array_equal(c.time, time):
            channels[name] = Channel(c.values, c.unit, c.labels, c.group, c.meaning)
    later = (Event(e.time + shift, e.level, e.text) for e in second.events)
    limits = first.meta.get("limits", {}) | second.meta.get("limits", {})
    meta = first.meta | second.meta | {"limits": limits, "joined_at_s": shift}
    meta["metrics_window_s"] = [float(time[0]), float(time[-1])]
    return Recording(time, channels, (*first.events, *later), meta)
