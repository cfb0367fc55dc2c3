"""Joint torques of any tree, term by term: the twist matrix transposed times the wrenches.

THEORY C, ZS24 eq 11 with its signs mended and all inertia kept:
``τ_i = S_iᵀ Σ_{bodies distal to i} [m a; Iα + ω×Iω + r_c×m a] − S_iᵀ w_ext``. Every wrench is taken
about the base origin in world axes, so sums over the distal bodies need no transport and one
pass out and one pass back are enough: O(n). The base is a free body of six rows in Pinocchio's
order (linear, angular, base axes); a fixed base has zeros there and its caller drops the rows.
Only the base's attitude enters: gravity is uniform and all levers start at the base.
"""

import numpy as np

from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.types import Floats, Ints, Tree
from snakegen.kernels.core.vec3 import (
    Three,
    back,
    cross,
    inner,
    minus,
    plus,
    read,
    times,
    turn,
    write,
)
from snakegen.kernels.kinematics.chain import forward_into

GRAVITY, LINEAR, ANGULAR, GYROSCOPIC, CORIOLIS, EXTERNAL, ARMATURE, SEGMENT = range(8)
TERMS = (
    "gravity",  # -m g
    "linear_inertia",  # m a of accelerations (joints' and base's), velocities left out
    "angular_inertia",  # I α of the same
    "gyroscopic",  # ω × I ω
    "coriolis",  # m a and I α of velocity products: centripetal and Coriolis
    "external",  # -w_ext
    "armature",  # rotor inertia of the servo times its joint's acceleration
    "segment_inertia",  # ZS24 eq 24: J β, a segment's inertia times its own joints' acceleration
)
BODY_TERMS = 6  # the first six are sums of wrenches over bodies
# How deep a torque goes (THEORY C): which terms it sums.
DEPTHS = {
    "static": (GRAVITY, EXTERNAL),
    "quasi_static": (GRAVITY, EXTERNAL, SEGMENT),
    "full": (GRAVITY, LINEAR, ANGULAR, GYROSCOPIC, CORIOLIS, EXTERNAL, ARMATURE),
}


@jit(inline="always")
def _put(W: Floats, i: int, k: int, x: Three, f: Three, moment: Three) -> None:
    """Writes term `k` of body `i`: force `f` acting at `x` and a free moment."""
    m = plus(cross(x, f), moment)
    W[i, k, 0], W[i, k, 1], W[i, k, 2] = f[0], f[1], f[2]
    W[i, k, 3], W[i, k, 4], W[i, k, 5] = m[0], m[1], m[2]


@jit
def _base_motion(base_rotation: Floats, v: Floats, a: Floats, motion: Floats) -> None:
    """Fills row 0 of `motion`. The base's rows are in its own axes: ``p̈ = R (v̇ + ω × v)``."""
    R = base_rotation.reshape(1, 3, 3)
    spin = (v[3], v[4], v[5])
    write(motion, 0, 0, turn(R, 0, spin))
    write(motion, 0, 3, turn(R, 0, (a[3], a[4], a[5])))
    write(motion, 0, 6, (0.0, 0.0, 0.0))
    write(motion, 0, 9, turn(R, 0, (a[0], a[1], a[2])))
    write(motion, 0, 12, turn(R, 0, cross(spin, (v[0], v[1], v[2]))))


@jit
def _move(tree: Tree, p: Floats, e: Floats, v: Floats, a: Floats, motion: Floats) -> None:
    """Carries motion (n, 15) from the base outwards, world axes: [ω, α_a, α_v, a_a, a_v].

    α and the origin's acceleration a are split into what accelerations cause (a) and what
    velocities cause (v).
    """
    # Fields are taken out once, here and below: each access in a loop would count references.
    parent, prismatic = tree.parent, tree.prismatic
    for i in range(1, parent.shape[0]):
        j = parent[i]
        axis, r = read(e, i, 0), minus(read(p, i, 0), read(p, j, 0))
        w, alpha_a, alpha_v = read(motion, j, 0), read(motion, j, 3), read(motion, j, 6)
        a_a = plus(read(motion, j, 9), cross(alpha_a, r))
        a_v = plus(read(motion, j, 12), plus(cross(alpha_v, r), cross(w, cross(w, r))))
        swept, own = times(cross(w, axis), v[5 + i]), times(axis, a[5 + i])
        if prismatic[i]:
            a_a, a_v = plus(a_a, own), plus(a_v, times(swept, 2.0))
        else:
            w, alpha_a = plus(w, times(axis, v[5 + i])), plus(alpha_a, own)
            alpha_v = plus(alpha_v, swept)
        write(motion, i, 0, w)
        write(motion, i, 3, alpha_a)
        write(motion, i, 6, alpha_v)
        write(motion, i, 9, a_a)
        write(motion, i, 12, a_v)


