"""What would do in a scene without a way: wider openings, through which a motion is certified."""

from collections.abc import Callable
from dataclasses import replace

from snakegen.planning.body import PlannedBody
from snakegen.planning.guide import BlockedWay, way_through
from snakegen.planning.judgement import COARSE, MISS, Judgement, judge
from snakegen.planning.motion import Motion, certified
from snakegen.planning.seed_choice import look
from snakegen.planning.seeds import Seed, seeds
from snakegen.planning.wider import wider_openings
from snakegen.robot.robot import Robot
from snakegen.scene.schema import Demands, Scene

Looked = list[tuple[float, Seed, Judgement]]
_HINTS = 4


def openings_that_would_do(
    robot: Robot,
    scene: Scene,
    blocked: tuple[str, ...],
    looked: Looked,
    until: float,
    said: Callable[[str], object],
    clock: Callable[[], float],
) -> str:
    """Returns which wider openings would do, "" if none is found in time.

    Args:
        robot: that has no way.
        scene: in which.
        blocked: names of the obstacles in its way.
        looked: seeds that were looked at, with their worth.
        until: s of `clock`, when no further size is tried.
        said: called with what is going on.
        clock: s.
    """
    hints = _promising(looked, scene.demands)

    def attempt(wider: Scene) -> tuple[str, ...] | None:
        nonlocal hints
        sizes = ", ".join(
            f"{o.size[0]:.2f} by {o.size[1]:.2f} m in {o.name}" for o in wider.openings
        )
        said(f"trying wider openings: {sizes}")
        body = PlannedBody(robot, wider.solids)
        found: Looked = [_again(one, body, wider.demands) for one in hints]
        if not found:
            try:
                way, lines = way_through(wider)
            except BlockedWay as error:
                return or_all(error.names, wider)
            families = seeds(body, wider, way, lines)
            found = look(families, wider.demands, until, lambda _: None, clock)
            hints = _promising(found, wider.demands)
        if not found:
            return None
        worth, best, how = max(found, key=lambda row: row[0])
        if worth <= -10.0:
            return nearest(how.where)
        motion = Motion(*certified(best, wider.demands), best.chain.body, len(found), 0.0)
        between = motion.certificate.clearance.between[1]
        return nearest(between) if motion.unmet(wider.demands) else ()

    least = 2.0 * (PlannedBody(robot).shapes.widest + scene.demands.clearance)
    try:
        return wider_openings(scene, blocked, attempt, least=least, in_time=lambda: clock() < until)
    except KeyboardInterrupt:
        said("interrupted: no size that would do is known")
        return ""


def _promising(looked: Looked, demands: Demands) -> list[Seed]:
    """Returns seeds that are short of clearance alone, the best first, one of a family."""
    out: dict[object, Seed] = {}
    for _, one, found in sorted(looked, key=lambda row: -row[2].clearance):
        if found.miss < MISS and set(found.short(demands)) <= {"clearance", "tracking"}:
            out.setdefault(one.family, one)
    return list(out.values())[:_HINTS]


def _again(seed: Seed, body: PlannedBody, demands: Demands) -> tuple[float, Seed, Judgement]:
    """Returns a seed among other obstacles, and how it fares there."""
    chain = replace(seed.chain, body=body.turned(seed.chain.body.heading))
    one = replace(seed, chain=chain)
    found = judge(one, COARSE, demands)
    return found.worth(demands), one, found


def nearest(where: str) -> tuple[str, ...]:
    """Returns the obstacle of a pair of bodies, as in "link3 and ceiling.4"."""
    return (where.rpartition(" and ")[2].partition(".")[0],)


def or_all(names: tuple[str, ...], scene: Scene) -> tuple[str, ...]:
    """Returns names, or where there are none those of all openings."""
    return names or tuple(o.name for o in scene.openings)
