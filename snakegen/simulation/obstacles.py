"""Ground that is not flat and open, as boxes: ducts, pipes, rough tiles, ledges."""

import math

import numpy as np

from snakegen.errors import MissionError
from snakegen.simulation.flight.plan import Box

THICK = 0.03  # m, half thickness of walls and ceilings


def duct(x: tuple[float, float], width: float, height: float) -> tuple[Box, ...]:
    """Returns two walls and a ceiling round the x axis, from x[0] to x[1] [m]."""
    if not (x[1] > x[0] and width > 0 and height > 0):
        raise MissionError(
            f"a duct {x[1] - x[0]:g} m long, {width:g} m wide and {height:g} m high: more than 0 "
            "is needed."
        )
    middle, half = 0.5 * (x[0] + x[1]), 0.5 * (x[1] - x[0])
    aside, up = 0.5 * width + THICK, 0.5 * height
    return (
        Box("wall_left", (middle, aside, up), (half, THICK, up)),
        Box("wall_right", (middle, -aside, up), (half, THICK, up)),
        Box("ceiling", (middle, 0.0, height + THICK), (half, 0.5 * width + 2 * THICK, THICK)),
    )


def pipe(x: tuple[float, float], radius: float, staves: int = 16) -> tuple[Box, ...]:
    """Returns a round pipe that lies on the ground along x, from x[0] to x[1] [m], as staves.

    Its section is the regular polygon about the circle of `radius` [m]; the lowest stave is the
    ground itself, so that a drive can enter.
    """
    middle, half = 0.5 * (x[0] + x[1]), 0.5 * (x[1] - x[0])
    deep = 0.5 * THICK
    wide = (radius + 2.0 * deep) * math.tan(math.pi / staves)
    out = []
    for k in range(1, staves):
        roll = 2.0 * math.pi * k / staves
        away = radius + deep
        centre = (middle, away * math.sin(roll), radius - away * math.cos(roll))
        out.append(Box(f"stave{k}", centre, (half, wide, deep), roll))
    return tuple(out)


def tiles(
    x: tuple[float, float], width: float, size: float, height: float, rng: np.random.Generator
) -> tuple[Box, ...]:
    """Returns square tiles of random heights up to `height` [m] about the x axis.

    Raises:
        MissionError: more tiles than a simulation takes.
    """
    along, across = round((x[1] - x[0]) / size), round(width / size)
    if along * across > 2000:
        raise MissionError(
            f"{along * across} tiles of {size:g} m are too many; 2000 at most: take larger ones."
        )
    out = []
    for i in range(along):
        for j in range(across):
            up = 0.5 * max(float(rng.uniform(0.0, height)), 1e-4)
            centre = (x[0] + (i + 0.5) * size, (j + 0.5) * size - 0.5 * across * size, up)
            out.append(Box(f"tile{i + 1}_{j + 1}", centre, (0.5 * size, 0.5 * size, up)))
    return tuple(out)


def ledge(x: tuple[float, float], width: float, height: float) -> tuple[Box, ...]:
    """Returns one box to be climbed at x[0] and left at x[1] [m]."""
    half = (0.5 * (x[1] - x[0]), 0.5 * width, 0.5 * height)
    return (Box("ledge", (0.5 * (x[0] + x[1]), 0.0, 0.5 * height), half),)
