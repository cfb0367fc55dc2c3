"""Which openings, how much wider, would let the body through: found by planning through them."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.errors import SceneError
from snakegen.scene.schema import Scene

STEP = 0.05  # m, by which an opening in the way is widened
MOST = 0.6  # m, more than any is widened by

Attempt = Callable[[Scene], tuple[str, ...] | None]


def wider_openings(
    scene: Scene,
    blocked: tuple[str, ...],
    attempt: Attempt,
    *,
    least: float = 0.0,
    in_time: Callable[[], bool] = lambda: True,
) -> str:
    """Returns which openings of which size would do; "" where none is found.

    The opening in the way is widened by `STEP` and the scene is planned again, until a motion is
    certified; then another may be in the way.

    Args:
        scene: that has no way.
        blocked: names of the obstacles in its way.
        attempt: plans a scene; returns () if certified, the names of what is in the way, or None
            where that is no obstacle.
        least: m, no smaller opening is tried.
        in_time: whether another scene may be planned.
    """
    more = np.zeros(len(scene.openings))
    now: tuple[str, ...] | None = blocked
    while now and in_time():
        grown = False
        for k in in_the_way(scene, now):
            short = least - (min(scene.openings[k].size) + more[k])
            more[k] += STEP * max(1.0, float(np.ceil(short / STEP - 1e-9)))
            grown = grown or more[k] <= MOST
        if not grown:
            return ""
        try:
            made = widened(scene, more)
        except SceneError:
            return ""  # it would leave its plate, or meet another
        now = attempt(made)
        if now == ():
            return _words(scene, more)
    return ""


def in_the_way(scene: Scene, names: tuple[str, ...]) -> list[int]:
    """Returns the openings of the named obstacles; of one with several the one on the way."""
    found: dict[str, int] = {}
    for k, opening in enumerate(scene.openings):
        if opening.name not in names:
            continue
        before = found.setdefault(opening.name, k)
        if _off_the_way(scene, opening.centre) < _off_the_way(scene, scene.openings[before].centre):
            found[opening.name] = k
    return list(found.values())


def _off_the_way(scene: Scene, point: Floats) -> float:
    """Returns the distance [m] of a point from the straight line from start to goal."""
    if scene.start is None or scene.goal is None:
        return 0.0
    start, step = scene.start.cog, scene.goal.cog - scene.start.cog
    share = float(np.clip((point - start) @ step / max(float(step @ step), 1e-12), 0.0, 1.0))
    return float(np.linalg.norm(point - start - share * step))


def widened(scene: Scene, more: Floats) -> Scene:
    """Returns the scene with opening k wider by ``more[k]`` [m]; start and goal stay.

    Raises:
        SceneError: an opening that leaves its plate or meets another.
    """
    solids, openings = list(scene.solids), list(scene.openings)
    starts = [k for k, o in enumerate(openings) if k == 0 or openings[k - 1].name != o.name]
    for first, end in pairwise([*starts, len(openings)]):
        name = openings[first].name
        for k in range(first, end):
            if more[k] > 0.0:
                parts, ways = openings[k].widened(float(more[k]))
                solids = [s for s in solids if s.name.partition(".")[0] != name] + parts
                openings[first:end] = ways
    return replace(scene, solids=tuple(solids), openings=tuple(openings))


def _words(scene: Scene, more: Floats) -> str:
    """Returns the sizes that would do in words."""
    said = []
    for opening, much in zip(scene.openings, more, strict=True):
        if much > 0.0:
            new = " by ".join(f"{x + much:.2f}" for x in opening.size)
            old = " by ".join(f"{x:.2f}" for x in opening.size)
            said.append(f"{new} m in {opening.name} instead of {old} m")
    return f"an opening of {' and of '.join(said)} would do (a motion through it was certified)"
