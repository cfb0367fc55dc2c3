"""Frames without mass at the ends of a URDF: which of them are rotors that nothing else names."""

import re

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.linter.finding import shapes
from snakegen.robot.adoption.rotor_evidence import RotorCandidate, UrdfTree

_SENSORS = re.compile(
    r"cam|imu|gps|gnss|lidar|laser|optical|sensor|depth|colou?r|infra|flow|sonar|radar|baro|magnet|"
    r"foot|base|tool|tip|tcp|grip|hand|hook|payload|load|mount|marker|odom|map|world|co[gm]|"
    r"centre|center|origin|antenna|battery|leg|skid|gear|ground|dock|light|led|target|goal",
    re.I,
)  # fmt: skip
_OFF = 0.05  # of the rotors' spread: how far outside them a centre of mass is not held
_REASON = "frame without mass: the other rotors alone do not hold the centre of mass"


def frames_left(tree: UrdfTree, found: list[RotorCandidate]) -> list[str]:
    """Returns the frames without mass at an end of the tree that were not taken for rotors."""
    taken = {c.link for c in found}
    taken |= {name for c in found for name in tree.subtree(c.link)}
    ends = [n for n in tree.links if n not in taken and n != tree.top and not tree.below.get(n)]
    return [n for n in ends if tree.mass_of(n) == 0.0 and not list(shapes(tree.links[n]))]


def with_peers(tree: UrdfTree, found: list[RotorCandidate]) -> list[RotorCandidate]:
    """Returns `found` and, where it cannot hover level, the frames that complete it, as guesses.

    Of a body whose rotors have no names of their own a servo may give one away; the others are
    frames like it. Thrusts of the rotors found have a centre of pressure inside their polygon:
    where the centre of mass lies outside it, fixed frames away from it that are named after no
    sensor or tool are taken too, if the polygon of all holds the centre of mass.
    """
    if not found or _holds(tree, [c.link for c in found]):
        return found
    apart = 0.02 * float(np.ptp(_points(tree, list(tree.links)), axis=0).max())
    peers = [
        name
        for name in frames_left(tree, found)
        if not tree.moving(name)
        and not _SENSORS.search(name)
        and np.linalg.norm(_points(tree, [name])[0] - tree.centre[:2]) > apart
    ]
    if not peers or not _holds(tree, [*(c.link for c in found), *peers]):
        return found
    more = [RotorCandidate(name, None, 2, (_REASON,), guess=True) for name in peers]
    order = list(tree.links)
    return sorted([*found, *more], key=lambda c: order.index(c.link))


def _points(tree: UrdfTree, names: list[str]) -> Floats:
    """Returns the places (n, 2) [m] of links in the root link's xy plane, joints at 0."""
    return np.array([tree.poses[name][:2, 3] for name in names])


def _holds(tree: UrdfTree, names: list[str]) -> bool:
    """Tells whether the polygon of these links contains the centre of mass, seen from above.

    ``min ‖Σ w_i (p_i − c)‖`` over ``w ≥ 0, Σ w = 1``, by non-negative least squares.
    """
    from scipy.optimize import nnls

    away = _points(tree, names) - tree.centre[:2]
    span = float(np.abs(away).max(initial=0.0))
    if span < 1e-6:
        return True
    rows = np.vstack([away.T / span, np.ones(len(names))])
    weights, _ = nnls(rows, np.array([0.0, 0.0, 1.0]))
    total = float(weights.sum())
    return total > 0.5 and bool(np.linalg.norm(rows[:2] @ weights) < _OFF * total)
