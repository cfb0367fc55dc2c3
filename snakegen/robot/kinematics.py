"""Kinematics and mass properties of one posture, in NumPy (ZN23 eqs 1-3; ZS24 eqs 3, 12, 13, 20).

Each function is the readable twin of a kernel in `kernels/kinematics/`, takes the same arguments
and agrees with it to round-off (`tests/test_plain_twins.py`). All results are in world axes.
"""

import numpy as np

from snakegen.base.geometry import Floats, cross, skew
from snakegen.kernels.core.types import Tree


def forward(
    tree: Tree, base_rotation: Floats, base_position: Floats, angles: Floats
) -> tuple[Floats, Floats]:
    """Returns the world pose of every body: ``T_i = T_parent · (R_i, t_i) · exp(axis_i angle_i)``.

    Args:
        tree: the robot's n bodies.
        base_rotation: (…, 3, 3) attitude of body 0, columns its axes in the world.
        base_position: (…, 3) m, origin of body 0.
        angles: (…, n-1) rad (m where the joint slides), body 1 first.

    Returns:
        rotation (…, n, 3, 3) and position (…, n, 3) [m] of the body frames.
    """
    n, k = len(tree.parent), skew(tree.axis[1:])
    angle = np.where(tree.prismatic[1:], 0.0, angles)[..., None, None]
    turned = np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * (k @ k)  # Rodrigues
    turned = tree.rotation[1:] @ turned
    slid = tree.axis[1:] * (tree.prismatic[1:] * angles)[..., None]
    moved = tree.translation[1:] + np.einsum("ijk,...ik->...ij", tree.rotation[1:], slid)
    rotation, position = (
        np.empty((*angles.shape[:-1], n, 3, 3)),
        np.empty((*angles.shape[:-1], n, 3)),
    )
    rotation[..., 0, :, :], position[..., 0, :] = base_rotation, base_position
    for i, j in enumerate(tree.parent[1:], 1):
        above = rotation[..., j, :, :]
        rotation[..., i, :, :] = above @ turned[..., i - 1, :, :]
        step = (above @ moved[..., i - 1, :, None])[..., 0]
        position[..., i, :] = position[..., j, :] + step
    return rotation, position


def centre_of_gravity(tree: Tree, rotation: Floats, position: Floats) -> tuple[float, Floats]:
    """Returns the mass [kg] and the CoG (3,) [m, world]: ``c = Σ m_i c_i / Σ m_i``."""
    mass = float(tree.mass.sum())
    with np.errstate(invalid="ignore", divide="ignore"):
        return mass, tree.mass @ _centres(tree, rotation, position) / mass


def mass_properties(tree: Tree, rotation: Floats, position: Floats) -> tuple[float, Floats, Floats]:
    """Returns mass, CoG and inertia about the CoG of bodies at the given poses.

    ``I = Σ R_i I_i R_iᵀ + m_i (d·d E - d dᵀ)``, d from the CoG to the body's centre of mass.

    Args:
        tree: the robot's n bodies.
        rotation: (n, 3, 3) body attitudes from `forward`.
        position: (n, 3) m, body origins.

    Returns:
        mass [kg], cog (3,) [m], inertia (3, 3) [kg·m²]; world axes.
    """
    mass, cog = centre_of_gravity(tree, rotation, position)
    d = _centres(tree, rotation, position) - cog
    own = (rotation @ tree.inertia @ rotation.transpose(0, 2, 1)).sum(axis=0)
    moved = np.einsum("i,ij,ik->jk", tree.mass, d, d)
    return mass, cog, own + np.trace(moved) * np.eye(3) - moved


def _centres(tree: Tree, rotation: Floats, position: Floats) -> Floats:
    return position + np.einsum("ijk,ik->ij", rotation, tree.com)


def twist_columns(tree: Tree, base_rotation: Floats, angles: Floats) -> Floats:
    """Returns the twist matrix S (6, n-1) at the base origin, world axes (ZS24 eqs 13 and 20).

    Column i is ``[r_i × e_i; e_i]``, ``[e_i; 0]`` where the joint slides: the order is
    [linear; angular], the paper's is the other way round.
    """
    rotation, position = forward(tree, base_rotation, np.zeros(3), angles)
    return _joint_columns(tree, rotation, position)


def tip_jacobian(
    tree: Tree, base_rotation: Floats, angles: Floats, body: int, point: Floats
) -> tuple[Floats, Floats, Floats]:
    """Returns a point's place, its body's attitude and their Jacobian by the joints.

    ``[ṗ; ω] = J θ̇``: the columns of the twist matrix between base and `body`, moved to the point
    (ZS24 eq 3: there the point is the base origin); zero for joints off that path.

    Args:
        tree: the robot's n bodies.
        base_rotation: (3, 3) attitude of body 0 in the world.
        angles: (n-1,) rad (m where the joint slides).
        body: index of the body that carries the point.
        point: (3,) m, in that body's frame.

    Returns:
        position (3,) m from the base origin, world axes; rotation (3, 3); J (6, n-1).
    """
    rotation, position = forward(tree, base_rotation, np.zeros(3), angles)
    tip = position[body] + rotation[body] @ point
    jacobian = _joint_columns(tree, rotation, position - tip)
    on_path = np.zeros(len(tree.parent), bool)
    i = body
    while i > 0:
        on_path[i] = True
        i = tree.parent[i]
    return tip, rotation[body].copy(), jacobian * on_path[1:]


def _joint_columns(tree: Tree, rotation: Floats, lever: Floats) -> Floats:
    """Returns (6, n-1): the twist that a unit rate of each joint gives a body at ``lever = 0``."""
    axis = np.einsum("ijk,ik->ij", rotation, tree.axis)[1:]
    slides = tree.prismatic[1:, None] > 0
    linear = np.where(slides, axis, cross(lever[1:], axis))
    return np.hstack([linear, np.where(slides, 0.0, axis)]).T.copy()
