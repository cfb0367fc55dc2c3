"""What a screw drive can do: singular shapes, slip, demands of paths, directions, radii."""

import math

import numpy as np
import pytest

from snakegen.analysis.screw_drive import (
    constraint_matrices,
)
from snakegen.errors import AnalysisError
from snakegen.kernels.screw.shape_search import sigma_squared, smallest_sigma
from snakegen.screw_drive.ground_paths import (
    l_crank,
)
from snakegen.screw_drive.held_shape import direction_cone, fixed_shape_radii
from snakegen.screw_drive.kinematics import (
    following_radii,
    following_radius,
    hara_chain,
    path_demand,
    slip_sensitivity,
    state_rate,
    worst_slip_sensitivity,
)
from snakegen.screw_drive.singularity import drive_hold, search_hold

ALPHA = (-math.pi / 4, math.pi / 4, -math.pi / 4, math.pi / 4)
PAPER = (0.075, 0.0, 0.103, 0.123)


def alternating(n):
    return tuple(math.pi / 4 * (-1.0) ** (np.arange(n) + 1))


def test_sigma_and_its_gradient():
    rng = np.random.default_rng(5)
    for n in (3, 5, 8):
        g = hara_chain(rng.uniform(-1.4, 1.4, n), L0=0.05)
        known = (*g.arrays, g.scale)
        shape = rng.uniform(-1, 1, n - 1)
        A, _ = constraint_matrices(
            np.concatenate([np.zeros(3), shape]), g.alpha, 0.075, 0.05, 0.103, 0.123
        )
        scaled = A[:n, :3] / [1, 1, g.scale]
        assert np.isclose(
            smallest_sigma(shape[None], *known)[0], np.linalg.svd(scaled, compute_uv=False)[-1]
        )
        gradient = sigma_squared(shape, *known)[1]
        for k in range(n - 1):
            step = np.eye(n - 1)[k] * 1e-6
            slope = (
                sigma_squared(shape + step, *known)[0] - sigma_squared(shape - step, *known)[0]
            ) / 2e-6
            assert np.isclose(gradient[k], slope, atol=1e-7)


@pytest.mark.parametrize(("n", "smallest"), [(3, 0.28), (4, None), (6, None), (10, 0.59)])
def test_alternating_drives_hold_within_45_degrees(n, smallest):
    limit = np.full(n - 1, math.pi / 4)
    found = search_hold(hara_chain(alternating(n)), -limit, limit, samples=512, starts=12)
    assert not found.singular and found.certified is not None
    sigma = found.weakest.sigma[-1]
    assert found.certified <= sigma
    if smallest is not None:
        assert np.isclose(sigma, smallest, atol=0.006)
    g = hara_chain(alternating(n))
    shapes = np.random.default_rng(n).uniform(-limit, limit, (20_000, n - 1))
    known = (*g.arrays, g.scale)
    assert smallest_sigma(shapes, *known).min() > sigma - 1e-12


def test_a_proof_is_refused_above_the_minimum():
    from snakegen.screw_drive.singularity import _prove

    g, limit = hara_chain(alternating(3)), np.full(2, math.pi / 4)
    sigma = float(search_hold(g, -limit, limit, samples=256, starts=8).weakest.sigma[-1])
    assert _prove(g, -limit, limit, 0.95 * sigma, 100_000) > 0
    assert _prove(g, -limit, limit, 1.0001 * sigma, 100_000) == 0


def test_singular_shapes_are_found_and_described():
    right = np.full(3, math.pi / 2)
    wide = search_hold(hara_chain(alternating(4)), -right, right, samples=512, starts=12)
    assert {h.kind for h in wide.singular} == {"parallel axles", "concurrent axles"}
    corner = [np.allclose(np.abs(h.shape), math.pi / 2) for h in wide.singular]
    assert corner == [h.kind == "parallel axles" for h in wide.singular]
    nearly = np.radians(
        [88.0, 88.0, 88.0]
    )  # a family at (any, ±86…87°, ∓88°): all ±90° is not first
    assert search_hold(hara_chain(alternating(4)), -nearly, nearly, starts=40).singular
    three = search_hold(hara_chain(alternating(3)), -right[:2], right[:2], samples=512)
    assert any(h.kind == "concurrent axles" for h in three.singular)
    first = min(np.abs(h.shape).max() for h in three.singular)
    assert math.radians(80) < first <= math.pi / 2
    for hold in (*wide.singular, *three.singular):
        check_free_twist(hold, alternating(hold.shape.size + 1))


