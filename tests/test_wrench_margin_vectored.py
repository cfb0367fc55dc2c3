"""Certified vectored margins: the reference table, anchors, and an independent search."""

import numpy as np
import pytest
from margin_robots import LENGTH, MASS, chain
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from snakegen.analysis.wrench_margin import vectored_margins
from snakegen.errors import SnakegenError
from snakegen.wrench_margins.vectored import apparatus_sets, set_margins

LIMIT = 64.0


def margins_of(points, limits=LIMIT, attitude=None, drag=0.0, **options):
    weight = MASS * 9.81 * np.shape(points)[-2]
    up = np.array([0, 0, 1.0]) if attitude is None else attitude
    return set_margins(
        apparatus_sets(points, limits, drag),
        np.r_[weight * up, 0, 0, 0],
        force_scale=weight,
        torque_scale=weight * LENGTH,
        **options,
    )


def support(points, limits, twist):
    """h(v, ω) = Σ L_j ‖v + ω × p_j‖, spelled out."""
    reach = twist[:3] + np.cross(twist[3:], points)
    return (limits * np.linalg.norm(reach, axis=1)).sum()


def searched(points, limits, hover, unit, rng, starts):
    """Least ``(h(d) - d·w0)/‖d_slice‖`` by Nelder-Mead and BFGS from many random twists."""

    def ratio(d):
        norm = np.linalg.norm(d[unit])
        return (support(points, limits, d) - d @ hover) / norm if norm > 1e-9 else 1e9

    best = np.inf
    for _ in range(starts):
        start = minimize(ratio, rng.normal(size=6), method="BFGS", options={"maxiter": 60})
        found = minimize(
            ratio, start.x, method="Nelder-Mead", options={"maxfev": 600, "fatol": 1e-9}
        )
        best = min(best, found.fun)
    # an apparatus on the twist axis: v = -ω × p_j
    for j in range(len(points)):
        for _ in range(4):

            def kinked(w, j=j):
                return ratio(np.r_[-np.cross(w, points[j]), w])

            best = min(best, minimize(kinked, rng.normal(size=3), method="Nelder-Mead").fun)
    return best


def random_body(rng, count, bend):
    points, at, rotation = [], np.zeros(3), np.eye(3)
    for _ in range(count):
        points.append(at + rotation @ [0.21, 0, 0])
        at = at + rotation @ [0.42, 0, 0]
        rotation = rotation @ Rotation.from_euler("YZ", rng.uniform(-bend, bend, 2)).as_matrix()
    points = np.array(points)
    # off centre by what a near-straight body can still hold
    return points - points.mean(axis=0) + 0.1 * bend * 0.01 * rng.normal(size=3)


@pytest.mark.parametrize(
    ("count", "posture", "rank", "force", "torque", "wrench"),
    [
        (1, "straight", 3, 44.4, 0.0, 0.0),
        (2, "straight", 5, 88.8, 0.0, 0.0),
        (2, "spatial", 5, 88.8, 0.0, 0.0),
        (3, "straight", 5, 133.1, 0.0, 0.0),
        (3, "planar", 6, 133.1, 8.07, 0.323),
        (3, "spatial", 6, 133.1, 6.30, 0.253),
        (4, "straight", 5, 177.5, 0.0, 0.0),
        (4, "planar", 6, 177.5, 27.96, 0.794),
        (4, "spatial", 6, 177.5, 23.37, 0.678),
        (5, "straight", 5, 221.9, 0.0, 0.0),
        (5, "planar", 6, 221.9, 47.5, 1.116),
        (5, "spatial", 6, 221.9, 42.3, 0.993),
    ],
)
def test_reference_table(count, posture, rank, force, torque, wrench):
    points, _ = chain(count, posture)
    m = margins_of(points)
    assert m.rank == rank and m.closed
    # equal limits, centroid at the CoG: exactly Ñ L - m g
    assert m.force_bounds[1] == pytest.approx(count * (LIMIT - MASS * 9.81), rel=1e-12)
    assert m.force == m.force_bounds[0] and m.wrench == m.wrench_bounds[0]
    assert m.force == pytest.approx(force, abs=0.05)
    assert m.torque == pytest.approx(torque, abs=0.06 if torque > 40 else 0.006)
    assert m.wrench == pytest.approx(wrench, abs=9e-4) and m.wrench_bounds[1] - m.wrench < 4e-4
    for low, high in (m.wrench_bounds, m.force_bounds, m.torque_bounds):
        assert low <= high


def test_a_straight_robot_names_the_lost_turn():
    m = margins_of(chain(4, "straight")[0])
    np.testing.assert_allclose(np.abs(m.worst("torque")), [0, 0, 0, 1, 0, 0], atol=1e-9)
    assert m.saturated("torque") == ([], [])
    assert m.directional([0, 0, 0, 1, 0, 0]) == 0.0
    assert m.directional([0, 0, 0, 0, 1, 0]) > 1.0


@pytest.mark.parametrize("count", [3, 4, 6])
def test_bounds_hold_against_an_independent_search(count):
    rng = np.random.default_rng(count)
    for bend in (1.4, 0.05):
        points = random_body(rng, count, bend)
        limits = rng.uniform(40.0, 70.0, count)
        up = rng.normal(size=3)
        m = margins_of(points, limits, up / np.linalg.norm(up))
        hover = m.hover_wrench
        assert m.closed and m.feasible
        for bounds, unit in ((m.force_bounds, slice(0, 3)), (m.torque_bounds, slice(3, 6))):
            found = searched(points, limits, hover, unit, rng, 5)
            assert found >= bounds[0] * (1 - 1e-9)  # nothing below the certificate
            assert bounds[1] <= found * (1 + 1e-3)  # nor does the search beat the upper bound


