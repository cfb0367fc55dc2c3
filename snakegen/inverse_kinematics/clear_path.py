"""A path followed from resting postures until the body keeps clear of itself and what is around."""

from dataclasses import replace

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError
from snakegen.inverse_kinematics.collisions import Collisions, Nearest
from snakegen.inverse_kinematics.path_following import Chain, Options, Track, follow, reach_point


def follow_clear(
    chain: Chain, full: Floats, path: Floats, loop: Options, world: Collisions, tries: int
) -> tuple[Floats, float, Track | None, Nearest | None, int]:
    """Follows a path from resting postures, the given one first, until one keeps clear.

    Returns the tree's angles at the start, by how much that misses the first point [m], the track,
    its least distance and how many were tried: of the longest track, the one that fits the port,
    then the one with most clearance.
    """
    names = tuple(chain.robot.joint_names[j] for j in chain.joints)
    rng = np.random.default_rng(0)
    middle, half = 0.5 * (chain.lower + chain.upper), 0.5 * (chain.upper - chain.lower)
    kept: tuple[Floats, float, Track | None, Nearest | None] | None = None
    rank = (-1.0, False, 0.0)
    for k in range(tries):
        begin, options = full, loop
        if k > 0:
            preferred = middle + 0.8 * np.minimum(half, np.pi) * rng.uniform(-1.0, 1.0, len(half))
            options, begin = replace(loop, posture=preferred), full.copy()
            begin[chain.joints] = preferred
        start, missed, _ = reach_point(chain, begin, path[0], options)
        track = follow(chain, start, path, options) if missed <= loop.give_up else None
        near = None if track is None else world.nearest(track.angles, names)
        fits, made = False, (-1.0, False, 0.0)
        if track is not None and near is not None:
            fits = track.clearance >= world.thickest
            made = (track.length, fits, near.distance)
        if kept is None or made > rank:
            kept, rank = (start, missed, track, near), made
        if track is None or near is None or (near.free and (k == 0 or (track.complete and fits))):
            break
    if kept is None:
        raise AnalysisError("at least one posture must be tried.")
    return (*kept, k + 1)
