"""How far joints move shapes and thrust points from the CoG: constants of a body.

One joint's turn by Δ moves a point beyond it by at most Δ times its distance from the joint, at
most the lengths of the bodies between; it moves the CoG by the same law, weighed by mass. Moved
one after the other, joints with turns Δ_j displace a point from the CoG by at most ``Σ κ_j |Δ_j|``,
whatever the posture.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.planning.mounts import STEEP, Mounts
from snakegen.planning.shapes import Shapes


@dataclass(frozen=True, eq=False)
class Reach:
    """Constants of displacement, per joint of the pose (k columns).

    Attributes:
        shapes: (s, k) m, κ of the body's shapes from the CoG.
        points: (n, k) m, κ of the thrust points from the CoG.
        own: (p, k) m, of the second shape of each pair of the body's own from the first.
        shift: m, Σ of the moments the gimbals carry, over mass: the CoG's κ for attitudes.
        tilt: (n, k) 1 where a joint turns the apparatus' link.
    """

    shapes: Floats
    points: Floats
    own: Floats
    shift: float
    tilt: Floats


def reaches(model: Any, ids: list[int], mounts: Mounts, shapes: Shapes, mass: float) -> Reach:
    """Returns the constants of a body.

    Args:
        model: Pinocchio's.
        ids: (k,) its joints in a pose.
        mounts, shapes: of the body.
        mass: kg.
    """
    supports = [set(model.supports[j].tolist()) for j in range(model.njoints)]
    hop = np.array([np.linalg.norm(p.translation) for p in model.jointPlacements])

    def far(j: int, other: int) -> float:
        """Returns the most that the frame of joint `other` is from joint j's origin [m]."""
        return float(sum(hop[k] for k in supports[other] if k > j and j in supports[k]))

    carried = np.zeros(len(ids))
    for i, j in enumerate(ids):
        for other in range(model.njoints):
            if j in supports[other]:
                inertia = model.inertias[other]
                arm = far(j, other) + float(np.linalg.norm(inertia.lever))
                carried[i] += inertia.mass * arm / mass
    m = mounts
    tilt = np.array([[float(j in supports[link]) for j in ids] for link in m.joint])
    share = np.abs(m.moment) / mass
    drift = carried + (2.0 / STEEP) * share @ tilt  # of offsets, and of what of it is uncertain
    extent = np.linalg.norm(shapes.centres, axis=1) + shapes.radii
    rows = _moved(shapes.joints, extent, ids, supports, far)
    pivots = np.linalg.norm(m.pivot, axis=1)
    thrust = _moved(m.joint, pivots, ids, supports, far)
    thrust = thrust + (2.0 / STEEP) * np.abs(m.lever)[:, None] * tilt
    own = []
    for a, b in shapes.pairs[shapes.outer :]:
        one, two = supports[shapes.joints[a]], supports[shapes.joints[b]]
        own.append(
            [
                rows[b, i] if j in two - one else rows[a, i] if j in one - two else 0.0
                for i, j in enumerate(ids)
            ]
        )
    return Reach(
        rows + drift,
        thrust + drift,
        np.array(own).reshape(-1, len(ids)),
        float(share.sum()),
        tilt,
    )


def _moved(joints: Any, extent: Floats, ids: list[int], supports: Any, far: Any) -> Floats:
    """Returns (s, k) m: the most that points within `extent` of a joint's frame are moved."""
    out = np.zeros((len(joints), len(ids)))
    for s, joint in enumerate(joints):
        for i, j in enumerate(ids):
            if j in supports[joint]:
                out[s, i] = far(j, joint) + extent[s]
    return out
