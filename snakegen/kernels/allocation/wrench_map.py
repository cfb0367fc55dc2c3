"""Allocation matrices on plain arrays (ZN23 eqs 7-14, 34-35, 42-45; THEORY A2).

Wrenches are ``[force; torque]`` about the CoG in the given axes. Every matrix comes from world
joint axes and origins, so any gimbal order, gimbal axis and rotor axis is served. A rotor pushes
along u at p and drags its body by c per newton, c = -κ s: ``w = [u; p × u + c u]``.
"""

import numpy as np

from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.mat3 import cross_into, turn_back_into, turn_into
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.types import Floats, Gimbals, Rotors, Tree
from snakegen.kernels.core.vec3 import Three, cross, minus, plus, read, times, turn
from snakegen.kernels.kinematics.chain import centre_of_gravity


@jit
def rotor_frames(
    rotors: Rotors, rotation: Floats, position: Floats, cog: Floats, axes: Floats
) -> tuple[Floats, Floats]:
    """Returns rotor positions from the CoG (n, 3) [m] and unit thrust directions (n, 3) in `axes`.

    Args:
        rotors: the robot's n rotors.
        rotation: world attitudes of the bodies, from `chain.forward`.
        position: m, world origins of the bodies.
        cog: (3,) m, world.
        axes: (3, 3) attitude of the CoG frame in the world.
    """
    n = rotors.body.shape[0]
    points, directions = np.empty((n, 3)), np.empty((n, 3))
    step = np.empty(3)
    for r in range(n):
        body = rotors.body[r]
        turn_into(rotation[body], rotors.position[r], step)
        for k in range(3):
            step[k] += position[body, k] - cog[k]
        turn_back_into(axes, step, points[r])
        turn_into(rotation[body], rotors.axis[r], step)
        turn_back_into(axes, step, directions[r])
    return points, directions


@jit
def dual_map(rotors: Rotors, points: Floats, directions: Floats) -> Floats:
    """Returns the map (6, n) from rotor thrusts [N] to the wrench: eqs 7-10.

    Args:
        rotors: the robot's n rotors (for their torque ratio).
        points: (n, 3) m, rotor positions from the CoG.
        directions: (n, 3) unit thrust directions.
    """
    n = points.shape[0]
    q, moment = np.empty((6, n)), np.empty(3)
    for r in range(n):
        cross_into(points[r], directions[r], moment)
        for k in range(3):
            q[k, r] = directions[r, k]
            q[3 + k, r] = moment[k] + rotors.torque_ratio[r] * directions[r, k]
    return q


@bare
def dual_into(
    rotors: Rotors, rotation: Floats, position: Floats, cog: Three, axes: Floats, q: Floats
) -> None:
    """Writes the map (6, n) from rotor thrusts [N] to the wrench (eqs 7-10), straight from poses.

    Args:
        rotors: the robot's n rotors.
        rotation, position: (n, 3, 3) and (n, 3) [m], poses of the bodies in the world.
        cog: m, world.
        axes: (3, 3) attitude of the CoG frame in the world.
        q: (6, n), filled.
    """
    body, place, axis, ratio = rotors.body, rotors.position, rotors.axis, rotors.torque_ratio
    for r in range(body.shape[0]):
        b = body[r]
        arm = minus(plus(read(position, b, 0), turn(rotation, b, read(place, r, 0))), cog)
        push = turn(rotation, b, read(axis, r, 0))
        moment = plus(cross(arm, push), times(push, ratio[r]))
        for k in range(3):
            x, y, z = axes[0, k], axes[1, k], axes[2, k]
            q[k, r] = x * push[0] + y * push[1] + z * push[2]
            q[3 + k, r] = x * moment[0] + y * moment[1] + z * moment[2]


@jit
def rotor_counts(rotors: Rotors, apparatuses: int) -> Floats:
    """Returns how many rotors each of the `apparatuses` carries, as floats."""
    count = np.zeros(apparatuses)
    for r in range(rotors.apparatus.shape[0]):
        count[rotors.apparatus[r]] += 1.0
    return count


@jit
def virtual_map(rotors: Rotors, dual: Floats, apparatuses: int) -> Floats:
    """Returns the map (6, Ñ) from apparatus thrusts [N] shared equally by its rotors: eq 14.

    The column is the mean of the rotors' columns; the drag of a counter-rotating pair cancels.
    """
    count = rotor_counts(rotors, apparatuses)
    q = np.zeros((6, apparatuses))
    for r in range(dual.shape[1]):
        j = rotors.apparatus[r]
        for k in range(6):
            q[k, j] += dual[k, r] / count[j]
    return q


@jit
def thrust_points(
    gimbals: Gimbals, rotation: Floats, position: Floats, cog: Floats, axes: Floats
) -> Floats:
    """Returns the points (Ñ, 3) [m] where apparatus forces act, from the CoG in `axes`."""
    n = gimbals.thrust_body.shape[0]
    points, step = np.empty((n, 3)), np.empty(3)
    for j in range(n):
        body = gimbals.thrust_body[j]
        turn_into(rotation[body], gimbals.thrust_point[j], step)
        for k in range(3):
            step[k] += position[body, k] - cog[k]
        turn_back_into(axes, step, points[j])
    return points


@jit
def link_axes(gimbals: Gimbals, rotation: Floats, axes: Floats) -> Floats:
    """Returns the attitude (Ñ, 3, 3) of each apparatus' link axes L in `axes`."""
    n = gimbals.link_body.shape[0]
    result = np.empty((n, 3, 3))
    for j in range(n):
        world = rotation[gimbals.link_body[j]]
        for a in range(3):
            for b in range(3):
                total = 0.0
                for k in range(3):
                    for l in range(3):
                        total += axes[k, a] * world[k, l] * gimbals.link_rotation[j, l, b]
                result[j, a, b] = total
    return result


