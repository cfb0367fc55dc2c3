"""Stiffness of cabled postures: against MuJoCo's finite differences, and disturbed in MuJoCo."""

import json
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.optimize import LinearConstraint, minimize

import snakegen
from snakegen.analysis import cables
from snakegen.cli import main
from snakegen.description.mjcf.tendons import holding
from snakegen.errors import AnalysisError, SpecError
from snakegen.kernels.cables.cables import Holes
from snakegen.spec.loading import load_spec
from snakegen.statics.cable_holding import least_holding_tension, stiffness_of
from snakegen.statics.cable_stiffness import PointLoad, cable_geometry, chain_of, load_stiffness
from snakegen.statics.cabled import HELD_DRIFT
from snakegen.statics.joint_torques import joint_torques

DOWN = np.array([0.0, 0.0, -9.81])


@pytest.fixture(scope="module")
def arm():
    return snakegen.load("arm6")


def posture(arm, rng):
    return rng.uniform(-0.4, 0.4, arm.model.nq)


def differences(path, joints, step=1e-5):
    """Returns -∂τ/∂θ of an MJCF at rest, by central differences of MuJoCo's forces."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    dofs = [int(model.joint(n).dofadr[0]) for n in joints]

    def torque(dof, by):
        mujoco.mj_resetDataKeyframe(model, data, 0)
        data.qpos[dof] += by
        mujoco.mj_forward(model, data)
        return (data.qfrc_bias - data.qfrc_actuator - data.qfrc_passive)[dofs]

    return np.array([(torque(d, step) - torque(d, -step)) / (2 * step) for d in dofs]).T


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("base", ["fixed", "{pose: any, rpy: [0.4, -0.7, 0.2]}"])
def test_stiffness_is_mujocos_finite_difference(seed, base, tmp_path, monkeypatch):
    """Cables, their tension and gravity, on any base, to 1e-6 of the largest entry."""
    monkeypatch.setattr("snakegen.statics.cabled.let_go", lambda *_: (0.0, 0.0, None, 0.0))
    arm = snakegen.load(load_spec("arm6", overrides=[f"base={base}"]))
    rng = np.random.default_rng(seed)
    found = cables.analyze(
        arm, posture(arm, rng), minimum=10 + 30 * seed, elasticity=5e4, mjcf=tmp_path / "a.xml"
    )
    measured = differences(tmp_path / "a.xml", found.joints)
    assert np.abs(measured - found.stiffness).max() < 1e-6 * np.abs(found.stiffness).max()
    assert np.abs(found.stiffness - found.stiffness.T).max() < 1e-9


def test_loads_are_the_difference_of_static_torques(arm):
    """Forces and moments that keep their direction in the world: the symmetric part."""
    rng = np.random.default_rng(3)
    q = posture(arm, rng)
    wrench = rng.normal(size=6) * 5
    body, rotation, origin = arm.body_of_link("link5")
    load = PointLoad(body, origin, wrench[:3], wrench[3:])
    index = np.arange(len(arm.joint_names))
    found = load_stiffness(arm, chain_of(arm, q), DOWN, (load,), index)
    step = 1e-6

    def torque(k, by):
        moved = q.copy()
        moved[k] += by
        return joint_torques(arm, moved, wrenches={"link5": wrench}, terms="static")

    rows = [(torque(k, step) - torque(k, -step)) / (2 * step) for k in index]
    measured = np.array(rows).T
    assert np.abs(measured).max() > 1.0
    assert np.allclose(found, 0.5 * (measured + measured.T), atol=1e-7)
    assert rotation.shape == (3, 3)


def test_the_fault_that_was_called_held(arm, tmp_path):
    """Balanced to 1e-12, eigenvalues -4.06 and -2.30 N·m/rad: bent by 1 mrad it leaves."""
    q = arm.configuration({"joint3_yaw": 0.4})
    found = cables.analyze(arm, q, minimum=80.0, mjcf=tmp_path / "a.xml")
    values = np.linalg.eigvalsh(found.stiffness)
    assert values[:2] == pytest.approx([-4.056, -2.304], abs=1e-3)
    assert found.feasible and not found.holds
    assert found.held.drift < 1e-9 and found.held.left is True
    out = found.to_json()
    assert (out["state"], out["held"], out["in_mujoco"]["held"]) == ("balanced", False, False)
    assert out["least_tension_that_holds_N"] is None
    assert out["held_up_to_least_tension_N"] == pytest.approx(54.6, abs=0.1)


def test_held_comes_back_and_balanced_leaves(arm, tmp_path):
    """The prediction, by the sign of the least eigenvalue, is what MuJoCo does."""
    rng = np.random.default_rng(11)
    seen = {True: 0, False: 0}
    for k in range(8):
        q = posture(arm, rng)
        least = 5.0 if k % 2 else 150.0
        found = cables.analyze(arm, q, minimum=least, mjcf=tmp_path / "a.xml")
        if not found.feasible:
            continue
        assert found.held.left is (not found.holds), (k, found.least)
        seen[found.holds] += 1
    assert min(seen.values()) >= 2


def _stiffness(arm, q, **given):
    routing = cables.route(arm)
    joints = [n for group in routing.segments for n in group]
    index = np.array([arm.body_of_joint(n) - 1 for n in joints])
    geometry = cable_geometry(arm, q, routing.holes, index)
    torque = joint_torques(arm, q, terms="static")[index]
    return stiffness_of(arm, geometry, gravity=DOWN, winch=5e4, **given), torque


def test_the_least_tension_that_holds_is_a_semidefinite_optimum(arm):
    """Where the least tensions buckle: the cut linear programs meet SLSQP's optimum."""
    rng = np.random.default_rng(2)
    q = posture(arm, rng)
    stiffness, torque = _stiffness(arm, q)
    plain = cables.analyze(arm, q, minimum=5.0)
    margin = stiffness.softest(plain.tension)[0] + 0.5  # above what least tensions give
    found = least_holding_tension(stiffness, torque, 1.0, np.inf, margin)
    assert found is not None
    assert stiffness.softest(found)[0] >= margin
    assert np.allclose(stiffness.arms @ found, torque, atol=1e-7)
    assert found.min() >= 1.0 - 1e-9
    count = len(found)
    best = minimize(
        lambda t: t.sum() / 1e3,
        found + 0.1,
        jac=lambda t: np.full(count, 1e-3),
        bounds=[(1.0, None)] * count,
        constraints=[
            LinearConstraint(stiffness.arms, torque, torque),
            {"type": "ineq", "fun": lambda t: stiffness.softest(t)[0] - margin},
        ],
        method="SLSQP",
        options={"maxiter": 300, "ftol": 1e-10},
    )
    assert best.success, best.message
    assert found.sum() <= 1e3 * best.fun * (1 + 1e-6)
    assert least_holding_tension(stiffness, torque, 400.0, np.inf) is None


