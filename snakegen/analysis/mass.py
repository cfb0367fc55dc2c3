"""Mass, centre of gravity and inertia of the whole body in a posture."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.robot.kinematics import forward, mass_properties
from snakegen.robot.robot import Robot

COMMAND = "mass"
ORDER = 10


@dataclass(frozen=True)
class Mass:
    """kg, m, kg·m²; root-link axes, CoG from the root link's origin."""

    mass: float
    cog: Floats
    inertia: Floats
    fixed_root: float = 0.0  # kg of it that is bolted to the world

    def to_json(self) -> dict[str, Any]:
        """Returns plain data for a program."""
        return {
            "mass_kg": self.mass,
            "fixed_root_mass_kg": self.fixed_root,
            "cog_m": self.cog.tolist(),
            "inertia_kg_m2": self.inertia.tolist(),
        }

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people."""
        moments = np.linalg.eigvalsh(self.inertia)
        held = f", {self.fixed_root:.3f} kg of it the fixed root link" if self.fixed_root else ""
        return [
            ("mass", f"{self.mass:.3f} kg{held}"),
            ("CoG from the root link", "{:+.4f} {:+.4f} {:+.4f} m".format(*self.cog)),
            ("principal inertia", "{:.4f} {:.4f} {:.4f} kg·m²".format(*moments)),
        ]


def applies(robot: Robot) -> bool:
    """A link with a mass."""
    return robot.mass > 0


def analyze(robot: Robot, q: Floats) -> Mass:
    """Returns mass properties of the whole body at q, a fixed root link included."""
    q = robot.validate_configuration(q)
    base, origin = robot.base_pose(q)
    rotation, position = forward(robot.tree, base, origin, robot.angles(q))
    tree, fixed = robot.tree, 0.0
    if not robot.floating:  # the tree leaves out what cannot move
        root = robot.model.inertias[0]
        fixed = float(root.mass)
        tree = tree._replace(
            mass=np.concatenate([[fixed], tree.mass[1:]]),
            com=np.concatenate([[root.lever], tree.com[1:]]),
            inertia=np.concatenate([[root.inertia], tree.inertia[1:]]),
        )
    mass, cog, inertia = mass_properties(tree, rotation, position)
    return Mass(float(mass), base.T @ (cog - origin), base.T @ inertia @ base, fixed)
