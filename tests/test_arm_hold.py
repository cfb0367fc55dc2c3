"""Thruster arms: thrust and servos hold what servos alone do not; what flies is not printed."""

import numpy as np
import pytest

import snakegen
from snakegen.analysis import (
    actuation,
    along,
    attitude,
    control,
    hover,
    relief,
    singularity,
    wrench_margin,
)
from snakegen.errors import AnalysisError, MissionError
from snakegen.simulation.arm.trials import arm_trials
from snakegen.simulation.flight.run import run
from snakegen.simulation.monte_carlo import wilson
from snakegen.spec.loading import load_spec
from snakegen.statics.joint_torques import joint_torques
from snakegen.statics.thrust_relief import force_set, inner_ball, thrust_map, tip_force
from snakegen.statics.tip import find_tip, tip_pose
from snakegen.sweep.batch import Body

BENT = {"joint1_yaw": 0.4, "joint2_pitch": -0.5, "joint3_yaw": 0.6}
SHORT = {"posture": BENT, "duration": 1.0}


@pytest.fixture(scope="module")
def arm():
    return snakegen.load(load_spec("dragon4", overrides=["base=fixed"]))


@pytest.mark.parametrize("force", ["0,0,0", "0,0,-15", "6,-8,4"])
def test_thrust_leaves_to_the_servos_what_relief_says(arm, force):
    """MuJoCo's servo torques against the cone program's; 43 N m would load joint 1 without.

    The turned gimbals' own weight counts: without it a joint is 7 % of its limit off.
    """
    held = run(arm, "hold", options=SHORT | {"tip_force": force}, ideal=True)
    assert held.verdict.passed, held.verdict.summary()
    servo = held.channel("joint_torque").values[len(held.time) // 2 :].mean(axis=0)
    law = held.channel("joint_torque_law").values[0]
    assert np.abs(servo - law).max() < 0.01 * 7.0


def test_servos_alone_do_not_hold_and_a_lost_apparatus_is_found(arm):
    alone = run(arm, "hold", options=SHORT | {"thrust": False})
    assert {c.metric for c in alone.verdict.failed} >= {"joint_torque_use", "position_max_m"}
    weak = snakegen.load(
        load_spec("dragon4", overrides=["base=fixed", "vectoring_apparatus.thrust_max=4"])
    )
    with pytest.raises(MissionError, match="at best"):
        run(weak, "hold", options=SHORT)


def test_trials_draw_thrusts_too(arm):
    found, worst = arm_trials(arm, "hold", 2, seed=1, options=SHORT)
    good = sum(t.survived for t in found.trials)
    assert good >= 1 and found.interval == wilson(good, 2)
    assert worst.meta["drawn"]["mass"] != 1.0
    given = worst.channel("thrust").values[-1].reshape(-1, 2)
    assert np.ptp(given[1]) > 1e-3  # rotors of one apparatus are asked alike


def test_the_set_of_tip_forces_is_reached_from_inside(arm):
    """A force in any direction, as large as the radius of the inner ball, is borne."""
    q = arm.configuration(BENT)
    index = [arm.joint_names.index(n) for n in arm.chain_joints]
    load = np.asarray(joint_torques(arm, q, terms="static"))[index]
    jacobian = tip_pose(arm, q, find_tip(arm)).jacobian[:3, index]
    thrust = thrust_map(arm, q)
    corners = force_set(thrust, load, jacobian)
    radius = inner_ball(corners)
    assert corners.shape == (26, 3) and 20.0 < radius < np.linalg.norm(corners, axis=1).min()
    for u in np.random.default_rng(0).standard_normal((4, 3)):
        u /= np.linalg.norm(u)
        assert tip_force(thrust, load, jacobian.T @ u, 1e-3).value >= radius


def test_a_fixed_base_has_no_free_flight(arm):
    flown = (actuation, along, attitude, control, hover, singularity, wrench_margin)
    assert not any(analysis.applies(arm) for analysis in flown) and relief.applies(arm)
    with pytest.raises(AnalysisError, match="fixed base"):
        Body.of(arm, ("joint1_yaw",), np.eye(3), 1e-3)
