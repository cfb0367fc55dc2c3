"""How a seed fares: followed by the body at sampled postures, and held against the demands."""

from dataclasses import dataclass

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.planning.body import PlannedBody
from snakegen.planning.follow import pose_of
from snakegen.planning.seeds import Seed
from snakegen.planning.timing import paced, rates_of
from snakegen.planning.tracking import SCALE, Tracking
from snakegen.scene.schema import Demands

COARSE, FINE = 0.10, 0.04  # m, that the leader advances between postures
MISS = 0.08  # m, that rods may cut corners by
FEW = 20  # poses at which tracking errors are looked at


@dataclass(frozen=True, eq=False)
class Judgement:
    """How a seed fares at sampled postures.

    Attributes:
        poses: (m, 6 + k).
        clearance, own: m, least distances from obstacles and from itself.
        force, torque: N, N·m, least margins.
        miss: m, of the rods from the curve.
        roll: rad, the most that a hovering gimbal rolls while its link is not vertical.
        upright: least cosine of a link's angle with the horizontal.
        errors: (6,) m, rad, RMS tracking errors that usual hardware leaves (`tracking`).
        cover: least clearance in standard deviations of these errors.
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
    errors: Floats
    cover: float
    where: str

    def short(self, demands: Demands) -> dict[str, float]:
        """Returns what is lacking, as shares of what is demanded; empty if nothing is."""
        pairs = {
            "clearance": (self.clearance, demands.clearance, 0.05),
            "self-clearance": (self.own, 0.0, 0.05),
            "force margin": (self.force, demands.force_margin, 50.0),
            "torque margin": (self.torque, demands.torque_margin, 5.0),
            "tracking": (self.cover, demands.tracking_sigmas, 5.0),
        }
        return {k: (least - v) / scale for k, (v, least, scale) in pairs.items() if v < least}

    def worth(self, demands: Demands) -> float:
        """Returns a rank: what is lacking counts first, then room, margins and rolls."""
        lacking = sum(self.short(demands).values())
        if lacking > 0.0:
            return -10.0 - lacking
        steep = 0.7 * self.roll + (5.0 if self.roll > 1.3 else 0.0)
        room = 1.5 * min(self.cover, 8.0) + min(self.torque, 10.0) / 5.0
        # noise turns roll gimbals by 1/cos of the slope and by 1/torque margin
        calm = min(self.torque * self.upright, 4.0)
        off = 6.0 * float(np.max(self.errors / SCALE))
        return room + calm - steep - off - 0.02 * len(self.poses)


def judge(seed: Seed, step: float, demands: Demands) -> Judgement:
    """Returns how a seed fares, the leader advancing by `step` [m] between postures.

    Args:
        seed: that is followed.
        step: m.
        demands: whose rates set the pace.
    """
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
    nows, found = [], []
    for pose in poses:
        nows.append(body.at_pose(pose))
        found.append(body.distances(nows[-1].q))
    gaps = np.array(found)
    clear = gaps[:, :outer].min(axis=1, initial=np.inf) - np.array([n.slack for n in nows])
    own = gaps[:, outer:].min(initial=np.inf)
    force, torque = body.margins(np.array([n.points for n in nows]))
    worst = int(np.argmin(clear))
    pair = body.shapes.pairs[int(np.argmin(gaps[worst, :outer]))] if outer else (0, 0)
    tracking, few = Tracking(body), poses[:: max(len(poses) // FEW, 1)]
    times = paced(few, rates_of(body, demands))
    errors = tracking.errors(few, times)
    return Judgement(
        poses,
        float(clear.min()),
        float(own),
        float(force.min()),
        float(torque.min()),
        float(misses.max()),
        _roll(body, poses),
        min(float(n.upright.min()) for n in nows),
        tracking.rms(errors, few),
        tracking.cover(errors, few, times).sigmas,
        f"{body.shapes.labels[pair[0]]} and {body.shapes.labels[pair[1]]}",
    )


def _settled(start: Floats, end: Floats) -> Floats:
    """Returns poses (m, 6 + k) after `start` up to `end`, evenly; none if they are the same."""
    far = float(np.abs(end - start).max())
    if far < 1e-4:
        return np.empty((0, len(start)))
    share = np.linspace(0.0, 1.0, max(int(np.ceil(far / 0.05)), 2) + 1)[1:, None]
    return np.asarray(start + share * (end - start))


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
