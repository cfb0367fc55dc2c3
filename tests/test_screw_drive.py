"""Screw drive: A, B and u against wheel kinematics differentiated, paths, holds, demands, eq 8."""

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from screw_urdf import drive_urdf

from snakegen.analysis.screw_drive import (
    analyze,
    applies,
    constraint_matrices,
    examine,
    follow_the_leader,
    wheel_rates,
)
from snakegen.errors import AnalysisError
from snakegen.kernels.screw.constraints import follow
from snakegen.kernels.screw.shape_search import sigma_squared, smallest_sigma
from snakegen.robot.robot import from_urdf_text
from snakegen.screw_drive.geometry import drive_geometry
from snakegen.screw_drive.ground_paths import (
    FollowReference,
    TimeLaw,
    l_crank,
    path_length,
    path_pieces,
    path_points,
    s_curve,
    square,
    waypoints,
)
from snakegen.screw_drive.held_shape import direction_cone, fixed_shape_radii
from snakegen.screw_drive.kinematics import (
    ScrewGeometry,
    following_radii,
    following_radius,
    hara_chain,
    path_demand,
    slip_sensitivity,
    state_rate,
    worst_slip_sensitivity,
)
from snakegen.screw_drive.singularity import drive_hold, search_hold
from snakegen.screw_drive.tracking import ScrewLaw
from snakegen.simulation.drive.kinematic_plant import drive_kinematic

ALPHA = (-math.pi / 4, math.pi / 4, -math.pi / 4, math.pi / 4)
FIG9 = np.array(
    [0.1, 0.1, -1.1 * math.pi, -math.pi / 10, -math.pi / 11, -math.pi / 12]
)  # w(0) of HA section IV
PAPER = (0.075, 0.0, 0.103, 0.123)


def alternating(n):
    return tuple(math.pi / 4 * (-1.0) ** (np.arange(n) + 1))


def turn(x, y, angle):
    """Rotates a planar vector; works on complex numbers, for complex-step derivatives."""
    return np.array([np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y])


def ground_point(w, theta, i, r, L0, L1, L2):
    """Where the drum's material point that touches the ground at θ = 0 is (xy), link by link."""
    here, heading = np.array([w[0], w[1]]), w[2]
    here = here + turn(L0, 0.0, heading)
    for k in range(i):
        here = here + turn(L1 + L2, 0.0, heading)
        heading = heading + w[3 + k]
    # Rx(θ) on [0, 0, -r] has y = r sin θ.
    return here + turn(L1, r * np.sin(theta), heading), heading


def differentiated(w, alpha, r, L0, L1, L2):
    """Returns A and B by complex-step derivatives of the wheels' ground points."""
    n = len(alpha)
    A, B = np.zeros((2 * n - 1, n + 2)), np.zeros((2 * n - 1, 2 * n - 1))
    for i in range(n):
        heading = ground_point(w, 0.0, i, r, L0, L1, L2)[1]
        axle = turn(math.cos(alpha[i]), math.sin(alpha[i]), heading)
        for k in range(n + 2):
            step = w.astype(complex)
            step[k] += 1e-30j
            A[i, k] = axle @ ground_point(step, 0.0, i, r, L0, L1, L2)[0].imag / 1e-30
        B[i, i] = -axle @ ground_point(w, 1e-30j, i, r, L0, L1, L2)[0].imag / 1e-30
    A[n:, 3:] = B[n:, n:] = np.eye(n - 1)
    return A, B


