"""The search: seeds in order of promise, each followed, judged, timed and certified."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.errors import PlanError
from snakegen.planning.body import PlannedBody
from snakegen.planning.certificate import Certificate, certify
from snakegen.planning.ends import check_end, ends_of
from snakegen.planning.follow import pose_of
from snakegen.planning.guide import guide, openings_on
from snakegen.planning.seeds import Seed, seeds
from snakegen.planning.timing import rates_of, smoothed, timed
from snakegen.planning.trajectory import Trajectory
from snakegen.robot.robot import Robot
from snakegen.scene.schema import Demands, Place, Scene

COARSE, FINE = 0.10, 0.04  # m, that the leader advances between postures
_MISS = 0.08  # m, that rods may cut corners by
_TRIES = 300
_FIRST = 36  # families that are looked at in any case
_EACH = 24  # seeds of a family


@dataclass(frozen=True, eq=False)
class Judgement:
    """How a seed fares at sampled postures.

    Attributes:
        poses: (m, 6 + k).
        clearance, own: m, least distances from obstacles and from itself.
        force, torque: N, N m, least margins.
        miss: m, of the rods from the curve.
        roll: rad, the most that a hovering gimbal rolls while its link is not vertical.
        upright: least cosine of a link's angle with the horizontal.
        grip: least scaled σ_min of the wrench by thrusts and gimbal angles (`PlannedBody.grip`).
        swing: RMS of how far the root link's attitude is from its first (Frobenius, horizontal
            rows): an IMU's tilt turns with it and moves the body.
        where: the two bodies of `clearance`.
    """

    poses: Floats
    clearance: float
    own: float
    force: float
    torque: float
    miss: float
    roll: float
    upright: float
    grip: float
    swing: float
    where: str

    def short(self, demands: Demands) -> dict[str, float]:
        """Returns what is lacking, as shares of what is demanded; empty if nothing is."""
        pairs = {
            "clearance": (self.clearance, demands.clearance, 0.05),
            "self-clearance": (self.own, 0.0, 0.05),
            "force margin": (self.force, demands.force_margin, 50.0),
            "torque margin": (self.torque, demands.torque_margin, 5.0),
        }
        return {k: (least - v) / scale for k, (v, least, scale) in pairs.items() if v < least}

    def worth(self, demands: Demands) -> float:
        """Returns a rank: what is lacking counts first, then room, margins and rolls."""
        lacking = sum(self.short(demands).values())
        if lacking > 0.0:
            return -10.0 - lacking
        steep = 0.7 * self.roll + (5.0 if self.roll > 1.3 else 0.0)
        room = min(self.clearance, 0.15) / 0.03 + min(self.torque, 10.0) / 5.0
        # noise turns roll gimbals by 1/cos of the slope and by 1/torque margin
        calm = 4.0 * min(self.torque * self.upright, 4.0)
        return room + calm - steep - 1.5 * self.swing - 0.02 * len(self.poses)


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion through a scene.

    Attributes:
        path: over time.
        certificate: its proved bounds.
        body: among the scene's solids.
        tried: seeds looked at.
        seconds: spent.
        notes: for people.
    """

    path: Trajectory
    certificate: Certificate
    body: PlannedBody
    tried: int
    seconds: float
    notes: list[str] = field(default_factory=list)

    def unmet(self, demands: Demands) -> list[str]:
        """Returns the demands that the certificate does not prove."""
        c = self.certificate
        pairs = (
            ("clearance", c.clearance.lower, demands.clearance, "m"),
            ("self-clearance", c.self_clearance.lower, 0.0, "m"),
            ("force margin", c.force_margin.lower, demands.force_margin, "N"),
            ("torque margin", c.torque_margin.lower, demands.torque_margin, "N m"),
        )
        return [f"{n} {v:.4g} < {d:g} {u}" for n, v, d, u in pairs if not v >= d]


