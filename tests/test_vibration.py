"""Vibration suppression: internal forces that take energy out of what bends, and nothing else."""

import mujoco
import numpy as np
import pytest

from snakegen.control.controller import flight_controller
from snakegen.errors import MissionError
from snakegen.kernels.allocation.fully_actuated import forces_of, point_map
from snakegen.kernels.allocation.gimbals import joint_order, mounts, thrust_line
from snakegen.kernels.allocation.underactuated import rotor_map
from snakegen.kernels.control.types import Command, Measured
from snakegen.kernels.control.vibration_damping import Body, damped, hinge_velocities, internal
from snakegen.kernels.kinematics.chain import forward, mass_properties
from snakegen.robot.robot import load
from snakegen.simulation.flight.run import prepare, run
from snakegen.simulation.flight.vibration import (
    Damping,
    actuator_lag,
    damper,
    hinges,
    modal_maps,
    retuned,
)
from snakegen.simulation.flight.world import make_world
from snakegen.simulation.missions import planned
from snakegen.simulation.missions.flight.ring import decay
from snakegen.simulation.recording.bending_signals import elastic_channels, running_mean
from snakegen.spec.loading import load_spec

STIFF = ["plant.link_stiffness=300", "joint.servo.stiffness=1000", "joint.servo.damping=2"]
ON = Damping(12.0, 1e3)


def machine(*overrides, name="dragon4"):
    return load(load_spec(name, overrides=list(overrides)))


class Scene:
    """A hovering elastic robot: its world, what the controller believes, and its damper."""

    def __init__(self, *overrides, mode=None):
        self.robot = machine("plant.link_stiffness=300", *overrides)
        self.world = make_world(self.robot, link_stiffness=300.0, floor=False)
        self.controller = flight_controller(self.robot, mode=mode)
        self.data = mujoco.MjData(self.world.model)
        self.start = planned("hover", self.robot, 200.0, duration=0.1).start
        self.world.set_state(self.data, self.start)
        mujoco.mj_forward(self.world.model, self.data)
        self.damper, self.modes = damper(self.world, self.controller, ON, self.data.qpos)
        c, law = self.controller, self.controller.law
        self.angles = self.robot.angles(self.start)
        base, origin = self.robot.base_pose(self.start)
        self.measured = Measured(
            base, origin, np.zeros(3), np.zeros(3), self.angles, np.zeros_like(self.angles)
        )
        rotation, position = forward(c.tree, base, origin, self.angles)
        self.mass, cog, _ = mass_properties(c.tree, rotation, position)
        self.axes = rotation[law.axes_body] @ law.axes_rotation
        self.body = Body(rotation, position, cog, self.axes)
        self.m, self.rotor = mounts(c.tree, c.rotors, c.gimbals, rotation, position, cog, self.axes)
        turns = np.array(
            [
                [self.angles[b - 1] for b in pair]
                for pair in zip(c.gimbals.roll_body, c.gimbals.pitch_body, strict=True)
            ]
        )
        n = len(c.rotors.body)
        thrust = np.full(n, self.mass * 9.81 / n)
        zero = np.zeros(6)
        self.command = Command(thrust, turns, zero, zero, 1.0, 0, 0.0, 0)

    def damp(self, rates, blend):
        c = self.controller
        return damped(
            c.mechanism,
            c.law,
            self.damper,
            self.measured,
            rates,
            np.eye(3),
            blend,
            self.command,
        )


@pytest.fixture(scope="module")
def scene():
    return Scene()


def test_hinges_move_the_thrust_points_as_in_the_simulator(scene):
    model, data, c = scene.world.model, scene.data, scene.controller
    rates = np.random.default_rng(0).normal(size=len(scene.damper.rate))
    names = [[r.link for r in a.rotors] for a in scene.robot.modules.apparatuses]
    u, p, v = np.empty(3), np.empty(3), np.empty(3)
    for j, pair in enumerate(names):
        thrust_line(scene.m, j, joint_order(scene.m, scene.command.gimbals)[j], u, p)
        hinge_velocities(scene.damper, scene.body, rates, j, p, v)
        expected = np.zeros(3)
        for name in pair:
            jac = np.zeros((3, model.nv))
            mujoco.mj_jacSite(model, data, jac, None, model.site(name).id)
            expected += 0.5 * jac[:, scene.damper.rate] @ rates
        np.testing.assert_allclose(scene.axes @ v, expected, atol=1e-9)
    assert c.apparatuses == 4 and np.linalg.norm(v) > 0.1


