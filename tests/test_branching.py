"""Products of convex pieces along a direction: where they begin and end."""

import numpy as np
from limited_bodies import random_sets

from snakegen.wrench_margins.branching.piece_pool import Pool
from snakegen.wrench_margins.inputs import force_map


def test_a_product_holds_the_push_whose_forces_it_is_about():
    """Also where it begins beyond hover: seen from there the least push has a negative bound."""
    rng, held, beyond = np.random.default_rng(5), 0, 0
    for _ in range(60):
        sets = random_sets(rng, 4)
        hull = sets.hull()
        thrust, phi, theta = (rng.uniform(a, b) for a, b in _ranges(sets))
        u = [np.sin(theta), -np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)]
        forces = np.einsum("nij,jn->ni", sets.frames, thrust * np.array(u))
        e = rng.normal(size=3)
        e /= np.linalg.norm(e)
        reached = force_map(sets.points, sets.drag) @ forces.ravel()
        push = rng.uniform(0.5, 3.0)
        pool = Pool(hull, reached - push * np.r_[e, 0, 0, 0], slice(0, 3))
        index = pool.add(forces, e)
        if index < 0:
            continue  # hardly more than a point of it
        held += 1
        begins, ends = pool.span(index, e)
        assert begins <= push * (1 + 2e-4) and push * (1 - 2e-4) <= ends
        beyond += begins > 0.01 * push
    assert held > 55 and beyond > 20


def _ranges(sets):
    """Returns ranges of thrusts and angles, their ends left out."""
    ends = [(sets.low, sets.high), tuple(sets.phi.T), tuple(sets.theta.T)]
    return [(a + 0.05 * (b - a), b - 0.05 * (b - a)) for a, b in ends]
