"""From joint angles to everything that margins need, for a batch of postures in one call."""

from typing import NamedTuple

import numpy as np

from snakegen.kernels.allocation.gimbals import mounts, point_thrust
from snakegen.kernels.allocation.wrench_map import dual_into
from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.types import Floats, Gimbals, Ints, Mechanism, Rotors, Tree
from snakegen.kernels.core.vec3 import Three, back, minus, plus, read, turn, write
from snakegen.kernels.kinematics.chain import forward_into, weigh


class PlacedPostures(NamedTuple):
    """What `hover_postures` fills, of m postures; root-link axes and from the CoG, or world."""

    dual: Floats  # (m, 6, n_rotors)
    points: Floats  # (m, Ñ, 3) m
    frames: Floats  # (m, Ñ, 3, 3), axes of what carries each apparatus' gimbals, of `mounts`
    hover: Floats  # (m, 6)
    spine: Floats  # (m, L, 2, 3) m, the segments of the links, world axes
    discs: Floats  # (m, n_rotors, 3) m, rotor centres, world axes


@jit
def hover_postures(
    mechanism: Mechanism,
    limits: tuple[Floats, Floats],
    base: Floats,
    joints: Ints,
    samples: Floats,
    gravity: float,
    segments: tuple[Ints, Floats],
    out: PlacedPostures,
) -> None:
    """Fills the allocation of m postures, every thrust pointed up first; root-link axes, CoG.

    Args:
        mechanism: the robot.
        limits: (n-1,) rad each, lower and upper, of all joints.
        base: (3, 3) attitude of the root link, one for all.
        joints: (k,) indices into the tree's angles of the joints that are sampled.
        samples: (m, k) rad.
        gravity: m/s².
        segments: of the links: (L,) body of each, and (L, 2, 3) m, its ends in that body.
        out: filled.
    """
    tree, rotors, gimbals = mechanism
    low, high = limits
    bodies, ends = segments
    dual, points, frames, hover, spine, discs = out
    n = tree.parent.shape[0]
    rotation, position = np.empty((n, 3, 3)), np.empty((n, 3))
    angles, origin = np.zeros(n - 1), np.zeros(3)
    forward_into(tree, base, origin, angles, rotation, position)
    m, _ = mounts(tree, rotors, gimbals, rotation, position, origin, base)
    for s in range(samples.shape[0]):
        angles[:] = 0.0
        for k in range(joints.shape[0]):
            angles[joints[k]] = samples[s, k]
        forward_into(tree, base, origin, angles, rotation, position)
        _point_up(tree, gimbals, low, high, base, rotation, m, angles)
        forward_into(tree, base, origin, angles, rotation, position)
        mass, cog = weigh(tree, rotation, position)
        dual_into(rotors, rotation, position, cog, base, dual[s])
        for k in range(3):
            hover[s, k] = mass * gravity * base[2, k]
            hover[s, 3 + k] = 0.0
        for j in range(gimbals.thrust_body.shape[0]):
            at = _placed(gimbals.thrust_body[j], gimbals.thrust_point, j, rotation, position)
            arm = minus(at, cog)
            body = gimbals.thrust_body[j]
            still = max(gimbals.roll_body[j], gimbals.pitch_body[j]) < 0
            for k in range(3):
                points[s, j, k] = base[0, k] * arm[0] + base[1, k] * arm[1] + base[2, k] * arm[2]
                for c in range(3):
                    frames[s, j, k, c] = m[j, k, c]
                    if still:  # no gimbal, whose carrier `_point_up` brings up to date
                        frames[s, j, k, c] = 0.0
                        for a in range(3):
                            frames[s, j, k, c] += base[a, k] * rotation[body, a, c]
        for r in range(discs.shape[1]):
            at = _placed(rotors.body[r], rotors.position, r, rotation, position)
            write(discs[s], r, 0, at)
        for i in range(bodies.shape[0]):
            for e in range(2):
                write(spine[s, i], e, 0, _placed(bodies[i], ends[i], e, rotation, position))


@jit
def dual_postures(
    tree: Tree,
    rotors: Rotors,
    base: Floats,
    angles: Floats,
    gravity: float,
    dual: Floats,
    hover: Floats,
) -> None:
    """Fills the dual map (m, 6, n_rotors) and hover wrench (m, 6) of m postures, gimbals as given.

    Args:
        tree, rotors: the robot.
        base: (3, 3) attitude of the root link, one for all.
        angles: (m, n-1) rad, all joints.
        gravity: m/s².
        dual, hover: filled; root-link axes, about the CoG.
    """
    n = tree.parent.shape[0]
    rotation, position, origin = np.empty((n, 3, 3)), np.empty((n, 3)), np.zeros(3)
    for s in range(angles.shape[0]):
        forward_into(tree, base, origin, angles[s], rotation, position)
        mass, cog = weigh(tree, rotation, position)
        dual_into(rotors, rotation, position, cog, base, dual[s])
        for k in range(3):
            hover[s, k] = mass * gravity * base[2, k]
            hover[s, 3 + k] = 0.0


