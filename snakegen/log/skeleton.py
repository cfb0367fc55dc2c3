"""Forward kinematics of a URDF over a whole run at once: what pictures are drawn from.

Every analysis reads a robot through Pinocchio; a log must be drawable from nothing but the text
inside it, for thousands of instants together, so this walks the joints once with stacked poses:
``T_child = T_parent · T_origin · exp(axis · angle)`` (URDF, rpy in fixed axes).
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from snakegen.base.geometry import quaternion_xyzw, rotation_from_rpy
from snakegen.errors import LogError

Floats = NDArray[np.float64]
Poses = tuple[Floats, Floats]  # rotations (T, 3, 3), positions (T, 3)
_ROWS = 2048  # instants computed together


@dataclass(frozen=True)
class Joint:
    """One joint of a URDF."""

    name: str
    kind: str
    parent: str
    child: str
    rotation: Floats  # (3, 3)
    translation: Floats  # (3,)
    axis: Floats  # (3,)


@dataclass(frozen=True)
class Skeleton:
    """A URDF's joints from the root outwards."""

    name: str
    root: str
    joints: tuple[Joint, ...]
    tips: dict[str, Floats]  # (3,) m per link: the end of its longest cylinder or box

    def spine(self) -> list[str]:
        """The body: `link1`, `link2` … where links are named so, else the longest way out."""
        route = {self.root: [self.root]}
        for j in self.joints:
            route[j.child] = [*route[j.parent], j.child]
        body = [name for name in route if re.fullmatch(r"link\d+", name)]
        if len(body) > 1:
            return max((route[name] for name in body), key=len)
        return max(route.values(), key=len)

    def body_line(self, base: Poses, angles: dict[str, Floats]) -> Floats:
        """Returns the body as a line through its link origins to its tip, (T, n, 3) m."""
        links = self.spine()
        out = []
        for first in range(0, max(len(base[1]), 1), _ROWS):  # poses of all instants are large
            part = slice(first, first + _ROWS)
            turned = {name: values[part] for name, values in angles.items()}
            poses = self.poses((base[0][part], base[1][part]), turned, set(links))
            points = [poses[name][1] for name in links]
            if links[-1] in self.tips:
                rotation, position = poses[links[-1]]
                points.append(position + rotation @ self.tips[links[-1]])
            out.append(np.stack(points, axis=1))
        return np.concatenate(out)

    def moving(self) -> tuple[Joint, ...]:
        """The joints that turn or slide."""
        return tuple(j for j in self.joints if j.kind != "fixed")

    def poses(
        self, base: Poses, angles: dict[str, Floats], links: set[str] | None = None
    ) -> dict[str, Poses]:
        """Returns every link's poses in the world.

        Args:
            base: poses of the root link, (T, 3, 3) and (T, 3).
            angles: (T,) per joint name, rad or m; a joint that is not named stays at 0.
            links: which links are wanted, with all on the way to them; by default every one.
        """
        out = {self.root: base}
        for j in self.joints:
            if links is not None and j.child not in links:
                continue
            rotation, position = out[j.parent]
            # One flat product: NumPy walks stacks of 3 × 3 one by one.
            rows = np.ascontiguousarray(rotation).reshape(-1, 3)
            turned = (rows @ j.rotation).reshape(-1, 3, 3)
            moved = position + (rows @ j.translation).reshape(-1, 3)
            angle = angles.get(j.name)
            if angle is not None and j.kind in ("revolute", "continuous"):
                turned = turned @ rotations_about(j.axis, angle)
            elif angle is not None and j.kind == "prismatic":
                moved = moved + (turned @ j.axis) * angle[:, None]
            out[j.child] = (turned, moved)
        return out


def skeleton(urdf: str) -> Skeleton:
    """Reads the joints of a URDF text, parents before children.

    Raises:
        LogError: the text is not a URDF whose joints form one tree.
    """
    try:
        robot = ET.fromstring(urdf)
    except ET.ParseError as error:
        raise LogError(f"the log's URDF cannot be read: {error}") from None
    joints = [_joint(e) for e in robot.findall("joint")]
    links = [e.get("name", "") for e in robot.findall("link")]
    children = {j.child for j in joints}
    roots = [name for name in links if name not in children]
    if len(roots) != 1:
        raise LogError(f"the log's URDF has {len(roots)} root links; it needs one")
    by_parent: dict[str, list[Joint]] = {}
    for j in joints:
        by_parent.setdefault(j.parent, []).append(j)
    ordered: list[Joint] = []
    front = [roots[0]]
    while front:
        for j in by_parent.get(front.pop(0), []):
            ordered.append(j)
            front.append(j.child)
    tips = {e.get("name", ""): tip for e in robot.findall("link") if (tip := _tip(e)) is not None}
    return Skeleton(robot.get("name", "robot"), roots[0], tuple(ordered), tips)


