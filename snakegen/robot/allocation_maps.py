"""Q in its kinds and J_w of one posture, in NumPy (ZN23 eqs 7-14, 34-35, 42-45; THEORY A2).

Wrenches are ``[force; torque]`` about the CoG in the given axes. A rotor pushes along u at p and
drags its body by c per newton, c = -κ s: ``w = [u; p × u + c u]``. Each function is the readable
twin of a kernel in `kernels/allocation/wrench_map.py` and agrees with it to round-off.
"""

import numpy as np

from snakegen.base.geometry import Floats, cross
from snakegen.kernels.core.types import Gimbals, Rotors, Tree
from snakegen.robot.kinematics import centre_of_gravity


def rotor_frames(
    rotors: Rotors, rotation: Floats, position: Floats, cog: Floats, axes: Floats
) -> tuple[Floats, Floats]:
    """Returns rotor positions from the CoG (n, 3) [m] and unit thrust directions (n, 3) in `axes`.

    ``p = Aᵀ (o_b + R_b r - c)``, ``u = Aᵀ R_b e`` for a rotor at r, thrust axis e, on body b.
    """
    at, turn = position[rotors.body], rotation[rotors.body]
    points = at + np.einsum("rij,rj->ri", turn, rotors.position) - cog
    return points @ axes, np.einsum("rij,rj->ri", turn, rotors.axis) @ axes


def dual_map(rotors: Rotors, points: Floats, directions: Floats) -> Floats:
    """Returns the map (6, n) from rotor thrusts [N] to the wrench: eqs 7-10."""
    drag = rotors.torque_ratio[:, None] * directions
    return np.hstack([directions, cross(points, directions) + drag]).T.copy()


def sharing(rotors: Rotors, apparatuses: int) -> Floats:
    """Returns (n, Ñ): an apparatus' thrust is shared equally by its rotors."""
    mine = rotors.apparatus[:, None] == np.arange(apparatuses)
    return mine / np.maximum(mine.sum(axis=0), 1)


def virtual_map(rotors: Rotors, dual: Floats, apparatuses: int) -> Floats:
    """Returns the map (6, Ñ) from apparatus thrusts [N] to the wrench: eq 14, the rotors' mean."""
    return dual @ sharing(rotors, apparatuses)


def thrust_points(
    gimbals: Gimbals, rotation: Floats, position: Floats, cog: Floats, axes: Floats
) -> Floats:
    """Returns the points (Ñ, 3) [m] where apparatus forces act, from the CoG in `axes`."""
    body = gimbals.thrust_body
    arm = np.einsum("jab,jb->ja", rotation[body], gimbals.thrust_point)
    return np.ascontiguousarray((position[body] + arm - cog) @ axes)


def link_axes(gimbals: Gimbals, rotation: Floats, axes: Floats) -> Floats:
    """Returns the attitude (Ñ, 3, 3) of each apparatus' link axes L in `axes`."""
    return np.asarray(axes.T @ rotation[gimbals.link_body] @ gimbals.link_rotation)


def mean_drag(rotors: Rotors, apparatuses: int) -> Floats:
    """Returns the mean torque ratio (Ñ,) [m] of each apparatus' rotors."""
    return np.asarray(rotors.torque_ratio @ sharing(rotors, apparatuses))


def force_map(points: Floats, frames: Floats, drag: Floats) -> Floats:
    """Returns the map (6, 3Ñ) from forces in link axes to the wrench: ``[E; p× + c E] R_L``.

    Eqs 34-35; c is the mean torque ratio of the apparatus' rotors, 0 for a counter-rotating pair.

    Args:
        points: (Ñ, 3) m, points of application from the CoG.
        frames: (Ñ, 3, 3) link axes, from `link_axes`.
        drag: (Ñ,) m, from `mean_drag`.
    """
    moment = np.cross(points[:, :, None], frames, axisa=1, axisb=1, axisc=1)
    blocks = np.concatenate([frames, moment + drag[:, None, None] * frames], axis=1)
    return blocks.transpose(1, 0, 2).reshape(6, -1).copy()


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

    A gimbal joint with axis a through o turns its rotors: ``∂u = a × u``, ``∂p = a × (p - o)``,
    ``∂w = λ [∂u; ∂p × u + p × ∂u + c ∂u]``. The CoG is held fixed. A joint that is absent leaves
    a column of zeros.
    """
    n = len(gimbals.link_body)
    p, u = rotor_frames(rotors, rotation, position, cog, axes)
    shared = sharing(rotors, n)
    columns = [virtual_map(rotors, dual_map(rotors, p, u), n)]
    for joint in (gimbals.roll_body, gimbals.pitch_body):
        body = joint[rotors.apparatus]
        a = np.einsum("rij,rj->ri", rotation[body], tree.axis[body]) @ axes
        du = cross(a, u) * (body >= 0)[:, None]
        dp = cross(a, p - (position[body] - cog) @ axes) * (body >= 0)[:, None]
        moment = cross(dp, u) + cross(p, du) + rotors.torque_ratio[:, None] * du
        columns.append(np.hstack([du, moment]).T @ (shared * thrust))
    return np.hstack(columns)


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
        rotation: (n, 3, 3) world attitudes of the bodies, from `kinematics.forward`.
        position: (n, 3) m, world origins of the bodies.
        axes: (3, 3) attitude of the CoG frame in the world: ``rotation[0]`` for the root link's
            axes, another body's for that link's.
        thrust: (Ñ,) N, apparatus thrusts; they matter to the last result alone.

    Returns:
        rotor_positions (n, 3) [m], rotor_axes (n, 3), dual (6, n), virtual (6, Ñ),
        force (6, 3Ñ), jacobian (6, 3Ñ) with columns [all λ | all φ | all θ].
    """
    n = len(gimbals.link_body)
    _, cog = centre_of_gravity(tree, rotation, position)
    points, directions = rotor_frames(rotors, rotation, position, cog, axes)
    dual = dual_map(rotors, points, directions)
    acting = thrust_points(gimbals, rotation, position, cog, axes)
    force = force_map(acting, link_axes(gimbals, rotation, axes), mean_drag(rotors, n))
    jacobian = jacobian_map(tree, rotors, gimbals, rotation, position, cog, axes, thrust)
    return points, directions, dual, virtual_map(rotors, dual, n), force, jacobian
