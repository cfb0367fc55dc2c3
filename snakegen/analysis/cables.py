"""Cables: the tensions that hold a posture, and whether a routing can (ZS24 section 2).

Three or more cables a segment; those of far segments run through the near ones and load them too.
The paper prints neither radius nor phase: both are parameters.
"""

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from snakegen.errors import AnalysisError
from snakegen.geometry import Floats
from snakegen.kernels.cables import Holes, back_substitute, balance, lengths_and_rates
from snakegen.kernels.tree import Ints
from snakegen.kinetostatics.law import DOWN, Wrenches, finite, joint_torques
from snakegen.robot import Robot

COMMAND = "cables"
ORDER = 75
OPTIONS = {
    "count": [3, "cables a segment, three or more"],
    "radius": [0.03, "m, of the circle of holes"],
    "phase": [0.0, "rad, of the first hole from y towards z"],
    "standoff": [0.02, "m, from a joint to the holes on either side"],
    "sheathed": [False, "cables start at their own joint instead of running through all before"],
    "minimum": [5.0, "N, least tension"],
    "maximum": [1e9, "N, highest tension"],
    "wrenches": [None, 'loads, as in "link4=0,0,-5,0,0,0": [force; torque] at a link, world axes'],
    "gravity": ["0,0,-9.81", "m/s², world; 0,0,0 for none"],
}
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