@bare
def _placed(body: int, places: Floats, row: int, rotation: Floats, position: Floats) -> Three:
    """Returns the world place [m] of a row of `places` (…, 3), given in the frame of `body`."""
    return plus(read(position, body, 0), turn(rotation, body, read(places, row, 0)))


@jit
def _point_up(
    tree: Tree,
    gimbals: Gimbals,
    low: Floats,
    high: Floats,
    base: Floats,
    rotation: Floats,
    m: Floats,
    angles: Floats,
) -> None:
    """Sets the gimbals among `angles` so that every thrust points up; `rotation` without them.

    `m` (Ñ, 10, 3) comes from `mounts` at any posture: of it only the attitude of what carries the
    gimbal changes, and is brought up to date here.
    """
    up = np.array((base[2, 0], base[2, 1], base[2, 2]))
    last, lower, upper, found = np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2)
    for j in range(m.shape[0]):
        first = min(gimbals.roll_body[j], gimbals.pitch_body[j])
        second = max(gimbals.roll_body[j], gimbals.pitch_body[j])
        if second < 0:
            continue
        carrier = tree.parent[first] if first >= 0 else tree.parent[second]
        for k in range(3):
            x, y, z = 0.0, 0.0, 0.0
            for a in range(3):
                x += base[a, k] * rotation[carrier, a, 0]
                y += base[a, k] * rotation[carrier, a, 1]
                z += base[a, k] * rotation[carrier, a, 2]
            if first >= 0:
                row = back(tree.rotation, first, (x, y, z))
                x, y, z = row
            m[j, k, 0], m[j, k, 1], m[j, k, 2] = x, y, z
        lower[:], upper[:] = 0.0, 0.0
        if first >= 0:
            lower[0], upper[0] = low[first - 1], high[first - 1]
        lower[1], upper[1] = low[second - 1], high[second - 1]
        point_thrust(m, j, up, last, lower, upper, found)
        if first >= 0:
            angles[first - 1] = found[0]
        angles[second - 1] = found[1]


@bare
def segment_distance(a: Floats, b: Floats, c: Floats, d: Floats) -> float:
    """Returns the least distance [m] between segments a–b and c–d (Ericson's clamped form)."""
    uu = uv = vv = ur = vr = 0.0
    for k in range(3):
        u, v, r = b[k] - a[k], d[k] - c[k], a[k] - c[k]
        uu += u * u
        uv += u * v
        vv += v * v
        ur += u * r
        vr += v * r
    bottom = uu * vv - uv * uv
    s = 0.0
    if bottom > 1e-12 * uu * vv:
        s = min(max((uv * vr - ur * vv) / bottom, 0.0), 1.0)
    t = (uv * s + vr) / vv if vv > 0.0 else 0.0
    if t < 0.0 or t > 1.0:
        t = min(max(t, 0.0), 1.0)
        s = min(max((uv * t - ur) / uu, 0.0), 1.0) if uu > 0.0 else 0.0
    total = 0.0
    for k in range(3):
        gap = a[k] + s * (b[k] - a[k]) - c[k] - t * (d[k] - c[k])
        total += gap * gap
    return float(np.sqrt(total))


@bare
def self_distances(
    spine: Floats,
    discs: Floats,
    rods: Floats,
    radii: Floats,
    owner: Ints,
    out: Floats,
) -> None:
    """Writes the least clearance (m,) [m] of each posture: links as capsules, rotors as balls.

    Neighbouring links are left out, as are a rotor's own link and rotors of one apparatus.

    Args:
        spine: (m, L, 2, 3) m.
        discs: (m, n, 3) m.
        rods: (L,) m, radii of the links.
        radii: (n,) m, radii of the rotors.
        owner: (n,) index of the link that carries the rotor.
        out: (m,), filled; inf where nothing can touch.
    """
    links, rotors = rods.shape[0], radii.shape[0]
    for s in range(spine.shape[0]):
        best = np.inf
        for i in range(links):
            for j in range(i + 2, links):
                gap = segment_distance(
                    spine[s, i, 0], spine[s, i, 1], spine[s, j, 0], spine[s, j, 1]
                )
                best = min(best, gap - rods[i] - rods[j])
        for r in range(rotors):
            for i in range(links):
                if i == owner[r]:
                    continue
                gap = segment_distance(discs[s, r], discs[s, r], spine[s, i, 0], spine[s, i, 1])
                best = min(best, gap - radii[r] - rods[i])
            for t in range(r + 1, rotors):
                if owner[r] == owner[t]:
                    continue
                gap = segment_distance(discs[s, r], discs[s, r], discs[s, t], discs[s, t])
                best = min(best, gap - radii[r] - radii[t])
        out[s] = best
