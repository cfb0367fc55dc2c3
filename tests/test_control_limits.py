"""Allocation within limits against active-set, LP and optimality conditions."""

import numpy as np
import pytest
from flat_robots import snake
from scipy.optimize import linprog, lsq_linear, minimize
from test_control_allocation import controller_of

from snakegen.control import constrained, fully_actuated
from snakegen.control.frame import cog_frame
from snakegen.errors import AnalysisError
from snakegen.kernels.allocation.ball_allocation import BALL_STAGES, near_allocation
from snakegen.kernels.allocation.dual_newton import Bounded, ascend

LENGTH, G = 0.42, 9.81


def random_box(rng, m, n, reach):
    q, high = rng.normal(size=(m, n)), rng.uniform(5, 20, n)
    x = rng.uniform(0, 1, n) * high
    x[rng.random(n) < 0.3] = 0.0
    return q, q @ x * reach, high


@pytest.mark.parametrize("m, n", [(4, 4), (4, 8), (6, 8), (6, 16)])
@pytest.mark.parametrize("reach", [0.8, 1.7])
def test_bounded_thrusts_equal_an_active_set_solver(m, n, reach):
    rng = np.random.default_rng(m * n)
    for _ in range(25):
        q, wrench, high = random_box(rng, m, n, reach)
        rows = np.full(m, 0.05)
        mine = constrained.bounded_thrusts(q, wrench, 0.0, high, rows)
        best = lsq_linear(rows[:, None] * q, rows * wrench, (0, high), "bvls", tol=1e-14)
        assert np.all(mine.thrust >= 0) and np.all(mine.thrust <= high)
        assert mine.shortfall <= np.linalg.norm(rows * (q @ best.x - wrench)) + 1e-6


def test_bounded_thrusts_are_of_least_norm():
    rng = np.random.default_rng(2)
    for _ in range(4):
        q, wrench, high = random_box(rng, 4, 8, 0.9)
        mine = constrained.bounded_thrusts(q, wrench, 0.0, high, np.full(4, 0.05))
        best = minimize(
            lambda x, d: np.sum((x / d) ** 2),
            mine.thrust * 0.9,
            (high,),
            "SLSQP",
            jac=lambda x, d: 2 * x / d**2,
            bounds=[(0, h) for h in high],
            constraints={"type": "eq", "fun": lambda x, q, w: q @ x - w, "args": (q, wrench)},
            options={"ftol": 1e-14, "maxiter": 500},
        )
        assert best.success
        np.testing.assert_allclose(mine.thrust, best.x, atol=1e-4)


@pytest.mark.parametrize("reach", [0.95, 1.5, 4.0])
def test_bounded_forces_satisfy_the_optimality_conditions(reach):
    """Out of reach, each force is the point of its ball furthest along -∇‖S(w - Qf)‖²."""
    rng = np.random.default_rng(int(reach * 10))
    for _ in range(20):
        points, limits = rng.normal(size=(4, 3)), rng.uniform(10, 30, 4)
        f = rng.normal(size=(4, 3))
        f *= (limits * rng.choice([1.0, 0.5], 4) / np.linalg.norm(f, axis=1))[:, None]
        wrench = reach * np.r_[f.sum(0), np.cross(points, f).sum(0)]
        rows = np.r_[np.full(3, 0.02), np.full(3, 0.05)]
        mine = constrained.bounded_forces(points, limits, wrench, rows)
        size = np.linalg.norm(mine.thrust, axis=1)
        assert np.all(size <= limits * (1 + 1e-12))
        if reach < 1:
            assert mine.shortfall < 1e-6
        if mine.shortfall > 1e-3:
            lack = rows**2 * (wrench - mine.given)
            pull = lack[:3] + np.cross(lack[3:], points)
            gap = limits * np.linalg.norm(pull, axis=1) - np.sum(pull * mine.thrust, 1)
            assert gap.sum() < 1e-5 * mine.shortfall**2


def test_bad_limits_and_shapes_are_refused():
    with pytest.raises(AnalysisError, match="lower ≤ upper"):
        constrained.bounded_thrusts(np.eye(4), np.ones(4), 2.0, 1.0)
    with pytest.raises(AnalysisError, match="NaN"):
        constrained.bounded_thrusts(np.eye(4), np.full(4, np.nan), 0.0, 1.0)
    with pytest.raises(AnalysisError, match="fit together"):
        constrained.bounded_thrusts(np.eye(4), np.ones(3), 0.0, 1.0)
    with pytest.raises(AnalysisError, match="limits > 0"):
        constrained.bounded_forces(np.zeros((2, 3)), [1.0, 0.0], np.ones(6))