def search(
    robot: Robot,
    scene: Scene,
    *,
    minutes: float = 1.0,
    seed: int = 0,
    progress: Callable[[str], object] | None = None,
) -> Motion:
    """Returns a certified motion from the scene's start to its goal.

    Args:
        robot: that flies with virtual single rotors.
        scene: with start and goal.
        minutes: after which the search ends.
        seed: of the order among equals.
        progress: called with what is going on.

    Raises:
        PlanError: a start or goal that cannot be, or no way, with the reason.
    """
    begun = time.monotonic()
    said = progress or (lambda _: None)
    body = PlannedBody(robot, scene.solids)
    if scene.start is None or scene.goal is None:
        missing = "start" if scene.start is None else "goal"
        raise PlanError(f"{scene.name}: '{missing}' is missing: a plan needs start and goal.")
    check_places(body, scene)
    way, lines = way_through(body, scene)
    looked = look(seeds(body, scene, way, lines), scene.demands, begun + 25.0 * minutes, said)
    if not looked:
        raise PlanError(f"{scene.name}: no curve from start to goal could be laid.")
    chosen = [one for worth, one, _ in looked if worth > -10.0][:4]
    if not chosen:
        raise PlanError(no_way(scene, looked))
    motion = None
    for one in chosen:
        said("certifying")
        fine = judge(one, FINE)
        there = one.chain.body
        path = timed(smoothed(fine.poses), rates_of(body, scene.demands), there.heading)
        proved = certify(there, path, enough=enough(scene.demands))
        motion = Motion(path, proved, there, len(looked), time.monotonic() - begun)
        if not motion.unmet(scene.demands) or time.monotonic() - begun > 60.0 * minutes:
            break
    assert motion is not None
    return motion


def look(
    families: list[list[Seed]],
    demands: Demands,
    until: float,
    said: Callable[[str], object],
) -> list[tuple[float, Seed, Judgement]]:
    """Returns seeds with their worth, the best first.

    The best of each family is looked at first, then more of the families that fared best.

    Args:
        families: from `seeds`.
        demands: of the scene.
        until: s of the monotonic clock, when no further one is begun.
        said: called with what is going on.
    """
    out: list[tuple[float, Seed, Judgement]] = []
    worths = dict.fromkeys(range(len(families)), np.inf)
    taken = dict.fromkeys(worths, 0)
    while len(out) < _TRIES and worths:
        k = max(worths, key=lambda i: (worths[i], -i))
        if taken[k] == len(families[k]) or taken[k] >= _EACH:
            del worths[k]
            continue
        if out and time.monotonic() > until:
            break
        if sum(w > 0.0 for w, _, _ in out) >= 6 and (taken[k] or len(out) >= _FIRST):
            break
        one = families[k][taken[k]]
        taken[k] += 1
        try:
            found = judge(one, COARSE)
        except KeyboardInterrupt:
            if not any(w > -10.0 for w, _, _ in out):
                raise
            said("interrupted: the best so far is taken")
            break
        worth = found.worth(demands) if found.miss < _MISS else -100.0 - found.miss
        worths[k] = worth - 0.1 * taken[k]
        out.append((worth, one, found))
        said(
            f"seed {len(out)}: leader {'tip' if one.family[0] else 'root'}, radius "
            f"{one.family[1]:g} m, lean {one.family[2]:g} rad: clearance "
            f"{1e3 * found.clearance:.0f} mm, torque {found.torque:.2g} N m, worth {worth:.2f}"
        )
    return sorted(out, key=lambda row: -row[0])


def no_way(scene: Scene, looked: list[tuple[float, Seed, Judgement]]) -> str:
    """Returns why none of the seeds will do, and how much wider an opening would."""
    _, one, found = looked[0]
    lacking = found.short(scene.demands)
    body, steep = one.chain.body, 0
    for pose in found.poses:
        steep = max(steep, int((body.at_pose(pose).upright < 0.35).sum()))
    units = {
        "clearance": f"{1e3 * found.clearance:.0f} mm clearance between {found.where} of "
        f"{1e3 * scene.demands.clearance:.0f} mm",
        "self-clearance": f"{1e3 * found.own:.0f} mm between parts of the body",
        "force margin": f"a force margin of {found.force:.3g} N of {scene.demands.force_margin:g}",
        "torque margin": f"a torque margin of {found.torque:.3g} N m of "
        f"{scene.demands.torque_margin:g}",
    }
    what = "; ".join(units[k] for k in lacking) or f"rods that cut corners by {found.miss:.2f} m"
    text = f"{scene.name}: no way found in {len(looked)} tries: the best has {what}"
    if steep:
        text += f", with {steep} of {len(body.mounts.joint)} thrust links steeper than 70° at once"
    wider = wider_opening(scene, looked) if "clearance" in lacking else None
    return text + (f"; {wider}." if wider else ".")