@pytest.mark.parametrize("n", range(2, 11))
def test_matrices_and_rates_match_differentiated_kinematics(n):
    rng = np.random.default_rng(n)
    for _ in range(20):
        w, w_d, rate = rng.normal(size=(3, n + 2))
        alpha = rng.choice([-1, 1], n) * rng.uniform(0.2, 1.4, n)
        sizes = tuple(rng.uniform(0.05, 0.4, 4))
        A, B = constraint_matrices(w, alpha, *sizes)
        A_ref, B_ref = differentiated(w, alpha, *sizes)
        assert np.abs(A - A_ref).max() < 1e-12 and np.abs(B - B_ref).max() < 1e-12
        gain = rng.normal(size=(n + 2, n + 2))
        u = wheel_rates(w, w_d, rate, gain, alpha, *sizes)
        wanted = np.linalg.solve(B_ref, A_ref @ (rate - gain @ (w - w_d)))
        assert np.abs(u - wanted).max() < 1e-9 * max(1.0, np.abs(wanted).max())


def test_bare_links_and_uneven_lengths():
    """Units on links 1, 2, 4 and 5 of five, against the motion of their ground points."""
    rng = np.random.default_rng(7)
    lengths, offset = rng.uniform(0.1, 0.4, 5), rng.uniform(0.02, 0.2, 4)
    g = ScrewGeometry((0.5, -0.8, 0.9, -0.6), 0.06, (0, 1, 3, 4), tuple(offset), tuple(lengths))
    w = rng.normal(size=7)

    def place(state, i):
        psi = np.cumsum(state[2:])
        here = np.array([state[0], state[1]])
        for j in range(g.link[i]):
            here = here + turn(lengths[j], 0.0, psi[j])
        return here + turn(offset[i], 0.0, psi[g.link[i]]), psi[g.link[i]]

    rows = g.no_slip(w)
    for i in range(4):
        heading = place(w, i)[1]
        for k in range(7):
            step = w.astype(complex)
            step[k] += 1e-30j
            speed = place(step, i)[0].imag / 1e-30
            assert np.isclose(rows[i, k], turn(1.0, 0.0, heading + g.alpha[i]) @ speed, atol=1e-12)
    hold = search_hold(g, np.full(4, -0.7), np.full(4, 0.7), samples=256, starts=8, budget=2000)
    assert hold.weakest.sigma[-1] <= np.linalg.svd(g.rows(w[3:] * 0, g.scale))[1][-1]


def test_gain_may_be_scalar_diagonal_or_matrix():
    rng = np.random.default_rng(1)
    w, w_d, rate = rng.normal(size=(3, 6))
    scalar = wheel_rates(w, w_d, rate, 0.5, ALPHA, *PAPER)
    assert np.allclose(scalar, wheel_rates(w, w_d, rate, np.full(6, 0.5), ALPHA, *PAPER))
    assert np.allclose(scalar, wheel_rates(w, w_d, rate, 0.5 * np.eye(6), ALPHA, *PAPER))
    diagonal = np.array([0.5, 0.4, 0.3, 0.2, 0.1, 0.0])
    one = wheel_rates(w, w_d, rate, diagonal, ALPHA, *PAPER)
    assert np.allclose(one, wheel_rates(w, w_d, rate, np.diag(diagonal), ALPHA, *PAPER))
    assert not np.allclose(one, scalar)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"alpha": (0.0, 0.7, -0.7, 0.7)}, "unit 1 has a helix angle of 0°"),
        ({"alpha": (0.7, 0.7, math.pi, 0.7)}, "unit 3 has a helix angle of 180°"),
        ({"alpha": (0.7,)}, "at least 2 units"),
        ({"w": np.zeros(5)}, r"w has shape \(5,\), needs \(6,\)"),
        ({"w": [0, 0, math.nan, 0, 0, 0]}, "w has an entry that is not finite"),
        ({"gain": np.zeros(5)}, "gain has shape"),
        ({"r": -0.1}, "r must be positive"),
        ({"L1": -0.1}, "L0, L1, L2 not negative"),
    ],
)
def test_bad_input_is_refused_with_its_number(change, says):
    zero = np.zeros(6)
    given = {"w": zero, "w_d": zero, "w_d_dot": zero, "gain": 0.5, "alpha": ALPHA}
    given |= dict(zip(("r", "L0", "L1", "L2"), PAPER, strict=True))
    with pytest.raises(AnalysisError, match=says):
        wheel_rates(**(given | change))


