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
from snakegen.sweep.batch import Body

BENT = {"joint1_yaw": 0.4, "joint2_pitch": -0.5, "joint3_yaw": 0.6}
SHORT = {"posture": BENT, "duration": 1.0}


@pytest.fixture(scope="module")
def arm():
    return snakegen.load(load_spec("dragon4", overrides=["base=fixed"]))


@pytest.mark.parametrize("force", ["0,0,0", "0,0,-15", "6,-8,4"])
def test_thrust_leaves_to_the_servos_what_relief_says(arm, force):
    """MuJoCo's servo torques against the cone program's; 43 N·m would load joint 1 without.

    The turned gimbals' own weight counts: without it a joint is 7 % of its limit off.
    """
    held = run(arm, "hold", options=SHORT | {"tip_force": force}, ideal=True)
    assert held.verdict.passed, held.verdict.summary()
    servo = held.channel("joint_torque").values[len(held.time) // 2 :].mean(axis=0)
    law = held.channel("joint_torque_law").values[0]
    wrench = {"link4": held.meta["facts"]["tip_wrench"]}
    page = relief.analyze(arm, arm.configuration(BENT), wrenches=wrench)
    assert held.meta["facts"]["relief"] == page.relieved.value
    assert np.array_equal(law, page.torque)
    assert np.abs(servo - law).max() < 0.01 * 7.0


def test_servos_alone_do_not_hold_and_a_lost_apparatus_is_found(arm):
    alone = run(arm, "hold", options=SHORT | {"thrust": False})
    assert {c.metric for c in alone.verdict.failed} >= {"joint_torque_use", "position_held_m"}
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


def test_a_tip_force_of_the_page_is_held(arm):
    """Along a corner of the cube: what the page says is borne; half as much again is refused."""
    page = relief.analyze(arm, arm.configuration(BENT))
    assert page.sizes.shape == (14,) and 15.0 < page.least < 40.0
    corner = page.corners[0]
    given = SHORT | {"tip_force": ",".join(f"{x:.6f}" for x in 0.98 * corner)}
    held = run(arm, "hold", options=given, ideal=True)
    assert held.meta["facts"]["relief"] <= 1.0 and held.metrics["position_held_m"] < 0.02
    with pytest.raises(MissionError, match="at best"):
        run(arm, "hold", options=SHORT | {"tip_force": ",".join(f"{1.5 * x:.6f}" for x in corner)})


def test_a_fixed_base_has_no_free_flight(arm):
    flown = (actuation, along, attitude, control, hover, singularity, wrench_margin)
    assert not any(analysis.applies(arm) for analysis in flown) and relief.applies(arm)
    with pytest.raises(AnalysisError, match="fixed base"):
        Body.of(arm, ("joint1_yaw",), np.eye(3), 1e-3)
