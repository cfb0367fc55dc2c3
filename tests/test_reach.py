"""Inverse kinematics: the right inverse, paths followed, limits kept, and how far it gets."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

import snakegen
from snakegen.analysis import reach
from snakegen.errors import AnalysisError
from snakegen.inverse_kinematics.collisions import Collisions
from snakegen.inverse_kinematics.path_following import chain_of, follow, place
from snakegen.kernels.kinematics.inverse_kinematics import damped_right_inverse, limited_step
from snakegen.statics.tip import find_tip


@pytest.fixture(scope="module")
def arm():
    return snakegen.load("arm6")


@pytest.fixture(scope="module")
def bent(arm):
    """A posture away from the straight one, tip on the right of a circle of 50 mm."""
    return np.tile([0.3, -0.25, 0.35, 0.2], 3) * np.r_[np.ones(6), 0.5 * np.ones(6)]


def tip_by_pinocchio(arm, angles):
    data = arm.model.createData()
    pin.framesForwardKinematics(arm.model, data, np.asarray(angles, float))
    frame = data.oMf[arm.model.getFrameId("link7")]
    return frame.act(np.array([arm.modules.lengths["link7"], 0, 0]))


def a_circle(arm, bent, duration=10.0):
    start = tip_by_pinocchio(arm, bent)
    path = reach.circle(start, 0.05, [1.0, 0.2, -0.1], duration)
    return path + start - path[0]


def rates_only(gain):
    """The loop of eqs 4-5 mended: rates integrated, no Newton step after each sample."""
    return reach.Options(gain=gain, corrections=0)


def test_right_inverse_is_pinv_where_regular_and_bounded_where_not():
    rng = np.random.default_rng(0)
    J = rng.normal(size=(3, 12))
    inverse, sigma, rank, damping = damped_right_inverse(J, 0.01, 0.01)
    np.testing.assert_allclose(inverse, np.linalg.pinv(J), atol=1e-12)
    np.testing.assert_allclose(sigma, np.linalg.svd(J, compute_uv=False))
    assert rank == 3 and damping == 0.0
    J[2] = J[0] + 1e-9 * J[1]
    inverse, _, rank, damping = damped_right_inverse(J, 0.01, 0.01)
    assert rank == 2 and damping == pytest.approx(0.01)
    assert np.linalg.norm(inverse, 2) <= 1 / (2 * 0.01) + 1e-9
    assert np.linalg.matrix_rank(J.T @ J) < 12  # what eq 4 would invert


def test_a_step_serves_the_task_first_then_the_wish_inside_the_room():
    rng = np.random.default_rng(1)
    J, wanted, wish = rng.normal(size=(3, 8)), 0.1 * rng.normal(size=3), rng.normal(size=8)
    wide = np.full(8, 10.0)
    step = limited_step(J, wanted, wish, -wide, wide, 1e-3, 1e-3)
    np.testing.assert_allclose(J @ step.joints, wanted, atol=1e-12)
    spare = np.eye(8) - np.linalg.pinv(J) @ J
    np.testing.assert_allclose(spare @ step.joints, spare @ wish, atol=1e-12)
    least = np.max(np.abs(np.linalg.pinv(J) @ wanted))
    tight = np.full(8, 0.9 * least)
    for also in (0 * wish, wish):
        held = limited_step(J, wanted, also, -tight, tight, 1e-3, 1e-3)
        assert np.all(np.abs(held.joints) <= tight + 1e-12) and np.any(held.held)
        np.testing.assert_allclose(J @ held.joints, wanted, atol=1e-10)


def test_circle_closed_loop_keeps_a_tenth_of_a_millimetre_and_open_loop_drifts(arm, bent):
    path = a_circle(arm, bent, duration=5.0)
    errors = {}
    for gain in (0.0, 10.0):
        track = reach.analyze(arm, bent, path=path, options=rates_only(gain)).track
        assert track.complete and np.all(track.rank == 3)
        by_model = np.array([tip_by_pinocchio(arm, q) for q in track.angles])
        np.testing.assert_allclose(track.tip, by_model, atol=1e-12)
        np.testing.assert_allclose(track.error, np.linalg.norm(by_model - path, axis=1), atol=1e-12)
        errors[gain] = track.error
    assert errors[10.0].max() <= 1e-4
    assert errors[0.0][-1] > 5 * errors[10.0][-1]
    exact = reach.analyze(arm, bent, path=path, options=reach.Options(corrections=3))
    assert exact.track.error.max() <= 1e-6


def test_posture_wish_moves_the_elbow_but_not_the_tip(arm, bent):
    path = np.repeat(tip_by_pinocchio(arm, bent)[None], 400, axis=0)
    chain, wish = chain_of(arm, bent, find_tip(arm)), np.zeros(12)
    options = reach.Options(posture=wish, pull=5.0, corrections=2)
    track = follow(chain, bent, path, options)
    assert track.error.max() < 1e-5
    before, after = np.linalg.norm(bent - wish), np.linalg.norm(track.angles[-1] - wish)
    assert after < 0.9 * before
    _, J = place(chain, track.angles[-1])
    spare = np.eye(12) - np.linalg.pinv(J) @ J
    assert np.linalg.norm(spare @ (wish - track.angles[-1])) < 0.02 * before


def test_limits_are_kept_while_the_others_make_up(arm, bent):
    start = tip_by_pinocchio(arm, bent)
    path = np.linspace(start, start + np.array([-0.7, 0.2, 0.3]), 400)
    track = reach.analyze(arm, bent, path=path, options=reach.Options(corrections=2)).track
    limit = arm.limits(arm.joint_names)[1]
    assert np.all(np.abs(track.angles) <= limit + 1e-12)
    assert track.complete and track.error.max() < 1e-4
    chain = chain_of(arm, bent, find_tip(arm))
    loose = replace(chain, lower=-3 * limit, upper=3 * limit)
    free = follow(loose, bent, path, reach.Options(corrections=2))
    assert np.max(np.abs(free.angles) - limit) > 0.01, "the case must press on a limit"


def test_an_unreachable_path_says_how_far_it_gets(arm, bent):
    start = tip_by_pinocchio(arm, bent)
    path = np.linspace(start, start + np.array([1.5, 0, 0]), 800)
    result = reach.analyze(arm, bent, path=path)
    assert not result.complete
    shoulder = np.array([0.294, 0, 0])
    far = np.linalg.norm(path - shoulder, axis=1)
    at_rim = result.track.whole * np.argmax(far > result.reach) / (len(path) - 1)
    assert result.reach == pytest.approx(6 * 0.218)
    assert at_rim - 0.05 < result.track.length <= at_rim + 0.005
    assert f"{result.track.length:.4g} of 1.5 m" in result.why
    beyond = reach.analyze(arm, bent, path=path + np.array([2.0, 0, 0]))
    assert beyond.track is None and beyond.started > 1.0 and "beyond" in beyond.why


def test_straight_arm_has_rank_two_and_leaves_it(arm):
    result = reach.analyze(arm, np.zeros(12))
    assert result.rank == 2 and not result.left_inverse
    np.testing.assert_allclose(np.abs(result.lost.T), [[1, 0, 0]], atol=1e-12)
    assert result.complete and result.track.error.max() <= 1e-4
    assert result.to_json()["path"]["error_max_m"] == result.track.error.max()


def test_the_body_follows_its_tip_through_a_port(arm):
    opening = reach.port([1.25, 0.08, 0.08], [1, 0, 0], 0.06)
    path = np.vstack(
        [
            np.linspace([1.2, 0.08, 0.08], [1.5, 0.08, 0.08], 400),
            np.linspace([1.5, 0.08, 0.08], [1.47, 0.16, 0.12], 200),
        ]
    )
    options = reach.Options(port=opening, corrections=2)
    led = reach.analyze(arm, np.zeros(12), path=path, options=options)
    assert led.complete and led.track.clearance > 0
    blind = reach.analyze(arm, np.zeros(12), path=path, options=reach.Options(corrections=2))

    def crossing(angles):
        """Where the backbone, drawn by Pinocchio, crosses the port's plane."""
        data = arm.model.createData()
        pin.framesForwardKinematics(arm.model, data, angles)
        nodes = [data.oMf[arm.model.getFrameId(f"link{k}")].translation for k in range(1, 8)]
        nodes.append(tip_by_pinocchio(arm, angles))
        for a, b in list(pairwise(nodes))[::-1]:
            if a[0] <= 1.25 < b[0]:
                return np.linalg.norm((a + (b - a) * (1.25 - a[0]) / (b[0] - a[0]))[1:] - 0.08)
        return 0.0

    off = max(crossing(q) for q in led.track.angles)
    assert 0.06 - off == pytest.approx(led.track.clearance, abs=1e-9)
    assert max(crossing(q) for q in blind.track.angles) > 2 * off


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"path": np.zeros((5, 2))}, "needed"),
        ({"path": np.full((5, 3), np.nan)}, "NaN"),
        ({"options": reach.Options(dt=0.0)}, "dt"),
        ({"options": reach.Options(posture=np.zeros(3))}, "posture"),
    ],
)
def test_bad_questions_are_refused(arm, bent, given, words):
    with pytest.raises(AnalysisError, match=words):
        reach.analyze(arm, bent, **given)


