"""The kernels under the margins, one by one, against NumPy, SciPy and each other."""

import os
from itertools import combinations

import numba
import numpy as np
import pytest
from scipy.spatial import ConvexHull

from snakegen.analysis.allocation import allocation
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.margins.facets import tree
from snakegen.kernels.margins.facets4 import four, four_within
from snakegen.kernels.margins.gale import gale, invert_basis
from snakegen.kernels.margins.inner_radius import insert, simplex
from snakegen.kernels.margins.posture_batch import dual_postures
from snakegen.kernels.margins.wrench_subspace import RANK_TOLERANCE, subspace
from snakegen.robot.robot import GRAVITY, load


@pytest.mark.parametrize("rank", [1, 2, 3, 4, 5, 6])
@pytest.mark.parametrize("last", [1.0, 1e-3, 3e-6, 3e-7, 1e-9])
def test_subspace_has_the_rank_and_the_span_of_the_svd(rank: int, last: float) -> None:
    """Also where the least singular value stands close to the tolerance, on either side."""
    rng = np.random.default_rng(rank)
    for n in (rank, 8, 16):
        u, v = (np.linalg.qr(rng.normal(size=(k, rank)))[0] for k in (6, max(n, rank)))
        values = np.r_[rng.uniform(0.5, 1.0, rank - 1), last] if rank > 1 else np.ones(1)
        a = (u * values) @ v.T
        basis, lost = subspace(a, RANK_TOLERANCE)
        left, s, _ = np.linalg.svd(a)
        r = int((s > RANK_TOLERANCE * s[0]).sum())
        assert basis.shape == (6, r) and lost.shape == (6, 6 - r)
        whole = np.hstack([basis, lost])
        assert np.abs(whole.T @ whole - np.eye(6)).max() < 1e-14
        assert np.abs(basis @ basis.T - left[:, :r] @ left[:, :r].T).max() < 1e-9


def by_hand(a: np.ndarray, y: np.ndarray) -> list[float]:
    """Least slack/‖d‖, slack/‖d_f‖, slack/‖d_τ‖ over the null vectors of all column subsets."""
    d, n = a.shape
    least = [np.inf, np.inf, np.inf]
    for chosen in combinations(range(n), d - 1):
        normal = np.linalg.svd(a[:, chosen].T)[2][-1]
        slack = 0.5 * np.abs(normal @ a).sum() - abs(normal @ y)
        for k, part in enumerate((slice(None), slice(0, 3), slice(3, 6))):
            size = np.linalg.norm(normal[part])
            if size > 0:
                least[k] = min(least[k], slack / size)
    return least


def test_the_orbits_of_eight_columns_are_all_their_facets() -> None:
    rng = np.random.default_rng(1)
    table, order = np.empty((6, 14)), np.empty(6, np.int64)
    squared, normals = np.empty(3), np.zeros((3, 6))
    for _ in range(10):
        a = rng.normal(size=(6, 8))
        y = a @ rng.uniform(-0.3, 0.3, 8)
        invert_basis(a, table, order)
        state = gale(table, order, y, squared, normals, np.zeros(236), np.zeros(168))
        assert state == 1
        assert np.sqrt(squared) == pytest.approx(by_hand(a, y), rel=1e-10)
        for k, part in enumerate((slice(0, 6), slice(0, 3), slice(3, 6))):
            d = normals[k]
            slack = 0.5 * np.abs(d @ a).sum() - d @ y
            assert slack / np.linalg.norm(d[part]) == pytest.approx(np.sqrt(squared[k]), rel=1e-10)


def test_facets_in_four_dimensions_against_the_tree_and_by_hand() -> None:
    rng = np.random.default_rng(2)
    for n in (4, 6, 8, 11):
        a, basis = rng.normal(size=(4, n)), np.linalg.qr(rng.normal(size=(6, 4)))[0].T
        y, sizes = a @ rng.uniform(-0.3, 0.3, n), np.empty(n)
        rows = np.hstack([a, y[:, None], np.zeros((4, 1)), basis])
        squared, normals = np.full((3, 3), np.inf), np.zeros((3, 3, 6))
        assert four(a, y, squared[0], normals[0], sizes) == 1
        assert four_within(rows, n, squared[1], normals[1], sizes) == 1
        work = np.empty((6, 6, n + 8)), sizes, squared[2], normals[2], np.zeros(2)
        assert tree(rows, 4, n, *work, False)
        assert squared[1] == pytest.approx(squared[2], rel=1e-10)
        assert normals[1, 0] / np.linalg.norm(normals[1, 0]) == pytest.approx(
            normals[2, 0] / np.linalg.norm(normals[2, 0]), abs=1e-9
        )
        assert squared[0, 0] == pytest.approx(squared[1, 0], rel=1e-10)
        assert np.sqrt(squared[0, 0]) == pytest.approx(by_hand(a, y)[0], rel=1e-9)


def test_the_growing_polytope_is_the_convex_hull() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        points = rng.normal(size=(40, 3))
        points /= np.linalg.norm(points, axis=1, keepdims=True)
        points[6:] *= rng.uniform(0.5, 1.0, (34, 1))  # some end up inside
        facets, planes = np.empty((200, 3), np.int64), np.empty((200, 4))
        count, *corners = simplex(points, 6, facets, planes)
        edges = np.empty((200, 2), np.int64)
        for k in sorted(set(range(40)) - set(corners)):
            count, nearest = insert(points, k, facets, planes, count, edges, 1e-13)
        hull = ConvexHull(points)
        assert count == len(hull.simplices)
        assert planes[nearest, 3] == planes[:count, 3].min()
        assert planes[nearest, 3] == pytest.approx(-hull.equations[:, 3].max(), rel=1e-12)


def test_maps_straight_from_poses_are_those_of_one_posture() -> None:
    robot = load("dragon4")
    angles = np.random.default_rng(4).uniform(-1.0, 1.0, (5, len(robot.joint_names)))
    dual, hover = np.empty((5, 6, robot.rotors.body.size)), np.empty((5, 6))
    dual_postures(robot.tree, robot.rotors, np.eye(3), angles, GRAVITY, dual, hover)
    for row, q, w in zip(angles, dual, hover, strict=True):
        one = allocation(robot, robot.configuration(dict(zip(robot.joint_names, row, strict=True))))
        assert q == pytest.approx(one.dual, abs=1e-12)
        assert w == pytest.approx(one.hover_wrench, rel=1e-12)


@pytest.mark.skipif(os.environ.get("NUMBA_DISABLE_JIT") == "1", reason="nothing is compiled")
def test_a_bare_kernel_that_allocates_is_refused() -> None:
    with pytest.raises(numba.core.errors.NumbaError):
        allocates(np.ones(3))


@bare
def allocates(a: np.ndarray) -> float:
    return np.empty(a.size).sum()
