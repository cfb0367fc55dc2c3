"""The search: seeds in order of promise, each followed, judged, timed and certified."""

import time
from collections.abc import Callable
from dataclasses import replace

from snakegen.errors import PlanError
from snakegen.planning.advice import Looked, nearest, openings_that_would_do, or_all
from snakegen.planning.body import PlannedBody
from snakegen.planning.ends import check_places
from snakegen.planning.guide import BlockedWay, way_through
from snakegen.planning.motion import Motion, certified
from snakegen.planning.no_way import no_way
from snakegen.planning.seed_choice import look
from snakegen.planning.seeds import seeds
from snakegen.robot.robot import Robot
from snakegen.scene.schema import Scene


def search(
    robot: Robot,
    scene: Scene,
    *,
    minutes: float = 1.0,
    seed: int = 0,
    progress: Callable[[str], object] | None = None,
    clock: Callable[[], float] = time.monotonic,
    advise: bool = False,
) -> Motion:
    """Returns a certified motion from the scene's start to its goal.

    Args:
        robot: that flies with virtual single rotors.
        scene: with start and goal.
        minutes: after which the search ends.
        seed: of the order among equals.
        progress: called with what is going on.
        clock: s, by which `minutes` are counted.
        advise: where there is no way, plan through wider openings, for as many minutes again, so
            that the reason names sizes that would do.

    Raises:
        PlanError: a start or goal that cannot be, or no way, with the reason.
    """
    begun = clock()
    until, said = begun + 60.0 * minutes, progress or (lambda _: None)
    body = PlannedBody(robot, scene.solids)
    check_places(body, scene)

    looked: Looked = []

    def advice(blocked: tuple[str, ...]) -> str:
        if not advise:
            return ""
        limit = clock() + 60.0 * minutes
        return openings_that_would_do(robot, scene, blocked, looked, limit, said, clock)

    try:
        way, lines = way_through(scene)
    except BlockedWay as error:
        raise PlanError(_sentence(str(error), advice(or_all(error.names, scene)))) from None
    families = seeds(body, scene, way, lines)
    looked = look(families, scene.demands, begun + 25.0 * minutes, said, clock)
    if not looked:
        raise PlanError(f"{scene.name}: no curve from start to goal could be laid.")
    chosen = [one for worth, one, _ in looked if worth > -10.0][:4]
    if not chosen:
        raise PlanError(_sentence(no_way(scene, looked), advice(nearest(looked[0][2].where))))
    best: Motion | None = None
    for one in chosen:
        said("certifying")
        try:
            made = certified(one, scene.demands)
        except KeyboardInterrupt:
            if best is None:
                raise
            said("interrupted: the best so far is taken")
            return best
        found = Motion(*made, one.chain.body, len(looked), clock() - begun)
        if best is None or len(found.unmet(scene.demands)) < len(best.unmet(scene.demands)):
            best = found
        if not best.unmet(scene.demands):
            return best
        if clock() > until:
            break
    if best is None:
        raise PlanError(f"{scene.name}: no seed could be certified.")
    return replace(best, advice=advice(nearest(best.certificate.clearance.between[1])))


def _sentence(reason: str, advice: str) -> str:
    """Returns a reason and what would do, with one full stop."""
    return f"{reason.rstrip('.')}{'; ' if advice else ''}{advice}."
