"""The bodies of a robot on plain arrays: rotors, gimbals, masses, angles and limits."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.geometry import Floats
from snakegen.kernels.core.types import Gimbals, Rotors
from snakegen.robot.arrays import gimbals_of, rotors_of, spinners_of
from snakegen.robot.configuration import Configuration
from snakegen.robot.frames import ModelFrames

GRAVITY = 9.81  # m/s²


@dataclass(frozen=True, eq=False)
class RobotBodies(ModelFrames):
    """What analyses read of a robot's bodies; see `Robot`."""

    @property
    def folder(self) -> Path | None:
        """The folder of the URDF, where its mesh paths start; None for one made in memory."""
        return None if self.path is None else self.path.parent

    @cached_property
    def chain_joints(self) -> tuple[str, ...]:
        """Names of the joints that shape the body: no gimbals, spinning rotors, drums, wheels."""
        out = set(self.gimbal_names) | {self.joint_names[b - 1] for b in self.spinners}
        out |= self.rolling_names
        return tuple(n for n in self.joint_names if n not in out)

    @cached_property
    def rolling_names(self) -> frozenset[str]:
        """Names of the joints that turn a drum, and of all that turn on it."""
        drums = {self.body_of_joint(screw.joint) for screw in self.modules.screws}
        rolling = np.zeros(self.tree.parent.size, bool)
        for body, parent in enumerate(self.tree.parent):  # parents stand before children
            rolling[body] = body in drums or (parent >= 0 and rolling[parent])
        return frozenset(self.joint_names[b - 1] for b in np.flatnonzero(rolling))

    @cached_property
    def urdf_hash(self) -> str:
        """SHA-256 of the URDF text."""
        return hashlib.sha256(self.urdf.encode()).hexdigest()

    @cached_property
    def mass(self) -> float:
        """Mass that moves [kg]; a fixed root's own is left out."""
        return float(self.tree.mass.sum())

    @cached_property
    def link_length(self) -> float:
        """Mean link length [m], the lever of the torque scale."""
        if self.modules.lengths:
            return float(np.mean(list(self.modules.lengths.values())))
        steps = np.linalg.norm(self.tree.translation[1:], axis=1)
        return float(np.max(steps)) if steps.size and np.max(steps) > 0 else 1.0

    @property
    def force_scale(self) -> float:
        """F0 = m g [N]."""
        return self.mass * GRAVITY

    @property
    def torque_scale(self) -> float:
        """T0 = m g · mean link length [N·m]."""
        return self.force_scale * self.link_length

    @cached_property
    def rotors(self) -> Rotors:
        """The rotors on plain arrays, apparatus by apparatus."""
        return rotors_of(self, self.spinners)

    @cached_property
    def gimbals(self) -> Gimbals:
        """The apparatuses on plain arrays."""
        return gimbals_of(self, self.rotors)

    @cached_property
    def spinners(self) -> frozenset[int]:
        """Bodies that a rotor's own spin joint moves: their angle does not matter."""
        return spinners_of(self)

    def validate_configuration(self, q: ArrayLike) -> Configuration:
        """Returns `q` as a configuration of this robot: itself if it is one, else a checked copy.

        Args:
            q: (nq,) in Pinocchio's order.

        Raises:
            PostureError: another size, or an entry that is not finite.
        """
        if isinstance(q, Configuration) and q.robot is self:
            return q
        return Configuration(self, q)

    def base_pose(self, q: ArrayLike) -> tuple[Floats, Floats]:
        """Returns the base's rotation (3, 3) and position (3,) [m] in q."""
        at = self.validate_configuration(q)
        return np.array(at.base_rotation), at.base_position

    def angles(self, q: ArrayLike) -> Floats:
        """Returns the joint angles (n-1,) of q in the tree's order."""
        return np.array(self.validate_configuration(q).angles)

    def limits(self, names: Sequence[str]) -> tuple[Floats, Floats, Floats]:
        """Returns lower, upper [rad] and effort [N·m] of the joints `names`."""
        joints = [self.model.joints[self.model.getJointId(n)] for n in names]
        free = [j.nq == 2 for j in joints]
        low = [self.model.lowerPositionLimit[j.idx_q] for j in joints]
        high = [self.model.upperPositionLimit[j.idx_q] for j in joints]
        effort = [self.model.upperEffortLimit[j.idx_v] for j in joints]
        return (
            np.where(free, -np.pi, low).astype(float),
            np.where(free, np.pi, high).astype(float),
            np.array(effort, float),
        )
