"""The search: seeds in order of promise, each followed, judged, timed and certified."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.errors import PlanError
from snakegen.planning.body import PlannedBody
from snakegen.planning.certificate import Certificate, certify
from snakegen.planning.ends import check_end, ends_of
from snakegen.planning.guide import guide, openings_on
from snakegen.planning.hover_actuation import actuator_use, battery_share
from snakegen.planning.judgement import COARSE, FINE, MISS, Judgement, judge
from snakegen.planning.no_way import no_way
from snakegen.planning.plan_file import PlanFile
from snakegen.planning.seeds import Seed, seeds
from snakegen.planning.timing import rates_of, slowed, smoothed, timed
from snakegen.planning.tracking import Cover, Tracking
from snakegen.planning.trajectory import Trajectory
from snakegen.robot.robot import Robot
from snakegen.scene.schema import Demands, Place, Scene

_TRIES = 300
_FIRST = 36  # families that are looked at in any case
_EACH = 24  # seeds of a family
EVERY = 0.2  # s, between instants at which tracking errors of a motion are looked at


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion through a scene.

    Attributes:
        path: over time.
        certificate: its proved bounds.
        tracking: what hardware leaves of its clearance.
        battery: share of the battery's energy that it takes; 0 if that is endless.
        body: among the scene's solids.
        tried: seeds looked at.
        seconds: spent.
        notes: for people.
    """

    path: Trajectory
    certificate: Certificate
    tracking: Cover
    battery: float
    body: PlannedBody
    tried: int
    seconds: float
    notes: list[str] = field(default_factory=list)

    def file(self, scene: Scene) -> PlanFile:
        """Returns the mission file that flies it."""
        return PlanFile(
            self.body.robot.name,
            self.body.names,
            self.path,
            scene.solids,
            self.certificate.to_json(),
            vars(scene.demands),
            tracking=self.tracking.to_json(),
        )

    def unmet(self, demands: Demands) -> list[str]:
        """Returns the demands that the certificate does not prove."""
        c = self.certificate
        pairs = (
            ("clearance", c.clearance.lower, demands.clearance, "m"),
            ("self-clearance", c.self_clearance.lower, 0.0, "m"),
            ("force margin", c.force_margin.lower, demands.force_margin, "N"),
            ("torque margin", c.torque_margin.lower, demands.torque_margin, "N·m"),
            ("clearance over its tracking error", self.tracking.sigmas, demands.tracking_sigmas,
             "standard deviations"),
        )  # fmt: skip
        out = [f"{n} {v:.4g} < {d:g} {u}" for n, v, d, u in pairs if not v >= d]
        if self.battery > demands.battery_share:
            quicker = demands.joint_rate * self.battery / demands.battery_share
            out.append(
                f"its {self.path.times[-1]:.0f} s take {self.battery:.2f} of the battery, "
                f"{demands.battery_share:g} may be taken (joint_rate {quicker:.2g} rad/s would do "
                "where joints set the pace)"
            )
        return out


