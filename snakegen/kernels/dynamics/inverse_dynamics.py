"""Joint torques of any tree as one sum, at the speed of a sweep: no terms, no world axes.

The same law as `dynamics` (THEORY C), carried in each body's own axes: out with velocities and
accelerations, back with forces (recursive Newton-Euler). Gravity enters as an acceleration of the
base. It is a second way to the same number, so each holds the other in the tests.
"""

import math
from typing import NamedTuple

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


class Loads(NamedTuple):
    """k external wrenches that keep their direction in the world while their body moves."""

    body: Ints  # (k,) the body that carries it
    point: Floats  # (k, 3) m, where it acts, body frame
    wrench: Floats  # (k, 6) [force; torque about that point], world axes


NO_LOADS = Loads(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 6)))


@jit(inline="always")
def _joint_rotation(mount: Floats, i: int, axis: Three, angle: float, out: Floats) -> None:
    """Writes out[i] = mount[i] · exp(axis angle): the body's axes in its parent's."""
    s, c = math.sin(angle), math.cos(angle)
    for r in range(3):  # row · exp(k) = c row + s (row × k) + (1 - c) (row · k) k
        x, y, z = mount[i, r, 0], mount[i, r, 1], mount[i, r, 2]
        d = (1.0 - c) * (x * axis[0] + y * axis[1] + z * axis[2])
        out[i, r, 0] = c * x + s * (y * axis[2] - z * axis[1]) + d * axis[0]
        out[i, r, 1] = c * y + s * (z * axis[0] - x * axis[2]) + d * axis[1]
        out[i, r, 2] = c * z + s * (x * axis[1] - y * axis[0]) + d * axis[2]


@jit(fastmath={"contract"})
def _outwards(
    tree: Tree,
    angles: Floats,
    v: Floats,
    a: Floats,
    s: int,
    E: Floats,
    lever: Floats,
    motion: Floats,
) -> None:
    """Carries ω, α and the origin's acceleration (motion (n, 9), body axes) from the base outwards.

    Writes each body's axes E and origin `lever` in its parent's axes too.
    """
    # Fields are taken out once: each access inside the loop would count references.
    parent, prismatic, mount = tree.parent, tree.prismatic, tree.rotation
    translation, axes = tree.translation, tree.axis
    for i in range(1, parent.shape[0]):
        j, slides = parent[i], prismatic[i]
        angle, rate, rate2 = angles[s, i - 1], v[s, 5 + i], a[s, 5 + i]
        axis, t = read(axes, i, 0), read(translation, i, 0)
        w, alpha, acc = read(motion, j, 0), read(motion, j, 3), read(motion, j, 6)
        if slides:
            E[i] = mount[i]
            t = plus(t, times(turn(mount, i, axis), angle))
        else:
            _joint_rotation(mount, i, axis, angle, E)
        write(lever, i, 0, t)
        acc = plus(acc, plus(cross(alpha, t), cross(w, cross(w, t))))
        w, alpha, acc = back(E, i, w), back(E, i, alpha), back(E, i, acc)
        swept = times(cross(w, axis), rate)
        if slides:
            acc = plus(acc, plus(times(axis, rate2), times(swept, 2.0)))
        else:
            alpha = plus(alpha, plus(times(axis, rate2), swept))
            w = plus(w, times(axis, rate))
        write(motion, i, 0, w)
        write(motion, i, 3, alpha)
        write(motion, i, 6, acc)


@jit(fastmath={"contract"})
def _newton_euler(tree: Tree, motion: Floats, force: Floats) -> None:
    """Writes [force; moment about its origin] (n, 6) of each body, its own axes, from `motion`."""
    mass, coms, inertia = tree.mass, tree.com, tree.inertia
    for i in range(mass.shape[0]):
        w, alpha, com = read(motion, i, 0), read(motion, i, 3), read(coms, i, 0)
        a = plus(read(motion, i, 6), plus(cross(alpha, com), cross(w, cross(w, com))))
        f = times(a, mass[i])
        spin = cross(w, turn(inertia, i, w))
        write(force, i, 0, f)
        write(force, i, 3, plus(plus(turn(inertia, i, alpha), spin), cross(com, f)))