@jit
def _body_wrenches(
    tree: Tree, R: Floats, p: Floats, motion: Floats, gravity: Floats, wrenches: Floats, W: Floats
) -> None:
    """Fills W (n, 6 terms, 6): each body's own share of every wrench, about the base origin."""
    mass, coms, inertia = tree.mass, tree.com, tree.inertia
    g, none = (gravity[0], gravity[1], gravity[2]), (0.0, 0.0, 0.0)
    for i in range(mass.shape[0]):
        m, o, c = mass[i], read(p, i, 0), turn(R, i, read(coms, i, 0))
        w, alpha_a, alpha_v = read(motion, i, 0), read(motion, i, 3), read(motion, i, 6)
        x = plus(o, c)
        a_a = plus(read(motion, i, 9), cross(alpha_a, c))
        a_v = plus(read(motion, i, 12), plus(cross(alpha_v, c), cross(w, cross(w, c))))
        spin = cross(w, _swing(R, inertia, i, w))
        _put(W, i, GRAVITY, x, times(g, -m), none)
        _put(W, i, LINEAR, x, times(a_a, m), none)
        _put(W, i, ANGULAR, x, none, _swing(R, inertia, i, alpha_a))
        _put(W, i, GYROSCOPIC, x, none, spin)
        _put(W, i, CORIOLIS, x, times(a_v, m), _swing(R, inertia, i, alpha_v))
        f, moment = read(wrenches, i, 0), read(wrenches, i, 3)
        _put(W, i, EXTERNAL, o, times(f, -1.0), times(moment, -1.0))


@jit(inline="always")
def _swing(R: Floats, inertia: Floats, i: int, x: Three) -> Three:
    """Returns R I Rᵀ x of body `i`."""
    return turn(R, i, turn(inertia, i, back(R, i, x)))


@jit
def _segment_moments(
    tree: Tree, segment: Ints, R: Floats, e: Floats, a: Floats, motion: Floats, M: Floats
) -> None:
    """Fills M (n, 3): the moment J β of each body's own joint (ZS24 eq 24), world axes.

    J is the inertia of `segment[i]` about its centre of mass, β the joint's own acceleration
    about its axis: the base's acceleration for body 0, nothing for a joint that slides.
    """
    prismatic, inertia = tree.prismatic, tree.inertia
    write(M, 0, 0, _swing(R, inertia, 0, read(motion, 0, 3)))
    for i in range(1, prismatic.shape[0]):
        beta = 0.0 if prismatic[i] else a[5 + i]
        write(M, i, 0, _swing(R, inertia, segment[i], times(read(e, i, 0), beta)))


