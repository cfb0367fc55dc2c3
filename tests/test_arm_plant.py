"""An arm that is not its model: what is drawn, what it does to the tip, and what judges it."""

import numpy as np
import pytest

import snakegen
from snakegen.inverse_kinematics.friction import Friction
from snakegen.inverse_kinematics.torques_along import torques_along
from snakegen.inverse_kinematics.zs24_table3 import table3
from snakegen.kernels.kinematics.jacobians import tip_jacobian
from snakegen.simulation.arm.loop import _late
from snakegen.simulation.arm.plant import draw_arm, expected_tip_error
from snakegen.simulation.flight.run import run
from snakegen.simulation.flight.world import make_world
from snakegen.simulation.recording.summary import outcome
from snakegen.statics.tip import find_tip

SLOW = {"duration": 4.0}


@pytest.fixture(scope="module")
def arm():
    return snakegen.load("arm6")


@pytest.fixture(scope="module")
def world(arm):
    return make_world(arm, timestep=0.001, floor=False)


def test_draws_keep_to_what_is_declared(world):
    a, b, c = (draw_arm(world, None, s, ideal=False) for s in (0, 0, 1))
    assert np.array_equal(a.mass, b.mass) and not np.array_equal(a.mass, c.mass)
    assert np.abs(a.mass - 1).max() <= 0.05 and np.abs(a.inertia - 1).max() <= 0.10
    assert 0.005 <= a.delay <= 0.015 and 0.0 <= a.friction.static <= 0.005 * 40.0
    other = a.world(world).model
    np.testing.assert_allclose(other.body_mass, world.model.body_mass * a.mass)
    assert world.model.body_mass.sum() != pytest.approx(other.body_mass.sum(), rel=1e-6)
    given = draw_arm(world, Friction(0.1, 0.06), 0, ideal=False)
    assert given.friction == Friction(0.1, 0.06)
    none = draw_arm(world, None, 0, ideal=True)
    assert np.all(none.mass == 1.0) and none.delay == 0.0 and not none.friction.present


def test_late_commands_are_the_same_ones_later():
    time = np.arange(100) * 0.001
    command = np.stack([3.0 * time, time**2], axis=1)
    np.testing.assert_allclose(_late(time, command, 0.0125)[:, 0], 3.0 * (time - 0.0125))
    found = _late(time, command, 0.0125)[50:, 1]
    np.testing.assert_allclose(found, (time[50:] - 0.0125) ** 2, atol=3e-7)


def test_an_offset_moves_the_tip_by_the_jacobian(arm, world):
    """Expected error of offsets alone: σ times the Frobenius norm of the tip's Jacobian."""
    tip = find_tip(arm)
    motion = table3(arm, amplitude=1e-9)
    along = torques_along(
        arm, arm.configuration(), motion, np.array([0.0, 1.0]), gravity=np.zeros(3)
    )
    jacobian = tip_jacobian(arm.tree, np.eye(3), np.zeros(12), tip.body, tip.point)[2][:3]
    found = expected_tip_error(world, along, tip)
    assert found == pytest.approx(0.00175 * np.linalg.norm(jacobian), rel=0.02)


@pytest.mark.parametrize("seed", [0, 1])
def test_feed_forward_of_the_model_leads_an_arm_that_is_not_it(arm, seed):
    real = run(arm, "tip_path", seed=seed, options=SLOW)
    assert real.verdict.passed, real.verdict.summary()
    assert (
        1e-3 < real.metrics["position_max_m"] < 0.01
    )  # not the microns of an arm that is its model
    again = run(arm, "tip_path", seed=seed, options=SLOW)
    assert again.metrics["position_max_m"] == real.metrics["position_max_m"]
    said = "\n".join(outcome(real.meta, real.metrics))
    assert "feed-forward: speed and the torque" in said and "not its model" in said


def test_without_feed_forward_the_tip_fails_and_the_joint_is_named(arm):
    bare = run(arm, "tip_path", seed=0, options=SLOW | {"lead": "none"})
    check = next(c for c in bare.verdict.failed if c.metric == "position_max_m")
    assert check.value > 0.02 and check.worst is not None
    assert bare.meta["feed_forward"].startswith("none")


def test_a_link_half_as_heavy_again_is_seen_and_its_joint_named(arm, monkeypatch):
    """The law of the motion made misses what the link weighs more."""
    from snakegen.simulation.arm import run as arm_run

    honest = arm_run.draw_arm

    def planted(world, friction, seed, *, ideal):
        drawn = honest(world, friction, seed, ideal=ideal)
        drawn.mass[world.model.body("link4").id] *= 1.5
        return drawn

    fine = run(arm, "tip_path", seed=0, options=SLOW).metrics["made_gap_use"]
    monkeypatch.setattr(arm_run, "draw_arm", planted)
    heavy = run(arm, "tip_path", seed=0, options=SLOW)
    check = next(c for c in heavy.verdict.failed if c.metric == "made_gap_use")
    assert check.worst.part.startswith(("joint1", "joint2", "joint3"))
    assert check.value > 1.5 * check.bound > 1.5 * fine