def test_constrained_allocation_goes_beyond_the_pseudo_inverse_within_all_limits():
    rng = np.random.default_rng(11)
    robot = snake(4, offset=0.037, limit=16.0)
    angles = np.zeros(len(robot[0].parent) - 1)
    angles[robot[3][:, 1]] = 1.0
    paper, bounded = controller_of(robot), controller_of(robot, constrained=True)
    frame = cog_frame(paper, angles)
    gained = 0
    for _ in range(100):
        wrench = frame.hover_wrench + np.r_[rng.normal(size=3) * 12, rng.normal(size=3) * 4]
        free = fully_actuated.allocate(paper, frame, wrench, force=True)
        kept = fully_actuated.allocate(bounded, frame, wrench, force=True)
        assert np.all(kept.thrust <= 32.0 + 1e-9) and np.all(kept.thrust >= 0.0)
        missed = np.linalg.norm(kept.given - wrench)
        if np.all(free.thrust <= 32.0):
            np.testing.assert_allclose(kept.thrust, free.thrust, atol=1e-9)
        elif missed < 1e-5:
            gained += 1
    assert gained >= 3, "some wrenches are met only by the constrained allocator"


def test_constrained_allocation_respects_gimbal_limits():
    robot = snake(4, offset=0.037)
    angles = np.zeros(len(robot[0].parent) - 1)
    angles[robot[3][:, 1]] = 0.9
    limit = {"gimbal_lower": -0.085, "gimbal_upper": 0.085}
    c = controller_of(robot, constrained=True, **limit)
    frame = cog_frame(c, angles)
    inside = frame.hover_wrench + np.array([6.0, 4.0, 0, 0.2, -0.2, 0.5])
    free = fully_actuated.allocate(controller_of(robot), frame, inside)
    assert np.abs(free.gimbals).max() > 0.085, "the test means to meet the limits"
    a = fully_actuated.allocate(c, frame, inside, force=True)
    assert np.abs(a.gimbals).max() <= 0.085 + 1e-9
    np.testing.assert_allclose(a.given, inside, atol=1e-5)


def test_bounded_thrusts_reach_the_exact_directional_margin():
    """Met up to just below the LP's largest t with w0 + t u in W, missed just above it."""
    rng = np.random.default_rng(8)
    for _ in range(10):
        q, high = rng.normal(size=(4, 8)), rng.uniform(5, 20, 8)
        start, u = q @ (0.5 * high), rng.normal(size=4)
        best = linprog(
            np.r_[np.zeros(8), -1.0],
            A_eq=np.column_stack([q, -u]),
            b_eq=start,
            bounds=[(0, h) for h in high] + [(0, None)],
        )
        for share, reached in ((0.999, True), (1.01, False)):
            wrench = start + share * best.x[-1] * u
            mine = constrained.bounded_thrusts(q, wrench, 0.0, high, np.full(4, 0.05))
            assert (mine.shortfall < 1e-6) == reached


def test_bounded_forces_reach_the_anchor_of_equal_limits():
    """Centroid of the points at the CoG: straight up, N L is reached and no more (THEORY A4)."""
    points = np.array([[0.6, 0.1, 0.0], [-0.6, -0.1, 0.0], [0.2, -0.5, 0.1], [-0.2, 0.5, -0.1]])
    for share, reached in ((0.9999, True), (1.001, False)):
        up = np.array([0, 0, share * 4 * 32.0, 0, 0, 0])
        mine = constrained.bounded_forces(
            points, 32.0, up, np.r_[np.full(3, 0.01), np.full(3, 0.03)]
        )
        assert (mine.shortfall < 1e-6) == reached
        assert np.all(mine.at_limit) == (not reached)