@jit
def force_map(points: Floats, frames: Floats, drag: Floats) -> Floats:
    """Returns the map (6, 3Ñ) from forces in link axes to the wrench: ``[E; p× + c E] R_L``.

    Eqs 34-35; c is the mean torque ratio of the apparatus' rotors, 0 for a counter-rotating pair:
    the drag of a single rotor turns with its thrust.

    Args:
        points: (Ñ, 3) m, points of application from the CoG.
        frames: (Ñ, 3, 3) link axes, from `link_axes`.
        drag: (Ñ,) m, from `mean_drag`.
    """
    n = points.shape[0]
    q, direction, moment = np.empty((6, 3 * n)), np.empty(3), np.empty(3)
    for j in range(n):
        for c in range(3):
            for k in range(3):
                direction[k] = frames[j, k, c]
            cross_into(points[j], direction, moment)
            for k in range(3):
                q[k, 3 * j + c] = direction[k]
                q[3 + k, 3 * j + c] = moment[k] + drag[j] * direction[k]
    return q


@jit
def mean_drag(rotors: Rotors, apparatuses: int) -> Floats:
    """Returns the mean torque ratio (Ñ,) [m] of each apparatus' rotors."""
    count = rotor_counts(rotors, apparatuses)
    drag = np.zeros(apparatuses)
    for r in range(rotors.apparatus.shape[0]):
        drag[rotors.apparatus[r]] += rotors.torque_ratio[r] / count[rotors.apparatus[r]]
    return drag


@jit
def jacobian_map(
    tree: Tree,
    rotors: Rotors,
    gimbals: Gimbals,
    rotation: Floats,
    position: Floats,
    cog: Floats,
    axes: Floats,
    thrust: Floats,
) -> Floats:
    """Returns ``J_w = ∂w/∂(λ, φ, θ)`` (6, 3Ñ), columns [all λ | all φ | all θ]: eqs 42-45.

    A gimbal joint with world axis a through o moves its rotors: ``∂u = a × u``, and, left out in
    a model with o = 0, ``∂p = a × (p - o)``. The CoG is held fixed. A joint that is absent leaves
    a column of zeros.

    Args:
        tree: the bodies; the joints' axes are taken from it.
        rotors: the rotors.
        gimbals: the Ñ apparatuses.
        rotation: world attitudes of the bodies.
        position: m, world origins of the bodies.
        cog: (3,) m, world.
        axes: (3, 3) attitude of the CoG frame in the world.
        thrust: (Ñ,) N, thrust of each apparatus, shared equally by its rotors.
    """
    n = gimbals.link_body.shape[0]
    points, directions = rotor_frames(rotors, rotation, position, cog, axes)
    count = rotor_counts(rotors, n)
    jacobian = np.zeros((6, 3 * n))
    jacobian[:, :n] = virtual_map(rotors, dual_map(rotors, points, directions), n)
    arm, axis, origin = np.empty(3), np.empty(3), np.empty(3)
    du, dp, first, second = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for r in range(rotors.apparatus.shape[0]):
        j = rotors.apparatus[r]
        share = thrust[j] / count[j]
        for kind in range(2):
            body = gimbals.roll_body[j] if kind == 0 else gimbals.pitch_body[j]
            if body < 0:
                continue
            column = (1 + kind) * n + j
            turn_into(rotation[body], tree.axis[body], arm)
            turn_back_into(axes, arm, axis)
            for k in range(3):
                arm[k] = position[body, k] - cog[k]
            turn_back_into(axes, arm, origin)
            cross_into(axis, directions[r], du)
            for k in range(3):
                arm[k] = points[r, k] - origin[k]
            cross_into(axis, arm, dp)
            cross_into(dp, directions[r], first)
            cross_into(points[r], du, second)
            for k in range(3):
                jacobian[k, column] += share * du[k]
                jacobian[3 + k, column] += share * (
                    first[k] + second[k] + rotors.torque_ratio[r] * du[k]
                )
    return jacobian


@jit
def wrench_maps(
    tree: Tree,
    rotors: Rotors,
    gimbals: Gimbals,
    rotation: Floats,
    position: Floats,
    axes: Floats,
    thrust: Floats,
) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats]:
    """Returns everything about allocation at one posture.

    Args:
        tree, rotors, gimbals: the robot.
        rotation: (n, 3, 3) world attitudes of the bodies, from `chain.forward`.
        position: (n, 3) m, world origins of the bodies.
        axes: (3, 3) attitude of the CoG frame in the world: ``rotation[0]`` for the root link's
            axes, another body's for that link's.
        thrust: (Ñ,) N, apparatus thrusts; they matter to the last result alone.

    Returns:
        rotor_positions (n, 3) [m], rotor_axes (n, 3), dual (6, n), virtual (6, Ñ),
        force (6, 3Ñ), jacobian (6, 3Ñ) with columns [all λ | all φ | all θ].
    """
    n = gimbals.link_body.shape[0]
    _, cog = centre_of_gravity(tree, rotation, position)
    points, directions = rotor_frames(rotors, rotation, position, cog, axes)
    dual = dual_map(rotors, points, directions)
    virtual = virtual_map(rotors, dual, n)
    acting = thrust_points(gimbals, rotation, position, cog, axes)
    force = force_map(acting, link_axes(gimbals, rotation, axes), mean_drag(rotors, n))
    jacobian = jacobian_map(tree, rotors, gimbals, rotation, position, cog, axes, thrust)
    return points, directions, dual, virtual, force, jacobian
