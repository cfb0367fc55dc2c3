"""Hollow obstacles as convex parts: plates with rectangular openings, round pipes as staves."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from snakegen.base.geometry import Floats, rotation_onto
from snakegen.errors import SceneError
from snakegen.scene.solids import Solid

RUN = 0.16  # m, that a way goes straight on before and behind an obstacle


@dataclass(frozen=True, eq=False)
class Opening:
    """A way through an obstacle.

    Attributes:
        name: of the obstacle.
        centre: (3,) m, world.
        normal: (3,) unit, through it; upward or along +x or +y.
        size: (2,) m, across.
        line: (m, 3) m, world, a way through it from one side to the other.
        widened: returns the obstacle's parts and openings with this one wider by so much [m].
        bore: points [m, world] of a pipe's centre line; empty for an opening in a plate.
    """

    name: str
    centre: Floats
    normal: Floats
    size: tuple[float, float]
    line: Floats
    widened: "Callable[[float], tuple[list[Solid], list[Opening]]]"
    bore: tuple[tuple[float, ...], ...] = ()


def plate(
    name: str,
    centre: Floats,
    half: Floats,
    rotation: Floats,
    holes: list[tuple[Floats, Floats]],
) -> tuple[list[Solid], list[Opening]]:
    """Returns a box with rectangular openings through its thinnest side, as boxes round them.

    Args:
        name: of the plate.
        centre: (3,) m, world.
        half: (3,) m, half lengths.
        rotation: (3, 3) attitude.
        holes: (centre (2,), size (2,)) m, along the two longer sides in order, from the middle.

    Raises:
        SceneError: an opening that leaves the plate or overlaps another.
    """
    if not holes:
        return [Solid(name, "box", centre, rotation, tuple(float(x) for x in half))], []
    thin = int(np.argmin(half))
    sides = [k for k in range(3) if k != thin]
    cuts = [[-half[k], half[k]] for k in sides]
    rims: list[tuple[Floats, Floats]] = []
    for number, (middle, size) in enumerate(holes, 1):
        low, high = middle - 0.5 * size, middle + 0.5 * size
        if np.any(low < -half[sides] - 1e-9) or np.any(high > half[sides] + 1e-9):
            raise SceneError(
                f"{name}: opening {number} reaches beyond the plate, whose sides are "
                f"{2 * half[sides[0]]:g} and {2 * half[sides[1]]:g} m."
            )
        for other, (below, above) in enumerate(rims, 1):
            if np.all(low < above) and np.all(below < high):
                raise SceneError(f"{name}: openings {other} and {number} overlap.")
        rims.append((low, high))
        for k in range(2):
            cuts[k] += [float(low[k]), float(high[k])]
    edges = [np.unique(np.round(c, 12)) for c in cuts]
    parts: list[Solid] = []
    for a, b in pairwise(edges[0]):
        row: list[tuple[float, float]] = []
        for c, d in pairwise(edges[1]):
            at = np.array([0.5 * (a + b), 0.5 * (c + d)])
            if any(np.all(low < at) and np.all(at < high) for low, high in rims):
                continue
            if row and abs(row[-1][1] - c) < 1e-12:
                row[-1] = (row[-1][0], d)
            else:
                row.append((c, d))
        for c, d in row:
            middle3, size3 = np.zeros(3), np.array(half, float)
            middle3[sides] = 0.5 * (a + b), 0.5 * (c + d)
            size3[sides] = 0.5 * (b - a), 0.5 * (d - c)
            label = f"{name}.{len(parts) + 1}"
            parts.append(
                Solid(
                    label,
                    "box",
                    centre + rotation @ middle3,
                    rotation,
                    tuple(float(x) for x in size3),
                )
            )
    ways: list[Opening] = []
    for middle, size in holes:
        place = np.zeros(3)
        place[sides] = middle
        normal = rotation[:, thin]
        normal = normal * np.sign(normal[np.abs(normal).argmax()])
        at = centre + rotation @ place
        across = (float(size[0]), float(size[1]))
        step = normal * (half[thin] + RUN)

        def widened(more: float, which: int = len(ways)) -> tuple[list[Solid], list[Opening]]:
            grown = [(c, s + more if k == which else s) for k, (c, s) in enumerate(holes)]
            return plate(name, centre, half, rotation, grown)

        ways.append(Opening(name, at, normal, across, np.array([at - step, at + step]), widened))
    return parts, ways


def pipe(
    name: str, points: Floats, radius: float, wall: float, staves: int = 16
) -> tuple[list[Solid], list[Opening]]:
    """Returns a round pipe along a line of points as staves of boxes.

    The bore is the regular polygon about the circle of `radius`, so that the circle is free.
    Where the pipe bends the staves of each piece end in the plane that halves the angle, at
    their outermost edge; on the inner side of the bend pieces overlap within the wall alone.

    Args:
        name: of the pipe.
        points: (m, 3) m, world, its centre line; two at least.
        radius: m, of the bore.
        wall: m, thickness.
        staves: how many round the pipe.
    """
    parts: list[Solid] = []
    wide = (radius + wall) * math.tan(math.pi / staves)
    directions = np.diff(points, axis=0)
    lengths = np.linalg.norm(directions, axis=1)
    axes = directions / lengths[:, None]
    for k, start in enumerate(points[:-1]):
        frame = rotation_onto(axes[k])
        for stave in range(staves):
            angle = 2.0 * math.pi * stave / staves
            out = frame @ np.array([math.cos(angle), math.sin(angle), 0.0])
            ends = [0.0, float(lengths[k])]
            if k > 0:
                ends[0] += _mitre(axes[k], axes[k - 1], out, radius)
            if k + 1 < len(axes):
                ends[1] += _mitre(axes[k], axes[k + 1], out, radius)
            if ends[1] <= ends[0]:
                raise SceneError(f"{name}: point {k + 2} is too near its neighbour for the bend.")
            across = np.column_stack([out, np.cross(axes[k], out), axes[k]])
            middle = start + axes[k] * 0.5 * (ends[0] + ends[1]) + out * (radius + 0.5 * wall)
            half = (0.5 * wall, wide, 0.5 * (ends[1] - ends[0]))
            parts.append(Solid(f"{name}.{len(parts) + 1}", "box", middle, across, half))
    line = np.array(points, float)
    line[0] -= RUN * axes[0]
    line[-1] += RUN * axes[-1]
    middle = 0.5 * (points[0] + points[-1])

    def widened(more: float) -> tuple[list[Solid], list[Opening]]:
        return pipe(name, points, radius + 0.5 * more, wall, staves)

    wide_open = (2.0 * radius, 2.0 * radius)
    bore = tuple(tuple(float(x) for x in p) for p in points)
    return parts, [Opening(name, middle, axes[-1], wide_open, line, widened, bore)]


def _mitre(axis: Floats, other: Floats, out: Floats, radius: float) -> float:
    """Returns where [m, along `axis`] a stave at `out` meets the plane that halves a bend."""
    return -radius * float(out @ other) / (1.0 + float(axis @ other))
