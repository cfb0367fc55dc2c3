"""Follow the leader in space: postures with links on a curve, each where the one before was."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from snakegen.base.geometry import Floats, skew
from snakegen.planning.body import PlannedBody
from snakegen.planning.curves import Curve

_ROUNDS = 12
_KEEP = 0.01  # m per rad: how much a change of posture counts against a distance from the curve
_LEVEL = 0.2  # m: likewise of the sine of an apparatus' roll from the horizontal
_STILL = 3e-4  # m, rad


@dataclass(frozen=True, eq=False)
class Chain:
    """A body's rods, in the order in which they follow.

    Attributes:
        body: of which.
        tip_leads: whether the chain's tip goes first; else its root link.
    """

    body: PlannedBody
    tip_leads: bool = True

    @property
    def chords(self) -> Floats:
        """(r,) m, lengths of the rods from the leader back."""
        sizes = np.array([np.linalg.norm(e[1] - e[0]) for _, e in self.body.shapes.links])
        return sizes[::-1] if self.tip_leads else sizes

    def line(self, q: Floats) -> Floats:
        """Returns the rods' ends (r + 1, 3) [m] at q, from the last to the leader."""
        pin.forwardKinematics(self.body.model, self.body.data, q)
        ends = self.body.lines()
        nodes = np.concatenate([ends[:1], ends[1::2]])
        return nodes if self.tip_leads else nodes[::-1]

    def fit(self, nodes: Floats, q: Floats) -> tuple[Floats, float]:
        """Returns the q nearest to a guess whose rods end at `nodes`, and the worst miss [m].

        Gauss-Newton on ``Σ ‖p_i(q) - n_i‖² + keep² ‖q ⊖ q₀‖² + level² Σ (b_j·ẑ)²``, joints within
        their limits. b_j is the axis across which apparatus j tilts its thrust at φ = 0: what the
        nodes leave open, the turn about the body's own line, keeps φ small, continuous through
        vertical links.

        Args:
            nodes: (r + 1, 3) m, from the leader back.
            q: (nq,) guess, gimbals at 0.
        """
        body, model, data = self.body, self.body.model, self.body.data
        goal = nodes[::-1] if self.tip_leads else nodes
        goals = np.concatenate([goal[:-1, None], goal[1:, None]], axis=1).reshape(-1, 3)
        free = np.concatenate([np.arange(6), body.at_v])
        start, q = q.copy(), q.copy()
        miss = np.inf
        for _ in range(_ROUNDS):
            pin.computeJointJacobians(model, data, q)
            rows, gaps = [], []
            for i, (joint, ends) in enumerate(body.shapes.links):
                place = data.oMi[joint]
                jacobian = pin.getJointJacobian(model, data, joint, pin.LOCAL_WORLD_ALIGNED)
                for end, target in zip(ends, goals[2 * i : 2 * i + 2], strict=True):
                    lever = place.rotation @ end
                    rows.append((jacobian[:3] - skew(lever) @ jacobian[3:])[:, free])
                    gaps.append(target - place.translation - lever)
            away = pin.difference(model, q, start)[free]
            for joint, side in zip(body.mounts.joint, body.sides, strict=True):
                across = data.oMi[joint].rotation @ side
                jacobian = pin.getJointJacobian(model, data, joint, pin.LOCAL_WORLD_ALIGNED)
                # d(b·ẑ) = (ω × b)·ẑ = ω·(b × ẑ)
                tilt = np.array([across[1], -across[0], 0.0]) @ jacobian[3:, free]
                rows.append(_LEVEL * tilt[None])
                gaps.append(-_LEVEL * across[2:])
            matrix = np.concatenate([*rows, _KEEP * np.eye(len(free))])
            right = np.concatenate([*gaps, _KEEP * away])
            miss = max(float(np.linalg.norm(g)) for g in gaps[: len(goals)])
            step = np.linalg.solve(matrix.T @ matrix, matrix.T @ right)
            step *= min(1.0, 0.5 / max(float(np.abs(step).max()), 1e-12))
            change = np.zeros(model.nv)
            change[free] = step
            q = pin.integrate(model, q, change)
            q[body.at] = np.clip(q[body.at], body.low, body.high)
            if np.abs(step).max() < _STILL:
                break
        return q, miss

    def along(self, curve: Curve, arcs: Floats, q: Floats) -> tuple[Floats, Floats]:
        """Returns poses (m, 6 + k) with the leader at `arcs` of a curve, and misses (m,) [m]."""
        poses: list[Floats] = []
        misses: list[float] = []
        for arc in arcs:
            q, miss = self.fit(curve.nodes(float(arc), self.chords), q)
            poses.append(pose_of(self.body, q, poses[-1] if poses else None))
            misses.append(miss)
        return np.array(poses), np.array(misses)


def pose_of(body: PlannedBody, q: Floats, before: Floats | None = None) -> Floats:
    """Returns the pose (6 + k,) of q, its rotation vector the one nearest to that `before`."""
    turn = pin.Quaternion(q[3:7]).toRotationMatrix()
    vector = np.array(pin.log3(turn @ body.attitude(np.zeros(3)).T))
    if before is not None:
        vector = nearest_vector(vector, before[3:6])
    pose = np.concatenate([np.zeros(3), vector, q[body.at]])
    pose[:3] = q[:3] - body.at_pose(pose).q[:3]
    return pose


def nearest_vector(vector: Floats, before: Floats) -> Floats:
    """Returns the rotation vector of the same attitude that is nearest to another."""
    size = float(np.linalg.norm(vector))
    axis = vector / size if size > 1e-9 else before / max(float(np.linalg.norm(before)), 1e-12)
    turns = [vector + 2.0 * np.pi * k * axis for k in (-2, -1, 0, 1, 2)]
    return min(turns, key=lambda v: float(np.linalg.norm(v - before)))
