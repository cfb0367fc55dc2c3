"""How a run looks: colours, sizes, and which instants are drawn.

A screen shows about a thousand points across; a log of 60 s at 200 Hz has twelve. What is drawn
is thinned, what is stored is not (`store`).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

TIMELINE = "time"
FRAME_RATE = 20.0  # Hz, of what moves in 3D
MOST_FRAMES = 12_000  # ten minutes at that rate; longer runs are drawn at a lower one
PLOT_BYTES = 1.5e6  # what all plotted samples together may take
_ROWS = 16_384  # looked at together
SCREEN = 1000  # points across; fewer are all drawn

# Okabe & Ito's set, brightened for a dark ground; distinguished by colour-blind eyes.
PALETTE = (
    (86, 180, 233),
    (240, 168, 40),
    (40, 200, 140),
    (230, 110, 180),
    (240, 228, 90),
    (165, 120, 255),
    (235, 100, 50),
    (190, 190, 190),
)
LIMIT = (200, 50, 50)
CALM = (60, 110, 80)  # of a state in which nothing is at a limit
COG = (255, 255, 255)
TARGET = (60, 230, 255)
DISTURBANCE = (255, 70, 255)
WIND = (150, 200, 255)
CONTACT = (255, 210, 60)
OBSTACLE = (110, 116, 128)
GROUND = (24, 27, 32)
BARE_LINK = (150, 156, 166)  # links whose URDF names no colour


def color(index: int, *, dim: bool = False) -> tuple[int, int, int]:
    """Returns the colour of series `index`; `dim` for what was asked rather than measured.

    A second round is paler and a third darker, so that two dozen curves differ.
    """
    turn, index = divmod(index, len(PALETTE))
    share, towards = ((0.0, 0), (0.5, 255), (0.45, 0))[turn % 3]
    red, green, blue = (round(c + share * (towards - c)) for c in PALETTE[index])
    return (red // 2, green // 2, blue // 2) if dim else (red, green, blue)


def saturation_colors(use: Floats) -> NDArray[np.uint8]:
    """Returns (…, 3) RGB of a use 0…1 of a limit: green, amber from 0.7, red from 0.98."""
    stops = np.array([0.0, 0.5, 0.75, 0.9, 0.98])
    red, green = [40.0, 60.0, 240.0, 255.0, 255.0], [200.0, 220.0, 190.0, 120.0, 30.0]
    blue = [120.0, 90.0, 50.0, 40.0, 30.0]
    parts = [np.interp(np.nan_to_num(use), stops, p) for p in (red, green, blue)]
    return np.stack(parts, axis=-1).round().astype(np.uint8)


def frames(time: Floats) -> Ints:
    """Returns the indices of the instants at which the 3D scene is drawn; ends included."""
    step = float(np.median(np.diff(time))) if time.size > 1 else 1.0
    stride = max(1, round(1.0 / (FRAME_RATE * step)), -(-time.size // MOST_FRAMES))
    index = np.arange(0, time.size, stride)
    return index if index[-1] == time.size - 1 else np.append(index, time.size - 1)


def stride_for(samples: int) -> int:
    """Returns how many ticks share one plotted point when `samples` numbers are to be plotted.

    Never two: of two ticks neither stands out, and a spike might be the one left out.
    """
    stride = max(1, int(np.ceil(8.0 * samples / PLOT_BYTES)))
    return 3 if stride == 2 else stride


def standing_out(
    values: Floats, stride: int, release: Callable[[], None] = lambda: None
) -> tuple[Ints, Floats]:
    """Returns one row of each run of `stride` rows, the one farthest from the run's mean.

    So a spike of a single tick is still seen in a thinned plot. First and last rows are kept.

    Args:
        values: (T, k).
        stride: rows.
        release: gives back the memory of what was read; called after some rows.

    Returns:
        The rows' indices (n,) and values (n, k).
    """
    rows = len(values)
    if stride == 1 or rows <= 2 * stride:
        return np.arange(rows), np.array(values)
    from snakegen.kernels.flight.run_history import farthest_rows

    block = max(1, _ROWS // stride) * stride
    index, kept = [], []
    for first in range(0, rows, block):
        part = np.ascontiguousarray(values[first : first + block])
        found = farthest_rows(part, stride)
        inner = found[(first + found > 0) & (first + found < rows - 1)]
        start = [0] if first == 0 else []
        end = [len(part) - 1] if first + len(part) == rows else []
        chosen = np.concatenate([start, inner, end]).astype(np.int64)
        index.append(first + chosen)
        kept.append(part[chosen])
        release()
    return np.concatenate(index), np.concatenate(kept)