@jit(fastmath={"contract"})
def _inwards(
    tree: Tree,
    armature: Floats,
    a: Floats,
    s: int,
    E: Floats,
    lever: Floats,
    force: Floats,
    out: Floats,
) -> None:
    """Sums `force` from the tips to the base and writes each joint's share into out[s]."""
    parent, prismatic, axes = tree.parent, tree.prismatic, tree.axis
    for i in range(parent.shape[0] - 1, 0, -1):
        j = parent[i]
        axis, f, m = read(axes, i, 0), read(force, i, 0), read(force, i, 3)
        x = f if prismatic[i] else m
        own = armature[i - 1] * a[s, 5 + i]
        out[s, 5 + i] = inner(axis, x) + own
        f = turn(E, i, f)
        m = plus(turn(E, i, m), cross(read(lever, i, 0), f))
        write(force, j, 0, plus(read(force, j, 0), f))
        write(force, j, 3, plus(read(force, j, 3), m))
    for k in range(6):
        out[s, k] = force[0, k]


@jit(fastmath={"contract"})
def _start(
    gravity: Floats, base_rotation: Floats, v: Floats, a: Floats, s: int, motion: Floats
) -> None:
    """Writes the base's motion: ``p̈ = v̇ + ω × v - Rᵀ g`` in its own axes."""
    w = read(v, s, 3)
    g = back(base_rotation, s, (-gravity[0], -gravity[1], -gravity[2]))
    write(motion, 0, 0, w)
    write(motion, 0, 3, read(a, s, 3))
    write(motion, 0, 6, plus(plus(read(a, s, 0), cross(w, read(v, s, 0))), g))


@jit
def _subtract_loads(
    tree: Tree, base_rotation: Floats, E: Floats, loads: Loads, R: Floats, force: Floats
) -> None:
    """Takes the external wrenches from `force`."""
    parent, body, point, wrench = tree.parent, loads.body, loads.point, loads.wrench
    R[0] = base_rotation
    for i in range(1, parent.shape[0]):
        for r in range(3):
            row = R[parent[i], r]
            R[i, r, 0], R[i, r, 1], R[i, r, 2] = back(E, i, (row[0], row[1], row[2]))
    for k in range(body.shape[0]):
        i = body[k]
        f, m = back(R, i, read(wrench, k, 0)), back(R, i, read(wrench, k, 3))
        m = plus(m, cross(read(point, k, 0), f))
        write(force, i, 0, minus(read(force, i, 0), f))
        write(force, i, 3, minus(read(force, i, 3), m))


@jit
def torques_batch(
    tree: Tree,
    armature: Floats,
    gravity: Floats,
    base_rotation: Floats,
    angles: Floats,
    v: Floats,
    a: Floats,
    loads: Loads,
) -> Floats:
    """Returns the generalised forces of m states, (m, 6 + n-1): THEORY C's law as one sum.

    With v = a = 0 it is the `static` depth. A fixed base reads columns 6 on.

    Args:
        tree: the robot's n bodies.
        armature: (n-1,) kg·m², added to each joint's own inertia.
        gravity: (3,) m/s², world.
        base_rotation: (m, 3, 3) attitude of body 0 in the world.
        angles: (m, n-1) rad (m where the joint slides).
        v: (m, 6 + n-1) base linear and angular velocity in base axes, then joint rates.
        a: (m, 6 + n-1) its time derivative.
        loads: external wrenches, the same for every state; `NO_LOADS` for none.
    """
    n, m = tree.parent.shape[0], angles.shape[0]
    E, lever, R = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, 3, 3))
    motion, force, out = np.empty((n, 9)), np.empty((n, 6)), np.empty((m, 5 + n))
    loaded = loads.body.shape[0] > 0
    for s in range(m):
        _start(gravity, base_rotation, v, a, s, motion)
        _outwards(tree, angles, v, a, s, E, lever, motion)
        _newton_euler(tree, motion, force)
        if loaded:
            _subtract_loads(tree, base_rotation[s], E, loads, R, force)
        _inwards(tree, armature, a, s, E, lever, force, out)
    return out
