"""How a screw drive stands with a drum off the ground: the shape that carries, the links' heights.

A straight body stands on a line and falls over as soon as an end drum leaves the ground. Bent by
its yaw joints it stands on a triangle. HA drives in the plane; this goes beyond it.
"""

import numpy as np

from snakegen.base.geometry import Floats, rotation_about, rotation_from_rpy
from snakegen.kernels.kinematics.chain import centre_of_gravity, forward
from snakegen.robot.robot import Robot
from snakegen.screw_drive.geometry import drive_geometry, yaw_joints
from snakegen.screw_drive.kinematics import ScrewGeometry
from snakegen.simulation.drive.run import pitch_joints
from snakegen.statics.worst import search

_CASTER = 0.25  # weight of a caster's height against a drum's
_BENDING = 0.002  # weight of bends against heights
_SHARE = 0.75  # of the yaw joints' range, that shapes take: links that roll need more of it
GRIP = 0.1  # m, that a unit of σ₃ counts against the margin
_SWING = 0.01  # m/rad, that a change of shape counts against it


class Heights:
    """Heights of the chain's nodes for least heights of its drums and end casters."""

    def __init__(self, g: ScrewGeometry, pitch_first: bool = True) -> None:
        self.pitch_first = pitch_first
        self.lengths = np.array(g.lengths)
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

    def over(self, least: Floats) -> Floats:
        """Returns the nodes' heights (m + 1,) [m] for least heights (n + 2,) of its places.

        ``min |C z − c|²`` with ``R z ≥ f``: the least-distance problem of Lawson and Hanson, whose
        dual is a non-negative least-squares problem.
        """
        from scipy.optimize import nnls

        least_load = np.concatenate([self.weight * least, np.zeros(len(self.cost) - len(least))])
        free = self.inverse @ least_load
        _, r = np.linalg.qr(self.cost)
        G = np.linalg.solve(r.T, self.rows.T).T  # in y = r (z − free): G y ≥ h, min |y|
        h = least - self.rows @ free
        dual = np.vstack([G.T, h])
        target = np.concatenate([np.zeros(len(free)), [1.0]])
        u, _ = nnls(dual, target)
        gap = dual @ u - target
        y = -gap[:-1] / gap[-1] if abs(gap[-1]) > 1e-12 else np.zeros(len(free))
        return np.asarray(free + np.linalg.solve(r, y))

    def joints(self, z: Floats, headings: Floats) -> tuple[Floats, Floats]:
        """Returns pitch and yaw joints (m − 1,) [rad] of node heights z and headings ψ (m,).

        Link i points along ``Rz(ψ_i) Ry(θ_i) x``. A link that is pitched when it is yawed rolls:
        so the joints are found one after the other, from where the link before them has got to.
        """
        steep = np.arcsin(np.clip((z[:-1] - z[1:]) / self.lengths, -1.0, 1.0))
        turn = rotation_from_rpy([0.0, steep[0], headings[0]])
        pitch, yaw = np.zeros((2, len(steep) - 1))
        for i in range(len(pitch)):
            flat = np.cos(steep[i + 1])
            goal = np.array([np.cos(headings[i + 1]), np.sin(headings[i + 1]), 0.0]) * flat
            goal[2] = -np.sin(steep[i + 1])
            seen = turn.T @ goal
            if self.pitch_first:
                pitch[i], yaw[i] = np.arctan2(-seen[2], seen[0]), np.arcsin(seen[1])
                bend = rotation_about([0, 1, 0], pitch[i]) @ rotation_about([0, 0, 1], yaw[i])
            else:
                pitch[i], yaw[i] = -np.arcsin(seen[2]), np.arctan2(seen[1], seen[0])
                bend = rotation_about([0, 0, 1], yaw[i]) @ rotation_about([0, 1, 0], pitch[i])
            turn = turn @ bend
        return pitch, yaw


