"""What joints feel besides thrust and weight: told from the law, kept within limits in flight."""

import numpy as np
import pytest

from snakegen import load
from snakegen.control.controller import flight_controller
from snakegen.control.frame import cog_frame
from snakegen.kernels.control.types import Measured, Target
from snakegen.simulation.flight.postures import bent, place
from snakegen.simulation.flight.run import run
from snakegen.statics.joint_loads import joint_loads


@pytest.fixture(scope="module")
def robot():
    return load("dragon4")


def felt(robot, push, seconds, *, told=True):
    """Returns strain (6,) after ticks whose servos carry thrust, weight and `push` on link 4."""
    c = flight_controller(robot, allocator="constrained")
    q = place(robot, bent(robot), np.zeros(3))
    angles, still = robot.angles(q), np.zeros(3)
    frame, loads = cog_frame(c, angles), joint_loads(robot, q, "link4")
    state, thrust = c.start(_gimbals(robot, angles)), None
    target = Target(frame.cog, still, still, np.eye(3), still)
    for _ in range(round(seconds / 0.005)):
        torques = np.zeros(6)
        if thrust is not None:
            torques = loads.bias + loads.rotors @ thrust + loads.disturbance @ push
        seen = (np.eye(3), still, still, still, angles, np.zeros_like(angles))
        measured = Measured(*seen, torques) if told else Measured(*seen)
        state, command = c.tick(measured, target, state, 0.005)
        thrust = command.thrust
    return state.strain, loads.disturbance @ push


def _gimbals(robot, angles):
    pairs = zip(robot.gimbals.roll_body, robot.gimbals.pitch_body, strict=True)
    return np.array([[angles[b - 1] for b in pair] for pair in pairs])


def test_strain_is_what_a_push_far_from_the_root_does_to_the_joints(robot):
    push = np.array([1.0, -2.0, 0.5, 0.1, 0.0, 0.2])
    strain, true = felt(robot, push, 4.0)
    assert np.abs(true).max() > 0.5
    np.testing.assert_allclose(strain, true, atol=2e-3)
    early, _ = felt(robot, push, 0.5)
    share = early @ true / (true @ true)
    assert share == pytest.approx(1 - np.exp(-1), abs=0.05), "a time constant of half a second"


def test_servos_that_do_not_tell_leave_it_at_nothing(robot):
    strain, _ = felt(robot, np.ones(6), 0.5, told=False)
    assert not strain.any()


def test_a_push_far_from_the_root_is_held_to_the_promise(robot):
    """Without the strain 0.85 of it, and less: the joints between were believed free."""
    posture = {
        "joint1_pitch": 0.02, "joint1_yaw": -0.9, "joint2_pitch": 0.28,
        "joint2_yaw": -0.89, "joint3_pitch": 0.42, "joint3_yaw": -0.82,
    }  # fmt: skip
    options = {"kind": "force", "posture": posture, "link": "link4", "slow": 30.0}
    recording = run(robot, "push", allocator="constrained", ideal=True, options=options)
    assert recording.metrics["tracking_lost"] and 0.95 <= recording.metrics["ratio"] <= 1.1