@jit
def _sum_inwards(
    tree: Tree, R: Floats, p: Floats, e: Floats, W: Floats, M: Floats, out: Floats
) -> None:
    """Sums W and M from the tips to the base and writes S_iᵀ of the sums into `out`."""
    parent, prismatic = tree.parent, tree.prismatic
    for i in range(parent.shape[0] - 1, 0, -1):
        j, axis = parent[i], read(e, i, 0)
        lever = cross(read(p, i, 0), axis)
        out[SEGMENT, 5 + i] = 0.0 if prismatic[i] else inner(axis, read(M, i, 0))
        write(M, j, 0, plus(read(M, j, 0), read(M, i, 0)))
        for k in range(BODY_TERMS):
            f = (W[i, k, 0], W[i, k, 1], W[i, k, 2])
            m = (W[i, k, 3], W[i, k, 4], W[i, k, 5])
            out[k, 5 + i] = inner(axis, f) if prismatic[i] else inner(lever, f) + inner(axis, m)
            for c in range(6):
                W[j, k, c] += W[i, k, c]
    for k in range(BODY_TERMS):  # the base's rows are in its own axes
        for c in range(3):
            out[k, c] = R[0, 0, c] * W[0, k, 0] + R[0, 1, c] * W[0, k, 1] + R[0, 2, c] * W[0, k, 2]
            m = R[0, 0, c] * W[0, k, 3] + R[0, 1, c] * W[0, k, 4] + R[0, 2, c] * W[0, k, 5]
            out[k, 3 + c] = m
    out[SEGMENT, :3] = 0.0
    write(out, SEGMENT, 3, back(R, 0, read(M, 0, 0)))


@jit
def torque_terms_into(
    tree: Tree,
    armature: Floats,
    segment: Ints,
    gravity: Floats,
    state: tuple[Floats, Floats, Floats, Floats],
    wrenches: Floats,
    work: tuple[Floats, Floats, Floats, Floats, Floats, Floats],
    out: Floats,
) -> None:
    """Writes `torque_terms` into `out` (8, 6 + n - 1); `work` from `workspace`.

    `state` has base_rotation, angles, v and a.
    """
    base_rotation, angles, v, a = state
    R, p, e, motion, W, M = work
    axes = tree.axis
    forward_into(tree, base_rotation, np.zeros(3), angles, R, p)
    for i in range(axes.shape[0]):
        write(e, i, 0, turn(R, i, read(axes, i, 0)))
    _base_motion(base_rotation, v, a, motion)
    _move(tree, p, e, v, a, motion)
    _body_wrenches(tree, R, p, motion, gravity, wrenches, W)
    _segment_moments(tree, segment, R, e, a, motion, M)
    _sum_inwards(tree, R, p, e, W, M, out)
    out[ARMATURE, :6] = 0.0
    out[ARMATURE, 6:] = armature * a[6:]


@jit
def workspace(n: int) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats]:
    """Returns the scratch arrays of `torque_terms_into` for `n` bodies."""
    return (
        np.empty((n, 3, 3)),
        np.empty((n, 3)),
        np.empty((n, 3)),
        np.empty((n, 15)),
        np.empty((n, BODY_TERMS, 6)),
        np.empty((n, 3)),
    )


@jit
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
        segment: (n,) the body whose inertia eq 24 gives to each body's joint; itself as a rule,
            both axes of a universal joint name the link beyond it.
        gravity: (3,) m/s², world, for example (0, 0, -9.81).
        base_rotation: (3, 3) attitude of body 0 in the world.
        angles: (n-1,) rad (m where the joint slides).
        v: (6 + n-1,) base linear and angular velocity in base axes, then joint rates.
        a: (6 + n-1,) its time derivative, row by row (Pinocchio's spatial acceleration).
        wrenches: (n, 6) external [force; torque] on each body at its origin, world axes.

    Returns:
        (8, 6 + n-1): rows as `TERMS`; N for base linear, N·m for base angular and joints.
        `DEPTHS` says which rows sum to `static`, `quasi_static` and `full`.
    """
    n = tree.parent.shape[0]
    out = np.empty((8, 5 + n))
    state = (base_rotation, angles, v, a)
    torque_terms_into(tree, armature, segment, gravity, state, wrenches, workspace(n), out)
    return out


@jit
def torque_terms_batch(
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
    """Returns `torque_terms` of m states, (m, 8, 6 + n-1).

    Stacked: base_rotation (m, 3, 3), angles (m, n-1), v and a (m, 6 + n-1). One for all:
    `wrenches` (n, 6).
    """
    n = tree.parent.shape[0]
    work = workspace(n)
    out = np.empty((angles.shape[0], 8, 5 + n))
    for s in range(angles.shape[0]):
        state = (base_rotation[s], angles[s], v[s], a[s])
        torque_terms_into(tree, armature, segment, gravity, state, wrenches, work, out[s])
    return out