def test_a_path_comes_from_a_table(arm, bent, tmp_path):
    path = a_circle(arm, bent, duration=1.0)
    file = tmp_path / "path.csv"
    np.savetxt(file, path, delimiter=",", fmt="%.17g")
    want = reach.analyze(arm, bent, path=path)
    got = reach.analyze(arm, bent, path=str(file), port="1.0,0,0,1,0,0,1.0")
    np.testing.assert_array_equal(got.track.error < 2e-6, want.track.error < 2e-6)
    assert got.track.clearance > 0 and "port" in dict(got.rows())
    for text, words in (
        ("x,y,z\n1,2,x\n", "line 2: z is 'x'"),
        ("1,2,nan\n1,2,3\n", "line 1: z is 'nan'"),
        ("1,2\n3,4\n", "2 entries"),
    ):
        file.write_text(text)
        with pytest.raises(AnalysisError, match=words):
            reach.analyze(arm, bent, path=str(file))


def test_a_planted_fault_is_seen(arm, bent, monkeypatch):
    """A Jacobian 20 % too long must break the closed loop's tenth of a millimetre."""
    from snakegen.inverse_kinematics import path_following as module

    real = module.place

    def faulty(chain, full):
        position, J = real(chain, full)
        return position, 1.2 * J

    monkeypatch.setattr(module, "place", faulty)
    path = a_circle(arm, bent, duration=3.0)
    track = reach.analyze(
        arm, bent, path=path, options=reach.Options(corrections=0, give_up=0.1)
    ).track
    assert track.error.max() > 1e-4


