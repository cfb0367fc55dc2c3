"""A fall: the floor carries the robot again after take-off."""

import numpy as np

from snakegen.base.geometry import Floats

BORNE = 0.5  # share of the weight
OVER = 0.25  # s, over which the floor's force is averaged: an impact, or lying there
FREE = 0.5  # s without contact, after which a start on the floor has taken off


def fall(contact: Floats, dt: float, weight: float, *, on_floor: bool) -> int | None:
    """Returns the tick at which the robot fell to the floor, or None.

    It fell where, averaged over the next 0.25 s, the floor carries half of the weight or more. A
    touch in passing is less: 0.1 m/s of vertical speed lost are 4 % of it.

    Args:
        contact: (T,) N, normal force of the floor.
        dt: s, between ticks.
        weight: N.
        on_floor: whether the run starts there, so that it must take off first.
    """
    count, free = max(1, round(OVER / dt)), max(1, round(FREE / dt))
    touches = np.flatnonzero(contact > 0.0)
    if on_floor:
        edges = np.concatenate([[-1], touches, [len(contact)]])
        gaps = np.flatnonzero(np.diff(edges) > free)
        touches = touches[touches > edges[gaps[0]]] if len(gaps) else touches[:0]
    if len(touches) == 0:
        return None
    total = np.concatenate([[0.0], np.cumsum(contact)])
    mean = (total[np.minimum(touches + count, len(contact))] - total[touches]) / count
    heavy = np.flatnonzero(mean >= BORNE * weight)
    return int(touches[heavy[0]]) if len(heavy) else None
