"""From derivatives by points and load to derivatives by joints, masses and lengths of a posture.

The chain rule of a kinematic tree is the principle of virtual work: ``∂m/∂p`` acts on its point as
a force would, minus its sum on every mass in proportion (points are measured from the CoG), and
the derivative by a joint's angle is the torque of these forces about its axis.
"""

from dataclasses import dataclass

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.kernels.core.types import Ints, Tree
from snakegen.kernels.kinematics.chain import forward


@dataclass(frozen=True)
class BodyPoses:
    """Poses of a tree's bodies in the root link's axes, from its origin.

    Attributes:
        rotation, position: (n, 3, 3), (n, 3) m.
        centres: (n, 3) m, centres of mass.
        mass: kg, of all.
        cog: (3,) m.
    """

    rotation: Floats
    position: Floats
    centres: Floats
    mass: float
    cog: Floats

    @staticmethod
    def of(tree: Tree, angles: Floats) -> "BodyPoses":
        """Returns the poses at joint angles (n-1,)."""
        rotation, position = forward(tree, np.eye(3), np.zeros(3), np.ascontiguousarray(angles))
        centres = position + np.einsum("iab,ib->ia", rotation, tree.com)
        mass = float(tree.mass.sum())
        return BodyPoses(rotation, position, centres, mass, tree.mass @ centres / mass)


@dataclass(frozen=True)
class TreeGradient:
    """Derivatives of a margin by a tree's numbers, per unit of each.

    Attributes:
        joints: (n-1,) by joint angles, per rad (per m where a joint slides).
        translation: (n, 3) by `Tree.translation`, per m, in the parent's axes.
        mass: (n,) by the masses, per kg, through the CoG alone.
        com: (n, 3) by `Tree.com`, per m, body axes.
        places: (k, 3) by the points in their bodies' axes, per m.
    """

    joints: Floats
    translation: Floats
    mass: Floats
    com: Floats
    places: Floats


def tree_gradient(
    tree: Tree,
    poses: BodyPoses,
    bodies: tuple[Ints, Ints],
    points: Floats,
    pulls: Floats,
    couples: Floats,
) -> TreeGradient:
    """Returns the derivatives by the tree's numbers.

    Args:
        tree: of the robot.
        poses: at the posture.
        bodies: (k,) and (k,), which body carries each point, and which one turns its force.
        points: (k, 3) m, from the CoG.
        pulls: (k, 3) ∂m/∂p, the CoG held.
        couples: (k, 3) ∂m/∂(rotation vector of what turns the force).
    """
    n, total = tree.mass.size, pulls.sum(axis=0)
    share = tree.mass / poses.mass
    force = -share[:, None] * total  # on each centre of mass
    moment = np.cross(poses.centres, force)
    at = points + poses.cog
    np.add.at(force, bodies[0], pulls)
    np.add.at(moment, bodies[0], np.cross(at, pulls))
    np.add.at(moment, bodies[1], couples)
    for i in range(n - 1, 0, -1):
        force[tree.parent[i]] += force[i]
        moment[tree.parent[i]] += moment[i]
    axes = np.einsum("iab,ib->ia", poses.rotation, tree.axis)
    about = moment - np.cross(poses.position, force)
    slides = tree.prismatic.astype(bool)[:, None]
    joints = (axes * np.where(slides, force, about)).sum(axis=1)[1:]
    above = poses.rotation[np.maximum(tree.parent, 0)]
    return TreeGradient(
        joints,
        np.einsum("iba,ib->ia", above, force),
        -(poses.centres - poses.cog) @ total / poses.mass,
        -share[:, None] * (poses.rotation.transpose(0, 2, 1) @ total),
        np.einsum("kba,kb->ka", poses.rotation[bodies[0]], pulls),
    )