@pytest.mark.parametrize(
    ("robot", "points", "says"),
    [
        ("grasper3", [[0.4, 0.2, 0], [0.4, 0.2, 0.05]], "cannot move along [0.00 0.00 1.00]"),
        ("arm6", [[1.5, 0.1, 0], [1.59, 0.03, 0]], "can be reached, but not in one step of 114 mm"),
        ("arm6", [[1.5, 0, 0], [1.7, 0, 0]], "98 mm beyond the stretched chain"),
        ("arm6", [[-0.5, 0, 0], [-0.5, 0.1, 0]], "at the limit"),
    ],
)
def test_a_lost_path_says_the_true_reason(robot, points, says):
    """Off its plane, too far in one step, beyond the chain, behind the joints' limits."""
    machine = snakegen.load(robot)
    result = reach.analyze(machine, machine.configuration(), path=np.array(points, float))
    assert says in result.why, result.why


def test_a_port_narrower_than_the_links_does_not_fit(arm):
    """Links have a radius of 40 mm: their line passes a rim of 20 mm, they do not."""
    assert Collisions(arm).thickest == pytest.approx(0.04)
    for radius, fits in ((0.06, True), (0.02, False)):
        got = reach.analyze(arm, arm.configuration(), port=f"1.25,0.08,0.08,1,0,0,{radius}")
        assert got.track.complete and got.fits == got.complete == fits
        assert ("does not fit" in dict(got.rows())["port"]) != fits
