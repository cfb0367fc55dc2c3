"""Statics of built robots: against Pinocchio, ZS24's tables, closed forms and brute force."""

import json

import numpy as np
import pinocchio as pin
import pytest
from published_arms import GRASPER_ANGLES, SIGNS, TABLE_5
from scipy.optimize import linprog

import snakegen
from snakegen.analysis.allocation import allocation
from snakegen.analysis.statics import analyze, joint_torques, twist_matrix
from snakegen.errors import AnalysisError, DescriptionError
from snakegen.statics.joint_torques import torque_terms
from snakegen.statics.tip import find_tip, tip_pose

ROBOTS = ("arm6", "grasper3", "dragon4", "dragon3")


@pytest.fixture(scope="module")
def robots():
    return {name: snakegen.load(name) for name in ROBOTS}


def random_state(robot, seed=0):
    rng = np.random.default_rng(seed)
    n = robot.model.nq
    base = 7 if robot.floating else 0
    low = np.r_[-np.ones(base), -0.7 * np.ones(n - base)]
    q = pin.randomConfiguration(robot.model, low, -low)
    return q, *rng.normal(size=(2, robot.model.nv))


@pytest.mark.parametrize("name", ROBOTS)
def test_full_torques_with_wrenches_equal_pinocchio(robots, name):
    robot = robots[name]
    q, v, a = random_state(robot)
    rng = np.random.default_rng(1)
    links = ["link1", "link2", "link3"]
    wrenches = {link: rng.normal(size=6) for link in links}
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    tau = pin.rnea(robot.model, data, q, v, a)
    for link, w in wrenches.items():
        frame = robot.model.getFrameId(link, pin.FrameType.BODY)
        around = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        tau -= pin.computeFrameJacobian(robot.model, data, q, frame, around).T @ w
    got = joint_torques(robot, q, v, a, wrenches=wrenches)
    assert np.max(np.abs(got - tau)) < 1e-11 * np.max(np.abs(tau))
    gravity = np.array([1.0, 2.0, -3.0])
    model = robot.model.copy()
    model.gravity.linear = gravity
    static = joint_torques(robot, q, v, a, gravity=gravity, terms="static")
    want = pin.computeGeneralizedGravity(model, model.createData(), q)
    np.testing.assert_allclose(static, want, atol=1e-11)


@pytest.mark.parametrize("name", ROBOTS)
def test_twist_matrix_equals_pinocchios_jacobians(robots, name):
    robot = robots[name]
    q, *_ = random_state(robot, 2)
    S = twist_matrix(robot, q)
    assert S.shape == (6, len(robot.joint_names))
    data = robot.model.createData()
    J = pin.computeJointJacobians(robot.model, data, q)  # world axes, at the world's origin
    first = 6 if robot.floating else 0
    origin = q[:3] if robot.floating else np.zeros(3)
    J = J[:, first:]
    moved = J[:3] - np.cross(origin, J[3:].T).T
    np.testing.assert_allclose(S, np.vstack([moved, J[3:]]), atol=1e-12)
    # ZS24 eq 11 with its sign: a wrench about the base origin, borne by the last body alone.
    w = np.random.default_rng(3).normal(size=6)
    tip = robot.chain_joints[-1]
    body = robot.body_of_joint(tip)
    link = f"link{len(robot.modules.lengths)}"
    pose = tip_pose(robot, q, find_tip(robot, link, [0, 0, 0]))
    at_link = np.r_[w[:3], w[3:] - np.cross(pose.position, w[:3])]
    tau = joint_torques(robot, q, wrenches={link: at_link}, gravity=(0, 0, 0), terms="static")
    above, b = [], body
    while b > 0:
        above.append(b - 1)
        b = robot.tree.parent[b]
    np.testing.assert_allclose(tau[first:][above], -(S.T @ w)[above], atol=1e-12)


def test_grasper_preset_gives_table_1(robots):
    robot = robots["grasper3"]
    q = robot.configuration(dict(zip(robot.joint_names, GRASPER_ANGLES, strict=True)))
    tip = find_tip(robot)
    lever = tip_pose(robot, q, tip).rotation @ [0.26, 0, 0]
    wrench = np.r_[0, -20, 0, np.cross(lever, [0, -20, 0])]
    torque = joint_torques(robot, q, wrenches={"link4": wrench}, terms="static") * 1e3
    np.testing.assert_allclose(torque, [5464.10, 3464.10, 0.0], atol=0.01)


