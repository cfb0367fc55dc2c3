"""Which links of a URDF are rotors, and which joints tilt them: evidence from names and structure.

A URDF does not say where thrust acts. Names, shafts without torque, meshes of propellers, thrust
limits and the elements of simulators do, each a little.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from snakegen.linter.composites import Floats, rigid_body
from snakegen.linter.finding import numbers, shapes
from snakegen.linter.link_poses import link_poses
from snakegen.linter.tree_rules import end_of
from snakegen.linter.xml_tree import Node

_ROTOR = re.compile(r"rotor|prop(?!erty)|thrust|(?<![a-z])(edf|fan)(?![a-z])|impeller", re.I)
_MOTOR = re.compile(r"motor|blade|engine", re.I)
_OTHER = re.compile(r"mount|guard|holder|stator|plate|wheel|caster|roller|arm|base|servo", re.I)
_TILT = re.compile(r"gimbal|tilt|vector|swivel|servo|nacelle", re.I)
_ENOUGH = 2  # points of evidence that make a rotor


@dataclass(frozen=True)
class Shaft:
    """The joint that spins a rotor.

    Attributes:
        name: of the joint.
        axis: (3,) unit, in the axes of its child link.
        limits: (2,), None where it has none.
        effort: N·m, 0 where it has none.
    """

    name: str
    axis: Floats
    limits: tuple[float, float] | None
    effort: float


@dataclass(frozen=True)
class RotorCandidate:
    """A link that is probably a rotor, with the reasons; `guess` where they are weak."""

    link: str
    shaft: Shaft | None
    points: int
    reasons: tuple[str, ...]
    guess: bool = False


class UrdfTree:
    """A URDF by its links and joints, as `rotors` and `tilting` read it."""

    def __init__(self, root: Node) -> None:
        self.root = root
        self.links = {n.attrib.get("name", ""): n for n in root.findall("link")}
        joints = root.findall("joint")
        self.above = {end_of(j, "child") or "": j for j in joints}
        self.below: dict[str, list[Node]] = {}
        for joint in joints:
            self.below.setdefault(end_of(joint, "parent") or "", []).append(joint)
        self.top = next(name for name in self.links if name not in self.above)

    @cached_property
    def poses(self) -> dict[str, Floats]:
        """(4, 4) pose of each link with all joints at 0."""
        return link_poses(self.root)

    @cached_property
    def mass(self) -> float:
        """kg, of all links."""
        return sum(self.mass_of(name) for name in self.links)

    def mass_of(self, link: str) -> float:
        """Returns the mass of one link [kg]."""
        part = rigid_body(self.links[link])
        return 0.0 if part is None else part[0]

    @cached_property
    def centre(self) -> Floats:
        """(3,) m, the centre of mass with all joints at 0, in the root link's axes."""
        total, weighted = 0.0, np.zeros(3)
        for name, node in self.links.items():
            body = rigid_body(node)
            if body is not None:
                pose = self.poses[name]
                total += body[0]
                weighted += body[0] * (pose[:3, :3] @ body[1] + pose[:3, 3])
        return np.asarray(weighted / total if total > 0.0 else weighted)

    def parent(self, link: str) -> str | None:
        """Returns the link above, None at the root."""
        joint = self.above.get(link)
        return None if joint is None else end_of(joint, "parent")

    def ancestors(self, link: str) -> Iterator[str]:
        """Yields the links above `link`, the next first."""
        here = self.parent(link)
        while here is not None:
            yield here
            here = self.parent(here)

    def subtree(self, link: str) -> Iterator[str]:
        """Yields `link` and all links below it."""
        waiting = [link]
        while waiting:
            here = waiting.pop()
            yield here
            waiting += [end_of(joint, "child") or "" for joint in self.below.get(here, [])]

    def moving(self, link: str) -> bool:
        """Tells whether the joint above `link` moves."""
        joint = self.above.get(link)
        return joint is not None and joint.attrib.get("type") != "fixed"

    def carries_joints(self, link: str) -> bool:
        """Tells whether a joint below `link` moves."""
        return any(self.moving(name) for name in self.subtree(link) if name != link)

    def shaft(self, link: str) -> Shaft | None:
        """Returns the spinning joint right above `link`: it turns, and no joint is below it."""
        joint = self.above.get(link)
        if joint is None or joint.attrib.get("type") not in ("continuous", "revolute"):
            return None
        if self.carries_joints(link):
            return None
        limit = joint.find("limit")
        low, high = numbers(limit, "lower"), numbers(limit, "upper")
        effort = (numbers(limit, "effort") or (0.0,))[0]
        limits = (low[0] if low else 0.0, high[0]) if high else None
        if joint.attrib["type"] == "revolute" and not _spins(limits, effort):
            return None
        axis = np.array(numbers(joint.find("axis"), "xyz", 3) or (1.0, 0.0, 0.0))
        length = float(np.linalg.norm(axis)) or 1.0
        return Shaft(joint.attrib.get("name", ""), axis / length, limits, effort)

    def mesh_names(self, link: str) -> list[str]:
        """Returns the file names of the meshes of a link."""
        uris = [s.attrib.get("filename", "") for s in shapes(self.links[link]) if s.tag == "mesh"]
        return [uri.replace("\\", "/").rpartition("/")[2] for uri in uris]