def test_friction_over_a_hole_is_the_capstan(arm):
    """A cable that turns by φ in a hole carries e^(-μφ) behind it."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0.0]])
    holes = Holes(np.array([0, 3]), np.array([0, 0, 0]), points)
    made = cable_geometry(arm, arm.configuration(), holes, np.array([0]), 0.3)
    assert made.share == pytest.approx([1.0, np.exp(-0.3 * np.pi / 2)])


def test_friction_costs_tension_and_never_helps_stiffness(arm):
    q = arm.configuration({"joint1_yaw": 0.4, "joint2_yaw": -0.3, "joint4_pitch": 0.4})
    free, rubbed = (cables.analyze(arm, q, friction=mu) for mu in (0.0, 0.3))
    outer = [n.startswith("cable6") for n in free.names]  # they run through every joint
    assert rubbed.tension[outer].max() > 1.2 * free.tension[outer].max()
    assert np.allclose(rubbed.arms @ rubbed.tension, rubbed.torque, atol=1e-7)
    assert np.all(np.abs(rubbed.arms) <= np.abs(free.arms) + 1e-9)


def test_a_load_at_the_tip_takes_tension_and_stability(arm):
    q = arm.configuration({"joint3_yaw": 0.4})
    free, loaded = (cables.analyze(arm, q, tip_force=f) for f in (None, "0,0,-10"))
    lever = 0.436 + 0.872 * np.cos(0.4)  # m, from joint 1 to the tip: two links, four turned
    assert loaded.torque[0] - free.torque[0] == pytest.approx(-10 * lever, rel=1e-9)
    assert loaded.least < free.least and loaded.limit < free.limit
    along = cables.analyze(arm, q, tip_force="0,0,-10", motion="table3").to_json()["along"]
    assert along["balanced_instants"] == along["instants"]
    assert along["stiffness_least_Nm_rad"] < loaded.least


def test_routing_of_the_spec_is_the_routing_used(capsys):
    arm = snakegen.load(load_spec("arm6", overrides=["cables={count: 4, radius: 0.025}"]))
    found = cables.analyze(arm, arm.configuration())
    assert len(found.names) == 24
    assert found.routing["radius_m"] == 0.025 and not found.routing["assumed"]
    assert cables.analyze(arm, arm.configuration(), count=3).routing["radius_m"] == 0.025
    with pytest.raises(SystemExit) as ended:
        main(["analyze", "cables", "arm6", "--set", "cables.count=5", "--json"])
    assert ended.value.code == 0
    assert json.loads(capsys.readouterr().out)["routing"]["cables_per_segment"] == 5


@pytest.mark.parametrize(
    "given",
    [{"stiffness": 0.0}, {"elasticity": -1}, {"friction": -0.1}, {"minimum": "x"}, {"count": "2"}],
)
def test_numbers_that_are_none_are_refused(arm, given):
    with pytest.raises(AnalysisError):
        cables.analyze(arm, arm.configuration(), **given)


def test_cables_of_a_floating_base_are_refused():
    with pytest.raises(SpecError, match="fixed base"):
        load_spec("dragon4", overrides=["cables.count=3"])


def test_any_cable_lost_is_found(arm, tmp_path, monkeypatch):
    """Of a held posture each cable in turn is cut: MuJoCo's robot leaves, and the page says so."""
    monkeypatch.setattr("snakegen.statics.cabled.let_go", lambda *_: (0.0, 0.0, None, 0.0))
    path = tmp_path / "a.xml"
    found = cables.analyze(arm, arm.configuration({"joint2_yaw": 0.3}), minimum=20.0, mjcf=path)
    assert found.holds and holding(path, 0.3).drift < 1e-9
    for name in found.names:
        spec = mujoco.MjSpec.from_file(str(path))
        spec.actuator(name).forcerange = [-1e-9, 0.0]
        cut = tmp_path / "cut.xml"
        cut.write_text(spec.to_xml())
        lost = holding(cut, 0.3)
        assert lost.drift > 10 * HELD_DRIFT and lost.acceleration > 1.0, name
        rows = dict(replace(found, held=replace(lost, left=None)).rows())
        assert "NOT" in rows["in MuJoCo"], name