def test_internal_is_the_projector_onto_the_null_space(scene):
    rng = np.random.default_rng(1)
    q = rng.normal(size=(6, 12))
    speed = rng.normal(size=12)
    expected = speed - np.linalg.pinv(q) @ q @ speed
    np.testing.assert_allclose(internal(q, np.ones(12), speed), expected, atol=1e-9)
    np.testing.assert_allclose(internal(q, np.ones(12), q.T @ rng.normal(size=6)), 0, atol=1e-9)
    lost = np.ones(12)
    lost[3:6] = 0.0
    found = internal(q, lost, speed)
    np.testing.assert_allclose(q @ found, 0.0, atol=1e-9)
    np.testing.assert_array_equal(found[3:6], 0.0)


def test_damping_takes_power_out_and_leaves_the_wrench(scene):
    """Virtual single rotors: forces change within the null space, against the velocity."""
    c, rng = scene.controller, np.random.default_rng(2)
    angles = joint_order(scene.m, scene.command.gimbals)
    pushes = scene.command.thrust.reshape(-1, 2).sum(axis=1)
    before = forces_of(scene.m, pushes, angles)
    for _ in range(20):
        rates = 0.05 * rng.normal(size=len(scene.damper.rate))
        thrust, turns = scene.damp(rates, 1.0)
        turned = joint_order(scene.m, turns)
        old = rotor_map(scene.m, scene.rotor, angles) @ scene.command.thrust
        new = rotor_map(scene.m, scene.rotor, turned) @ thrust
        np.testing.assert_allclose(new, old, atol=1e-5)
        extra = forces_of(scene.m, thrust.reshape(-1, 2).sum(axis=1), turned) - before
        speed, u, p, v = [], np.empty(3), np.empty(3), np.empty(3)
        for j in range(c.apparatuses):
            thrust_line(scene.m, j, angles[j], u, p)
            hinge_velocities(scene.damper, scene.body, rates, j, p, v)
            speed.extend(v)
        power = extra @ np.array(speed)
        seen = internal(
            point_map(scene.m, angles, np.stack([np.eye(3)] * 4)), np.ones(12), np.array(speed)
        )
        assert power < 0.0
        assert power == pytest.approx(-12.0 * seen @ seen, rel=0.2)  # points move with φ


def test_dual_rotors_are_damped_at_held_gimbals():
    scene = Scene("control.mode=dual_rotor")
    rng = np.random.default_rng(3)
    q = rotor_map(scene.m, scene.rotor, joint_order(scene.m, scene.command.gimbals))[2:]
    changed = 0.0
    for _ in range(10):
        rates = 0.2 * rng.normal(size=len(scene.damper.rate))
        thrust, turns = scene.damp(rates, 0.0)
        np.testing.assert_array_equal(turns, scene.command.gimbals)
        np.testing.assert_allclose(q @ (thrust - scene.command.thrust), 0.0, atol=1e-8)
        changed = max(changed, np.abs(thrust - scene.command.thrust).max())
    assert changed > 0.05
    thrust, _ = scene.damp(rates, 0.5)
    np.testing.assert_array_equal(thrust, scene.command.thrust, "nothing while the mode changes")


def test_forces_stay_within_their_limits(scene):
    limit = scene.controller.gimbals.limit
    thrust, _ = scene.damp(np.full(len(scene.damper.rate), 50.0), 1.0)
    pushes = thrust.reshape(-1, 2).sum(axis=1)
    assert np.all(pushes <= limit * (1 + 1e-9))
    asked = scene.command.thrust.reshape(-1, 2).sum(axis=1)
    assert np.all(np.abs(pushes - asked) <= 0.2 * limit + 0.5)


def test_the_filter_keeps_slow_modes_and_drops_fast_ones(scene):
    from snakegen.simulation.flight.elastic import elastic_modes

    frequency, shape = elastic_modes(scene.world.model, scene.data.qpos, hinges(scene.world).dof)
    low, pull, tuned = modal_maps(scene.world, scene.data.qpos, 2)
    np.testing.assert_allclose(tuned, 2.0 * np.pi * frequency[:2])
    keep = low @ pull
    np.testing.assert_allclose(keep @ shape[:, :2], shape[:, :2], atol=1e-9)
    np.testing.assert_allclose(keep @ shape[:, 2:], 0.0, atol=1e-9)
    assert scene.modes == len(frequency)