@pytest.mark.parametrize("calm", [0, 1])
@pytest.mark.parametrize("reach", [0.5, 0.95])
def test_forces_near_others_satisfy_the_optimality_conditions(calm, reach):
    """``(f - c)/L² = QᵀS²(w - Qf)/δ - κ f``, κ ≥ 0 and only at limits; c is the free answer."""
    rng = np.random.default_rng(17)
    met = 0
    for _ in range(20):
        points, limits = rng.normal(size=(4, 3)), rng.uniform(10, 30, 4)
        q = np.hstack([np.vstack([np.eye(3), np.cross(p, np.eye(3)).T]) for p in points])
        f = rng.normal(size=(4, 3))
        f *= (limits / np.linalg.norm(f, axis=1))[:, None]
        wrench, internal = q @ (reach * f.ravel()), rng.normal(size=12)
        rows, weight = np.r_[np.full(3, 0.02), np.full(3, 0.05)], np.repeat(limits, 3)
        free = internal + weight * (np.linalg.pinv(q * weight) @ (wrench - q @ internal))
        mine = near_allocation(q, wrench, rows, limits, internal, calm)
        size = np.linalg.norm(mine.reshape(4, 3), axis=1)
        assert np.all(size <= limits * (1 + 1e-12))
        if np.all(np.linalg.norm(free.reshape(4, 3), axis=1) < limits):
            np.testing.assert_allclose(mine, free, atol=1e-5)
            continue
        met += 1
        at = np.flatnonzero(size > limits * (1 - 1e-9))
        columns = np.zeros((12, len(at)))
        for k, j in enumerate(at):
            columns[3 * j : 3 * j + 3, k] = mine[3 * j : 3 * j + 3]
        pull = q.T @ (rows**2 * (wrench - q @ mine)) / 1e-2
        if not calm:
            assert np.linalg.norm(rows * (wrench - q @ mine)) < 1e-5
            columns, pull = np.hstack([columns, -q.T]), np.zeros(12)
        found, *_ = np.linalg.lstsq(columns, pull - (mine - free) / weight**2, rcond=None)
        left = columns @ found - pull + (mine - free) / weight**2
        assert np.abs(left).max() < 1e-6 and np.all(found[: len(at)] > -1e-6)
    assert met >= 5 or reach < 0.9, "limits are met"


def climbed(problem, warm=None):
    """Returns the answer at the last δ and the top of its dual, from there or from nowhere."""
    mu = np.full(problem.w.size, np.nan) if warm is None else warm.copy()
    x = np.empty(problem.q.shape[1])
    soft, factor, hard = BALL_STAGES
    ascend(problem, soft, factor, hard, mu, x)
    return x, mu


@pytest.mark.parametrize("reach", [0.6, 0.97, 1.4])
def test_where_a_climb_starts_does_not_matter(reach):
    """From the top of a problem near by, from that of another, and from nowhere: one answer."""
    rng = np.random.default_rng(int(100 * reach))
    met = 0
    for _ in range(30):
        points, limits = rng.normal(size=(4, 3)), rng.uniform(10, 30, 4)
        q = np.hstack([np.vstack([np.eye(3), np.cross(p, np.eye(3)).T]) for p in points])
        f = rng.normal(size=(4, 3))
        f *= (limits / np.linalg.norm(f, axis=1))[:, None]
        servos = rng.normal(size=(2, 12)) * 0.2
        room = np.abs(servos @ f.ravel()) * 0.9
        rows = np.r_[np.full(3, 0.02), np.full(5, 0.05)]
        whole = np.vstack([np.c_[q, np.zeros((6, 2))], np.c_[servos, -np.eye(2)]])
        scaled = np.c_[rows[:, None] * whole[:, :12], -np.r_[np.zeros((6, 2)), np.eye(2)]]
        wanted = np.r_[reach * rows[:6] * (q @ f.ravel()), np.zeros(2)]
        parts = (limits, np.zeros(12), 10 * rows[6:] * room, -rows[6:] * room, rows[6:] * room)
        problem = Bounded(scaled, wanted, *parts)
        cold, top = climbed(problem)
        met += np.any(np.linalg.norm(cold[:12].reshape(4, 3), axis=1) > limits * (1 - 1e-9))
        assert np.all(np.abs(cold[12:]) <= rows[6:] * room * (1 + 1e-12))
        moved = problem._replace(q=scaled * (1 + 1e-3 * rng.normal(size=scaled.shape)))
        there, _ = climbed(moved)
        assert np.abs(there - cold).max() > 1e-4, "the problem near by has another answer"
        for start in (top, rng.normal(size=8), 1e4 * rng.normal(size=8)):
            again, _ = climbed(moved, start)
            np.testing.assert_allclose(again, there, atol=1e-9)
    assert met >= 10 or reach < 0.9, "limits are met"
