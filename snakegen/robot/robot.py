"""Robot: a Pinocchio model and its modules, read from a URDF, the only truth."""

import hashlib
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from snakegen.base.geometry import Floats, rotation_from_xyzw
from snakegen.errors import DescriptionError, PostureError, SnakegenError, near
from snakegen.kernels.core.types import Gimbals, Rotors, Tree
from snakegen.robot.arrays import configuration_of, gimbals_of, rotors_of, spinners_of, tree_of
from snakegen.robot.force_sets import force_sets_at, force_shapes
from snakegen.robot.modules import Modules, from_urdf
from snakegen.robot.modules_file import from_file, with_servos
from snakegen.wrench_margins.force_sets import ForceSets

GRAVITY = 9.81  # m/s²


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot as analyses see it.

    Attributes:
        name: the URDF's robot name.
        urdf: the URDF text.
        path: where the URDF stands, None for one that was made in memory.
        modules: rotors, servos, gains: what URDF cannot say.
        model: Pinocchio model, armature included; the root is a free-flyer if floating.
    """

    name: str
    urdf: str
    path: Path | None
    modules: Modules
    model: pin.Model

    @property
    def floating(self) -> bool:
        """Tells whether the base is free."""
        return self.modules.floating

    @property
    def folder(self) -> Path | None:
        """The folder of the URDF, where its mesh paths start; None for one made in memory."""
        return None if self.path is None else self.path.parent

    @cached_property
    def root_link(self) -> str:
        """The name of the URDF's root link."""
        return str(_root_link(self.urdf))

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints in Pinocchio's order, without the free-flyer."""
        return tuple(self.model.names)[2 if self.floating else 1 :]

    @cached_property
    def gimbal_names(self) -> frozenset[str]:
        """Names of the joints that turn an apparatus."""
        names = (n for a in self.modules.apparatuses for n in (a.roll, a.pitch))
        return frozenset(n for n in names if n)

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
        """T0 = m g · mean link length [N m]."""
        return self.force_scale * self.link_length

    @cached_property
    def tree(self) -> Tree:
        """The kinematic tree on plain arrays; body 0 is the base."""
        return tree_of(self.model, self.floating)

    @cached_property
    def rotors(self) -> Rotors:
        """The rotors on plain arrays, apparatus by apparatus."""
        return rotors_of(self)

    @cached_property
    def gimbals(self) -> Gimbals:
        """The apparatuses on plain arrays."""
        return gimbals_of(self)

    @cached_property
    def force_shapes(self) -> ForceSets:
        """What its apparatuses can push with, in any posture."""
        return force_shapes(self)

    def force_sets(self, q: Floats) -> ForceSets:
        """Returns what its apparatuses can push with at q: points and axes about the CoG.

        Ranges are the gimbal joints' limits; points are those of q's gimbal angles. Gimbals
        whose thrusts are of no known form raise a DescriptionError.
        """
        return force_sets_at(self, self.check_q(q))

    @cached_property
    def spinners(self) -> frozenset[int]:
        """Bodies that a rotor's own spin joint moves: their angle does not matter."""
        return spinners_of(self)

    def body_of_link(self, link: str) -> tuple[int, Floats, Floats]:
        """Returns the body that carries `link`, and the link's rotation and origin in it."""
        if not self.model.existFrame(link, pin.FrameType.BODY):
            names = [f.name for f in self.model.frames if f.type == pin.FrameType.BODY]
            raise DescriptionError(f"{self.name} has no link '{link}'.{near(link, names)}")
        frame = self.model.frames[self.model.getFrameId(link, pin.FrameType.BODY)]
        body = int(frame.parentJoint) - (1 if self.floating else 0)
        return body, np.array(frame.placement.rotation), np.array(frame.placement.translation)

    def body_of_joint(self, joint: str) -> int:
        """Returns the body that `joint` moves."""
        if joint not in self.joint_names:
            raise DescriptionError(
                f"{self.name} has no joint '{joint}'.{near(joint, self.joint_names)}"
            )
        return self.joint_names.index(joint) + 1

    def configuration(
        self,
        posture: Mapping[str, float] | None = None,
        *,
        base_rpy: Sequence[float] = (0.0, 0.0, 0.0),
        base_position: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> Floats:
        """Returns q of a posture given by joint names; joints not named are at 0.

        Args:
            posture: rad (m where a joint slides) by joint name; may hold ``base_rpy`` and
                ``base_position`` too, as posture files do.
            base_rpy: rad, attitude of the root link; floating base only.
            base_position: m.

        Raises:
            PostureError: an unknown name (with the near ones), no number, or out of limits.
        """
        return configuration_of(self, {} if posture is None else posture, base_rpy, base_position)

    def check_q(self, q: Any) -> Floats:
        """Returns `q` as float64 after checking its size and its numbers."""
        out = np.asarray(q, dtype=float)
        if out.shape != (self.model.nq,):
            raise PostureError(f"{self.name}: q has shape {out.shape}, ({self.model.nq},) needed.")
        if not np.all(np.isfinite(out)):
            raise PostureError(f"{self.name}: q holds NaN or infinity.")
        return out

    def base_pose(self, q: Floats) -> tuple[Floats, Floats]:
        """Returns the base's rotation (3, 3) and position (3,) [m] in q."""
        if not self.floating:
            return np.eye(3), np.zeros(3)
        return rotation_from_xyzw(q[3:7]), np.array(q[:3])

    def angles(self, q: Floats) -> Floats:
        """Returns the joint angles (n-1,) of q in the tree's order."""
        q = self.check_q(q)
        at, turning = self._places
        out = q[at]
        out[turning] = np.arctan2(q[at[turning] + 1], out[turning])
        return np.asarray(out)

    @cached_property
    def _places(self) -> tuple[Any, Any]:
        """Where each joint's angle stands in q, and which are continuous (cos, sin there)."""
        first = 2 if self.floating else 1
        joints = [self.model.joints[k] for k in range(first, self.model.njoints)]
        at = np.array([joint.idx_q for joint in joints], np.int64)
        return at, np.flatnonzero([joint.nq == 2 for joint in joints])

    def limits(self, names: Sequence[str]) -> tuple[Floats, Floats, Floats]:
        """Returns lower, upper [rad] and effort [N m] of the joints `names`."""
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


def load(source: Any, *, modules: str | Path | None = None) -> Robot:
    """Reads a robot from a preset name, a spec file or RobotSpec, or a URDF file.

    Args:
        source: what to read; a path that ends in .urdf is a URDF.
        modules: a modules file for a URDF that snakegen did not write.

    Raises:
        SnakegenError: one line that says what is wrong, where, and what would have worked.
    """
    from snakegen.spec.urdf import read_urdf, urdf_text

    if isinstance(source, str | Path) and str(source).endswith((".urdf", ".xml")):
        path = Path(source)
        return from_urdf_text(read_urdf(path), path, modules=modules)
    if modules is not None:
        raise SnakegenError("--modules goes with a URDF; a spec already names its modules.")
    return from_urdf_text(urdf_text(source), None)


def from_urdf_text(
    text: str,
    path: Path | None,
    *,
    modules: str | Path | None = None,
    checked: bool = False,
) -> Robot:
    """Reads a robot from URDF text that stands, or would stand, at `path`.

    Args:
        text: URDF text.
        path: where its meshes are looked for, None to leave them out.
        modules: a modules file, for text without a <snakegen> element.
        checked: the lint has passed it already.
    """
    from snakegen.linter import lint

    if not checked:
        lint.check(path if path is not None else text)
    found = from_urdf(text)
    if modules is not None:
        found = with_servos(from_file(Path(modules), _root_link(text)), text)
    found = Modules(floating=False) if found is None else found
    try:
        root = (pin.JointModelFreeFlyer(),) if found.floating else ()
        model = pin.buildModelFromXML(text, *root)
    except (ValueError, RuntimeError) as error:
        raise DescriptionError(f"{path or 'URDF'}: Pinocchio cannot read it ({error}).") from None
    for what, parts in (("servo", found.servos), ("screw drive", found.screws)):
        for part in parts:
            if not model.existJointName(part.joint):
                raise DescriptionError(
                    f"{what} on joint '{part.joint}', which does not exist."
                    f"{near(part.joint, list(model.names)[1:])}"
                )
            model.armature[model.joints[model.getJointId(part.joint)].idx_v] = part.armature
    robot = Robot(str(model.name), text, path, found, model)
    _ = robot.tree, robot.rotors, robot.gimbals  # a wrong name is an error now, not later
    return robot


def _root_link(text: str) -> str:
    root = ET.fromstring(text)
    children = {str(e.get("link")) for e in root.iterfind("joint/child")}
    return next(str(e.get("name")) for e in root.iterfind("link") if e.get("name") not in children)
