"""The line of a whole body, and how far it is off the centreline of a hole."""

import numpy as np
from numpy.typing import NDArray

from snakegen.base.geometry import Floats
from snakegen.inverse_kinematics.hole import Hole
from snakegen.inverse_kinematics.path_following import Chain
from snakegen.kernels.kinematics.chain import forward
from snakegen.kernels.kinematics.jacobians import tip_jacobian

_SAMPLES = 33  # points of a piece of the body at which its distance is taken


class Body:
    """The line of a chain from its base to its tip, as points that bodies carry."""

    def __init__(self, chain: Chain, per_link: int = 4) -> None:
        self.chain, tree = chain, chain.robot.tree
        above = [chain.tip.body]
        while above[-1] > 0:
            above.append(int(tree.parent[above[-1]]))
        points, behind = [(chain.tip.body, chain.tip.point)], [0.0]
        end, far = chain.tip.point, 0.0
        for body in above:
            length = float(np.linalg.norm(end))
            if length > 1e-9:
                for share in np.arange(1, per_link + 1) / per_link:
                    points.append((body, (1.0 - share) * end))
                    behind.append(far + share * length)
            far += length
            end = tree.translation[body]
        self.bodies = np.array([body for body, _ in points], np.int64)
        self.points, self.behind = np.array([x for _, x in points]), np.array(behind)
        self.run_up = float(np.linalg.norm(chain.tip.point)) or 0.1 * far

    def places(self, full: Floats, shift: Floats) -> Floats:
        """Returns the points (n, 3) [m] from the base's first place, the tip first."""
        R, p = forward(self.chain.robot.tree, self.chain.base, shift, full)
        return np.asarray(p[self.bodies] + np.einsum("nij,nj->ni", R[self.bodies], self.points))

    def jacobians(self, full: Floats) -> Floats:
        """Returns their Jacobians (n, 3, k) by the chain's joints."""
        chain, tree = self.chain, self.chain.robot.tree
        placed = zip(self.bodies, self.points, strict=True)
        rows = [tip_jacobian(tree, chain.base, full, int(b), x)[2][:3] for b, x in placed]
        return np.array(rows)[:, :, chain.joints]


def off_line(body: Body, places: Floats, hole: Hole, s: float) -> tuple[float, float]:
    """Returns how far the body inside is off the centreline, and the rest beyond the wall [m].

    Whatever stands beyond the mouth counts as inside or, farther off than the room, in the wall.
    The body is the line through `places`, cut at the mouth and at the tip's depth s. The distance
    to a straight hole is largest at an end of a cut piece, so the result is exact there; along a
    curved one it is taken at 33 points a piece.
    """
    beyond, behind = (places - hole.points[0]) @ hole.inwards, body.behind
    tip_side, base_side = np.maximum(s - behind, 0.0), np.maximum(behind - s, 0.0)
    inside = _piece(places, beyond, tip_side[:-1] > 0.0, _ratio(tip_side, base_side), True)
    outside = _piece(places, beyond, base_side[1:] > 0.0, _ratio(tip_side, base_side), False)
    off = _distance(hole, inside).max(initial=0.0)
    deep = outside[_distance(hole, outside) > hole.room]
    return float(off), float(((deep - hole.points[0]) @ hole.inwards).max(initial=0.0))


def _ratio(tip_side: Floats, base_side: Floats) -> Floats:
    """Returns where along each piece (0 at the tip's end, 1 at the base's) the depth s is."""
    whole = tip_side[:-1] + base_side[1:]
    return np.where(whole > 0.0, tip_side[:-1] / np.where(whole > 0.0, whole, 1.0), 0.0)


def _piece(
    places: Floats, beyond: Floats, kept: NDArray[np.bool_], cut: Floats, tip: bool
) -> Floats:
    """Returns points (m, 3) of the line through `places` beyond the mouth, of one side of s."""
    a, b = (np.zeros_like(cut), cut) if tip else (cut, np.ones_like(cut))
    first, step = beyond[:-1], np.diff(beyond)
    level = np.abs(step) < 1e-15
    mouth = np.where(level, 0.0, -first / np.where(level, 1.0, step))
    a = np.where(step > 0.0, np.maximum(a, mouth), a)
    b = np.where(step < 0.0, np.minimum(b, mouth), b)
    kept = kept & (a <= b) & ~(level & (first < 0.0))
    share = np.linspace(0.0, 1.0, _SAMPLES)[:, None]
    t = (a + share * (b - a))[:, kept, None]
    return (places[:-1][kept] + t * np.diff(places, axis=0)[kept]).reshape(-1, 3)


def _distance(hole: Hole, points: Floats) -> Floats:
    """Returns how far points (m, 3) are from the centreline, (m,) m."""
    if not len(points):
        return np.zeros(0)
    return np.asarray(np.linalg.norm(points - hole.nearest(points)[0], axis=1))
