"""Kinematics and centroidal quantities of a `Tree`: poses, mass, CoG, inertia, momentum.

All results are in world axes. The CoG velocity contains the joint rates: ``c' = Σ m_i c_i' / m``
over every body, not the root's velocity alone (ZN23 eqs 1-3 and 15-16).
"""

from math import cos, sin

import numpy as np

from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.mat3 import cross_into, matmul_into, turn_back_into, turn_into
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.stack_arrays import scratch
from snakegen.kernels.core.types import Floats, Tree
from snakegen.kernels.core.vec3 import Three, cross, read, turn


@bare
def forward_into(
    tree: Tree,
    base_rotation: Floats,
    base_position: Floats,
    angles: Floats,
    rotation: Floats,
    position: Floats,
) -> None:
    """Writes the pose of every body: `forward` without its allocation.

    Row k of a body's attitude is row k of its mounting turned by Rodrigues' formula:
    ``m exp([a] θ) = m cos θ + (m × a) sin θ + a (m·a)(1 - cos θ)``.
    """
    parent, prismatic, mounted = tree.parent, tree.prismatic, tree.rotation
    offset, axis = tree.translation, tree.axis
    for k in range(3):
        position[0, k] = base_position[k]
        for l in range(3):
            rotation[0, k, l] = base_rotation[k, l]
    for i in range(1, parent.shape[0]):
        above, angle, slide = parent[i], angles[i - 1], 0.0
        if prismatic[i]:
            angle, slide = 0.0, angles[i - 1]
        c, s = cos(angle), sin(angle)
        x, y, z = axis[i, 0], axis[i, 1], axis[i, 2]
        for k in range(3):
            u, v, w = rotation[above, k, 0], rotation[above, k, 1], rotation[above, k, 2]
            e = u * mounted[i, 0, 0] + v * mounted[i, 1, 0] + w * mounted[i, 2, 0]
            f = u * mounted[i, 0, 1] + v * mounted[i, 1, 1] + w * mounted[i, 2, 1]
            g = u * mounted[i, 0, 2] + v * mounted[i, 1, 2] + w * mounted[i, 2, 2]
            along = e * x + f * y + g * z
            step = u * offset[i, 0] + v * offset[i, 1] + w * offset[i, 2]
            position[i, k] = position[above, k] + step + along * slide
            along *= 1.0 - c
            rotation[i, k, 0] = c * e + s * (f * z - g * y) + along * x
            rotation[i, k, 1] = c * f + s * (g * x - e * z) + along * y
            rotation[i, k, 2] = c * g + s * (e * y - f * x) + along * z


@jit
def forward(
    tree: Tree, base_rotation: Floats, base_position: Floats, angles: Floats
) -> tuple[Floats, Floats]:
    """Returns the world pose of every body: ``T_i = T_parent · (R_i, t_i) · exp(axis_i angle_i)``.

    Args:
        tree: the robot's n bodies.
        base_rotation: (3, 3) attitude of body 0, columns its axes in the world.
        base_position: (3,) m, origin of body 0.
        angles: (n-1,) rad (m where the joint slides), body 1 first.

    Returns:
        rotation (n, 3, 3) and position (n, 3) [m] of the body frames.
    """
    n = tree.parent.shape[0]
    rotation, position = np.empty((n, 3, 3)), np.empty((n, 3))
    forward_into(tree, base_rotation, base_position, angles, rotation, position)
    return rotation, position


@bare
def weigh(tree: Tree, rotation: Floats, position: Floats) -> tuple[float, Three]:
    """Returns the mass [kg] and the CoG [m, world] of bodies at the given poses."""
    mass, com = tree.mass, tree.com
    total, x, y, z = 0.0, 0.0, 0.0, 0.0
    for i in range(mass.shape[0]):
        arm = turn(rotation, i, read(com, i, 0))
        total += mass[i]
        x += mass[i] * (position[i, 0] + arm[0])
        y += mass[i] * (position[i, 1] + arm[1])
        z += mass[i] * (position[i, 2] + arm[2])
    return total, (x / total, y / total, z / total)


@jit
def centre_of_gravity(tree: Tree, rotation: Floats, position: Floats) -> tuple[float, Floats]:
    """Returns the mass [kg] and the CoG (3,) [m, world] of bodies at the given poses."""
    total, centre = weigh(tree, rotation, position)
    return total, np.array(centre)


@bare
def inertia_into(tree: Tree, rotation: Floats, position: Floats, cog: Floats, out: Floats) -> None:
    """Writes the inertia (3, 3) [kg·m²] about `cog` (3,), world axes: see `mass_properties`."""
    arm, half = scratch(3), scratch((3, 3))
    for a in range(3):
        for b in range(3):
            out[a, b] = 0.0
    for i in range(tree.mass.shape[0]):
        r, m = rotation[i], tree.mass[i]
        turn_into(r, tree.com[i], arm)
        for k in range(3):
            arm[k] += position[i, k] - cog[k]
        square = arm[0] * arm[0] + arm[1] * arm[1] + arm[2] * arm[2]
        matmul_into(r, tree.inertia[i], half)
        for a in range(3):
            out[a, a] += m * square
            for b in range(3):
                turned = half[a, 0] * r[b, 0] + half[a, 1] * r[b, 1] + half[a, 2] * r[b, 2]
                out[a, b] += turned - m * arm[a] * arm[b]