def test_the_upper_bounds_are_attained_by_their_twists():
    points = random_body(np.random.default_rng(1), 5, 1.2)
    m = margins_of(points)
    for at, unit in ((1, slice(0, 3)), (2, slice(3, 6))):
        twist = m.twists[at] * np.r_[np.ones(3), np.full(3, m.scale[0] / m.scale[3])]
        slack = support(points, m.limits, twist) - twist @ m.hover_wrench
        assert slack / np.linalg.norm(twist[unit]) == pytest.approx(m.bounds[at, 1], rel=1e-9)


def test_ray_ends_on_the_boundary_in_the_worst_direction():
    points = random_body(np.random.default_rng(2), 4, 1.2)
    m = margins_of(points, tolerance=1e-6)
    assert m.closed
    for name in ("wrench", "force", "torque"):
        reach = m.directional(m.worst(name))
        assert reach == pytest.approx(getattr(m, f"{name}_bounds")[1], rel=1e-3)
        assert reach >= m.bounds[("wrench", "force", "torque").index(name), 0] * (1 - 1e-7)
    rng = np.random.default_rng(3)
    for _ in range(20):
        u = rng.normal(size=6) * m.scale
        assert m.directional(u) * np.linalg.norm(u / m.scale) >= m.wrench * (1 - 1e-6)


def test_an_impossible_hover_is_negative_by_its_distance():
    points, _ = chain(4, "planar")
    m = margins_of(points, 10.0)
    weight = 4 * MASS * 9.81
    assert not m.feasible and np.isnan(m.force) and np.isnan(m.torque) and m.closed
    assert m.wrench == pytest.approx(40.0 / weight - 1.0, rel=1e-9)


def test_near_straight_bodies_close_and_lose_37_newton_metres_a_radian():
    for bend in (0.1, 0.01, 0.001):
        at = np.cumsum([[0.42, 0, 0]] * 4, axis=0)
        headings = np.cumsum([0.0, bend, bend, bend])
        steps = 0.21 * np.c_[np.cos(headings), np.sin(headings), np.zeros(4)]
        at = np.cumsum(np.vstack([steps[:1], steps[:-1] + steps[1:]]), axis=0)
        m = margins_of(at - at.mean(axis=0))
        assert m.rank == 6 and m.closed
        assert m.torque / bend == pytest.approx(37.0, rel=0.03)


def test_a_thin_body_with_two_apparatuses_near_the_twist_axis_closes():
    """Here the terms of the objective cancel to a hundredth: a line search must not stall."""
    points = np.array(
        [
            [-0.62161250, 0.19075140, 0.09832610],
            [-0.19371772, 0.05918188, 0.04718912],
            [0.21411517, -0.06497327, 0.00617911],
            [0.60488461, -0.19536949, -0.04426262],
        ]
    )
    weight = 78.48
    m = vectored_margins(
        points,
        32.0,
        [0, 0, weight, 0, 0, 0],
        force_scale=weight,
        torque_scale=weight * LENGTH,
    )
    assert m.rank == 6 and m.closed and 0 < m.force < 1
    hover, rng = m.hover_wrench, np.random.default_rng(0)
    found = searched(points, np.full(4, 32.0), hover, slice(0, 3), rng, 2)
    assert found >= m.force_bounds[0] * (1 - 1e-9)


def test_batch_equals_single_and_closes():
    rng = np.random.default_rng(6)
    points = np.array([random_body(rng, 4, 1.5) for _ in range(50)])
    batch = margins_of(points)
    assert batch.closed.all() and len(batch) == 50
    one = margins_of(points[7], wrench_starts=0)
    np.testing.assert_allclose(one.bounds, batch[7].bounds, rtol=2e-3)
    assert (one.bounds[:, 0] <= batch[7].bounds[:, 1]).all()
    refined = margins_of(points[7])
    assert refined.wrench_bounds[1] <= one.wrench_bounds[1]


def test_a_search_that_cannot_close_says_so():
    m = margins_of(chain(4, "spatial")[0], tolerance=1e-15)
    assert not m.closed
    low, high = m.force_bounds
    true = 4 * LIMIT - 4 * MASS * 9.81  # the apparatuses' centroid is the CoG
    assert low < high < low * (1 + 1e-9)
    assert low <= true * (1 + 1e-12) and high >= true * (1 - 1e-12)
    # the worst torque lies on a flat face of the slice, which closes to the last digit or nearly so
    assert m.torque_bounds[0] <= m.torque_bounds[1] < m.torque_bounds[0] * (1 + 1e-9)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"points": np.zeros((4, 2))}, r"points has shape \(4, 2\)"),
        ({"points": np.full((2, 3), np.inf)}, r"points\[0, 0\] is inf"),
        ({"limits": -1.0}, r"limits\[0\] is -1"),
        ({"limits": np.ones(3)}, r"limits has shape \(3,\)"),
        ({"hover_wrench": [0, 0, 1]}, r"hover_wrench has shape \(3,\)"),
        ({"tolerance": 0.0}, "tolerance is 0"),
        ({"force_scale": -2.0}, "force_scale is -2"),
    ],
)
def test_bad_input_is_one_clear_line(change, says):
    arguments = {
        "points": np.eye(4, 3),
        "limits": 10.0,
        "hover_wrench": [0, 0, 1, 0, 0, 0],
        "force_scale": 1.0,
        "torque_scale": 1.0,
        **change,
    }
    with pytest.raises(SnakegenError, match=says) as caught:
        vectored_margins(**arguments)
    assert "\n" not in str(caught.value)
