"""Which seeds are looked at, in which order, and how they fare."""

import time
from collections.abc import Callable, Iterator

import numpy as np

from snakegen.planning.judgement import COARSE, MISS, Judgement, judge
from snakegen.planning.seeds import Seed
from snakegen.scene.schema import Demands

_TRIES = 300
_FIRST = 36  # families that are looked at in any case
_EACH = 24  # seeds of a family


def look(
    families: list[list[Seed]],
    demands: Demands,
    until: float,
    said: Callable[[str], object],
    clock: Callable[[], float] = time.monotonic,
) -> list[tuple[float, Seed, Judgement]]:
    """Returns seeds with their worth, the best first.

    The best of each family is looked at first, then more of the families that fared best.

    Args:
        families: from `seeds`.
        demands: of the scene.
        until: s of `clock`, when no further one is begun.
        said: called with what is going on.
        clock: s.
    """
    out: list[tuple[float, Seed, Judgement]] = []
    try:
        for one, found, worth in _judged(families, demands, until, clock):
            out.append((worth, one, found))
            family = one.family
            said(
                f"seed {len(out)}: leader {'tip' if family.tip else 'root'}, radius "
                f"{family.radius:g} m, lean {family.lean:g} rad, waves of {family.wave:g} m: "
                f"clearance {1e3 * found.clearance:.0f} mm, torque {found.torque:.2g} N·m, worth "
                f"{worth:.2f}"
            )
    except KeyboardInterrupt:
        if not any(worth > -10.0 for worth, _, _ in out):
            raise
        said("interrupted: the best so far is taken")
    return sorted(out, key=lambda row: -row[0])


def _judged(
    families: list[list[Seed]], demands: Demands, until: float, clock: Callable[[], float]
) -> Iterator[tuple[Seed, Judgement, float]]:
    """Yields seeds, how they fare and their worth; see `look`."""
    worths = dict.fromkeys(range(len(families)), np.inf)
    taken, count, good = dict.fromkeys(worths, 0), 0, 0
    while count < _TRIES and worths:
        k = max(worths, key=lambda i: (worths[i], -i))
        if taken[k] == len(families[k]) or taken[k] >= _EACH:
            del worths[k]
            continue
        late = count > 0 and clock() > until
        if late or (good >= 6 and (taken[k] or count >= _FIRST)):
            break
        one = families[k][taken[k]]
        taken[k] += 1
        found = judge(one, COARSE, demands)
        worth = found.worth(demands) if found.miss < MISS else -100.0 - found.miss
        worths[k] = worth - 0.1 * taken[k]
        count, good = count + 1, good + (worth > 0.0)
        yield one, found, worth
