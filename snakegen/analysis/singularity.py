"""Singularities: gimbals near θ = ±90°, and the motion that is lost when J_w loses rank."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from snakegen.analysis.actuation import RANK_TOLERANCE, scaled, turning_gimbals
from snakegen.analysis.allocation import allocation
from snakegen.base.describe_motion import motions
from snakegen.base.geometry import Floats
from snakegen.robot.robot import Robot

COMMAND = "singularity"
ORDER = 30
_WARN_ANGLE = np.deg2rad(10.0)


@dataclass(frozen=True)
class GimbalDistance:
    """How far an apparatus stands from pointing its thrust along its own roll axis."""

    apparatus: int  # from 1
    distance: float  # rad, to θ = ±90° (thrust along the roll axis)
    gain: float  # |cosθ|, the factor left of the roll's authority (THEORY A1)
    link: str | None = None  # that carries the apparatus


@dataclass(frozen=True)
class Singularity:
    """State of singularity of a posture, gimbals included."""

    gimbals: tuple[GimbalDistance, ...]
    sigma_min: float
    sigma_max: float
    rank: int
    threshold: float
    lost: tuple[str, ...]
    weakest: str  # the motion of the smallest singular value, lost or not

    @property
    def verdict(self) -> str:
        """``singular``, ``near-singular`` or ``regular``."""
        if self.rank < 6:
            return "singular"
        return "near-singular" if self.sigma_min < self.threshold else "regular"

    def to_json(self) -> dict[str, Any]:
        """Returns plain data for a program."""
        return {
            "verdict": self.verdict,
            "jacobian_rank": self.rank,
            "jacobian_sigma_min": self.sigma_min,
            "jacobian_sigma_max": self.sigma_max,
            "threshold": self.threshold,
            "lost": list(self.lost),
            "weakest": self.weakest,
            "gimbals": [
                asdict(g) | {"distance_deg": float(np.rad2deg(g.distance))} for g in self.gimbals
            ],
        }

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people."""
        what = f"lost: {'; '.join(self.lost)}" if self.lost else f"weakest: {self.weakest}"
        out = [(f"posture is {self.verdict}", f"σ_min(J_w) {self.sigma_min:.3g}; {what}")]
        if "roll about the body axis" in self.lost:
            out.append(("", "the thrusts stand in one line; bend the body: --joint joint1_yaw=0.8"))
        for g in self.gimbals:
            mark = "  (roll nearly without effect)" if g.distance < _WARN_ANGLE else ""
            out.append(
                (
                    f"gimbal {g.apparatus}{f' on {g.link}' if g.link else ''}",
                    f"thrust {np.rad2deg(g.distance):.1f}° from its roll axis (θ = ±90°), "
                    f"roll authority {g.gain:.2f}{mark}",
                )
            )
        return out


def applies(robot: Robot) -> bool:
    """A robot with gimbals and a free base."""
    return robot.floating and bool(robot.gimbal_names)


def analyze(robot: Robot, q: Floats, threshold: float = 0.02) -> Singularity:
    """Returns distances to gimbal singularity and what J_w loses at q (ZN23 2.1, THEORY A1, A3).

    ``det ∂f/∂(λ, φ, θ) = ± λ² cosθ``: the roll's part of it is ``|sin|`` of the angle between
    thrust and roll axis, which equals |cosθ| for x–y gimbals.

    Options:
        threshold: scaled σ_min(J_w) below which a posture counts as near-singular
    """
    a = allocation(robot, q)
    count = robot.gimbals.limit.size
    columns = np.concatenate([robot.gimbals.limit, turning_gimbals(robot)])
    matrix = scaled(robot, a.jacobian, columns)
    whole = np.zeros((6, max(6, 3 * count)))
    whole[:, : 3 * count] = matrix
    left, sigma, _ = np.linalg.svd(whole)
    rank = int(np.sum(sigma > RANK_TOLERANCE * sigma[0]))
    unscale = np.repeat([1.0 / robot.force_scale, 1.0 / robot.torque_scale], 3)
    twists = unscale[:, None] * left
    lever, points = robot.link_length, a.thrust_points
    return Singularity(
        _gimbal_distances(robot, q),
        float(sigma[5]),
        float(sigma[0]),
        rank,
        threshold,
        motions(twists[:, rank:], lever, points),
        motions(twists[:, 5:], lever, points)[0],
    )


def _gimbal_distances(robot: Robot, q: Floats) -> tuple[GimbalDistance, ...]:
    """Returns, for each apparatus with a roll joint, the angle from thrust to its roll axis."""
    from snakegen.robot.kinematics import forward

    base, origin = robot.base_pose(q)
    rotation, _ = forward(robot.tree, base, origin, robot.angles(q))
    out = []
    for j, roll in enumerate(robot.gimbals.roll_body):
        if roll < 0:
            continue
        axis = rotation[roll] @ robot.tree.axis[roll]
        thrust = rotation[robot.gimbals.thrust_body[j]] @ robot.gimbals.thrust_axis[j]
        sine = float(np.linalg.norm(np.cross(axis, thrust)))
        angle = float(np.arctan2(sine, abs(axis @ thrust)))
        out.append(GimbalDistance(j + 1, angle, sine, robot.modules.apparatuses[j].link))
    return tuple(out)