class Stance:
    """A drive on the plane by its shape: where drums and centre of gravity are."""

    def __init__(self, robot: Robot) -> None:
        self.robot, self.geometry = robot, drive_geometry(robot)
        names = yaw_joints(robot)
        self.index = [robot.joint_names.index(n) for n in names]
        low, high, _ = robot.limits(names)
        self.limit = _SHARE * np.minimum(-low, high)
        pitch = robot.body_of_joint(pitch_joints(robot)[0])
        self.pitch_first = robot.body_of_joint(names[0]) > pitch

    def headings(self, shape: Floats) -> Floats:
        """Returns the links' headings (m,) [rad], π in the mean: the body travels along +x."""
        turn = np.concatenate([[0.0], np.cumsum(shape)])
        return np.asarray(np.pi + turn - turn.mean())

    def places(self, shape: Floats) -> tuple[Floats, Floats]:
        """Returns P (2,) and the drums (n, 2) [m], the drums' mean at the origin."""
        g, psi = self.geometry, self.headings(shape)
        along = np.stack([np.cos(psi), np.sin(psi)], axis=1)
        starts = np.vstack([np.zeros(2), np.cumsum(along * np.array(g.lengths)[:, None], axis=0)])
        link = np.array(g.link)
        drums = starts[link] + np.array(g.offset)[:, None] * along[link]
        return -drums.mean(axis=0), drums - drums.mean(axis=0)

    def margin(self, shape: Floats, lifted: int) -> float:
        """Returns how deep [m] the centre of gravity lies between the drums but `lifted`.

        Negative outside; minus the distance to the line where the drums stand on one.
        """
        head, drums = self.places(shape)
        angles = np.zeros(len(self.robot.joint_names))
        angles[self.index] = shape
        c, s = np.cos(self.headings(shape)[0]), np.sin(self.headings(shape)[0])
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        _, cog = centre_of_gravity(
            self.robot.tree, *forward(self.robot.tree, turn, np.append(head, 0.0), angles)
        )
        return depth(np.delete(drums, lifted, axis=0), cog[:2])

    def grip(self, shape: Floats, lifted: int) -> float:
        """Returns σ₃ of the no-slip rows, levers scaled, of the drums but `lifted`: 0, no steer."""
        g = self.geometry
        rows = np.delete(g.rows(shape, g.scale), lifted, axis=0)
        return float(np.linalg.svd(rows, compute_uv=False)[-1])

    def firm(self, lifted: int, before: Floats | None = None) -> Floats:
        """Returns the shape (m − 1,) in which the drums but `lifted` carry and steer best.

        The largest of ``min(margin, GRIP σ₃)``, less what it takes to get there from `before`.
        """

        def value(shape: Floats) -> float:
            swing = 0.0 if before is None else float(np.abs(shape - before).max())
            stands = self.margin(shape, lifted)
            return min(stands, GRIP * self.grip(shape, lifted)) - _SWING * swing

        return search(
            lambda shapes: np.array([value(x) for x in shapes]),
            -self.limit,
            self.limit,
            samples=256,
            starts=4,
            tolerance=1e-3,
        ).angles

    def shapes(self) -> list[Floats]:
        """Returns a firm shape (m − 1,) for each drum that is lifted, each near the one before.

        The first and its mirror image stand alike but do not steer alike: the better row is taken.
        """
        first = self.firm(0)
        rows = []
        for start in (first, -first):
            row = [start]
            for k in range(1, self.geometry.units):
                row.append(self.firm(k, row[-1]))
            rows.append(row)
        return max(rows, key=lambda row: min(GRIP * self.grip(x, k) for k, x in enumerate(row)))


def depth(points: Floats, inside: Floats) -> float:
    """Returns how deep (2,) lies in the convex hull of points (k, 2): its distance to the edges.

    Every line through two points that has all others on one side is an edge.
    """
    best = np.inf
    for i, a in enumerate(points):
        for b in points[i + 1 :]:
            across = np.array([a[1] - b[1], b[0] - a[0]]) / max(float(np.hypot(*(b - a))), 1e-12)
            sides = (points - a) @ across
            if sides.min() > -1e-12 or sides.max() < 1e-12:
                sign = 1.0 if sides.max() >= -sides.min() else -1.0
                best = min(best, sign * float((inside - a) @ across))
    return best
