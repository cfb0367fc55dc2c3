"""Joint torques of states, term by term, in NumPy: the twist matrix transposed times wrenches.

THEORY C, ZS24 eq 11 with its signs mended and all inertia kept:
``τ_i = S_iᵀ Σ_{bodies distal to i} [m a; Iα + ω×Iω + r_c×m a] - S_iᵀ w_ext``, every wrench about
the base origin in world axes. The readable twin of `kernels/dynamics/torque_terms.py`, where the
terms are named.
"""

import numpy as np

from snakegen.base.geometry import Floats, cross
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
        armature: (n-1,) kg·m² (kg where the joint slides), added to each joint's own inertia.
        segment: (n,) the body whose inertia eq 24 gives to each body's joint.
        gravity: (3,) m/s², world, for example (0, 0, -9.81).
        base_rotation: (…, 3, 3) attitude of body 0 in the world.
        angles: (…, n-1) rad (m where the joint slides).
        v: (…, 6 + n-1) base linear and angular velocity in base axes, then joint rates.
        a: (…, 6 + n-1) its time derivative, row by row (Pinocchio's spatial acceleration).
        wrenches: (n, 6) external [force; torque] on each body at its origin, world axes.

    Returns:
        (…, 8, 6 + n-1): rows as `kernels.dynamics.torque_terms.TERMS`; N for base linear, N·m for
        base angular and joints.
    """
    rotation, p = forward(tree, base_rotation, np.zeros(3), angles)
    e, c = _turned(rotation, tree.axis), _turned(rotation, tree.com)
    w, alpha, acceleration = _motion(tree, base_rotation, p, e, v, a)
    inertia = rotation @ tree.inertia @ np.swapaxes(rotation, -1, -2)
    at_com = acceleration + cross(alpha, c)
    at_com[1] += cross(w, cross(w, c))
    mass, none, x = tree.mass[:, None], np.zeros_like(p), p + c
    external = wrenches + none.repeat(2, axis=-1)
    body = [  # (…, n, 6) each: a body's share of every wrench
        _about_base(x, none - mass * gravity, none),
        _about_base(x, mass * at_com[0], none),
        _about_base(x, none, _turned(inertia, alpha[0])),
        _about_base(x, none, cross(w, _turned(inertia, w))),
        _about_base(x, mass * at_com[1], _turned(inertia, alpha[1])),
        -_about_base(p, external[..., :3], external[..., 3:]),
    ]
    turns = np.where(tree.prismatic > 0, 0.0, np.insert(a[..., 6:], 0, 0.0, axis=-1))
    beta = _turned(inertia[..., segment, :, :], e * turns[..., None])  # eq 24: J β
    beta[..., 0, :] = _turned(inertia[..., 0, :, :], alpha[0, ..., 0, :])
    total = np.stack([*body, np.concatenate([none, beta], axis=-1)], axis=-3)  # (…, terms, n, 6)
    for i in range(len(tree.parent) - 1, 0, -1):
        total[..., tree.parent[i], :] += total[..., i, :]
    slides = (tree.prismatic > 0)[:, None]
    linear, angular = np.where(slides, e, cross(p, e)), np.where(slides, 0.0, e)
    columns = np.concatenate([linear, angular], axis=-1)  # S
    out = np.zeros((*angles.shape[:-1], BODY_TERMS + 2, 5 + len(tree.parent)))
    terms, base = [*range(BODY_TERMS), BODY_TERMS + 1], rotation[..., 0, :, :]
    out[..., terms, :3], out[..., terms, 3:6] = (
        total[..., 0, :3] @ base,
        total[..., 0, 3:] @ base,
    )
    out[..., terms, 6:] = np.einsum("...tij,...ij->...ti", total, columns)[..., 1:]
    out[..., BODY_TERMS, 6:] = armature * a[..., 6:]
    return out


def _turned(rotation: Floats, x: Floats) -> Floats:
    """Returns the product of each matrix (…, 3, 3) and vector (…, 3)."""
    return np.asarray(np.einsum("...jk,...k->...j", rotation, x))


def _about_base(x: Floats, force: Floats, moment: Floats) -> Floats:
    """Returns wrenches (…, 6) about the base origin of forces at x (…, 3) and free moments."""
    return np.concatenate([force, cross(x, force) + moment], axis=-1)


def _motion(
    tree: Tree, base_rotation: Floats, p: Floats, e: Floats, v: Floats, a: Floats
) -> tuple[Floats, Floats, Floats]:
    """Carries the motion outwards: ω (…, n, 3), α and origins' acceleration (2, …, n, 3), world.

    α and acceleration are split into what accelerations cause and what velocities cause.
    """
    w, alpha, linear = np.zeros_like(p), np.zeros((2, *p.shape)), np.zeros((2, *p.shape))
    w[..., 0, :] = _turned(base_rotation, v[..., 3:6])
    alpha[0, ..., 0, :] = _turned(base_rotation, a[..., 3:6])
    linear[0, ..., 0, :] = _turned(base_rotation, a[..., :3])  # p̈ = R (v̇ + ω × v), base axes
    linear[1, ..., 0, :] = _turned(base_rotation, cross(v[..., 3:6], v[..., :3]))
    for i, j in enumerate(tree.parent[1:], 1):
        r, axis = p[..., i, :] - p[..., j, :], e[..., i, :]
        rate, rate2, spin = v[..., 5 + i, None], a[..., 5 + i, None], w[..., j, :]
        swept = cross(spin, axis) * rate
        w[..., i, :], alpha[..., i, :] = spin, alpha[..., j, :]
        linear[..., i, :] = linear[..., j, :] + cross(alpha[..., j, :], r)
        linear[1, ..., i, :] += cross(spin, cross(spin, r))
        if tree.prismatic[i]:
            linear[0, ..., i, :] += axis * rate2
            linear[1, ..., i, :] += 2.0 * swept
        else:
            w[..., i, :] += axis * rate
            alpha[0, ..., i, :] += axis * rate2
            alpha[1, ..., i, :] += swept
    return w, alpha, linear