def wider_opening(scene: Scene, looked: list[tuple[float, Seed, Judgement]]) -> str:
    """Returns which opening, how much wider, lets one of the best seeds through; "" if none."""
    names = looked[0][2].where
    hit = [w for w in scene.openings if f"and {w.name}." in names or names.endswith(w.name)]
    if not hit:
        return ""
    for more in np.arange(1, 13) * 0.05:
        made, _ = hit[0].widened(float(more))
        kept = [s for s in scene.solids if s.name.partition(".")[0] != hit[0].name]
        body = PlannedBody(looked[0][1].chain.body.robot, (*kept, *made))
        for _, one, _ in looked[:3]:
            chain = replace(one.chain, body=body.turned(one.chain.body.heading))
            found = judge(replace(one, chain=chain), COARSE)
            if not found.short(scene.demands) and found.miss < _MISS:
                size = " by ".join(f"{x + more:.2f}" for x in hit[0].size)
                old = " by ".join(f"{x:.2f}" for x in hit[0].size)
                return f"an opening of {size} m in {hit[0].name} instead of {old} m would do"
    return ""


def enough(demands: Demands) -> dict[str, float]:
    """Returns bounds by name that need no bettering: twice the demanded margins."""
    return {
        "self_clearance": 0.01,
        "force_margin": 2.0 * demands.force_margin,
        "torque_margin": 2.0 * demands.torque_margin,
    }


def judge(seed: Seed, step: float) -> Judgement:
    """Returns how a seed fares, the leader advancing by `step` [m] between postures."""
    body = seed.chain.body
    count = max(int(np.ceil((seed.curve.length - seed.first) / step)), 4)
    arcs = np.linspace(seed.first, seed.curve.length, count + 1)
    poses, misses = seed.chain.along(seed.curve, arcs, seed.start.q)
    if not seed.goal.free:
        poses = np.concatenate([poses, _settled(poses[-1], pose_of(body, seed.goal.q, poses[-1]))])
    if not seed.start.free:
        first = pose_of(body, seed.start.q, poses[0])
        poses = np.concatenate([_settled(poses[0], first)[::-1], poses])
    outer = body.shapes.outer
    nows, found, grips = [], [], []
    for pose in poses:
        nows.append(body.at_pose(pose))
        grips.append(body.grip(nows[-1]))
        found.append(body.distances(nows[-1].q))
    gaps = np.array(found)
    clear = gaps[:, :outer].min(axis=1, initial=np.inf) - np.array([n.slack for n in nows])
    own = gaps[:, outer:].min(initial=np.inf)
    force, torque = body.margins(np.array([n.points for n in nows]))
    worst = int(np.argmin(clear))
    pair = body.shapes.pairs[int(np.argmin(gaps[worst, :outer]))] if outer else (0, 0)
    return Judgement(
        poses,
        float(clear.min()),
        float(own),
        float(force.min()),
        float(torque.min()),
        float(misses.max()),
        _roll(body, poses),
        min(float(n.upright.min()) for n in nows),
        min(grips),
        _swing(body, poses),
        f"{body.shapes.labels[pair[0]]} and {body.shapes.labels[pair[1]]}",
    )


def _settled(start: Floats, end: Floats) -> Floats:
    """Returns poses (m, 6 + k) after `start` up to `end`, evenly; none if they are the same."""
    far = float(np.abs(end - start).max())
    if far < 1e-4:
        return np.empty((0, len(start)))
    share = np.linspace(0.0, 1.0, max(int(np.ceil(far / 0.05)), 2) + 1)[1:, None]
    return np.asarray(start + share * (end - start))


def _swing(body: PlannedBody, poses: Floats) -> float:
    """Returns the RMS distance of the root link's attitudes from the first; see `Judgement`."""
    turns = np.array([body.attitude(pose[3:6]) for pose in poses])
    away = turns[:, :2] - turns[0, :2]
    return float(np.sqrt(np.mean(np.sum(away**2, axis=(1, 2)))))


def _roll(body: PlannedBody, poses: Floats) -> float:
    """Returns the most that hover rolls a gimbal [rad], beside vertical links left out."""
    most = 0.0
    for pose in poses:
        now = body.at_pose(pose)
        for joint, axis, side, up in zip(
            body.mounts.joint, body.mounts.axis, body.sides, now.upright, strict=True
        ):
            if up > 0.3:
                turn = body.data.oMi[joint].rotation
                along = np.cross(side, axis)
                most = max(most, abs(float(np.arctan2((turn @ side)[2], (turn @ along)[2]))))
    return most


def check_places(body: PlannedBody, scene: Scene) -> None:
    """Refuses a fixed start or goal that cannot be held.

    Raises:
        PlanError: which, and by how much.
    """
    for name in ("start", "goal"):
        place: Place = getattr(scene, name)
        if place.within > 0.0:
            continue
        reasons = []
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