@jit
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
    total, cog = centre_of_gravity(tree, rotation, position)
    inertia = np.empty((3, 3))
    inertia_into(tree, rotation, position, cog, inertia)
    return total, cog, inertia


@bare
def body_twists_into(
    tree: Tree,
    rotation: Floats,
    position: Floats,
    base_linear: Floats,
    base_angular: Floats,
    rates: Floats,
    linear: Floats,
    angular: Floats,
) -> None:
    """Writes the velocities of every body: `body_twists` without its allocation."""
    for k in range(3):
        linear[0, k], angular[0, k] = base_linear[k], base_angular[k]
    for i in range(1, tree.parent.shape[0]):
        above, axis = tree.parent[i], turn(rotation, i, read(tree.axis, i, 0))
        arm = (
            position[i, 0] - position[above, 0],
            position[i, 1] - position[above, 1],
            position[i, 2] - position[above, 2],
        )
        swept = cross(read(angular, above, 0), arm)
        slide = rates[i - 1] if tree.prismatic[i] else 0.0
        spin = 0.0 if tree.prismatic[i] else rates[i - 1]
        for k in range(3):
            linear[i, k] = linear[above, k] + swept[k] + axis[k] * slide
            angular[i, k] = angular[above, k] + axis[k] * spin


@jit
def body_twists(
    tree: Tree,
    rotation: Floats,
    position: Floats,
    base_linear: Floats,
    base_angular: Floats,
    rates: Floats,
) -> tuple[Floats, Floats]:
    """Returns linear (n, 3) [m/s, of body origins] and angular (n, 3) [rad/s] velocities, world.

    Args:
        tree: the robot's n bodies.
        rotation: (n, 3, 3) body attitudes.
        position: (n, 3) m, body origins.
        base_linear: (3,) m/s, of body 0's origin, world axes.
        base_angular: (3,) rad/s, world axes.
        rates: (n-1,) joint rates, rad/s (m/s where the joint slides).
    """
    n = tree.parent.shape[0]
    linear, angular = np.empty((n, 3)), np.empty((n, 3))
    body_twists_into(tree, rotation, position, base_linear, base_angular, rates, linear, angular)
    return linear, angular


@bare
def drift_into(
    tree: Tree, rotation: Floats, linear: Floats, angular: Floats, speed: Floats
) -> None:
    """Writes the CoG velocity (3,) [m/s, world] from `body_twists`' result."""
    total, x, y, z = 0.0, 0.0, 0.0, 0.0
    for i in range(tree.mass.shape[0]):
        out = cross(read(angular, i, 0), turn(rotation, i, read(tree.com, i, 0)))
        mass = tree.mass[i]
        total += mass
        x += mass * (linear[i, 0] + out[0])
        y += mass * (linear[i, 1] + out[1])
        z += mass * (linear[i, 2] + out[2])
    speed[0], speed[1], speed[2] = x / total, y / total, z / total


@jit
def centre_velocity(tree: Tree, rotation: Floats, linear: Floats, angular: Floats) -> Floats:
    """Returns the CoG velocity (3,) [m/s, world] from `body_twists`' result."""
    speed = np.empty(3)
    drift_into(tree, rotation, linear, angular, speed)
    return speed


@jit
def centroidal_motion(
    tree: Tree,
    rotation: Floats,
    position: Floats,
    base_linear: Floats,
    base_angular: Floats,
    rates: Floats,
) -> tuple[Floats, Floats, Floats]:
    """Returns CoG velocity, angular momentum about the CoG, and mean angular velocity.

    ``h = Σ R_i I_i R_iᵀ ω_i + m_i (c_i - c) × (c_i' - c')`` and ``ω_mean = I⁻¹ h``. Rotors count
    as rigid parts of their bodies. Arguments as in `body_twists`.

    Returns:
        cog_velocity (3,) [m/s], momentum (3,) [N·m·s], mean angular velocity (3,) [rad/s]; world.
    """
    linear, angular = body_twists(tree, rotation, position, base_linear, base_angular, rates)
    _, cog, inertia = mass_properties(tree, rotation, position)
    drift = centre_velocity(tree, rotation, linear, angular)
    arm, out, turned = np.empty(3), np.empty(3), np.empty(3)
    momentum, speed = np.zeros(3), np.empty(3)
    for i in range(tree.mass.shape[0]):
        r = rotation[i]
        turn_into(r, tree.com[i], arm)
        cross_into(angular[i], arm, speed)
        for k in range(3):
            speed[k] += linear[i, k] - drift[k]
        turn_back_into(r, angular[i], turned)
        turn_into(tree.inertia[i], turned, out)
        turn_into(r, out, turned)
        turn_into(r, tree.com[i], arm)
        for k in range(3):
            arm[k] += position[i, k] - cog[k]
        cross_into(arm, speed, out)
        for k in range(3):
            momentum[k] += turned[k] + tree.mass[i] * out[k]
    return drift, momentum, np.linalg.solve(inertia, momentum)
