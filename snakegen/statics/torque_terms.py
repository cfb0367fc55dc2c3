"""Joint torques of one state, term by term, in NumPy: the twist matrix transposed times wrenches.

THEORY C, ZS24 eq 11 with its signs mended and all inertia kept:
``τ_i = S_iᵀ Σ_{bodies distal to i} [m a; Iα + ω×Iω + r_c×m a] - S_iᵀ w_ext``, every wrench about
the base origin in world axes. The readable twin of `kernels/dynamics/torque_terms.py`, where the
terms are named.
"""

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.kernels.core.types import Ints, Tree
from snakegen.kernels.dynamics.torque_terms import BODY_TERMS
from snakegen.robot.kinematics import forward


def torque_terms(
    tree: Tree,
    armature: Floats,
    segment: Ints,
    gravity: Floats,
    base_rotation: Floats,
    angles: Floats,
    v: Floats,
    a: Floats,
    wrenches: Floats,
) -> Floats:
    """Returns the generalised forces that balance a motion, term by term (THEORY C; ZN23 eq 6).

    Args:
        tree: the robot's n bodies.
        armature: (n-1,) kg m² (kg where the joint slides), added to each joint's own inertia.
        segment: (n,) the body whose inertia eq 24 gives to each body's joint.
        gravity: (3,) m/s², world, for example (0, 0, -9.81).
        base_rotation: (3, 3) attitude of body 0 in the world.
        angles: (n-1,) rad (m where the joint slides).
        v: (6 + n-1,) base linear and angular velocity in base axes, then joint rates.
        a: (6 + n-1,) its time derivative, row by row (Pinocchio's spatial acceleration).
        wrenches: (n, 6) external [force; torque] on each body at its origin, world axes.

    Returns:
        (8, 6 + n-1): rows as `kernels.dynamics.torque_terms.TERMS`; N for base linear, N m for
        base angular and joints.
    """
    rotation, p = forward(tree, base_rotation, np.zeros(3), angles)
    e = np.einsum("ijk,ik->ij", rotation, tree.axis)
    w, alpha, acceleration = _motion(tree, base_rotation, p, e, v, a)
    inertia = rotation @ tree.inertia @ rotation.transpose(0, 2, 1)
    c = np.einsum("ijk,ik->ij", rotation, tree.com)
    own = np.array([np.einsum("ijk,ik->ij", inertia, x) for x in alpha])  # I α
    at_com = acceleration + np.cross(alpha, c)
    at_com[1] += np.cross(w, np.cross(w, c))
    mass, none = tree.mass[:, None], np.zeros((len(p), 3))
    body = np.array(  # (6 terms, n, 6): each body's share of every wrench
        [
            _about_base(p + c, -mass * gravity, none),
            _about_base(p + c, mass * at_com[0], none),
            _about_base(p + c, none, own[0]),
            _about_base(p + c, none, np.cross(w, np.einsum("ijk,ik->ij", inertia, w))),
            _about_base(p + c, mass * at_com[1], own[1]),
            -_about_base(p, wrenches[:, :3], wrenches[:, 3:]),
        ]
    )
    turns = np.where(tree.prismatic > 0, 0.0, np.concatenate([[0.0], a[6:]]))
    beta = np.einsum("ijk,ik->ij", inertia[segment], e * turns[:, None])  # eq 24: J β
    beta[0] = inertia[0] @ alpha[0, 0]
    total = np.concatenate([body, np.concatenate([none, beta], axis=1)[None]])
    for i in range(len(p) - 1, 0, -1):
        total[:, tree.parent[i]] += total[:, i]
    columns = np.concatenate([np.cross(p, e), e], axis=1)  # S
    slides = tree.prismatic > 0
    columns[slides] = np.concatenate([e, 0.0 * e], axis=1)[slides]
    out = np.zeros((BODY_TERMS + 2, 5 + len(p)))
    terms = [*range(BODY_TERMS), BODY_TERMS + 1]
    out[terms, :3], out[terms, 3:6] = total[:, 0, :3] @ rotation[0], total[:, 0, 3:] @ rotation[0]
    out[terms, 6:] = np.einsum("tij,ij->ti", total, columns)[:, 1:]
    out[BODY_TERMS, 6:] = armature * a[6:]
    return out


def _about_base(x: Floats, force: Floats, moment: Floats) -> Floats:
    """Returns wrenches (n, 6) about the base origin of forces at x (n, 3) and free moments."""
    return np.concatenate([force, np.cross(x, force) + moment], axis=1)


def _motion(
    tree: Tree, base_rotation: Floats, p: Floats, e: Floats, v: Floats, a: Floats
) -> tuple[Floats, Floats, Floats]:
    """Carries the motion outwards: ω (n, 3), α and the origins' acceleration (2, n, 3), world.

    α and acceleration are split into what accelerations cause and what velocities cause.
    """
    n = len(p)
    w, alpha, linear = np.zeros((n, 3)), np.zeros((2, n, 3)), np.zeros((2, n, 3))
    w[0], alpha[0, 0] = base_rotation @ v[3:6], base_rotation @ a[3:6]
    linear[0, 0] = base_rotation @ a[:3]  # p̈ = R (v̇ + ω × v), v in base axes
    linear[1, 0] = base_rotation @ np.cross(v[3:6], v[:3])
    for i, j in enumerate(tree.parent[1:], 1):
        r, rate, rate2 = p[i] - p[j], v[5 + i], a[5 + i]
        swept = np.cross(w[j], e[i]) * rate
        w[i], alpha[:, i] = w[j], alpha[:, j]
        linear[:, i] = linear[:, j] + np.cross(alpha[:, j], r)
        linear[1, i] += np.cross(w[j], np.cross(w[j], r))
        if tree.prismatic[i]:
            linear[0, i] += e[i] * rate2
            linear[1, i] += 2.0 * swept
        else:
            w[i] = w[j] + e[i] * rate
            alpha[0, i] = alpha[0, j] + e[i] * rate2
            alpha[1, i] = alpha[1, j] + swept
    return w, alpha, linear
