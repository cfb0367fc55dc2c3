"""The arrays of a robot from its resolved spec, in closed form: what the templates would give.

No xacro, no parser: masses, offsets and thrust points are read off the resolved spec; which body is
whose child, and axes, come once from a robot that the templates made (`Skeleton.of`, which also
checks that both agree). Inertias are left as they were: no margin depends on them.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.description.meshes.solids_of import rod_radii
from snakegen.errors import AnalysisError
from snakegen.kernels.allocation.wrench_map import mean_drag
from snakegen.kernels.core.types import Gimbals, Ints, Rotors, Tree
from snakegen.robot.robot import GRAVITY, Robot
from snakegen.wrench_margins.force_sets import ForceSets

AGREED = 1e-12  # between closed form and templates, m, kg and N


@dataclass(frozen=True, eq=False)
class Rods:
    """The links of a robot in space.

    Attributes:
        bodies: (L,) that carry them.
        ends: (L, 2, 3) m, in their bodies.
        radii: (L,) m.
    """

    bodies: Ints
    ends: Floats
    radii: Floats

    @staticmethod
    def of(robot: Robot) -> "Rods":
        """Returns the links of a robot whose lengths are known."""
        names = list(robot.modules.lengths)
        places = [robot.body_of_link(n) for n in names]
        ends = [
            [p, p + turn @ np.array([robot.modules.lengths[n], 0.0, 0.0])]
            for n, (_, turn, p) in zip(names, places, strict=True)
        ]
        bodies = np.array([b for b, _, _ in places], np.int64)
        return Rods(bodies, np.reshape(ends, (-1, 2, 3)), rod_radii(robot.urdf, names))


@dataclass(frozen=True, eq=False)
class BodyArrays:
    """A robot as margins need it.

    Attributes:
        tree, rotors, gimbals: as of `Robot`.
        shapes: what its apparatuses can push with.
        low, high: (n-1,) rad, limits of all joints.
        link_length: m, mean.
        rods: what its links are in space.
        diameters: (n_rotors,) m.
        efforts: (k,) N·m, limits of the joints that shape the body.
    """

    tree: Tree
    rotors: Rotors
    gimbals: Gimbals
    shapes: ForceSets
    low: Floats
    high: Floats
    link_length: float
    rods: Rods
    diameters: Floats
    efforts: Floats

    @property
    def mass(self) -> float:
        """kg."""
        return float(self.tree.mass.sum())

    @property
    def scale(self) -> tuple[float, float]:
        """F0 = m g [N] and T0 = m g · mean link length [N·m]."""
        return self.mass * GRAVITY, self.mass * GRAVITY * self.link_length

    @staticmethod
    def of(robot: Robot) -> "BodyArrays":
        """Returns the arrays of a robot."""
        low, high, _ = robot.limits(robot.joint_names)
        diameters = [r.diameter for a in robot.modules.apparatuses for r in a.rotors]
        return BodyArrays(
            robot.tree, robot.rotors, robot.gimbals, robot.force_shapes, low, high,
            robot.link_length, Rods.of(robot), np.array(diameters, float),
            robot.limits(robot.chain_joints)[2],
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Skeleton:
    """What the designs of one topology share.

    Attributes:
        names: of the joints, in the tree's order.
        chain_joints: of those that shape the body.
        arrays: of one design of this topology.
    """

    names: tuple[str, ...]
    chain_joints: tuple[str, ...]
    arrays: BodyArrays

    @staticmethod
    def of(robot: Robot, resolved: dict[str, Any]) -> "Skeleton":
        """Returns the skeleton of a robot that the templates made of `resolved`.

        Raises:
            AnalysisError: the closed form does not know some part of it.
        """
        skeleton = Skeleton(robot.joint_names, robot.chain_joints, BodyArrays.of(robot))
        for part in ("screw_drive", "cables"):
            if resolved.get(part):
                raise AnalysisError(f"{robot.name}: designs with '{part}' are not searched.")
        made, known = skeleton.fill(resolved), skeleton.arrays
        pairs = [
            (made.tree.mass, known.tree.mass),
            (made.tree.com, known.tree.com),
            (made.tree.translation, known.tree.translation),
            (made.rotors.position, known.rotors.position),
            (made.rotors.torque_ratio, known.rotors.torque_ratio),
            (made.rotors.thrust_max, known.rotors.thrust_max),
            (made.shapes.high, known.shapes.high),
            (made.gimbals.thrust_point, known.gimbals.thrust_point),
            (made.rods.ends, known.rods.ends),
            (made.rods.radii, known.rods.radii),
            (made.diameters, known.diameters),
            (made.efforts, known.efforts),
        ]
        if any(np.abs(a - b).max(initial=0.0) > AGREED for a, b in pairs):
            raise AnalysisError(f"{robot.name}: some of its modules are not known in closed form.")
        return skeleton

    def fill(self, resolved: dict[str, Any]) -> BodyArrays:
        """Returns the arrays of another design of this topology."""
        old, chain, joint = self.arrays, resolved["chain"], resolved["joint"]
        unit = resolved["vectoring_apparatus"]
        translation = np.zeros_like(old.tree.translation)
        masses: list[list[tuple[float, Floats]]] = [[] for _ in old.tree.mass]
        carrier = {1: 0}
        for body, name in enumerate(self.names, start=1):
            part, _, axis = name.partition("_")
            if part.startswith("gimbal"):
                j = int(part.removeprefix("gimbal")) - 1
                place = unit["at"][j]
                if axis == "roll":
                    along = place["position"] * chain["length"][place["link"] - 1]
                    translation[body, 0] = along
                    masses[body].append((unit["roll_mass"][j], np.zeros(3)))
                else:
                    translation[body, 2] = unit["offset"][j]
                    masses[body].append((unit["pitch_mass"][j], np.zeros(3)))
                continue
            i = int(part.removeprefix("joint")) - 1
            axes, gap = joint["axes"][i], joint["gap"][i]
            first = axis == axes[0]
            if len(axes) == 2 and not first:
                translation[body, 0] = gap
            else:
                translation[body, 0] = chain["length"][i] + (gap if len(axes) == 1 else 0.0)
            if len(axes) == 2 and first:
                masses[body].append((joint["mass"][i], np.array([gap / 2.0, 0.0, 0.0])))
            else:
                carrier[i + 2] = body
        self._links(resolved, carrier, masses)
        mass = np.array([sum(m for m, _ in parts) for parts in masses])
        com = np.array([sum((m * c for m, c in parts), np.zeros(3)) for parts in masses])
        com /= np.where(mass > 0.0, mass, 1.0)[:, None]
        rotors, shapes = self._rotors(unit)
        tree = old.tree._replace(translation=translation, mass=mass, com=com)
        n, count = len(unit["at"]), rotors.apparatus
        points = np.array([rotors.position[count == j].mean(axis=0) for j in range(n)])
        limit = np.array([rotors.thrust_max[count == j].sum() for j in range(n)])
        gimbals = old.gimbals._replace(thrust_point=points, limit=limit)
        ends = np.zeros_like(old.rods.ends)
        ends[:, 1, 0] = chain["length"]
        radii = np.array(chain["radius"], float)
        efforts = [joint["effort"][int(n[5:].partition("_")[0]) - 1] for n in self.chain_joints]
        return replace(
            old, tree=tree, rotors=rotors, gimbals=gimbals, shapes=shapes,
            link_length=float(np.mean(chain["length"])),
            rods=replace(old.rods, ends=ends, radii=radii),
            diameters=np.repeat(np.array(unit["rotor_diameter"], float), unit["rotors"]),
            efforts=np.array(efforts, float),
        )  # fmt: skip

    @staticmethod
    def _links(
        resolved: dict[str, Any], carrier: dict[int, int], masses: list[list[tuple[float, Floats]]]
    ) -> None:
        """Adds to each body its link, the block at its end, and the lumps that the link carries."""
        chain, joint = resolved["chain"], resolved["joint"]
        for link, body in carrier.items():
            i, length = link - 1, chain["length"][link - 1]
            along = chain["com"][i] * length
            masses[body].append((chain["mass"][i], np.array([along, 0.0, 0.0])))
            block = i < len(joint["axes"]) and len(joint["axes"][i]) == 1
            if block and joint["mass"][i] is not None:
                at = length + joint["gap"][i] / 2.0
                masses[body].append((joint["mass"][i], np.array([at, 0.0, 0.0])))

        def lump(place: dict[str, Any], mass: float, step: Any) -> None:
            at = np.array([place["position"] * chain["length"][place["link"] - 1], 0.0, 0.0])
            masses[carrier[place["link"]]].append((mass, at + np.asarray(step, float)))

        load = resolved.get("payload") or {"at": []}
        for k, place in enumerate(load["at"]):
            lump(place, load["mass"][k], np.add(load["offset"][k], load["com"][k]))
        caster = resolved.get("caster") or {"at": []}
        for k, place in enumerate(caster["at"]):
            lump(place, caster["mass"][k], [0.0, 0.0, caster["radius"][k] - caster["drop"][k]])
        battery = resolved.get("battery")
        if battery:
            lump(battery["at"][0], battery["mass"], np.zeros(3))

    def _rotors(self, unit: dict[str, Any]) -> tuple[Rotors, ForceSets]:
        """Returns the rotors and what the apparatuses can push with."""
        old = self.arrays
        position = np.zeros_like(old.rotors.position)
        ratio, least, most = (np.zeros(len(position)) for _ in range(3))
        high, low = np.zeros(len(unit["at"])), np.zeros(len(unit["at"]))
        for j in range(len(unit["at"])):
            mine = np.flatnonzero(old.rotors.apparatus == j)
            for k, r in enumerate(mine):
                if len(mine) == 2:
                    position[r, 1] = (0.5 - k) * unit["separation"][j]
                ratio[r] = -unit["drag_ratio"][j] * unit["spin"][j][k]
                least[r], most[r] = unit["thrust_min"][j], unit["thrust_max"][j]
            low[j], high[j] = len(mine) * unit["thrust_min"][j], len(mine) * unit["thrust_max"][j]
        rotors = old.rotors._replace(
            position=position, torque_ratio=ratio, thrust_min=least, thrust_max=most
        )
        drag = mean_drag(rotors, len(high))
        return rotors, replace(old.shapes, low=low, high=high, drag=drag)