def check_free_twist(hold, alpha):
    """The free motion that a description names must leave every wheel without slip."""
    A, _ = constraint_matrices(np.concatenate([np.zeros(3), hold.shape]), alpha, *PAPER)
    if hold.point is not None:
        twist = np.array([hold.point[1], -hold.point[0], 1.0])
    else:
        twist = np.array([math.cos(hold.direction), math.sin(hold.direction), 0.0])
    assert np.abs(A[: len(alpha), :3] @ twist).max() < 1e-5 * np.linalg.norm(twist)


def test_two_units_and_one_hand_never_hold_straight():
    g2 = hara_chain(alternating(2))
    assert search_hold(g2, [-0.8], [0.8]).singular
    for bend in (-0.7, 0.0, 0.4):
        hold = drive_hold(g2, [bend])
        assert hold.rank == 2 and hold.kind == "concurrent axles"
        check_free_twist(hold, g2.alpha)
    one_hand = drive_hold(hara_chain((math.pi / 4,) * 5), np.zeros(4))
    assert one_hand.kind == "parallel axles" and np.isclose(one_hand.direction, 0.75 * math.pi)
    check_free_twist(one_hand, (math.pi / 4,) * 5)


def test_slip_of_redundant_wheels():
    g = hara_chain(alternating(5))
    rng = np.random.default_rng(2)
    w = np.concatenate([rng.normal(size=3), rng.uniform(-0.5, 0.5, 4)])
    rate = rng.normal(size=7)
    A, B = constraint_matrices(w, g.alpha, *PAPER)
    u = np.linalg.solve(B, A @ rate)
    moved, slip = state_rate(w, u, g)
    assert np.allclose(moved, rate) and np.abs(slip).max() < 1e-12
    u[0] += 0.3  # now five wheels disagree about three numbers
    moved, slip = state_rate(w, u, g)
    assert np.allclose(A[:5] @ moved - (B @ u)[:5], slip) and np.abs(slip).max() > 1e-3
    assert np.abs(A[:5, :3].T @ slip).max() < 1e-12
    found = slip_sensitivity(g, w[3:], [-0.1, 0.05, 0.1])
    assert found["radius"] < 1e-15 < 1e-6 < min(found["alpha"], found["offset"], found["length"])
    three = hara_chain(alternating(3))
    assert max(slip_sensitivity(three, w[3:5], [-0.1, 0.05, 0.1]).values()) < 1e-15


def test_path_demand_and_tight_paths():
    g = hara_chain(ALPHA)
    demand = path_demand(g, l_crank(), 0.125, 6.0, 1.0, math.pi / 4)
    assert np.isclose(math.degrees(demand.joint_angle), 21.71, atol=0.01)
    twice = path_demand(g, l_crank(), 0.25, 6.0, 1.0, math.pi / 4)
    assert np.isclose(twice.screw_rate, 2 * demand.screw_rate)
    assert np.isclose(twice.fastest, demand.fastest)
    at_limit = path_demand(g, l_crank(), demand.fastest)
    assert np.isclose(max(at_limit.screw_rate / 6.0, at_limit.joint_rate / 1.0), 1.0)
    smallest = following_radius(g.lengths, math.pi / 4)
    with pytest.raises(AnalysisError, match=rf"51\.\d°.*45\.0°.*radius {smallest:.3f} m"):
        path_demand(g, [("line", 0.5), ("arc", 1.5, 0.25)], 0.1, joint_limit=math.pi / 4)
    path_demand(g, [("arc", 6.0, smallest * 1.001)], 0.1, joint_limit=math.pi / 4)
    with pytest.raises(AnalysisError):
        path_demand(g, [("arc", 6.0, smallest * 0.99)], 0.1, joint_limit=math.pi / 4)


