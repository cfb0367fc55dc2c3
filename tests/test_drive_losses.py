"""Losses of screw drives: against closed forms and a power balance; planted faults are found."""

import math

import numpy as np
import pytest

from snakegen.description.mjcf.decorate import decorate
from snakegen.errors import SnakegenError
from snakegen.pipeline.equivalence import compare
from snakegen.robot.losses import NONE, Losses
from snakegen.robot.robot import load
from snakegen.screw_drive.geometry import drive_geometry, yaw_joints
from snakegen.simulation.drive.contact_plant import ContactDrive
from snakegen.simulation.drive.hardware import DriveDraw, DriveHardware
from snakegen.simulation.drive.losses import CableDrag, motor_side, through_play
from snakegen.simulation.drive.plan import DrivePlan, following
from snakegen.simulation.drive.run import contact_model, pitch_joints, run_contact
from snakegen.simulation.run_settings import RunSettings
from snakegen.spec.loading import load_spec

OFF = "plant.losses={rolling: 0, bearing: 0, play: 0, cable_mass: 0}"


def drive_of(*overrides):
    return load(load_spec("screw4", overrides=list(overrides)))


@pytest.fixture(scope="module")
def screw4():
    return load("screw4")


def straight(robot, seed=0):
    """Returns 3 s of a straight drive at 0.2 m/s."""
    reference = following(robot, [("line", 0.8)], 0.2, 0.4)
    return run_contact(robot, DrivePlan(reference, reference.at(0.0)[0], 3.0), RunSettings(seed))


def power(driven):
    """Returns the mean power of the screws while they turn steadily [W]."""
    rows = driven.rows
    late = (rows["time"] > 1.0) & (rows["time"] < 2.9)
    return float((rows["screw_torque"] * rows["rate"])[late].sum(axis=1).mean())


def test_screws_pay_for_rolling_friction():
    """Σ τ θ̇ = Σ N e |ω|, ω of a wheel about its axle, under a drum which rolls along it.

    Ellipsoids share a drum's load from wheel to wheel, and lose little in passing it on.
    """
    v, rw, arm = 0.2, 0.012, 3e-4
    spin = math.sqrt(2.0) * v / rw  # its rim cancels v ahead and r θ̇ = v aside
    given = f"plant.losses={{rolling: {arm}, bearing: 0, play: 0, cable_mass: 0}}"
    paid, free = (
        straight(drive_of(how, "screw_drive.rollers=ellipsoid"), seed=1) for how in (given, OFF)
    )
    normal = paid.rows["load"][100:290].sum(axis=1).mean()
    assert power(paid) - power(free) == pytest.approx(normal * arm * spin, rel=0.05)


def test_slippery_ground_is_worse():
    slip = {}
    for friction in (0.8, 0.05):
        driven = straight(drive_of(f"screw_drive.friction={friction}"))
        error = (driven.rows["state"] - driven.rows["desired"])[-1, :2]
        slip[friction] = driven.rows["slip"][50:].mean(), float(np.hypot(*error))
    assert slip[0.05][0] > 3 * slip[0.8][0] and slip[0.05][1] > 5 * slip[0.8][1]


def test_a_servo_has_no_torque_within_its_play():
    target, play = np.array([0.3, 0.3, 0.3, 0.3]), 0.02
    angle = np.array([0.295, 0.305, 0.25, 0.35])
    assert np.allclose(through_play(target, angle, play) - angle, [0.0, 0.0, 0.04, -0.04])
    assert np.allclose(motor_side(target, angle, play), [0.3, 0.3, 0.26, 0.34])
    assert np.allclose(through_play(target, angle, 0.0), target)