def search(
    robot: Robot,
    scene: Scene,
    *,
    minutes: float = 1.0,
    seed: int = 0,
    progress: Callable[[str], object] | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> Motion:
    """Returns a certified motion from the scene's start to its goal.

    Args:
        robot: that flies with virtual single rotors.
        scene: with start and goal.
        minutes: after which the search ends.
        seed: of the order among equals.
        progress: called with what is going on.
        clock: s, by which `minutes` are counted.

    Raises:
        PlanError: a start or goal that cannot be, or no way, with the reason.
    """
    begun = clock()
    said = progress or (lambda _: None)
    body = PlannedBody(robot, scene.solids)
    if scene.start is None or scene.goal is None:
        missing = "start" if scene.start is None else "goal"
        raise PlanError(f"{scene.name}: '{missing}' is missing: a plan needs start and goal.")
    check_places(body, scene)
    way, lines = way_through(body, scene)
    families = seeds(body, scene, way, lines)
    looked = look(families, scene.demands, begun + 25.0 * minutes, said, clock)
    if not looked:
        raise PlanError(f"{scene.name}: no curve from start to goal could be laid.")
    chosen = [one for worth, one, _ in looked if worth > -10.0][:4]
    if not chosen:
        raise PlanError(no_way(scene, looked))
    best: Motion | None = None
    for one in chosen:
        said("certifying")
        try:
            made = certified(one, scene.demands)
        except KeyboardInterrupt:
            if best is None:
                raise
            said("interrupted: the best so far is taken")
            break
        found = Motion(*made, one.chain.body, len(looked), clock() - begun)
        if best is None or len(found.unmet(scene.demands)) < len(best.unmet(scene.demands)):
            best = found
        if not best.unmet(scene.demands) or clock() - begun > 60.0 * minutes:
            break
    assert best is not None
    return best


def certified(seed: Seed, demands: Demands) -> tuple[Trajectory, Certificate, Cover, float]:
    """Returns a seed's motion over time, what is proved of it, its tracking and its energy."""
    body = seed.chain.body
    path = in_time(body, smoothed(judge(seed, FINE, demands).poses), demands)
    proved = certify(body, path, enough=enough(demands))
    return path, proved, expected(body, path), battery_share(body, path)


def in_time(body: PlannedBody, poses: Floats, demands: Demands) -> Trajectory:
    """Returns the trajectory through poses (m, 6 + k) within all limits of rate."""
    rates = rates_of(body, demands)
    path = timed(poses, rates, body.heading)
    return slowed(path, rates, lambda p: actuator_use(body, p, demands))


def expected(body: PlannedBody, path: Trajectory) -> Cover:
    """Returns the least clearance along a path in standard deviations of the tracking error."""
    times = np.linspace(0.0, path.times[-1], max(int(path.times[-1] / EVERY), 2))
    poses = path.at(times)
    tracking = Tracking(body)
    return tracking.cover(tracking.errors(poses, times), poses, times)


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


def enough(demands: Demands) -> dict[str, float]:
    """Returns bounds by name that need no bettering: twice the demanded margins."""
    return {
        "self_clearance": 0.01,
        "force_margin": 2.0 * demands.force_margin,
        "torque_margin": 2.0 * demands.torque_margin,
    }


def check_places(body: PlannedBody, scene: Scene) -> None:
    """Refuses a start or goal that cannot be held: a free one in no attitude that it may have.

    Raises:
        PlanError: which, and by how much.
    """
    for name in ("start", "goal"):
        place: Place = getattr(scene, name)
        reasons: list[str] = []
        for end in ends_of(body, place):
            reasons.append(check_end(body, end, name, scene.demands))
            if not reasons[-1]:
                break
        else:
            raise PlanError(f"{scene.name}: {reasons[0]}.")


def way_through(body: PlannedBody, scene: Scene) -> tuple[Floats, list[Floats]]:
    """Returns a way for the body's rods from start to goal, and the openings' lines on it.

    Raises:
        PlanError: what blocks the way.
    """
    assert scene.start is not None and scene.goal is not None
    least = 0.02
    way = guide(scene, scene.start.cog, scene.goal.cog, least)
    if way is None:
        solid = (s for s in scene.solids if s.kind != "half_space")
        names = sorted({s.name.partition(".")[0] for s in solid})
        blocking = []
        for name in names:
            left = tuple(s for s in scene.solids if s.name.partition(".")[0] != name)
            without = Scene(scene.name, left, scene.openings, scene.start, scene.goal)
            if guide(without, scene.start.cog, scene.goal.cog, least) is not None:
                blocking.append(name)
        what = f"{', '.join(blocking)} blocks it" if blocking else "several obstacles block it"
        raise PlanError(f"{scene.name}: no way from start to goal, even for a single rod: {what}.")
    return way, openings_on(scene, way)
