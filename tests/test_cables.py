"""Cables: lengths and arms against MuJoCo's tendons, tensions against the closed form and an LP."""

import mujoco
import numpy as np
import pytest
from scipy.optimize import linprog

import snakegen
from snakegen.analysis import cables, motion
from snakegen.errors import AnalysisError
from snakegen.kernels.cables.cables import balance, lengths_and_rates


@pytest.fixture(scope="module")
def arm():
    return snakegen.load("arm6")


@pytest.fixture(scope="module")
def bent(arm):
    return np.random.default_rng(4).uniform(-0.6, 0.6, arm.model.nq)


@pytest.mark.parametrize("coupled", [True, False])
def test_lengths_and_arms_equal_mujocos_spatial_tendons(arm, bent, coupled):
    routing = cables.route(arm, count=4, radius=0.025, phase=0.3, coupled=coupled)
    names = ["world", *arm.joint_names]
    spec = mujoco.MjSpec()
    tree, bodies = arm.tree, [spec.worldbody]
    for i in range(1, len(tree.parent)):
        body = bodies[tree.parent[i]].add_body(pos=tree.translation[i], mass=1, inertia=[1, 1, 1])
        body.add_joint(name=names[i], axis=tree.axis[i], type=mujoco.mjtJoint.mjJNT_HINGE)
        bodies.append(body)
    holes = routing.holes
    for h, (b, point) in enumerate(zip(holes.body, holes.point, strict=True)):
        bodies[b].add_site(name=f"hole{h}", pos=point)
    for k, name in enumerate(routing.names):
        tendon = spec.add_tendon(name=name)
        for h in range(holes.first[k], holes.first[k + 1]):
            tendon.wrap_site(f"hole{h}")
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:] = bent
    mujoco.mj_forward(model, data)
    length, rates = lengths_and_rates(tree, np.eye(3), arm.angles(bent), holes)
    np.testing.assert_allclose(length, data.ten_length, atol=1e-12)
    dense = np.zeros((model.ntendon, model.nv))
    if data.ten_J.size == dense.size:
        dense = data.ten_J.reshape(dense.shape)
    else:
        start = getattr(model, "ten_J_rowadr", getattr(data, "ten_J_rowadr", None))
        count = getattr(model, "ten_J_rownnz", getattr(data, "ten_J_rownnz", None))
        column = getattr(model, "ten_J_colind", getattr(data, "ten_J_colind", None))
        for k in range(model.ntendon):
            at = slice(start[k], start[k] + count[k])
            dense[k, np.ravel(column)[at]] = np.ravel(data.ten_J)[at]
    np.testing.assert_allclose(rates, dense, atol=1e-12)
    result = cables.analyze(arm, bent, routing=routing)
    np.testing.assert_allclose(-dense.T @ result.tension, result.torque, atol=1e-9)


def test_straight_arms_are_the_textbooks(arm):
    """r [−sin φ, cos φ] about pitch and yaw, φ from y towards z."""
    routing = cables.route(arm, radius=0.03, phase=0.2, coupled=False)
    _, rates = lengths_and_rates(arm.tree, np.eye(3), np.zeros(12), routing.holes)
    for c in range(3):
        phi = 0.2 + 2 * np.pi * c / 3
        np.testing.assert_allclose(-rates[c, :2], 0.03 * np.array([-np.sin(phi), np.cos(phi)]))
        assert not np.any(rates[c, 2:])


def test_three_symmetric_cables_have_the_closed_form_and_it_is_the_least():
    phi = 2 * np.pi * np.arange(3) / 3
    A = 0.03 * np.array([-np.sin(phi), np.cos(phi)])
    rng = np.random.default_rng(0)
    for torque in rng.normal(size=(20, 2)):
        t, short = balance(A, torque, 5.0)
        assert not np.any(short)
        np.testing.assert_allclose(A @ t, torque, atol=1e-12)
        assert t.min() == pytest.approx(5.0)
        t0 = np.linalg.pinv(A) @ torque
        np.testing.assert_allclose(t, t0 + (5.0 - t0.min()), atol=1e-9)  # t = A⁺τ + λ·1
        least = linprog(np.ones(3), A_eq=A, b_eq=torque, bounds=[(5.0, None)] * 3)
        assert t.sum() == pytest.approx(least.fun, rel=1e-9)


def test_uneven_and_many_cables_are_least_too():
    rng = np.random.default_rng(1)
    for c in (3, 4, 6):
        phi = np.linspace(0, 2 * np.pi, c, endpoint=False) + rng.uniform(-0.3, 0.3, c)
        A = 0.02 * np.array([-np.sin(phi), np.cos(phi)])
        torque = rng.normal(size=2)
        t, short = balance(A, torque, 2.0)
        least = linprog(np.ones(c), A_eq=A, b_eq=torque, bounds=[(2.0, None)] * c)
        assert not np.any(short) and t.min() >= 2.0 - 1e-9
        assert t.sum() == pytest.approx(least.fun, rel=1e-9)