def _spins(limits: tuple[float, float] | None, effort: float) -> bool:
    """Tells whether a revolute joint is a shaft: no torque, or room for many turns."""
    span = 0.0 if limits is None else limits[1] - limits[0]
    return effort == 0.0 or span > 8.0 * np.pi


def rotors(tree: UrdfTree) -> list[RotorCandidate]:
    """Returns the rotors of a URDF in the order of its links, one for each shaft."""
    every = [_candidate(tree, name) for name in tree.links]
    found = [c for c in every if c.points >= _ENOUGH]
    if not found:  # the name of a motor is all that some files give
        found = [c for c in every if c.points and c.reasons == ("name of a motor",)]
    by_link = {c.link: c for c in found}
    dropped: set[str] = set()
    for c in found:
        for name in tree.ancestors(c.link):
            other = by_link.get(name)
            if other is not None:
                dropped.add(c.link if _rank(other) > _rank(c) else other.link)
            if tree.moving(name) and not (other and other.shaft):
                break  # beyond another joint there is another body
    return [c for c in found if c.link not in dropped]


def _rank(c: RotorCandidate) -> tuple[bool, int]:
    return c.shaft is not None, c.points


def _candidate(tree: UrdfTree, link: str) -> RotorCandidate:
    """Returns a link with its points: names 2, a free shaft 2, a propeller's mesh 2, a motor 1."""
    shaft, points = tree.shaft(link), 0
    reasons: list[str] = []
    joint = tree.above.get(link)
    if joint is None or tree.carries_joints(link) or (tree.moving(link) and shaft is None):
        return RotorCandidate(link, shaft, 0, ())
    names = [link, *([shaft.name] if shaft else [])]
    if any(_ROTOR.search(n) and not _OTHER.search(_ROTOR.sub("", n)) for n in names):
        points, reasons = points + 2, [*reasons, "name"]
    elif any(_MOTOR.search(n) and not _OTHER.search(_MOTOR.sub("", n)) for n in names):
        points, reasons = points + 1, [*reasons, "name of a motor"]
    meshes = [n for n in tree.mesh_names(link) if _ROTOR.search(n) or "blade" in n.lower()]
    if meshes and not any(_OTHER.search(n) for n in meshes):
        points, reasons = points + 2, [*reasons, f"mesh '{meshes[0]}'"]
    if shaft is not None and shaft.effort == 0.0:
        wheel = any(_OTHER.search(n) for n in names)
        points, reasons = points + (0 if wheel else 2), [*reasons, "shaft without torque"]
    elif shaft is not None:
        points, reasons = points + 1, [*reasons, "shaft"]
    above = tree.above.get(tree.parent(link) or "")
    frame = not tree.moving(link) and tree.mass_of(link) == 0.0 and not tree.below.get(link)
    if frame and above is not None and _TILT.search(above.attrib.get("name", "")):
        points, reasons = points + 2, [*reasons, "frame at the end of a tilting joint"]
    return RotorCandidate(link, shaft, points, tuple(reasons))


def tilting(tree: UrdfTree, found: list[RotorCandidate]) -> dict[str, tuple[str, ...]]:
    """Returns, by rotor link, the links behind the joints that tilt it, the outermost first.

    Such a joint turns rotors of one body and no joint but their shafts and another such one. Of the
    joints of a chain that ends with a rotor the innermost are taken: as many as every rotor has,
    those with the name of a gimbal, and those on the root that carry less than 15 % of the mass.
    """
    of_rotor: dict[str, list[str]] = {}
    for c in found:
        start = tree.parent(c.link) if c.shaft else c.link
        path = [start, *tree.ancestors(start)] if start else []
        moved = [name for name in path if tree.moving(name)]
        mates = {d.link for d in found if _carrier(tree, d) == _carrier(tree, c)}
        others = {d.link for d in found} - mates
        of_rotor[c.link] = [n for n in moved if not others & set(tree.subtree(n))]
    common = min((len(links) for links in of_rotor.values()), default=0)
    out = {}
    for link, exclusive in of_rotor.items():
        count = 0
        for k, name in enumerate(exclusive[:2]):
            joint = tree.above[name]
            below = sum(tree.mass_of(n) for n in tree.subtree(name))
            turns = joint.attrib.get("type") in ("revolute", "continuous")
            named = _TILT.search(joint.attrib.get("name", "")) is not None
            light = below < 0.15 * tree.mass and _start(tree, tree.parent(name) or "") == tree.top
            if not turns or joint.find("mimic") is not None or not (k < common or named or light):
                break
            count = k + 1
        out[link] = tuple(reversed(exclusive[:count]))
    return out


def _carrier(tree: UrdfTree, c: RotorCandidate) -> str:
    """Returns the link that begins the body which a rotor pushes."""
    return _start(tree, (tree.parent(c.link) or "") if c.shaft else c.link)


def _start(tree: UrdfTree, here: str) -> str:
    """Returns the link that begins the moving body of a link."""
    while here in tree.above and not tree.moving(here):
        here = tree.parent(here) or ""
    return here
