"""Thrust on a fixed base: programs against SLSQP, and the relieved torques in MuJoCo."""

import mujoco
import numpy as np
import pytest
from scipy.optimize import minimize

import snakegen
from snakegen.analysis import relief
from snakegen.errors import AnalysisError
from snakegen.robot.kinematics import forward
from snakegen.robot.posture import set_angle
from snakegen.simulation.flight.world import make_world
from snakegen.spec.loading import load_spec
from snakegen.statics.joint_torques import joint_torques
from snakegen.statics.relieved_posture import free_gimbals, relieved_posture
from snakegen.statics.thrust_relief import least_use, thrust_map
from snakegen.statics.tip import find_tip, tip_pose

DOWN = np.array([0.0, 0.0, -9.81])


@pytest.fixture(scope="module")
def arm():
    return snakegen.load(load_spec("dragon4", overrides=["base=fixed", "joint.effort=3"]))


@pytest.fixture(scope="module")
def page(arm):
    return relief.analyze(arm, arm.configuration(POSTURE))


POSTURE = {"joint1_yaw": 0.4, "joint2_pitch": -0.5, "joint3_yaw": 0.6}


def test_forces_are_a_cone_programs_optimum(arm):
    """Thrust limited to 6 N each cannot take all: the share against SLSQP from many starts."""
    weak = snakegen.load(
        load_spec("dragon4", overrides=["base=fixed", "vectoring_apparatus.thrust_max=3"])
    )
    found = relief.analyze(weak, weak.configuration(POSTURE))
    q = found.posture.q
    load, thrust, size = found.posture.load, found.thrust, 3 * len(found.thrust.limit)
    there = least_use(thrust, load)
    assert there.bound <= found.relieved.value <= there.bound + 1e-5
    assert found.relieved.bound <= there.bound and found.posture.off.max() < 1e-6
    again = relieved_posture(weak, q, DOWN, loads(weak, np.zeros(3)))  # nothing moves any more
    assert again.relieved.value == pytest.approx(found.relieved.value, abs=1e-6)
    assert 0.2 < found.relieved.value < found.use
    rng = np.random.default_rng(0)
    best = np.inf
    for _ in range(3):
        run = minimize(
            lambda x: x[-1],
            np.append(rng.normal(size=size), 5.0),
            constraints=[
                {"type": "ineq", "fun": lambda x, s=s: x[-1] * thrust.effort - s * (
                    load - thrust.relief @ x[:-1])}
                for s in (1.0, -1.0)
            ] + [{"type": "ineq", "fun": lambda x: thrust.limit**2 - np.sum(
                x[:-1].reshape(-1, 3) ** 2, axis=1)}],
            method="SLSQP",
            options={"maxiter": 500},
        )  # fmt: skip
        best = min(best, run.fun) if run.success else best
    assert found.relieved.value == pytest.approx(best, abs=1e-4)
    assert np.all(np.linalg.norm(found.relieved.forces, axis=1) <= thrust.limit * (1 + 1e-9))


def test_mujoco_has_the_relieved_torques(arm, page):
    """The forces put on at the thrust points leave the joints what is predicted."""
    found = page
    world = make_world(arm, floor=False)
    data = mujoco.MjData(world.model)
    world.set_state(data, found.posture.q)
    mujoco.mj_forward(world.model, data)
    generalized = np.zeros(world.model.nv)
    for j, force in enumerate(found.relieved.forces):
        rotors = arm.modules.apparatuses[j].rotors
        point = np.mean([data.site(r.link).xpos for r in rotors], axis=0)
        body = world.model.site(rotors[0].link).bodyid[0]
        mujoco.mj_applyFT(world.model, data, force, np.zeros(3), point, body, generalized)
    left = data.qfrc_bias - generalized
    dofs = [int(world.model.joint(n).dofadr[0]) for n in found.thrust.joints]
    np.testing.assert_allclose(left[dofs], found.torque, atol=1e-9)
    assert np.abs(found.torque).max() < 1e-3 and np.abs(found.load).max() > 10.0


def loads(arm, force):
    """Returns the joint loads of a posture with a force at the tip, from Jacobians."""
    index = [arm.joint_names.index(n) for n in arm.chain_joints]

    def load_at(q):
        J = tip_pose(arm, q, find_tip(arm)).jacobian[:3, index]
        return joint_torques(arm, q, terms="static")[index] - J.T @ force

    return load_at


def test_a_tip_force_is_borne_and_no_more(arm, page):
    """With the force on, the relieving posture is within torque; beyond the bound it is not."""
    q, found = arm.configuration(POSTURE), page
    ways = np.kron(np.eye(3), np.array([[1.0], [-1.0]]))
    for u, (name, both) in zip(ways, found.along.items(), strict=True):
        assert np.isfinite(both.value) and 0.8 * both.bound < both.value <= both.bound
        alone = found.alone[name]
        assert np.isnan(alone) or alone < both.value
        if name not in ("+x", "-z"):
            continue
        held, lost = (
            relieved_posture(arm, q, DOWN, loads(arm, size * u)).relieved
            for size in (0.97 * both.value, 1.01 * both.bound)
        )
        assert held.value <= 1.0 < lost.bound


def test_gimbals_stay_within_what_they_can_do_to_the_loads(arm):
    """The joints' loads at any angle of the gimbals, and the bound is nearly reached."""
    rng = np.random.default_rng(1)
    q = arm.configuration(POSTURE)
    free, rest = free_gimbals(arm, q, DOWN), loads(arm, np.zeros(3))
    centre, most = rest(q) + free.shift, np.zeros(len(free.shift))
    axes = arm.gimbals.thrust_axis
    for _ in range(300):
        turned = arm.configuration(POSTURE)
        for name in arm.joint_names:
            if name.startswith("gimbal"):
                set_angle(arm, turned, name, rng.uniform(-np.pi, np.pi))
        # each apparatus at its limit, along its thrust
        frames = arm.gimbals.thrust_body
        rotation, _ = forward(arm.tree, np.eye(3), np.zeros(3), arm.angles(turned))
        full = 32.0 * np.array([rotation[b] @ a for b, a in zip(frames, axes, strict=True)])
        push = (thrust_map(arm, turned).relief - free.thrust.relief) @ full.ravel()
        most = np.maximum(most, np.abs(rest(turned) - centre - push))
    assert np.all(most <= free.swing + 1e-12) and np.all(most > 0.2 * free.swing)


def test_what_flies_or_has_no_thrust_is_refused():
    for name in ("dragon4", "arm6"):
        robot = snakegen.load(name)
        with pytest.raises(AnalysisError, match="fixed base and apparatuses"):
            relief.analyze(robot, robot.configuration())


def test_a_direction_without_a_limit_is_said_to_have_none():
    """A straight arm pushed along its axis; the least of all directions is that of the others."""
    arm = snakegen.load(load_spec("dragon4", overrides=["base=fixed"], links=2))
    found = relief.analyze(arm, arm.configuration(), gravity=(0.0, 0.0, 0.0))
    rows = dict(found.rows())
    assert rows["tip force +x"].startswith("no limit") and "inf" not in str(rows)
    assert np.isfinite(found.least) and len(found.corners) < 14
    assert found.to_json()["tip_force_N"]["+x"] is None
