"""Distances between links, floor and obstacles of an arm, by coal through Pinocchio.

Neighbours are left out as in the MJCF: links that share a joint or have only a link without
collision geometry between them, links fixed to each other, and pairs that overlap at rest.
"""

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from snakegen.base.geometry import Floats
from snakegen.robot.posture import set_angle
from snakegen.robot.robot import Robot
from snakegen.scene.schema import read_scene
from snakegen.scene.solids import Solid

_WIDE = 50.0  # m, half, of the floor


@dataclass(frozen=True)
class Nearest:
    """The least distance along postures.

    Attributes:
        distance: m; below 0 by how deep two bodies are in each other.
        pair: their names, "" where there is no pair at all.
        index: of the posture.
        note: why the links' shapes were left out; "" where they were not.
    """

    distance: float
    pair: tuple[str, str]
    index: int
    note: str = ""

    @property
    def free(self) -> bool:
        """Whether nothing touches."""
        return self.distance > 0.0

    def text(self) -> str:
        """Returns the result for people."""
        if self.note:
            return self.note
        if not self.pair[0]:
            return "no two bodies that could touch"
        one, two = self.pair
        size = f"{1e3 * abs(self.distance):.3g} mm"
        if self.free:
            return f"{size} at least, between {one} and {two}"
        return f"{one} and {two} are {size} in each other"

    def to_json(self) -> dict[str, Any]:
        """Returns plain data; keys carry units."""
        distance = self.distance if np.isfinite(self.distance) else None
        return {
            "collision_free": None if self.note else self.free,
            "clearance_m": distance,
            "clearance_pair": list(self.pair),
            "clearance_sample": self.index,
        }