def joint_angles(labels: tuple[str, ...], q: Floats) -> dict[str, Floats]:
    """Returns (T,) per joint from `q` (T, nq) with its labels; ``:cos``/``:sin`` pairs join."""
    columns = {label: q[:, i] for i, label in enumerate(labels)}
    out = {}
    for label, values in columns.items():
        name, _, part = label.partition(":")
        if not part:
            out[name] = values
        elif part == "cos":
            out[name] = np.arctan2(columns[f"{name}:sin"], values)
    return out


def base_poses(labels: tuple[str, ...], q: Floats) -> Poses:
    """Returns the root link's poses; identity for a fixed base (no label ``qw``)."""
    if "qw" not in labels:
        return np.broadcast_to(np.eye(3), (len(q), 3, 3)), np.zeros((len(q), 3))
    return rotations_from_xyzw(q[:, 3:7]), q[:, :3]


def rotations_from_xyzw(quaternion: Floats) -> Floats:
    """Returns (T, 3, 3) of quaternions xyzw (T, 4); identity for one of no length."""
    size = np.linalg.norm(quaternion, axis=1, keepdims=True)
    x, y, z, w = np.where(size > 0, quaternion / np.where(size > 0, size, 1.0), [0, 0, 0, 1]).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def rotations_about(axis: Floats, angle: Floats) -> Floats:
    """Returns (T, 3, 3) by `angle` (T,) about the unit `axis` (Rodrigues)."""
    x, y, z = axis
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + s * k + (1.0 - c) * (k @ k)


def joint_poses(joint: Joint, angle: Floats) -> tuple[Floats, Floats]:
    """Returns position (T, 3) [m] and quaternion xyzw (T, 4) of a joint's child in its parent."""
    position = np.repeat(joint.translation[None], len(angle), axis=0)
    start = quaternion_xyzw(joint.rotation)
    if joint.kind == "prismatic":
        position = position + angle[:, None] * (joint.rotation @ joint.axis)
        return position, np.repeat(start[None], len(angle), axis=0)
    # start ⊗ (axis sin, cos): both parts are one product with a (2, 4) of constants
    v, w = start[:3], start[3]
    sine = np.append(w * joint.axis + np.cross(v, joint.axis), -v @ joint.axis)
    half = 0.5 * angle[:, None]
    return position, np.sin(half) * sine + np.cos(half) * start


def _joint(element: ET.Element) -> Joint:
    rotation, xyz = _origin(element)
    axis_element = element.find("axis")
    axis = _vector(None if axis_element is None else axis_element.get("xyz"), "1 0 0")
    ends = [element.find(tag) for tag in ("parent", "child")]
    parent, child = ("" if e is None else e.get("link", "") for e in ends)
    size = float(np.linalg.norm(axis)) or 1.0
    return Joint(
        element.get("name", ""),
        element.get("type", "fixed"),
        parent,
        child,
        rotation,
        xyz,
        axis / size,
    )


def _origin(element: ET.Element) -> tuple[Floats, Floats]:
    origin = element.find("origin")
    xyz = _vector(None if origin is None else origin.get("xyz"), "0 0 0")
    rpy = _vector(None if origin is None else origin.get("rpy"), "0 0 0")
    return rotation_from_rpy(rpy), xyz


def _tip(link: ET.Element) -> Floats | None:
    """Returns the end, farthest from the link's origin, of its longest cylinder or box."""
    best, length = None, 0.0
    for visual in link.findall("visual"):
        rotation, xyz = _origin(visual)
        cylinder, box = visual.find("geometry/cylinder"), visual.find("geometry/box")
        if cylinder is not None:
            half = np.array([0.0, 0.0, 0.5 * float(cylinder.get("length", "0"))])
        elif box is not None:
            size = _vector(box.get("size"), "0 0 0")
            half = np.where(np.arange(3) == np.argmax(size), 0.5 * size, 0.0)
        else:
            continue
        if np.linalg.norm(half) > length:
            length = float(np.linalg.norm(half))
            best = max((xyz + rotation @ half, xyz - rotation @ half), key=np.linalg.norm)
    return best


def _vector(text: str | None, default: str) -> Floats:
    return np.array([float(v) for v in (text or default).split()])


def angles_of(rotation: Floats) -> Floats:
    """Returns roll, pitch, yaw (T, 3) rad of ``Rz(yaw) Ry(pitch) Rx(roll)``, turns unwrapped."""
    pitch = -np.arcsin(np.clip(rotation[:, 2, 0], -1.0, 1.0))
    roll = np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2])
    yaw = np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])
    angles = np.column_stack([roll, pitch, yaw])
    if np.any(np.abs(np.diff(angles, axis=0)) > np.pi):
        angles = np.unwrap(angles, axis=0)
    return angles
