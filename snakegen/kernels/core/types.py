"""The flat form of a robot that every kernel takes: a kinematic tree, its rotors, its gimbals.

`Robot` fills these from a URDF once; kernels index them. Body 0 is the base (the root link with
everything fixed to it; of mass 0 when the base is fixed, as Pinocchio drops it). Body i ≥ 1 turns
(or slides) about `axis[i]` in its own joint frame by `angles[i - 1]`; `parent[i] < i`.
Pose of body i in its parent: ``T = (rotation[i], translation[i]) · exp(axis[i] · angles[i-1])``.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Tree(NamedTuple):
    """Kinematics and inertia of n bodies, joint frames at the origin of each moving body."""

    parent: Ints  # (n,) index of the parent body, -1 for body 0
    prismatic: Ints  # (n,) 1 where the joint slides, 0 where it turns
    rotation: Floats  # (n, 3, 3) joint frame in the parent's body frame, at angle 0
    translation: Floats  # (n, 3) m
    axis: Floats  # (n, 3) unit joint axis in the body's frame
    mass: Floats  # (n,) kg
    com: Floats  # (n, 3) m, centre of mass in the body's frame
    inertia: Floats  # (n, 3, 3) kg·m², about the body's centre of mass, body axes


class Rotors(NamedTuple):
    """n rotors, apparatus by apparatus; thrust acts along `axis` at `position`."""

    body: Ints  # (n,) the body that carries the rotor (a spinning joint counts as fixed)
    position: Floats  # (n, 3) m, body frame
    axis: Floats  # (n, 3) unit thrust direction, body frame
    torque_ratio: Floats  # (n,) m, torque on the body about `axis` per newton: -κ s
    thrust_min: Floats  # (n,) N
    thrust_max: Floats  # (n,) N
    apparatus: Ints  # (n,) index of the apparatus


class Gimbals(NamedTuple):
    """n vectoring apparatuses: where each stands and which joints turn it."""

    link_body: Ints  # (n,) the body of the link that carries the apparatus
    link_rotation: Floats  # (n, 3, 3) link axes L in that body's frame
    roll_body: Ints  # (n,) body moved by the roll joint φ, -1 if absent
    pitch_body: Ints  # (n,) body moved by the pitch joint θ, -1 if absent
    thrust_body: Ints  # (n,) body in which the thrust point F is fixed
    thrust_point: Floats  # (n, 3) m, F in that body's frame: mean of its rotors' positions
    thrust_axis: Floats  # (n, 3) unit, mean thrust direction in that body's frame
    limit: Floats  # (n,) N, sum of its rotors' largest thrusts


class Mechanism(NamedTuple):
    """One robot: what every kernel of a flight needs of it."""

    tree: Tree
    rotors: Rotors
    gimbals: Gimbals


class Body(NamedTuple):
    """Where a robot is: poses of its bodies, its CoG, the CoG frame's axes."""

    rotation: Floats  # (n, 3, 3) world
    position: Floats  # (n, 3) m, world
    cog: Floats  # (3,) m, world
    axes: Floats  # (3, 3)
