"""Thrust on a fixed base: programs against SLSQP, and the relieved torques in MuJoCo."""

import mujoco
import numpy as np
import pytest
from scipy.optimize import minimize

import snakegen
from snakegen.analysis import relief
from snakegen.errors import AnalysisError
from snakegen.simulation.flight.world import make_world
from snakegen.spec.loading import load_spec


@pytest.fixture(scope="module")
def arm():
    return snakegen.load(load_spec("dragon4", overrides=["base=fixed", "joint.effort=3"]))


POSTURE = {"joint1_yaw": 0.4, "joint2_pitch": -0.5, "joint3_yaw": 0.6}


def test_forces_are_a_cone_programs_optimum(arm):
    """Thrust limited to 6 N each cannot take all: the share against SLSQP from many starts."""
    weak = snakegen.load(
        load_spec("dragon4", overrides=["base=fixed", "vectoring_apparatus.thrust_max=3"])
    )
    found = relief.analyze(weak, weak.configuration(POSTURE))
    thrust, size = found.thrust, 3 * len(found.thrust.limit)
    assert found.relieved.bound <= found.relieved.value <= found.relieved.bound + 1e-5
    assert 0.2 < found.relieved.value < found.use
    rng = np.random.default_rng(0)
    best = np.inf
    for _ in range(3):
        run = minimize(
            lambda x: x[-1],
            np.append(rng.normal(size=size), 5.0),
            constraints=[
                {"type": "ineq", "fun": lambda x, s=s: x[-1] * thrust.effort - s * (
                    found.load - thrust.relief @ x[:-1])}
                for s in (1.0, -1.0)
            ] + [{"type": "ineq", "fun": lambda x: thrust.limit**2 - np.sum(
                x[:-1].reshape(-1, 3) ** 2, axis=1)}],
            method="SLSQP",
            options={"maxiter": 500},
        )  # fmt: skip
        best = min(best, run.fun) if run.success else best
    assert found.relieved.value == pytest.approx(best, abs=1e-4)
    assert np.all(np.linalg.norm(found.relieved.forces, axis=1) <= thrust.limit * (1 + 1e-9))


def test_mujoco_has_the_relieved_torques(arm):
    """The forces put on at the thrust points leave the joints what is predicted."""
    q = arm.configuration(POSTURE)
    found = relief.analyze(arm, q)
    world = make_world(arm, floor=False)
    data = mujoco.MjData(world.model)
    world.set_state(data, q)
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


def test_a_tip_force_is_borne_and_no_more(arm):
    found = relief.analyze(arm, arm.configuration(POSTURE))
    for name, both in found.along.items():
        assert np.isfinite(both.value) and both.value <= both.bound * (1 + 1e-9)
        assert both.value >= 0.999 * both.bound
        alone = found.alone[name]
        assert np.isnan(alone) or alone < both.value


def test_what_flies_or_has_no_thrust_is_refused():
    for name in ("dragon4", "arm6"):
        robot = snakegen.load(name)
        with pytest.raises(AnalysisError, match="fixed base and apparatuses"):
            relief.analyze(robot, robot.configuration())
