"""Joint torques of a flown robot are those of the law: one law for the arm and for the hover."""

import numpy as np
import pytest

import snakegen
from snakegen.simulation.flight.run import run
from snakegen.statics.joint_loads import joint_loads
from snakegen.statics.joint_torques import joint_torques

POSTURE = {"joint1_yaw": 0.9, "joint2_yaw": 0.4, "joint3_yaw": -0.8, "joint2_pitch": 0.3}


@pytest.fixture(scope="module")
def flown():
    """dragon4 in hover, bent out of its plane, as MuJoCo has it after five seconds."""
    robot = snakegen.load("dragon4")
    options = {"duration": 5.0, "posture": POSTURE}
    return robot, run(robot, "hover", ideal=True, options=options)


def rows(robot, names):
    return [robot.model.joints[robot.model.getJointId(n)].idx_v for n in names]


def test_servo_torques_in_hover_are_thrust_and_gravity(flown):
    robot, recording = flown
    servo = recording.channel("joint_torque")
    q, thrust = (recording.channel(n).values[-1] for n in ("q", "thrust"))
    law = joint_torques(robot, q, thrust=thrust, terms="static")
    torque = servo.values[-1]
    assert np.max(np.abs(torque)) > 0.1  # a thousand times what they may differ by
    np.testing.assert_allclose(torque, law[rows(robot, servo.labels)], atol=1e-4)
    assert np.max(np.abs(law[:6])) < 1e-3  # thrust holds the weight: the base needs nothing
    # Without thrust's share the law is far from the servos.
    alone = joint_torques(robot, q, terms="static")[rows(robot, servo.labels)]
    assert np.max(np.abs(alone - torque)) > 1.0


def test_maps_of_the_joint_limited_margins_give_the_flown_torques(flown):
    robot, recording = flown
    servo = recording.channel("joint_torque")
    q, thrust = (recording.channel(n).values[-1] for n in ("q", "thrust"))
    loads = joint_loads(robot, q)
    assert loads.names == tuple(servo.labels)
    np.testing.assert_allclose(loads.bias + loads.rotors @ thrust, servo.values[-1], atol=1e-4)