@dataclass(frozen=True)
class CablesResult:
    """Tensions that hold a posture.

    Attributes:
        names: (c,) cables, ``cable{segment}_{number}``.
        tension: (c,) N.
        length: (c,) m, along the holes.
        joints: (n,) chain joints.
        arms: (n, c) m, ``A = -(∂l/∂θ)ᵀ``.
        torque: (n,) N m, wanted of the cables.
        shortage: (n,) N m, what they leave; all zero where the posture is held.
        method: ``back-substitution`` or, where that fails, ``all segments at once``.
        why: one sentence.
    """

    names: tuple[str, ...]
    tension: Floats
    length: Floats
    joints: tuple[str, ...]
    arms: Floats
    torque: Floats
    shortage: Floats
    method: str
    why: str

    @property
    def feasible(self) -> bool:
        """Tells whether the cables hold the posture."""
        return bool(_balanced(self.shortage, self.torque))

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people: tensions segment by segment."""
        out = [("cables", self.why)]
        parts: dict[str, list[float]] = {}
        for name, t in zip(self.names, self.tension, strict=True):
            parts.setdefault(name.split("_")[0].replace("cable", "segment "), []).append(t)
        out += [(k, " ".join(f"{t:.4g}" for t in ts) + " N") for k, ts in parts.items()]
        return out

    def to_json(self) -> dict[str, Any]:
        """Returns plain data; keys carry units."""
        return {
            "feasible": self.feasible,
            "why": self.why,
            "method": self.method,
            "tension_N": dict(zip(self.names, self.tension.tolist(), strict=True)),
            "length_m": dict(zip(self.names, self.length.tolist(), strict=True)),
            "torque_Nm": dict(zip(self.joints, self.torque.tolist(), strict=True)),
            "shortage_Nm": dict(zip(self.joints, self.shortage.tolist(), strict=True)),
            "arms_m": self.arms.tolist(),
        }


def applies(robot: Robot) -> bool:
    """An arm: a chain on a fixed base."""
    return not robot.floating and len(robot.chain_joints) > 0


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
                points += [tree.translation[near] - away + ring, away + ring]
            first.append(len(bodies))
    numbers = np.arange(count * len(groups)).reshape(len(groups), count)
    return Routing(
        Holes(np.array(first), np.array(bodies), np.array(points)),
        groups,
        tuple(numbers),
        tuple(f"cable{k + 1}_{c + 1}" for k in range(len(groups)) for c in range(count)),
        coupled,
    )


def analyze(
    robot: Robot,
    q: ArrayLike,
    *,
    routing: Routing | None = None,
    torque: ArrayLike | None = None,
    wrenches: Wrenches = None,
    gravity: ArrayLike = DOWN,
    minimum: float = 5.0,
    maximum: float = np.inf,
    count: int = 3,
    radius: float = 0.03,
    phase: float = 0.0,
    standoff: float = 0.02,
    sheathed: bool = False,
) -> CablesResult:
    """Returns the least cable tensions that give the joints the torques that a posture needs.

    Args:
        robot: an arm.
        q: (nq,) posture.
        routing: from `route`; made from `count` … `sheathed` if absent.
        torque: (n,) N m of the chain joints; the static ones of gravity and `wrenches` if absent.
        wrenches, gravity: as in `joint_torques`.
        minimum, maximum: N, tension limits.
        count, radius, phase, standoff, sheathed: as in `route`; sheathed is not coupled.

    Raises:
        AnalysisError: not an arm, wrong shapes, NaN, minimum above maximum.
    """
    if not applies(robot):
        raise AnalysisError(f"{robot.name} is not an arm on a fixed base: cables are for those.")
    if not 0 <= minimum <= maximum or not np.isfinite(minimum):
        raise AnalysisError(f"tensions {minimum:g} … {maximum:g} N are no range above 0.")
    q = robot.check_q(q)
    if routing is None:
        routing = route(
            robot,
            count=count,
            radius=radius,
            phase=phase,
            standoff=standoff,
            coupled=not sheathed,
        )
    names = [n for group in routing.segments for n in group]
    index = np.array([robot.body_of_joint(n) - 1 for n in names], int)
    if torque is None:
        static = joint_torques(robot, q, wrenches=wrenches, gravity=gravity, terms="static")
        wanted = np.asarray(static[index])
    else:
        wanted = finite(torque, (len(index),), "torque")
    base = robot.base_pose(q)[0]
    length, rates = lengths_and_rates(robot.tree, base, robot.angles(q), routing.holes)
    arms = -rates[:, index].T
    ends = np.cumsum([len(g) for g in routing.segments])
    rows = [np.arange(e - len(g), e) for e, g in zip(ends, routing.segments, strict=True)]
    method = "back-substitution"
    t, short = back_substitute(arms, wanted, rows, list(routing.columns), minimum, maximum)
    if not _balanced(short, wanted) and routing.coupled:
        # Least tensions beyond may be the wrong ones for the segments before: ask all at once.
        together, left = balance(arms, wanted, minimum, maximum)
        if np.sum(np.abs(left)) < np.sum(np.abs(short)):
            t, short, method = together, left, "all segments at once"
    return CablesResult(
        routing.names, t, length, tuple(names), arms, wanted, short, method,
        _why(names, short, wanted, t, routing.names, maximum),
    )  # fmt: skip


def _groups(robot: Robot) -> tuple[tuple[str, ...], ...]:
    """Returns the chain joints, those of one universal joint together."""
    groups: dict[str, list[str]] = {}
    for name in robot.chain_joints:
        match = _GROUP.fullmatch(name)
        groups.setdefault(match[1] if match else name, []).append(name)
    return tuple(tuple(g) for g in groups.values())


def _balanced(shortage: Floats, torque: Floats) -> bool:
    """Tells whether what is left is the solver's rounding only."""
    return bool(np.max(np.abs(shortage)) <= 1e-7 * max(1.0, float(np.max(np.abs(torque)))))


def _why(
    joints: list[str],
    shortage: Floats,
    torque: Floats,
    tension: Floats,
    cables: tuple[str, ...],
    maximum: float,
) -> str:
    """Returns one sentence: the highest tension, or the joint that lacks most and by how much."""
    if _balanced(shortage, torque):
        i = int(np.argmax(tension))
        return f"held; the highest tension is {tension[i]:.4g} N in {cables[i]}"
    i = int(np.argmax(np.abs(shortage)))
    others = int(np.sum(np.abs(shortage) > 1e-7)) - 1
    cap = f" within {maximum:g} N" if np.isfinite(maximum) else ""
    more = f" ({others} more joints lack some)" if others else ""
    return (
        f"not held{cap}: {joints[i]} needs {torque[i]:.4g} N·m and lacks "
        f"{abs(shortage[i]):.4g} N·m{more}"
    )