PATHS = [
    l_crank(),
    s_curve(0.5, 1.0),
    [("arc", 2 * math.pi, 0.4), ("line", 0.1), ("arc", -4.0, 0.3)],
    [("line", 0.05)] + [("arc", 0.3, 0.5), ("line", 0.03), ("arc", -0.4, 0.6)] * 4,
]


@pytest.mark.parametrize("path", PATHS)
def test_every_joint_lies_on_the_path_behind_the_one_before(path):
    links = np.array([0.226, 0.3, 0.15, 0.2])
    dense = np.linspace(-1.5, path_length(path) + 0.5, 60_001)
    on_path = path_points(path, dense)[:, :2]
    for s in np.linspace(-0.3, path_length(path) + 0.4, 5):
        w = follow_the_leader(path, s, links)
        psi = np.cumsum(w[2:])
        nodes = w[:2] + np.vstack(
            [
                [0, 0],
                np.cumsum(links[:, None] * np.column_stack([np.cos(psi), np.sin(psi)]), axis=0),
            ]
        )
        at = s
        for node, chord in zip(nodes[1:], links, strict=True):
            # The first sample, going back along the path, that is a chord away from the last node.
            k = int(np.searchsorted(dense, at)) - 1
            origin = path_points(path, [at])[0, :2]
            while math.dist(on_path[k], origin) < chord:
                k -= 1
            at = dense[k] + (math.dist(on_path[k], origin) - chord)
            assert math.dist(path_points(path, [at])[0, :2], node) < 5e-5


@settings(max_examples=60, deadline=None)
@given(st.floats(-0.5, 4.0), st.integers(0, len(PATHS) - 1))
def test_reference_rate_is_its_derivative(s, which):
    pieces, links, h = path_pieces(PATHS[which]), np.full(5, 0.226), 1e-6
    w, rate = follow(pieces, s, links)
    ahead, behind = follow(pieces, s + h, links)[0], follow(pieces, s - h, links)[0]
    # Where a node passes from piece to piece the one-sided slopes differ: either may be it.
    slopes = np.stack([(ahead - w) / h, (w - behind) / h])
    assert (np.abs(slopes - rate).min(axis=0) < 1e-4).all()


def test_follow_the_leader_at_rest_and_on_the_arc():
    assert np.allclose(follow_the_leader([("line", 1)], 0.4, [0.2, 0.3]), [0.4, 0, -math.pi, 0])
    left = follow_the_leader([("arc", 6.0, 0.6)], 3.0, np.full(4, 0.226))
    assert np.allclose(np.degrees(left[3:]), -21.71, atol=5e-3)  # THEORY B: -21.7°
    right = follow_the_leader([("arc", -6.0, 0.6)], 3.0, np.full(4, 0.226))
    assert np.allclose(right[3:], -left[3:]) and np.isclose(right[1], -left[1])


def test_heading_runs_on_through_whole_turns():
    loop = [("arc", 2 * math.pi, 0.5)] * 3
    w = follow_the_leader(loop, path_length(loop) + 2.0, np.full(4, 0.226))
    assert np.isclose(w[2], 6 * math.pi - math.pi) and np.abs(w[3:]).max() < 1e-9


@pytest.mark.parametrize(
    "path", [[("arc", 1.0, -0.2)], [("line", -1.0)], [("bend", 1.0)], [("line", math.nan)], [7]]
)
def test_a_bad_piece_is_named(path):
    with pytest.raises(AnalysisError, match="path piece 1"):
        follow_the_leader([("line", 1.0), *path], 0.0, [0.2, 0.2])


