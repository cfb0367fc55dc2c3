"""What the layout of rotors says of them: spins, gimbals that lose an axis, thrusts all ways."""

from collections.abc import Sequence

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.linter.finding import numbers
from snakegen.robot.adoption.rotor_evidence import RotorCandidate, UrdfTree

_DRAG = 0.02  # m, by which spins count in the rank of the torques


def point_all_ways(
    tree: UrdfTree, found: Sequence[RotorCandidate], tilted: dict[str, tuple[str, ...]]
) -> bool:
    """Tells whether fixed rotors point all ways: no direction is much weaker than another."""
    if any(tilted.values()):
        return False
    own = [np.array([0.0, 0.0, 1.0]) if c.shaft is None else c.shaft.axis for c in found]
    turned = [tree.poses[c.link][:3, :3] @ a for c, a in zip(found, own, strict=True)]
    sigma = np.linalg.svd(np.array(turned), compute_uv=False)
    return len(turned) >= 6 and bool(sigma[-1] > 0.5 * sigma[0])


def loses_an_axis(
    tree: UrdfTree,
    found: Sequence[RotorCandidate],
    tilted: dict[str, tuple[str, ...]],
    points: Floats,
    thrusts: Floats,
    spins: Sequence[float],
) -> bool:
    """Tells whether free gimbals command fewer than six axes, and held ones hover and turn.

    Args:
        tree: the robot.
        found: n rotors.
        tilted: links of the gimbals that turn each, by the rotor's link.
        points: (n, 3) m, where they push, world axes.
        thrusts: (n, 3) directions of thrust, likewise.
        spins: +1 counter-clockwise, −1.
    """
    held, free = [], []
    for c, point, thrust, spin in zip(found, points, thrusts, spins, strict=True):
        arm = point - points.mean(axis=0)
        held.append(np.r_[thrust, np.cross(arm, thrust) - _DRAG * spin * thrust])
        free.append(held[-1])
        for link in tilted[c.link]:
            axis = numbers(tree.above[link].find("axis"), "xyz", 3) or (1.0, 0.0, 0.0)
            turned = np.cross(tree.poses[link][:3, :3] @ np.array(axis), thrust)
            free.append(np.r_[turned, np.cross(arm, turned)])
    if len(free) == len(held):
        return False  # no gimbals: that mode already
    ranks = [int(np.linalg.matrix_rank(np.array(rows), tol=1e-3)) for rows in (free, held)]
    return ranks[0] < 6 and ranks[1] >= 4


def alternating_spins(gimbals: Sequence[tuple[str, ...]], points: Floats) -> list[float]:
    """Returns spins that alternate: within a pair, over levels, and around the centre.

    Args:
        gimbals: links of the gimbals that turn each of n rotors; those of the same make a pair.
        points: (n, 3) m, where they push.
    """
    out = [0.0] * len(points)
    groups: dict[tuple[str, ...], list[int]] = {}
    for k, links in enumerate(gimbals):
        groups.setdefault(links, []).append(k)
    for links, members in groups.items():
        if links and len(members) > 1:
            for n, k in enumerate(members):
                out[k] = 1.0 if n % 2 == 0 else -1.0
    rest = [k for k in range(len(points)) if out[k] == 0.0]
    centre = points[rest].mean(axis=0) if rest else np.zeros(3)
    away = points[rest] - centre
    angle = np.round(np.arctan2(away[:, 1], away[:, 0]), 6)
    order = sorted(range(len(rest)), key=lambda i: (angle[i], -away[i, 2]))
    stacks: list[list[int]] = []
    for i in order:  # rotors on one vertical are a coaxial pair
        stack = stacks[-1] if stacks else None
        if stack and np.linalg.norm((away[i] - away[stack[0]])[:2]) < 1e-3:
            stack.append(i)
        else:
            stacks.append([i])
    for n, stack in enumerate(stacks):
        for level, i in enumerate(stack):
            out[rest[i]] = 1.0 if (n + level) % 2 == 0 else -1.0
    return out