def test_play_leaves_an_error_that_the_encoder_does_not_see(screw4):
    """A yaw joint pushed aside gives way by half the play before its servo resists."""
    model = contact_model(DriveHardware(screw4, RunSettings(ideal=True), 6).robot)
    drive = ContactDrive(model, 4, yaw_joints(screw4), pitch_joints(screw4), play=0.02)
    drive.reset(np.zeros(6))
    drive.model.opt.gravity[:] = 0.0
    for _ in range(300):
        drive.release()
        drive.pull([0.0, 2.0, 0.0], "link1", [0.0, 0.0, 0.0])
        drive.pull([0.0, -2.0, 0.0], "link2", [0.0, 0.0, 0.0])
        drive.step(np.zeros(7), 1)
    off = drive.state()[3]
    assert 0.0099 < abs(off) < 0.014 and abs(drive.read()[3]) < abs(off) - 0.0099


@pytest.mark.parametrize("turn", [0.0, 0.5 * math.pi])
def test_a_cable_pulls_by_the_friction_of_its_weight(turn):
    """On open ground no corner holds it: each metre is held by μ λ g at most."""
    losses = Losses(cable_mass=0.05, cable_friction=0.4, cable_length=2.0)
    cable, radius, v = CableDrag(losses), 0.6, 0.1
    arc = np.arange(0.0, 1.0 + radius * turn + 1.0, 1e-3)
    angle = np.clip((arc - 1.0) / radius, 0.0, turn)
    steps = 1e-3 * np.column_stack([np.cos(angle), np.sin(angle)])
    trail = np.vstack([[0.0, 0.0], np.cumsum(steps, axis=0)])
    for place in trail:
        force = cable.force(place, 1e-3 / v)
    weight = 0.4 * 0.05 * 9.81
    assert np.hypot(*force[:2]) == pytest.approx(weight * (2.0 + arc[-1]), rel=0.03)
    assert np.allclose(
        force / np.hypot(*force[:2]), [-math.cos(turn), -math.sin(turn), 0], atol=1e-6
    )
    back = cable.force(trail[-20], 0.2)
    assert not back.any()


def test_a_tail_that_trembles_does_not_wind_the_cable_up():
    """Sixty turns about within a hand's breadth: 6 m of way, and no more than 6 m of friction."""
    cable = CableDrag(Losses(cable_mass=0.05, cable_friction=0.4, cable_length=1.0))
    weight, most = 0.4 * 0.05 * 9.81, 0.0
    for k in range(60):
        place = np.array([0.1 * (k % 2), 0.01 * k])
        most = max(most, float(np.hypot(*cable.force(place, 0.5)[:2])))
    assert most <= weight * (1.0 + 60 * 0.11)


def test_the_check_finds_other_rolling_friction(screw4):
    def built():
        spec = decorate(screw4.urdf, screw4.modules, {}, visuals=False, folder=screw4.folder)
        return spec.compile()

    assert compare(screw4, built(), states=1).passed
    wrong = built()
    assert not wrong.dof_frictionloss.any(), "wheels turn freely: drives know their loads"
    wrong.dof_frictionloss[wrong.joint("wheel2_1_1").dofadr[0]] += 1e-4
    found = compare(screw4, wrong, states=1)
    assert not found.passed and "joint friction" in str(found) and "wheel2_1_1" in str(found)
    ball = decorate(
        screw4.urdf, screw4.modules, {}, visuals=False, rollers="ball", folder=screw4.folder
    ).compile()
    assert not ball.dof_frictionloss.any()


def test_switches_and_ranges(screw4):
    assert DriveHardware(screw4, RunSettings(ideal=True), 6).losses == NONE
    own = screw4.modules.losses
    assert own == Losses(cable_mass=0.05) == DriveHardware(screw4, RunSettings(), 6).losses
    worn = DriveHardware(screw4, RunSettings(draw=DriveDraw(ground=0.5, losses=2.0)), 6)
    assert worn.losses.play == 2 * own.play and worn.losses.arm == 2 * own.arm
    assert worn.robot.modules.screws[0].friction == 0.4
    assert (drive_of(OFF).modules.losses.arm, drive_of(OFF).modules.losses.play) == (0.0, 0.0)
    with pytest.raises(SnakegenError, match="rolling"):
        drive_of("plant.losses.rolling=-1")
    assert drive_geometry(screw4).units == 4