@pytest.mark.parametrize("count", [3, 4])
def test_coupled_cables_hold_the_arm_and_its_tip_load(arm, bent, count):
    routing = cables.route(arm, count=count)
    result = cables.analyze(arm, bent, routing=routing, wrenches={"link7": [0, 3, -5, 0, 0, 0]})
    assert result.feasible and result.tension.min() >= 5.0 - 1e-9
    np.testing.assert_allclose(result.arms @ result.tension, result.torque, atol=1e-9)
    # Forgetting that far cables load near joints would miss the balance by far.
    own = np.zeros_like(result.arms)
    for k, columns in enumerate(routing.columns):
        own[2 * k : 2 * k + 2, columns] = result.arms[2 * k : 2 * k + 2, columns]
    assert np.max(np.abs(own @ result.tension - result.torque)) > 0.05


def test_what_cannot_be_held_says_which_joint_lacks_how_much(arm):
    q = np.zeros(12)
    result = cables.analyze(arm, q, maximum=200.0)
    assert not result.feasible
    i = int(np.argmax(np.abs(result.shortage)))
    assert result.joints[i] in result.why
    assert f"{abs(result.shortage[i]):.4g} N·m" in result.why
    np.testing.assert_allclose(
        result.torque - result.arms @ result.tension, result.shortage, atol=1e-9
    )
    assert result.tension.max() <= 200.0 + 1e-9
    lone = balance(0.03 * np.array([[1.0, 1.0, 1.0]]), np.array([-1.0]), 1.0, 50.0)
    assert lone[1][0] == pytest.approx(-1.09)  # all pull one way: -1 N·m is out of reach


def test_all_segments_at_once_where_one_after_the_other_fails(arm):
    """A cap that tip-first least tensions break, but some other choice of tensions keeps."""
    rng = np.random.default_rng(0)
    q = rng.uniform(-0.7, 0.7, (57, 12))[56]
    free = cables.analyze(arm, q)
    assert free.method == "back-substitution"
    cap = 0.9 * free.tension.max()
    result = cables.analyze(arm, q, maximum=cap)
    assert result.feasible and result.method == "all segments at once"
    np.testing.assert_allclose(result.arms @ result.tension, result.torque, atol=1e-7)
    assert result.tension.max() <= cap + 1e-6


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"count": 2}, "three cables"),
        ({"count": True}, "three cables"),
        ({"radius": 0.0}, "above 0"),
        ({"phase": np.nan}, "finite phase"),
    ],
)
def test_impossible_routings_are_refused(arm, change, words):
    with pytest.raises(AnalysisError, match=words):
        cables.route(arm, **change)


def test_impossible_questions_are_refused(arm):
    with pytest.raises(AnalysisError, match="no range"):
        cables.analyze(arm, np.zeros(12), minimum=10, maximum=5)
    with pytest.raises(AnalysisError, match="NaN"):
        cables.analyze(arm, np.zeros(12), torque=np.full(12, np.nan))
    with pytest.raises(AnalysisError, match="fixed base"):
        cables.analyze(snakegen.load("dragon3"), np.zeros(15))


def test_a_routing_that_nobody_gave_is_said_to_be_assumed(arm):
    found = cables.analyze(arm, np.zeros(12))
    label, text = found.rows()[0]
    assert label == "routing" and text.startswith("assumed routing: 3 a segment at 30 mm")
    assert found.to_json()["routing"] == {
        "assumed": True,
        "cables_per_segment": 3,
        "radius_m": 0.03,
        "phase_rad": 0.0,
        "standoff_m": 0.02,
        "sheathed": False,
    }
    given = cables.analyze(arm, np.zeros(12), count=4, sheathed=True)
    assert given.rows()[0][1].startswith("4 a segment at 30 mm")
    assert not given.to_json()["routing"]["assumed"]
    own = cables.analyze(arm, np.zeros(12), routing=cables.route(arm))
    assert own.rows()[0] == ("routing", "as given") and own.to_json()["routing"] is None


def test_a_motion_that_nobody_gave_is_said_to_be_assumed(arm):
    found = motion.analyze(arm, np.zeros(12), rate=50)
    assert found.rows()[0][1].startswith("table3 (assumed: none was given), 6 s, weightless")
    assert found.to_json()["motion_assumed"]
    asked = motion.analyze(arm, np.zeros(12), motion="table3", rate=50)
    assert "assumed" not in asked.rows()[0][1] and not asked.to_json()["motion_assumed"]
    np.testing.assert_array_equal(found.torque, asked.torque)
