"""Joint torques along a motion: the law at every instant, its terms, peaks, RMS and power."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.geometry import Floats
from snakegen.base.memory import refuse_beyond
from snakegen.inverse_kinematics.motion import Motion
from snakegen.kernels.dynamics import torque_terms
from snakegen.kernels.dynamics.inverse_dynamics import torques_batch
from snakegen.robot.robot import Robot
from snakegen.statics import torque_terms as plain
from snakegen.statics.joint_torques import DOWN, Wrenches, armature, finite, link_loads, segments

FEW = 20_000  # instants, of some 30 µs each, before a kernel that takes 10 s to compile


@dataclass(frozen=True, eq=False)
class Along:
    """Torques of a motion at m instants, the base held.

    Attributes:
        joints: (k,) the chain's.
        time: (m,) s.
        angles, rates, accelerations: (m, k) rad, rad/s, rad/s².
        terms: (8, m, k) N·m, rows as `kernels.dynamics.TERMS`.
    """

    joints: tuple[str, ...]
    time: Floats
    angles: Floats
    rates: Floats
    accelerations: Floats
    terms: Floats

    def torque(self, depth: str = "full") -> Floats:
        """Returns (m, k) N·m: the terms that `depth` sums."""
        return np.asarray(self.terms[list(torque_terms.DEPTHS[depth])].sum(axis=0))

    def power(self, depth: str = "full") -> Floats:
        """Returns the mechanical power τ q̇ (m, k) W; negative where a joint is driven."""
        return self.torque(depth) * self.rates


def torques_along(
    robot: Robot,
    q: ArrayLike,
    motion: Motion,
    time: Floats,
    *,
    wrenches: Wrenches = None,
    gravity: ArrayLike = DOWN,
) -> Along:
    """Returns the joint torques of `motion` at the instants `time` (m,) s.

    Args:
        robot: any robot; a floating one is taken as held at its root.
        q: (nq,) posture: the base's attitude, and joints that do not belong to the chain.
        motion: of the chain.
        time: (m,) s.
        wrenches, gravity: as in `joint_torques`; wrenches keep their direction in the world.

    Raises:
        AnalysisError: more than fits into memory, NaN, wrong shapes.
        DescriptionError: a wrench on a link that does not exist.
    """
    q = robot.validate_configuration(q)
    n, m = len(robot.joint_names), len(time)
    refuse_beyond(
        8.0 * m * (n + 6) * (3 + 2 * len(torque_terms.TERMS)),
        f"torques of {n} joints at {m} instants",
        "ask for fewer samples a second, or a shorter motion or chain",
    )
    chain = np.array([robot.joint_names.index(j) for j in motion.joints], int)
    angles, rates, bends = motion.at(time)
    full = np.repeat(robot.angles(q)[None], m, axis=0)
    v, a = np.zeros((2, m, 6 + n))
    full[:, chain], v[:, 6 + chain], a[:, 6 + chain] = angles, rates, bends
    base = np.repeat(robot.base_pose(q)[0][None], m, axis=0)
    g = finite(gravity, (3,), "gravity")
    same, none = (robot.tree, armature(robot), segments(robot), g), np.zeros((n + 1, 6))
    law = plain.torque_terms if m <= FEW else torque_terms.torque_terms_batch
    rows = law(*same, base, full, v, a, none)
    loads = link_loads(robot, wrenches)
    if len(loads.body):
        still: Any = np.zeros((m, 6 + n))
        rows[:, torque_terms.EXTERNAL] = torques_batch(
            robot.tree, np.zeros(n), np.zeros(3), base, full, still, still, loads
        )
    terms = np.moveaxis(rows[:, :, 6 + chain], 1, 0)
    return Along(motion.joints, time, angles, rates, bends, np.ascontiguousarray(terms))
