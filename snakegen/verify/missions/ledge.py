"""Climb and leave a ledge: pitch joints lift and lower the body, screws drive (beyond HA).

HA drives in the plane. Here every drum is lifted just before the edge and set down behind it,
one at a time, while the others drive. At each place of the head a small quadratic program finds
the heights of the chain's nodes: drums and casters as low as the ground under them allows, the
body as little bent as that leaves room for.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import nnls

from snakegen.errors import MissionError
from snakegen.geometry import Floats
from snakegen.robot import Robot
from snakegen.screw_motion import ScrewGeometry
from snakegen.screw_robot import drive_geometry
from snakegen.verify.drive import pitch_joints
from snakegen.verify.drive_plan import COMMON, DrivePlan, can_drive, following
from snakegen.verify.drive_record import drive
from snakegen.verify.ground import ledge
from snakegen.verify.plan import quintic
from snakegen.verify.recording import Recording

OPTIONS: dict[str, list[Any]] = {k: v for k, v in COMMON.items() if k != "plant"} | {
    "height": [0.02, "m, of the ledge"],
    "length": [1.2, "m, of the ledge"],
    "lift": [True, "false: pitch joints stay at 0"],
    "compliance": [1.0, "1; pitch servos are softer by this factor"],
    "speed": [0.1, "m/s"],
}
_AHEAD = 0.4  # m, from the head to the edge
_REACH = 0.05  # m, by which a drum reaches ahead of and behind its middle
_RISE = 0.08  # m, along which a drum is lifted
_CLEAR = 0.006  # m, over the edge
_SETTLE = 0.05  # m, behind the edge, along which it comes down to the ledge
_CASTER = 0.25  # weight of a caster's height against a drum's
_BENDING = 0.002  # weight of bends against heights


def applies(robot: Robot) -> bool:
    """A floating base, screw drums, a pitch joint between links, casters on the first and last."""
    if not can_drive(robot):
        return False
    links = len(drive_geometry(robot).lengths)
    bodies = {robot.body_of_link(c.link)[0] for c in robot.modules.casters}
    ends = {robot.body_of_link(f"link{i}")[0] for i in (1, links)}
    return len(pitch_joints(robot)) == links - 1 and ends <= bodies


def floor_under(x: ArrayLike, edges: tuple[float, float], height: float) -> Floats:
    """Returns the least height [m] of a drum or caster at x [m]: lifted ahead of an edge.

    Up over `_RISE` to `_CLEAR` above the ledge before its edge, down to it behind; the same from
    the other edge down.
    """

    def upwards(place: Floats) -> Floats:
        up, _, _ = quintic((place + _REACH + _RISE) / _RISE)
        down, _, _ = quintic((place - _REACH) / _SETTLE)
        return np.asarray((height + _CLEAR) * up - _CLEAR * down)

    place = np.asarray(x, float)
    return np.minimum(upwards(place - edges[0]), upwards(edges[1] - place))


class Lift:
    """Pitch joints for each place of the head of a straight body."""

    def __init__(self, g: ScrewGeometry, edges: tuple[float, float], height: float) -> None:
        self.lengths, self.edges, self.height = np.array(g.lengths), edges, height
        ends = np.concatenate([[0.0], np.cumsum(self.lengths)])
        # drums and the casters at both ends as weighted sums of node heights
        self.places = np.array([*(ends[k] + o for k, o in zip(g.link, g.offset, strict=True))])
        self.places = np.concatenate([[0.0], self.places, ends[-1:]])
        self.rows = np.array([np.interp(self.places, ends, unit) for unit in np.eye(len(ends))]).T
        slope = np.diff(np.eye(len(ends)), axis=0) / self.lengths[:, None]
        bends = _BENDING * np.diff(slope, axis=0)
        self.weight = np.ones(len(self.rows))
        self.weight[[0, -1]] = _CASTER  # a caster off the ground costs no grip
        self.cost = np.vstack([self.weight[:, None] * self.rows, bends])
        self.inverse = np.linalg.pinv(self.cost)

    def heights(self, s: float) -> Floats:
        """Returns the nodes' heights (m + 1,) [m] with the head at s [m].

        ``min |C z − c|²`` with ``R z ≥ f``: the least-distance problem of Lawson and Hanson, whose
        dual is a non-negative least-squares problem.
        """
        least = floor_under(s - self.places, self.edges, self.height)
        wish = np.concatenate([self.weight * least, np.zeros(len(self.cost) - len(least))])
        free = self.inverse @ wish
        _, r = np.linalg.qr(self.cost)
        G = np.linalg.solve(r.T, self.rows.T).T  # in y = r (z − free): G y ≥ h, min |y|
        h = least - self.rows @ free
        dual = np.vstack([G.T, h])
        target = np.concatenate([np.zeros(len(free)), [1.0]])
        u, _ = nnls(dual, target)
        gap = dual @ u - target
        y = -gap[:-1] / gap[-1] if abs(gap[-1]) > 1e-12 else np.zeros(len(free))
        return np.asarray(free + np.linalg.solve(r, y))

    def pitches(self, s: float) -> Floats:
        """Returns the pitch joints (m − 1,) [rad]: a link that falls along x is pitched forward."""
        z = self.heights(s)
        return np.diff(np.arcsin(np.clip((z[:-1] - z[1:]) / self.lengths, -1.0, 1.0)))


def fly(
    robot: Robot, *, seed: int, ideal: bool, options: dict[str, Any], progress: Any
) -> Recording:
    """Drives a line over the ledge and returns the judged recording."""
    o = {k: v[0] for k, v in OPTIONS.items()} | options
    if not (o["height"] > 0 and o["length"] > 0):
        raise MissionError("ledge needs height and length above 0.")
    g = drive_geometry(robot)
    if o["length"] < sum(g.lengths):
        raise MissionError(
            f"a ledge {o['length']:g} m long is shorter than the body, {sum(g.lengths):.3f} m: two "
            "drums would be lifted at a time."
        )
    edges = (_AHEAD, _AHEAD + o["length"])
    way = edges[1] + _REACH + _RISE + sum(g.lengths) + 0.1
    reference = following(robot, [("line", way)], o["speed"], o["acceleration"])
    lift = Lift(g, edges, o["height"])
    steepest = max(float(np.abs(lift.pitches(s)).max()) for s in np.arange(0.0, way, 0.01))
    low, high, _ = robot.limits(pitch_joints(robot))
    limit = min(float(-low.max()), float(high.min()))
    if steepest > limit:
        raise MissionError(
            f"a ledge of {o['height']:g} m bends the pitch joints to "
            f"{math.degrees(steepest):.1f}°; they turn {math.degrees(limit):.1f}°."
        )
    plan = DrivePlan(
        reference,
        reference.at(0.0)[0],
        o["duration"] or reference.duration + 1.0,
        o["gain"],
        o["feedback"],
        lift=lift.pitches if o["lift"] else None,
        compliance=o["compliance"],
        obstacles=ledge(edges, 1.0, o["height"]),
        events=((0.0, f"a ledge of {1e3 * o['height']:.0f} mm, {_AHEAD:g} m ahead"),),
        facts={"ledge_m": o["height"], "pitch_max_rad": steepest},
        thresholds={
            "distance_rmse_settled_m": {"at_most": 0.05, "if_measured": True},
            "distance_rmse_m": {"at_most": 0.1},  # it slews while the head's drum is up
            "distance_end_m": {"at_most": 0.03},
            "slip_mean_m_s": {"at_most": 0.05},
            "tilt_max_rad": {"at_most": 0.5},
        },
    )
    return drive(robot, "ledge", plan, seed=seed, ideal=ideal, progress=progress)
