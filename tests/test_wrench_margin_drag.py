"""Vectored margins of apparatuses that drag: one rotor, or rotors of one spin."""

from types import SimpleNamespace

import numpy as np
import pytest
from dragging_bodies import (
    F0,
    SCALES,
    SLICES,
    height,
    margins_of,
    matrix,
    random_body,
    reach,
    searched,
    wrench_of,
)
from margin_robots import LENGTH, chain
from scipy.optimize import minimize

from snakegen.analysis.wrench_margin import vectored_margins
from snakegen.errors import SnakegenError


@pytest.mark.parametrize("count", [2, 3, 4, 6])
def test_bounds_hold_against_linear_programs_and_a_search(count):
    rng = np.random.default_rng(count)
    for _ in range(3):
        b = random_body(rng, count)
        m = margins_of(b, wrench_starts=0)
        if not m.feasible:
            assert np.isnan(reach(b, np.eye(6)[0]))
            continue
        assert m.rank == 6 and m.closed
        for k, (name, part) in enumerate(SLICES.items()):
            low, high = m.bounds[1 + k]
            assert searched(b, part, rng) >= low * (1 - 1e-9)
            along = reach(b, m.worst(name))
            assert low * (1 - 1e-9) <= along <= high * (1 + 1e-6)
            twist = m.twists[1 + k] * np.r_[np.ones(3), np.full(3, 1.0 / LENGTH)]
            assert height(b, twist) / np.linalg.norm(twist[part]) == pytest.approx(high, rel=1e-9)
            for e in rng.normal(size=(4, 3)):
                u = np.zeros(6)
                u[part] = e / np.linalg.norm(e)
                assert reach(b, u) >= low * (1 - 1e-9)
        for u in rng.normal(size=(3, 6)):
            assert m.directional(u) == pytest.approx(reach(b, u), rel=2e-6)


