"""Robots in flat form, written by hand: the tests' own, independent of URDF and templates."""

import numpy as np

from snakegen.base.geometry import rotation_about
from snakegen.kernels.core.types import Gimbals, Rotors, Tree

X, Y, Z = np.eye(3)


class FlatRobot:
    """Collects bodies, rotors and gimbals and freezes them into the kernels' tuples."""

    def __init__(self, mass: float, com, inertia):
        self.bodies = [(-1, 0, np.eye(3), np.zeros(3), X, mass, com, inertia)]
        self.rotors, self.gimbals = [], []

    def add(self, parent, translation, axis, mass=0.0, com=(0, 0, 0), inertia=None, **more):
        """Adds a moving body, returns its index."""
        rotation = more.get("rotation", np.eye(3))
        inertia = np.zeros((3, 3)) if inertia is None else inertia
        self.bodies.append(
            (parent, more.get("prismatic", 0), rotation, translation, axis, mass, com, inertia)
        )
        return len(self.bodies) - 1

    def add_apparatus(self, link, position, offset, spins, separation, drag, limit):
        """Adds roll and pitch gimbals and one rotor per spin (N a rotor: `limit`)."""
        roll = self.add(link, position, X)
        pitch = self.add(roll, (0, 0, offset), Y)
        j = len(self.gimbals)
        ys = separation / 2 * np.array([1, -1]) if len(spins) == 2 else [0.0]
        for y, spin in zip(ys, spins, strict=True):
            self.rotors.append((pitch, (0, y, 0), Z, -drag * spin, 0.0, limit, j))
        self.gimbals.append(
            (link, np.eye(3), roll, pitch, pitch, np.zeros(3), Z, limit * len(spins))
        )

    def freeze(self) -> tuple[Tree, Rotors, Gimbals]:
        """Returns the kernels' tuples."""
        return (
            _pack(Tree, self.bodies, (0, 1)),
            _pack(Rotors, self.rotors, (0, 6)),
            _pack(Gimbals, self.gimbals, (0, 2, 3, 4)),
        )


def _pack(kind, rows, integer_columns):
    columns = zip(*rows, strict=True)
    return kind(
        *(
            np.array(list(c), np.int64 if i in integer_columns else np.float64)
            for i, c in enumerate(columns)
        )
    )


def snake(links, *, offset=0.0, drag=0.01, same_spin=False, limit=32.0, mass=2.0, length=0.42):
    """A chain of equal links (THEORY A3's reference robot); joints pitch then yaw, in that order.

    Returns tree, rotors, gimbals, and the angle indices of (pitch, yaw) per joint and of
    (roll, pitch) per apparatus.
    """
    inertia = mass * np.diag([0.0008, 0.0165, 0.0165])
    robot = FlatRobot(mass, (length / 2, 0, 0), inertia)
    body, joints, joint_index = 0, [0], []
    for _ in range(links - 1):
        pitch = robot.add(body, (length, 0, 0), Y)
        body = robot.add(pitch, (0, 0, 0), Z, mass, (length / 2, 0, 0), inertia)
        joints.append(body)
        joint_index.append((pitch - 1, body - 1))
    for j, link in enumerate(joints):
        spins = (1, -1) if j % 2 == 0 or same_spin else (-1, 1)
        robot.add_apparatus(link, (length / 2, 0, 0), offset, spins, 0.2, drag, limit)
    tree, rotors, gimbals = robot.freeze()
    gimbal_index = np.stack([gimbals.roll_body - 1, gimbals.pitch_body - 1], 1)
    return tree, rotors, gimbals, np.array(joint_index).reshape(-1, 2), gimbal_index


def random_rotation(rng):
    axis = rng.normal(size=3)
    return rotation_about(axis / np.linalg.norm(axis), rng.uniform(-3, 3))


def random_inertia(rng):
    """A positive inertia that satisfies the triangle inequality."""
    points = rng.normal(size=(6, 3)) * 0.1
    square = np.einsum("ni,ni->", points, points) * np.eye(3)
    return square - points.T @ points


def random_tree(rng, bodies=9):
    """A branching tree of random frames, axes and inertias; some joints slide."""
    robot = FlatRobot(1.0, rng.normal(size=3), random_inertia(rng))
    for i in range(1, bodies):
        axis = rng.normal(size=3)
        robot.add(
            int(rng.integers(0, i)),
            rng.normal(size=3),
            axis / np.linalg.norm(axis),
            rng.uniform(0.1, 2.0),
            rng.normal(size=3) * 0.2,
            random_inertia(rng),
            rotation=random_rotation(rng),
            prismatic=int(rng.random() < 0.25),
        )
    return _pack(Tree, robot.bodies, (0, 1))