class Collisions:
    """Collision geometry of a robot, the floor below its base, and obstacles."""

    def __init__(self, robot: Robot, obstacles: tuple[Solid, ...] = ()) -> None:
        """Reads the collision shapes of the URDF; says so where its meshes cannot be read."""
        self.robot, self.data = robot, robot.model.createData()
        folders = [] if robot.path is None else [str(Path(robot.path).parent)]
        self.note = ""
        try:
            self.geometry = pin.buildGeomFromUrdfString(
                robot.model, robot.urdf, pin.GeometryType.COLLISION, package_dirs=folders
            )
        except (ValueError, RuntimeError) as error:
            self.geometry = pin.GeometryModel()
            self.note = (
                f"not checked: collision shapes cannot be read ({str(error).splitlines()[0]})"
            )
        count = len(self.geometry.geometryObjects)
        self.links = [robot.model.frames[g.parentFrame].name for g in self.geometry.geometryObjects]
        solid, self.fixed = list(obstacles), dict[int, Any]()
        if robot.modules.mount is not None:
            below = -robot.modules.mount.height - 1.0
            middle = np.array([0.0, 0.0, below])
            solid.append(Solid("floor", "box", middle, size=(_WIDE, _WIDE, 1.0)))
        for one in solid:
            placement = pin.SE3(one.rotation, np.asarray(one.centre, float))
            made = pin.GeometryObject(one.name, 0, placement, one.shape())
            self.fixed[int(self.geometry.addGeometryObject(made))] = placement
        self.links += [one.name for one in solid]
        self._add_pairs(count)
        self.places = pin.GeometryData(self.geometry)

    @property
    def thickest(self) -> float:
        """Returns the largest radius of the robot's cylinders and capsules [m]; 0: it has none."""
        own = [g.geometry for g in self.geometry.geometryObjects if g.parentFrame > 0]
        round_ = [g.radius for g in own if isinstance(g, coal.Cylinder | coal.Capsule)]
        return float(max(round_, default=0.0))

    def _add_pairs(self, count: int) -> None:
        """Adds pairs of links that are no neighbours, and of moving links with what is fixed."""
        group, joined = _neighbours(self.robot.urdf, set(self.links[:count]))
        fixed = group[self.robot.root_link]
        for i, k in combinations(range(count), 2):
            one, two = group[self.links[i]], group[self.links[k]]
            if one != two and frozenset((one, two)) not in joined:
                self.geometry.addCollisionPair(pin.CollisionPair(i, k))
        for i in range(count):
            if group[self.links[i]] != fixed:
                for k in range(count, len(self.links)):
                    self.geometry.addCollisionPair(pin.CollisionPair(i, k))
        rest = pin.GeometryData(self.geometry)
        pin.computeDistances(
            self.robot.model, self.data, self.geometry, rest, pin.neutral(self.robot.model)
        )
        overlapping = [
            pair
            for pair, found in zip(self.geometry.collisionPairs, rest.distanceResults, strict=True)
            if found.min_distance <= 0.0 and pair.second < count
        ]
        for pair in overlapping:
            self.geometry.removeCollisionPair(pair)

    def nearest(
        self,
        angles: Floats,
        joints: tuple[str, ...],
        most: int = 200,
        shift: Floats | None = None,
    ) -> Nearest:
        """Returns the least distance along postures.

        Args:
            angles: (m, k) rad.
            joints: (k,) their names; others are at 0.
            most: how many of the postures are looked at, evenly, the last one too.
            shift: (m, 3) m, of the whole robot from where its base is; none if absent.
        """
        best = Nearest(float("inf"), ("", ""), 0, self.note)
        if not len(self.geometry.collisionPairs):
            return best
        rows = np.unique(np.linspace(0, len(angles) - 1, min(most, len(angles))).astype(int))
        q = pin.neutral(self.robot.model)
        for row in rows:
            for name, angle in zip(joints, angles[row], strict=True):
                set_angle(self.robot, q, name, float(angle))
            if shift is not None:
                for k, place in self.fixed.items():
                    moved = pin.SE3(place.rotation, place.translation - shift[row])
                    self.geometry.geometryObjects[k].placement = moved
            pin.computeDistances(self.robot.model, self.data, self.geometry, self.places, q)
            found = np.array([r.min_distance for r in self.places.distanceResults])
            k = int(np.argmin(found))
            if found[k] < best.distance:
                pair = self.geometry.collisionPairs[k]
                names = self.links[pair.first], self.links[pair.second]
                best = Nearest(float(found[k]), names, int(row))
        return best


def _neighbours(urdf: str, solid: set[str]) -> tuple[dict[str, str], set[frozenset[str]]]:
    """Returns each link's group (links fixed together), and pairs of groups that are neighbours."""
    root = ET.fromstring(urdf)
    group = {str(e.get("name")): str(e.get("name")) for e in root.iterfind("link")}
    ends = []
    for joint in root.iterfind("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is not None and child is not None:
            fixed = joint.get("type") == "fixed"
            ends.append((str(parent.get("link")), str(child.get("link")), fixed))
    for _ in ends:  # a link's group is that of what it is fixed to, however far up
        for above, below, fixed in ends:
            if fixed:
                group[below] = group[above]
    hard = {group[link] for link in solid}
    links: dict[str, set[str]] = {}
    for above, below, fixed in ends:
        if not fixed:
            one, two = group[above], group[below]
            links.setdefault(one, set()).add(two)
            links.setdefault(two, set()).add(one)
    joined = {frozenset((one, two)) for one, others in links.items() for two in others}
    for middle, others in links.items():
        if middle not in hard:
            joined |= {frozenset(pair) for pair in combinations(sorted(others), 2)}
    return group, joined


def obstacles_of(given: str | Path | Sequence[Solid] | None) -> tuple[Solid, ...]:
    """Returns solids, or those of a scene file; the ground is below the base, not in the scene.

    Raises:
        SceneError: a file that is no scene, with the place.
    """
    if not isinstance(given, str | Path):
        return tuple(given or ())
    return read_scene(Path(given), ground=False).solids
