"""A Pinocchio model by the names of its links and joints."""

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from snakegen.base.geometry import Floats
from snakegen.errors import DescriptionError, near
from snakegen.kernels.core.types import Tree
from snakegen.robot.followers import Follower, followers_of
from snakegen.robot.modules import Modules


def tree_of(model: pin.Model, floating: bool) -> Tree:
    """Returns the kinematic tree of a Pinocchio model; a free-flyer becomes body 0."""
    first = 1 if floating else 0
    count = model.njoints - first
    q0 = pin.neutral(model)
    prismatic = np.zeros(count, np.int64)
    parent = np.full(count, -1, np.int64)
    axis = np.zeros((count, 3))
    axis[0, 0] = 1.0
    rotation, translation = np.zeros((count, 3, 3)), np.zeros((count, 3))
    rotation[0] = np.eye(3)
    for i in range(1, count):
        joint = model.joints[i + first]
        if joint.nv != 1:
            raise DescriptionError(
                f"joint '{model.names[i + first]}' has {joint.nv} degrees of freedom; "
                "snakegen takes revolute, continuous, prismatic and fixed joints."
            )
        data = joint.createData()
        joint.calc(data, q0)
        motion = np.asarray(data.S, float).reshape(6)
        prismatic[i] = int(np.any(motion[:3]))
        axis[i] = motion[:3] if prismatic[i] else motion[3:]
        parent[i] = int(model.parents[i + first]) - first
        rotation[i] = model.jointPlacements[i + first].rotation
        translation[i] = model.jointPlacements[i + first].translation
    bodies = [model.inertias[i + first] for i in range(count)]
    if not floating:  # what is bolted to the world does not move: Pinocchio's sums leave it out
        bodies[0] = pin.Inertia.Zero()
    return Tree(
        parent,
        prismatic,
        rotation,
        translation,
        axis,
        np.array([b.mass for b in bodies], float),
        np.array([b.lever for b in bodies], float),
        np.array([b.inertia for b in bodies], float),
    )


@dataclass(frozen=True, eq=False)
class ModelFrames:
    """A Pinocchio model and its modules, by the names of links and joints.

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

    @cached_property
    def root_link(self) -> str:
        """The name of the URDF's root link."""
        return str(root_link_of(self.urdf))

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints in Pinocchio's order, without the free-flyer."""
        return tuple(self.model.names)[2 if self.floating else 1 :]

    @cached_property
    def followers(self) -> dict[str, Follower]:
        """Leader, multiplier and offset of each joint that follows another (mimic)."""
        return followers_of(self.urdf, self.joint_names)

    @cached_property
    def gimbal_names(self) -> frozenset[str]:
        """Names of the joints that turn an apparatus."""
        names = (n for a in self.modules.apparatuses for n in (a.roll, a.pitch))
        return frozenset(n for n in names if n)

    @cached_property
    def apparatus_names(self) -> tuple[str, ...]:
        """Names of the apparatuses for people: number and link, as in ``apparatus 2 on link2``."""
        links = [f" on {a.link}" if a.link else "" for a in self.modules.apparatuses]
        return tuple(f"apparatus {j + 1}{link}" for j, link in enumerate(links))

    @cached_property
    def tree(self) -> Tree:
        """The kinematic tree on plain arrays; body 0 is the base."""
        return tree_of(self.model, self.floating)

    @cached_property
    def angle_places(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Where each joint's angle stands in q, and which are continuous (cos, sin there)."""
        first = 2 if self.floating else 1
        joints = [self.model.joints[k] for k in range(first, self.model.njoints)]
        at = np.array([joint.idx_q for joint in joints], np.int64)
        return at, np.flatnonzero([joint.nq == 2 for joint in joints])

    def angles_of(self, q: Floats) -> Floats:
        """Returns the joint angles (n-1,) of the array `q` (nq,) in the tree's order."""
        at, turning = self.angle_places
        out = q[at]
        out[turning] = np.arctan2(q[at[turning] + 1], out[turning])
        return np.asarray(out)

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


def root_link_of(text: str) -> str:
    """Returns the name of the root link of a URDF text."""
    root = ET.fromstring(text)
    children = {str(e.get("link")) for e in root.iterfind("joint/child")}
    return next(str(e.get("name")) for e in root.iterfind("link") if e.get("name") not in children)


def links_in_a_row(text: str) -> int:
    """Returns how many links the longest chain of a URDF's tree has."""
    root = ET.fromstring(text)
    below: dict[str, list[str]] = {}
    for joint in root.iterfind("joint"):
        parent, child = (end_link(joint, kind) for kind in ("parent", "child"))
        below.setdefault(parent, []).append(child)
    deepest, level = 0, [root_link_of(text)]
    while level:
        deepest += 1
        level = [child for name in level for child in below.get(name, [])]
    return deepest


def end_link(joint: ET.Element, kind: str) -> str:
    """Returns the name of a joint's ``parent`` or ``child`` link."""
    end = joint.find(kind)
    return "" if end is None else end.get("link", "")