def test_waypoints_pass_their_legs_and_refuse_a_radius_that_does_not_fit():
    points = np.array([[0.5, 0.2], [1.5, 0.2], [1.5, 1.4], [0.2, 2.0]])
    path, (x, y, heading) = waypoints(points, 0.3)
    end = path_points(path, [path_length(path)])[0]
    assert np.allclose(np.add((x, y), turn(*end[:2], heading)), points[-1], atol=1e-12)
    assert np.isclose(end[2] + heading, math.atan2(0.6, -1.3))
    with pytest.raises(AnalysisError, match=r"at most (\S+) m fits") as refusal:
        waypoints(points, 5.0)
    fits = float(str(refusal.value).split("at most ")[1].split()[0])
    waypoints(points, fits * 0.999)
    with pytest.raises(AnalysisError):
        waypoints(points, fits * 1.001)


@pytest.mark.parametrize("acceleration", [0.4, 0.05, math.inf])
def test_time_law_keeps_its_limits_and_rests_between_stretches(acceleration):
    law = TimeLaw((1.2, 0.3, 1.2), 0.2, acceleration)
    t = np.linspace(0, law.duration, 20_001)
    s, v = np.array([law.at(x) for x in t]).T
    assert np.isclose(s[-1], 2.7) and v.max() <= 0.2 + 1e-12 and v.min() >= 0
    assert np.abs(np.gradient(s, t)[1:-1] - v[1:-1]).max() < (1e-3 if acceleration < 1 else 0.11)
    if acceleration < 1:
        assert np.abs(np.diff(v) / np.diff(t)).max() <= acceleration * (1 + 1e-6)
        assert abs(v[np.searchsorted(s, 1.2)]) < 0.02


REFERENCES = {
    "lcrank": (
        FollowReference(tuple(l_crank()), (0.226,) * 4, TimeLaw((path_length(l_crank()),), 0.125)),
        0.5,
        FIG9,
    ),
    "square": (
        square(1.2, 0.2, 0.4, 3),
        (0.5, 0.5, 0.5, 0.0, 0.0, 0.0),
        np.array([0.05, -0.03, 0.1, 0.02, -0.01, 0.03]),
    ),
}


@pytest.mark.parametrize("name", REFERENCES)
def test_kinematic_loop_obeys_the_error_law(name):
    reference, gain, start = REFERENCES[name]
    law = ScrewLaw(hara_chain(ALPHA), gain=gain)
    run = drive_kinematic(law.command, reference, hara_chain(ALPHA), start, 25.0, 0.01)
    decay = np.exp(-np.multiply.outer(run.time, np.broadcast_to(gain, 6)))
    gap = np.abs(run.error - run.error[0] * decay).max(axis=1)
    assert gap[-1] < 1e-6 and gap.max() < 1e-6
    assert np.abs(run.slip).max() < 1e-12
    if name == "lcrank":  # THEORY B: 3.2 rad/s, 12°/s, 28 mm from the start error alone
        assert np.isclose(np.abs(run.command[:, :4]).max(), 3.2, atol=0.05)
        assert np.isclose(np.degrees(np.abs(run.command[:, 4:]).max()), 12, atol=0.2)
        assert np.isclose(run.position_rmse(), 0.028, atol=0.001)


def test_a_law_held_between_stages_would_break_the_error_law():
    """Guards the proof's sharpness: holding the law for 10 ms costs a hundred times 1e-6."""
    reference, gain, start = REFERENCES["lcrank"]
    law = ScrewLaw(hara_chain(ALPHA), gain=gain)
    held = {}

    def stale(w, w_d, rate):
        if held.get("calls", 0) % 5 == 0:
            held["u"] = law.command(w, w_d, rate)
        held["calls"] = held.get("calls", 0) + 1
        return held["u"]

    run = drive_kinematic(stale, reference, hara_chain(ALPHA), start, 5.0, 0.01)
    assert np.abs(run.error - run.error[0] * np.exp(-0.5 * run.time)[:, None]).max() > 1e-4