def test_turns_to_both_sides_have_their_own_limits():
    """A left turn bends the joints of a trailing body to negative angles."""
    g = hara_chain(ALPHA)
    low, high = np.full(3, -0.3), np.full(3, 0.7)
    left, right = following_radii(g.lengths, low, high)
    assert (left, right) == (following_radius(g.lengths, 0.3), following_radius(g.lengths, 0.7))
    for radius, side in ((left, 1.0), (right, -1.0)):
        arc = [("arc", 6.0 * side, 1.001 * radius)]
        path_demand(g, arc, 0.1, joint_limit=(low, high))
        with pytest.raises(AnalysisError, match=r"bends joint2_yaw to .* -17\.2 … 40\.1°"):
            names = ("joint1_yaw", "joint2_yaw", "joint3_yaw")
            limits = (low, [0.8, 0.7, 0.8]) if side < 0 else ([-0.4, -0.3, -0.4], high)
            path_demand(g, [("arc", 6.0 * side, 0.99 * radius)], 0.1, 9, 9, limits, names)
    with pytest.raises(AnalysisError, match="positive"):
        path_demand(g, arc, -1.0)


def test_slip_is_that_of_the_worst_unit():
    """One unit's helix angle, believed 1 % too large, by the no-slip rows written out."""
    g, twist = hara_chain(ALPHA), np.array([-0.1, 0.0, 0.15])
    shape = np.array([0.3, 0.3, 0.3])
    rows = g.rows(shape)
    slips = []
    for unit in range(4):
        believed = np.array(ALPHA)
        believed[unit] *= 1.01
        wrong = hara_chain(believed)
        drive = wrong.rows(shape) @ twist / wrong.drive() * g.drive()
        left = drive - rows @ np.linalg.lstsq(rows, drive, rcond=None)[0]
        slips.append(np.sqrt(np.mean(left**2)))
    assert np.ptp(slips) > 0.1 * max(slips)
    assert slip_sensitivity(g, shape, twist)["alpha"] == pytest.approx(max(slips), rel=1e-9)
    both = worst_slip_sensitivity(g, (shape, 0 * shape), twist)
    assert both["alpha"] == max(max(slips), slip_sensitivity(g, 0 * shape, twist)["alpha"])


def test_direction_cone_of_the_straight_robot_is_the_closed_form():
    cone = direction_cone(hara_chain(ALPHA), np.zeros(3), 3.0)
    closed = 0.075 * 3.0 / (np.abs(np.cos(cone.direction)) + np.abs(np.sin(cone.direction)))
    assert np.allclose(cone.speed, closed) and np.isclose(cone.width(0.0), 2 * math.pi)
    assert 0 < cone.width(0.2) < math.pi
    one_hand = direction_cone(hara_chain((math.pi / 4,) * 4), np.zeros(3), 3.0)
    assert set(np.flatnonzero(one_hand.speed)) == {45, 225}  # only along the parallel axles


def test_fixed_shape_radius_against_brute_force():
    g, shape, speed, limit = hara_chain(ALPHA), np.array([-0.3, 0.2, -0.1]), 0.125, 3.2
    A, _ = constraint_matrices(np.concatenate([np.zeros(3), shape]), ALPHA, *PAPER)
    omega = np.linspace(-2, 2, 40_001)
    rates = A[:4, :3] @ np.stack([np.full_like(omega, -speed), 0 * omega, omega])
    fits = (np.abs(rates / g.drive()[:, None]) <= limit).all(axis=0)
    brute = speed / omega[fits].max(), -speed / omega[fits].min()
    assert np.allclose(fixed_shape_radii(g, shape, speed, limit), brute, rtol=1e-3)
    assert abs(brute[0] - brute[1]) > 1e-3  # a bent body turns tighter to one side
    assert fixed_shape_radii(g, shape, 10.0, limit) == (math.inf, math.inf)
    one_hand = hara_chain((0.7,) * 4)
    assert fixed_shape_radii(one_hand, np.zeros(3), speed, limit) == (math.inf, math.inf)