def test_the_wrench_margin_is_no_more_than_any_twist_of_a_search_and_no_less_than_its_bound():
    rng = np.random.default_rng(7)
    b = random_body(rng, 4)
    m = margins_of(b)
    unit = np.r_[np.ones(3), np.full(3, 1.0 / LENGTH)]

    def ratio(d):
        return height(b, unit * d) / F0 / np.linalg.norm(d)

    found = min(minimize(ratio, rng.normal(size=6), method="BFGS").fun for _ in range(20))
    low, high = m.wrench_bounds
    assert 0 < low <= found * (1 + 1e-9) and high == pytest.approx(found, rel=1e-4)
    twist = unit * m.twists[0]
    assert height(b, twist) / F0 / np.linalg.norm(m.twists[0]) == pytest.approx(high, rel=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_equal_drag_is_a_shear_of_the_torques(seed):
    """With one c for all, τ = τ' + c f: margins that hold the force, and rays, carry over."""
    rng = np.random.default_rng(seed)
    b = random_body(rng, 4)
    b.drag = np.full(4, 0.07)
    plain = SimpleNamespace(**vars(b))
    plain.drag, plain.hover = np.zeros(4), b.hover - np.r_[0, 0, 0, 0.07 * b.hover[:3]]
    m, other = margins_of(b), margins_of(plain)
    assert m.rank == other.rank == 6
    assert m.torque == pytest.approx(other.torque, rel=1e-3)
    assert m.force != pytest.approx(other.force, rel=1e-3)
    for u in rng.normal(size=(5, 6)):
        sheared = u - np.r_[0, 0, 0, 0.07 * u[:3]]
        assert m.directional(u) == pytest.approx(other.directional(sheared), rel=1e-7)


def test_a_mirror_turns_the_spins():
    b = random_body(np.random.default_rng(11), 4)
    mirror = np.diag([1.0, -1.0, 1.0])
    other = SimpleNamespace(points=b.points @ mirror, limits=b.limits, drag=-b.drag)
    other.hover = np.r_[mirror @ b.hover[:3], -mirror @ b.hover[3:]]
    np.testing.assert_allclose(margins_of(b).bounds, margins_of(other).bounds, rtol=1e-3)
    other.drag = b.drag
    assert margins_of(other).torque != pytest.approx(margins_of(b).torque, rel=1e-2)


@pytest.mark.parametrize(
    ("points", "drag", "rank"),
    [
        (np.zeros((1, 3)), [0.05], 3),
        (np.zeros((3, 3)), [0.05, -0.05, 0.02], 6),  # in one place: drags alone turn it
        (chain(2, "straight")[0], [0.05, 0.05], 5),
        (chain(2, "straight")[0], [0.05, -0.05], 6),
        (chain(4, "straight")[0], [0.03] * 4, 5),
        (chain(4, "straight")[0], [0.03, -0.03, 0.03, -0.03], 6),
        (chain(4, "straight")[0], [0.03, -0.01, 0.0, 0.0], 6),
        (chain(3, "planar")[0], [0.05, -0.05, 0.05], 6),
    ],
)
def test_spins_that_differ_turn_a_straight_body(points, drag, rank):
    rng, n = np.random.default_rng(0), len(points)
    hover = np.r_[0.2 * F0, 0.1 * F0, 0.9 * F0, 0, 0, 0]
    limits = np.full(n, 1.6 * F0 / n)
    b = SimpleNamespace(points=points, limits=limits, drag=np.array(drag), hover=hover)
    if rank < 6:  # the drag of equal spins is held by nothing: hover with it
        hover[3:] = b.drag[0] * hover[:3]
    m = margins_of(b)
    scaled = matrix(b) / np.repeat([1.0, LENGTH], 3)[:, None]
    assert m.rank == rank == np.linalg.matrix_rank(scaled, tol=1e-9)
    if rank < 6:
        assert m.wrench == 0.0 and m.torque == 0.0
        lost = np.linalg.svd(scaled)[0][:, rank:]
        np.testing.assert_allclose(lost @ lost.T @ m.twists[0], m.twists[0], atol=1e-9)
        return
    assert m.feasible and m.closed and m.torque > 0.0
    for k, (name, part) in enumerate(SLICES.items()):
        low, high = m.bounds[1 + k]
        assert searched(b, part, rng) >= low * (1 - 1e-9)
        along = reach(b, m.worst(name))
        assert low * (1 - 1e-9) <= along <= high * (1 + 1e-6)


def test_an_apparatus_with_room_is_one_whose_force_the_worst_twist_does_not_feel():
    rng, with_room = np.random.default_rng(12), 0
    for _ in range(12):
        b = random_body(rng, 4)
        m = margins_of(b, wrench_starts=0)
        for k, name in enumerate(SLICES):
            twist = m.twists[1 + k] * np.r_[np.ones(3), np.full(3, 1.0 / LENGTH)]
            speed = twist[:3] + np.cross(twist[3:], b.points) + b.drag[:, None] * twist[3:]
            still = np.linalg.norm(speed, axis=1) < 1e-6 * np.linalg.norm(speed, axis=1).max()
            full, room = m.saturated(name)
            assert (full, room) == (list(np.flatnonzero(~still)), list(np.flatnonzero(still)))
            with_room += int(still.any())
    assert with_room > 2


def test_an_impossible_hover_is_negative_by_its_distance():
    """The nearest forces by sequential quadratic programs: a convex problem."""
    b = random_body(np.random.default_rng(3), 3)
    b.hover = b.hover * 6.0
    m, unit = margins_of(b), np.r_[np.ones(3), np.full(3, LENGTH)]

    def square(x):
        return (((wrench_of(b, x.reshape(3, 3)) - b.hover) / unit / F0) ** 2).sum()

    def room(x):
        return 1.0 - (x.reshape(3, 3) ** 2).sum(axis=1) / b.limits**2

    balls = {"type": "ineq", "fun": room}
    options = {"maxiter": 500, "ftol": 1e-12}
    found = minimize(square, np.zeros(9), constraints=balls, method="SLSQP", options=options)
    assert found.success and room(found.x).min() > -1e-9
    assert not m.feasible and -m.wrench == pytest.approx(np.sqrt(found.fun), rel=1e-6)


def test_a_near_straight_body_that_its_drag_turns_is_out_of_reach():
    """The set is a ten-thousandth thick: a descent alone does not see that hover lies outside."""
    points = np.array(
        [
            [-4.199994e-01, -1.920000e-05, 4.144000e-04],
            [4.000000e-07, 3.380000e-05, 1.631000e-04],
            [4.199996e-01, -9.300000e-06, -5.820000e-04],
        ]
    )
    b = SimpleNamespace(points=points, limits=np.array([44.89, 37.28, 55.82]))
    b.drag = np.array([-6.355e-04, -7.270e-04, -4.280e-04])
    b.hover = np.array([-29.316, 48.224, -16.720, 0, 0, 0])
    for options in ({}, {"wrench_starts": 0}):
        m = margins_of(b, **options)
        assert m.rank == 6 and not m.feasible and np.isnan(m.force)
        twist = m.twists[0] / np.linalg.norm(m.twists[0])
        apart = -height(b, twist * np.r_[np.ones(3), np.full(3, 1.0 / LENGTH)]) / F0
        assert apart > 1e-5 and -m.wrench_bounds[1] == pytest.approx(apart, rel=1e-6)
        assert m.wrench <= m.wrench_bounds[1]


@pytest.mark.parametrize(
    ("drag", "says"),
    [(np.ones(3), r"drag has shape \(3,\)"), ([0, np.nan, 0, 0], r"drag\[1\] is nan")],
)
def test_bad_drag_is_one_clear_line(drag, says):
    b = random_body(np.random.default_rng(1), 4)
    with pytest.raises(SnakegenError, match=says):
        vectored_margins(b.points, b.limits, b.hover, drag=drag, **SCALES)