def test_law_parts_and_saturation():
    rng = np.random.default_rng(3)
    w, w_d, rate = rng.normal(size=(3, 6))
    whole = ScrewLaw(hara_chain(ALPHA), gain=0.5).command(w, w_d, rate)
    back = ScrewLaw(hara_chain(ALPHA), gain=0.5, feedforward=False).command(w, w_d, rate)
    A, B = constraint_matrices(w, ALPHA, *PAPER)
    assert np.allclose(whole - back, np.linalg.solve(B, A @ rate))
    forward = ScrewLaw(hara_chain(ALPHA), gain=0.5, feedback=False).command(w, w_d, rate)
    A_d, _ = constraint_matrices(w_d, ALPHA, *PAPER)
    assert np.allclose(forward, np.linalg.solve(B, A_d @ rate))
    slow = ScrewLaw(hara_chain(ALPHA), gain=0.5, screw_rate=1.0).command(w, w_d, rate)
    assert np.isclose(np.abs(slow[:4]).max(), 1.0)
    assert np.allclose(slow / np.abs(slow).max(), whole / np.abs(whole).max())


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


def test_analysis_reads_the_drive_from_a_urdf():
    robot = from_urdf_text(drive_urdf(ALPHA), None)
    assert applies(robot)
    found, wanted = drive_geometry(robot), hara_chain(ALPHA)
    assert found.link == wanted.link and np.allclose(found.alpha, wanted.alpha)
    assert np.allclose(found.offset, wanted.offset) and np.allclose(found.lengths, wanted.lengths)
    posture = {"joint1_yaw": 0.3, "joint3_yaw": -0.2, "joint2_pitch": 0.1}
    result = analyze(robot, robot.configuration(posture))
    assert np.allclose(result.hold.shape, [0.3, 0.0, -0.2]) and np.isclose(result.pitch, 0.1)
    A, _ = constraint_matrices([0, 0, 0, 0.3, 0, -0.2], ALPHA, *PAPER)
    sigma = np.linalg.svd(A[:4, :3] / [1, 1, 0.226], compute_uv=False)
    assert np.allclose(result.hold.sigma, sigma)
    demand = path_demand(wanted, l_crank(), 0.125, 6.0, 1.0, 0.7854)
    assert np.isclose(result.demand.fastest, demand.fastest)
    data = json.loads(json.dumps(result.to_json(), allow_nan=False))
    assert data["units"] == 4 and data["rank"] == 3 and data["certified_sigma"] > 0.1
    assert any("5.7°" in text for _, text in result.rows())
    with pytest.raises(AnalysisError, match="Did you mean 'lcrank'"):
        analyze(robot, robot.configuration(), path="lcrnk")


def test_report_names_what_is_wrong_with_a_drive():
    def report(alpha, path=(("line", 1.0),), limit=math.pi / 4):
        span = np.full(len(alpha) - 1, limit)
        return examine(hara_chain(alpha), 0 * span, -span, span, path)

    one_hand = report((math.pi / 4,) * 4)
    assert "one hand" in one_hand.warnings[0] and one_hand.hold.kind == "parallel axles"
    assert one_hand.search.singular and one_hand.fixed_radius == math.inf
    assert one_hand.to_json()["shapes_descended"] == 24
    assert one_hand.to_json()["shapes_sampled"] > 2048
    dead = report((math.pi / 4, 0.0, math.pi / 4, -math.pi / 4))
    assert dead.dead == (2,) and dead.demand is None and "unit 2" in dead.refusal
    assert json.dumps(dead.to_json(), allow_nan=False)
    two = report(alternating(2))
    assert any("needs 3" in text for text in two.warnings)
    tight = report(alternating(4), (("arc", 3.0, 0.2),))
    assert tight.demand is None and "45.0°" in tight.refusal
    assert tight.following_radius > 0.2 and ("path", tight.refusal) in tight.rows()
