"""Screw drive: A, B and u against wheel kinematics differentiated, paths, holds, demands, eq 8."""

import json
import math

import numpy as np
import pytest
from screw_urdf import drive_urdf

from snakegen.analysis.screw_drive import (
    analyze,
    applies,
    constraint_matrices,
    examine,
    wheel_rates,
)
from snakegen.errors import AnalysisError
from snakegen.robot.robot import from_urdf_text
from snakegen.screw_drive.geometry import drive_geometry
from snakegen.screw_drive.ground_paths import (
    FollowReference,
    TimeLaw,
    l_crank,
    path_length,
    square,
)
from snakegen.screw_drive.kinematics import (
    ScrewGeometry,
    hara_chain,
    path_demand,
)
from snakegen.screw_drive.singularity import search_hold
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
