"""Clearances of a run and its contact with the floor, from its recording alone."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from snakegen.base.geometry import Floats
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.recording.row_statistics import (
    cut,
    extreme,
    held_integral,
    inside,
    rows_where,
)
from snakegen.simulation.recording.signals import stored

AIRBORNE = 0.05  # m above the floor: off it, whatever the landing gear does
FREE = 0.5  # s without contact: not a bounce
TOUCHING = 1e-4  # m: contact


def clearance_metrics(recording: Recording, start: float, end: float) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for name in ("self_distance", "obstacle_distance"):
        if name in recording.channels:
            out[f"min_{name}_m"] = extreme(cut(recording, name, start, end), np.min)
    out.update(_floor(recording, end))
    return out


def _floor(recording: Recording, end: float) -> dict[str, Any]:
    """Returns when the robot left the floor, and what of it touched the floor afterwards.

    It is off once `floor_distance` exceeds 5 cm; where only forces are recorded, once half a
    second begins that is free of them.
    """
    pressed = np.empty(0, np.int64)  # samples with a force of the floor
    if "floor_contact" in recording.channels:
        force_time = recording.times("floor_contact")
        pressed = rows_where(stored(recording, "floor_contact"), _presses)
    if "floor_distance" in recording.channels:
        time = recording.times("floor_distance")
        height = recording.channel("floor_distance").values.min(axis=1)
        off = time[height > AIRBORNE]
    elif "floor_contact" in recording.channels:
        time, height = force_time, np.empty(0)
        touches = np.append(force_time[pressed], np.inf)
        starts = np.append(-np.inf, touches[:-1])
        free = touches - np.maximum(starts, force_time[0]) >= FREE
        off = np.maximum(starts, force_time[0])[free & (starts < force_time[-1] - FREE)]
    else:
        return {}
    if not off.size:
        return {"took_off": False}
    out: dict[str, Any] = {"took_off": True}
    contact = 0.0
    if height.size:
        aloft = inside(time, off[0], end)
        out["min_floor_distance_m"] = extreme(height[aloft], np.min)
        contact = held_integral(time, np.flatnonzero(aloft & (height <= TOUCHING)))
    if pressed.size:
        at = force_time[pressed]
        later = pressed[(at > off[0]) & (at <= end)]
        contact = max(contact, held_integral(force_time, later))
    out["floor_contact_after_takeoff_s"] = contact
    return out


def _presses(force: Floats) -> NDArray[np.bool_]:
    """Tells in which rows (n, k) of forces the floor presses."""
    return np.asarray(np.nansum(force, axis=1) > 0.0)