def test_what_swings_goes_on_when_the_posture_changes(scene):
    rng = np.random.default_rng(5)
    swinging_ = scene.damper._replace(swing=rng.normal(size=scene.damper.swing.shape))
    same = retuned(swinging_, scene.world, scene.data.qpos)
    np.testing.assert_allclose(same.swing, swinging_.swing, atol=1e-8)
    flipped = swinging_._replace(shape=-swinging_.shape, swing=-swinging_.swing)
    again = retuned(flipped, scene.world, scene.data.qpos)
    np.testing.assert_allclose(again.swing, swinging_.swing, atol=1e-8)


def test_the_lead_is_that_of_gimbals_or_of_motors(scene):
    assert actuator_lag(scene.world, scene.controller) == pytest.approx(2.1 / 100.0)
    dual = flight_controller(scene.robot, mode="dual_rotor")
    assert actuator_lag(scene.world, dual) == pytest.approx(0.035)


def test_a_body_that_changes_its_shape_swings_out_sooner_too():
    """On soft tubes, and without a gimbal at its limit."""
    off, on = (
        run(
            machine(*STIFF, f"control.vibration_damping={g}"),
            "ring",
            options={"moving": True, "duration": 5.0},
        )
        for g in (0, 10)
    )
    joints = off.channel("joint_command").values
    assert np.abs(joints[-1] - joints[0]).max() > 0.5
    slow = [r.metrics["modal_swing_j_s"][0] for r in (off, on)]
    assert slow[1] < 0.5 * slow[0], slow
    assert [r.metrics["gimbal_torque_limit_share"] for r in (off, on)] == [0.0, 0.0]
    with pytest.raises(MissionError, match="not both"):
        prepare(machine(), "ring", options={"moving": True, "posture": {"joint1_yaw": 1.0}})


def test_modal_energy_of_a_swinging_rod_is_its_mechanical_energy():
    """A free rod without damping: kinetic energy and springs', constant, whatever the mode."""
    from test_elastic import one_link

    world = make_world(one_link(), link_stiffness=400.0, link_damping=0.0, floor=False)
    model, data = world.model, mujoco.MjData(world.model)
    model.opt.gravity[:] = 0.0
    model.opt.timestep = 1e-4
    bend = model.joint("link1_bend_yaw")
    data.qpos[bend.qposadr[0]] = 0.01
    rows = 6000
    qpos, qvel = np.empty((rows, model.nq)), np.empty((rows, model.nv))
    for k in range(rows):
        qpos[k], qvel[k] = data.qpos, data.qvel
        mujoco.mj_step(model, data)
    found = elastic_channels(world, qpos, qvel, np.zeros((rows, 0)), model.opt.timestep)
    energy = found["modal_energy"].values.sum(axis=1)
    inside = energy[1000:-1000]
    np.testing.assert_allclose(inside, 0.5 * 400.0 * 0.01**2, rtol=0.03)
    assert found["elastic_angle"].values.max() == pytest.approx(0.01, rel=0.02)


def test_a_plucked_body_swings_out_sooner():
    off = run(machine(*STIFF), "ring", options={"duration": 5.0})
    on = run(machine(*STIFF, "control.vibration_damping=12"), "ring", options={"duration": 5.0})
    assert off.meta["vibration_damping"] == 0.0 and on.meta["vibration_damping"] == 12.0
    slow = [r.metrics["modal_swing_j_s"][0] for r in (off, on)]
    assert slow[1] < 0.3 * slow[0], slow
    assert on.metrics["modal_decay_s"][0] < 0.5 * off.metrics["modal_decay_s"][0]
    assert on.metrics["swing_j_s"] < off.metrics["swing_j_s"]
    assert "decay_s" in on.metrics and on.metrics["elastic_rms_rad"] > 0


def test_damping_without_redundancy_or_modes_is_refused():
    with pytest.raises(MissionError, match="dragon3 has 4 rotors for the 4 rows"):
        prepare(machine("control.vibration_damping=10", name="dragon3"), "hover")
    fixed = machine(*STIFF, "control.vibration_damping=10", "control.vibration_bandwidth=1")
    with pytest.raises(MissionError, match=r"lowest elastic mode is at 4\.\d Hz"):
        run(fixed, "hover", options={"duration": 0.5})


def test_running_mean_and_decay():
    x = np.arange(50.0)
    np.testing.assert_allclose(running_mean(x, 10)[10:40], x[10:40])
    since = np.linspace(-0.1, 2.0, 211)
    assert decay(since, np.exp(-5.0 * since)) == pytest.approx(np.log(10) / 5 - 0.1, abs=0.02)
    assert decay(since, np.ones_like(since)) is None