def table_3(robot, terms):
    peaks = np.zeros(12)
    for t in np.linspace(0, 2, 201):
        q = 0.2 * np.sin(np.pi * t) * SIGNS
        v, a = 0.2 * np.pi * np.cos(np.pi * t) * SIGNS, -(np.pi**2) * q
        tau = joint_torques(robot, q, v, a, gravity=(0, 0, 0), terms=terms)
        peaks = np.maximum(peaks, np.abs(tau))
    return peaks


def test_arm_preset_gives_table_5_as_a_reconstruction(robots):
    relative = table_3(robots["arm6"], "full") / TABLE_5 - 1
    assert np.max(np.abs(relative[:10])) < 0.025
    np.testing.assert_allclose(relative[10:], [0.11, 0.09], atol=0.01)


def test_the_papers_own_form_gives_the_segments_share(robots):
    """J β of ZS24 eq 24: both axes of a universal joint turn the segment, not the cross."""
    robot = robots["arm6"]
    q, v, a = random_state(robot, 4)
    got = joint_torques(robot, q, v, a, gravity=(0, 0, 0), terms="quasi_static")
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, q)
    want = np.zeros(12)
    for j in range(12):
        segment = 2 * (j // 2) + 2  # Pinocchio's joint that carries the link
        R = data.oMi[segment].rotation
        J = R @ robot.model.inertias[segment].inertia @ R.T
        axes = [data.oMi[k + 1].rotation @ robot.tree.axis[k + 1] for k in range(12)]
        for i in range(j + 1):
            want[i] += axes[i] @ J @ axes[j] * a[j]
    np.testing.assert_allclose(got, want, atol=1e-12)
    assert np.all(table_3(robot, "quasi_static") < 0.1 * TABLE_5)


def test_thrust_goes_through_the_same_law(robots):
    """Base rows equal minus the allocation's wrench: Q λ about the CoG (ZN23 eqs 6, 10)."""
    robot = robots["dragon4"]
    q, *_ = random_state(robot, 5)
    thrust = np.random.default_rng(6).uniform(2, 16, 8)
    tau = joint_torques(robot, q, gravity=(0, 0, 0), thrust=thrust, terms="static")
    a = allocation(robot, q)
    w = a.dual @ thrust
    about_root = np.r_[w[:3], w[3:] + np.cross(a.cog, w[:3])]
    np.testing.assert_allclose(-tau[:6], about_root, atol=1e-10)


def test_hover_balances_and_joints_bear_what_statics_says(robots):
    robot = robots["dragon4"]
    q = robot.configuration({f"joint{k}_yaw": 1.0 for k in (1, 2, 3)}, base_rpy=(0.1, -0.2, 0.3))
    load = {"link4": [0, 0, -5.0, 0, 0, 0]}
    result = analyze(robot, q, wrenches=load)
    assert result.support == "hover"
    np.testing.assert_allclose(result.base, 0, atol=1e-9)
    assert sum(result.share.values()) == pytest.approx(1.0)
    total = sum(result.by_term.values())
    np.testing.assert_allclose(total, result.torque, atol=1e-12)
    held = analyze(robot, q, wrenches=load, hold="base")
    want = joint_torques(robot, q, wrenches=load)
    np.testing.assert_allclose(held.torque, want[6:], atol=1e-12)
    np.testing.assert_allclose(held.base, want[:6], atol=1e-12)
    assert held.base[:3] @ held.base[:3] == pytest.approx((robot.mass * 9.81 + 5) ** 2)


def test_shares_and_depths_differ_as_they_must(robots):
    robot = robots["arm6"]
    q, v, a = random_state(robot, 7)
    result = analyze(robot, q, v=v, a=a)
    assert result.by_term["coriolis"].any() and result.by_term["gyroscopic"].any()
    rows = torque_terms(robot, q, v, a)
    for depth in ("static", "quasi_static", "full"):
        want = joint_torques(robot, q, v, a, terms=depth)
        np.testing.assert_allclose(result.depths[depth], want, atol=1e-12)
    np.testing.assert_allclose(result.depths["static"], rows[0] + rows[5], atol=1e-12)
    json.dumps(result.to_json(), allow_nan=False)


def test_rows_name_the_hardest_joint_first_and_text_options_read_as_numbers(robots):
    robot = robots["arm6"]
    result = analyze(robot, np.zeros(12), wrenches="link7=0,0,-20,0,0,0", gravity="0,0,0")
    rows = result.rows()
    joints = [row for row in rows if row[0].startswith("joint")]
    assert joints[0] == ("joint1_pitch", "-21.8 N·m of 40 (54.5 %)")  # 20 N at 5 x 0.218 m
    assert ("no load", "7 joints") in rows  # the yaws, and joint 6 whose axis the force meets
    over = analyze(robot, np.zeros(12), wrenches="link7=0,0,-100,0,0,0")
    assert over.overloaded[0] == "joint1_pitch" and over.tip_load.payload == 0.0
    assert "overloaded" in dict(over.rows())
    with pytest.raises(AnalysisError, match="write link="):
        analyze(robot, np.zeros(12), wrenches="link7")


@pytest.mark.parametrize(
    ("given", "error", "words"),
    [
        ({"wrenches": {"lnk7": np.zeros(6)}}, DescriptionError, "Did you mean 'link7'"),
        ({"wrenches": {"link7": np.zeros(5)}}, AnalysisError, "numbers given, "),
        ({"wrenches": {"link7": np.full(6, np.nan)}}, AnalysisError, "NaN"),
        ({"v": np.zeros(3)}, AnalysisError, "v: 3 numbers given"),
        ({"gravity": "down"}, AnalysisError, "gravity"),
        ({"terms": "dynamic"}, AnalysisError, "terms must be one of static"),
        ({"hold": "hover"}, AnalysisError, "fixed base"),
        ({"direction": (0, 0, 0)}, AnalysisError, "direction"),
        ({"tip": "link9"}, DescriptionError, "link9"),
    ],
)
def test_bad_questions_are_refused(robots, given, error, words):
    with pytest.raises(error, match=words):
        analyze(robots["arm6"], np.zeros(12), **given)


def test_a_planted_fault_is_seen(robots, monkeypatch):
    """Shifting a link's centre of mass by a millimetre breaks the agreement with Pinocchio."""
    robot = snakegen.load("arm6")
    q, v, a = random_state(robot)
    want = pin.rnea(robot.model, robot.model.createData(), q, v, a)
    com = robot.tree.com.copy()
    com[8, 0] += 1e-3
    monkeypatch.setitem(robot.__dict__, "tree", robot.tree._replace(com=com))
    got = joint_torques(robot, q, v, a)
    assert np.max(np.abs(got - want)) > 1e-4 * np.max(np.abs(want))


def test_a_bent_body_of_two_apparatuses_hovers_by_its_four_rotors(robots):
    """Two forces cannot balance it: its rotors can, and leave the base nothing."""
    robot = robots["dragon3"]
    q = robot.configuration({"joint1_yaw": 1.2, "joint2_yaw": 0.9})
    result = analyze(robot, q)
    assert result.support == "dual"
    np.testing.assert_allclose(result.base, 0.0, atol=1e-4)  # nothing is left for a base to bear
    a = allocation(robot, q)
    # the same hover from another solver: four thrusts for [f_z; τ] leave no choice
    found = linprog(np.zeros(4), A_eq=a.dual[2:], b_eq=a.hover_wrench[2:], bounds=[(0.0, 20.0)] * 4)
    again = analyze(robot, q, thrust=found.x)
    np.testing.assert_allclose(again.base, 0.0, atol=1e-9)
    np.testing.assert_allclose(result.torque, again.torque, atol=1e-5)
    rows = dict(result.rows())
    assert rows["support"] == "dual-rotor hover, gimbals as they stand"
    assert "tip load capacity (root held)" in rows and result.to_json()["tip_load"]["root_held"]
    tilted = analyze(robot, robot.configuration({"joint1_yaw": 1.2}, base_rpy=(0.5, 0.0, 0.0)))
    assert dict(tilted.rows())["support"] == "base held: its rotors cannot hold it here"
    with pytest.raises(AnalysisError, match="hold the base instead"):
        analyze(robot, q, hold="hover", wrenches={"link1": [5, 0, 0, 0, 0, 0]})


def test_an_arm_is_not_told_that_its_root_is_held(robots):
    rows = dict(analyze(robots["arm6"], np.zeros(12)).rows())
    assert rows["support"] == "base held" and "tip load capacity" in rows
