"""Where cables run: three or more a segment, round the rod, through the segments before."""

import re
from dataclasses import dataclass

import numpy as np

from snakegen.errors import AnalysisError
from snakegen.kernels.cables.cables import Holes
from snakegen.kernels.core.types import Ints
from snakegen.robot.robot import Robot

_GROUP = re.compile(r"(joint\d+)_(?:pitch|yaw|roll)")


@dataclass(frozen=True)
class Routing:
    """Where cables run.

    Attributes:
        holes: on flat arrays, for the kernels.
        segments: (K,) joint names of each segment, base first.
        columns: (K,) indices of each segment's cables.
        names: (c,) ``cable2_3`` is the third cable of segment 2.
        coupled: whether they run through the segments before.
    """

    holes: Holes
    segments: tuple[tuple[str, ...], ...]
    columns: tuple[Ints, ...]
    names: tuple[str, ...]
    coupled: bool


def route(
    robot: Robot,
    *,
    count: int = 3,
    radius: float = 0.03,
    phase: float = 0.0,
    standoff: float = 0.02,
    coupled: bool = True,
) -> Routing:
    """Returns `count` cables a segment, round the rod, with a hole on each side of every joint.

    Cables of segment k stand 2π/(count·K) further round than those of the segment before, so that
    no two share a hole.

    Args:
        robot: an arm whose rods lie along its links' x.
        count: cables a segment, three or more: two cannot pull a joint of two axes both ways.
        radius: m, of the circle of holes.
        phase: rad, of the first hole from y towards z.
        standoff: m, from a joint's centre to the holes on either side of it.
        coupled: whether cables run through the segments before; else each starts at its own joint,
            in a sheath up to there.

    Raises:
        AnalysisError: fewer than three cables, sizes that are not positive, no chain joint.
    """
    if isinstance(count, bool) or not isinstance(count, int) or count < 3:
        raise AnalysisError(f"count = {count}: three cables a segment or more are needed.")
    if not (radius > 0 and standoff > 0 and np.isfinite([radius, standoff, phase]).all()):
        raise AnalysisError("radius and standoff above 0 and a finite phase are needed.")
    groups = _groups(robot)
    if not groups:
        raise AnalysisError(f"{robot.name} has no chain joint for a cable to bend.")
    away = np.array([standoff, 0.0, 0.0])
    tree, bodies, points, first = robot.tree, [], [], [0]
    for k in range(len(groups)):
        for c in range(count):
            turn = phase + 2 * np.pi * (c / count + k / (count * len(groups)))
            ring = radius * np.array([0.0, np.cos(turn), np.sin(turn)])
            for group in groups[0 if coupled else k : k + 1]:
                near, far = robot.body_of_joint(group[0]), robot.body_of_joint(group[-1])
                bodies += [int(tree.parent[near]), far]
                points += [
                    tree.translation[near] + tree.rotation[near] @ (ring - away),
                    away + ring,
                ]
            first.append(len(bodies))
    numbers = np.arange(count * len(groups)).reshape(len(groups), count)
    return Routing(
        Holes(np.array(first), np.array(bodies), np.array(points)),
        groups,
        tuple(numbers),
        tuple(f"cable{k + 1}_{c + 1}" for k in range(len(groups)) for c in range(count)),
        coupled,
    )


def _groups(robot: Robot) -> tuple[tuple[str, ...], ...]:
    """Returns the chain joints, those of one universal joint together."""
    groups: dict[str, list[str]] = {}
    for name in robot.chain_joints:
        match = _GROUP.fullmatch(name)
        groups.setdefault(match[1] if match else name, []).append(name)
    return tuple(tuple(g) for g in groups.values())
