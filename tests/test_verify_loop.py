"""The compiled loop: against a plain one in Python, its rates, its ends, and its time step."""

import re
from collections import deque
from dataclasses import replace

import mujoco
import numpy as np
import pytest

import snakegen
from snakegen.control.controller import flight_controller
from snakegen.description.mjcf.decorate import lowest_point
from snakegen.errors import MissionError
from snakegen.kernels.control.types import Measured, Target
from snakegen.log import read, write
from snakegen.simulation.flight.loop import STRETCH, fly
from snakegen.simulation.flight.plan import Failure
from snakegen.simulation.flight.plant import Imperfections, draw
from snakegen.simulation.flight.run import prepare, run
from snakegen.simulation.flight.world import World, make_world, rotation_of
from snakegen.simulation.missions import planned
from snakegen.simulation.recording.clearance import clearances
from snakegen.simulation.recording.record import record

VACUUM = {"air_density": 0.0, "gyroscopic": 0.0}


@pytest.fixture(scope="module")
def dragon4():
    return snakegen.load("dragon4")


@pytest.fixture(scope="module")
def world(dragon4):
    return make_world(dragon4)


def flight(robot, world, plan, seed=0, what=None, **options):
    what = what or Imperfections()
    noise = draw(
        what, np.random.default_rng(seed), len(plan.time), len(world.rotors), len(world.qpos)
    )
    return fly(world, plan, flight_controller(robot), noise, what, **options)


def plain_loop(robot, world, plan, noise, what, seconds, speeds):
    """The loop as one would write it first: one tick after the other, in Python."""
    data, controller = mujoco.MjData(world.model), flight_controller(robot)
    world.set_state(data, plan.start)
    present = world.gimbals >= 0
    gimbals = data.qpos[world.qpos][world.gimbal_joints]
    joints = plan.joints[0].copy()
    data.ctrl[world.servos], data.ctrl[world.gimbals[present]] = joints, gimbals[present]
    mujoco.mj_forward(world.model, data)
    state = controller.start(gimbals)
    whole, part = divmod(what.delay / 0.005, 1.0)
    waiting = deque(maxlen=2 + int(whole))
    imu = (rotation_of(data.qpos[3:7]), data.qvel[3:6].copy())
    track = []

    def target(k):
        return Target(
            plan.position[k], plan.velocity[k], plan.acceleration[k], plan.rotation[k],
            plan.angular[k],
        )  # fmt: skip

    base = imu[0]
    at = (data.qpos[:3].copy(), data.qvel[:3].copy(), base @ imu[1])
    first = Measured(base, *at, data.qpos[world.qpos], data.qvel[world.qvel])
    thrust = controller.tick(first, target(0), state, 1e-9)[1].thrust
    data.act[world.activation], data.ctrl[world.rotors] = thrust, thrust
    for k in range(round(seconds / 0.005)):
        track.append(np.r_[data.qpos, data.qvel])
        if k % 5 == 0:
            seen = (data.qpos[:3] + noise.position[k], data.qvel[:3] + noise.velocity[k])
        waiting.append((*imu, seen, data.qpos[world.qpos].copy(), data.qvel[world.qvel].copy()))
        newer, older = (waiting[max(len(waiting) - 1 - int(whole) - i, 0)] for i in (0, 1))
        older = older if part else newer
        at = max(k - int(whole), 0)

        def mean(i, newer=newer, older=older):
            return (1.0 - part) * newer[i] + part * older[i]

        left, _, right = np.linalg.svd(mean(0))  # the nearest rotation
        rotation = left @ right @ noise.attitude[at]
        late = Measured(
            rotation,
            *older[2],
            rotation @ (mean(1) + noise.gyro[at]),
            mean(3) + noise.angles,
            mean(4),
        )
        state, command = controller.tick(
            late, target(k), state, 0.005, force_dt=0.025 if k % 5 == 0 else 0.0
        )
        gimbals = gimbals + np.clip(command.gimbals - gimbals, -12.5 * 0.005, 12.5 * 0.005)
        joints = joints + np.clip(plan.joints[k] - joints, -speeds * 0.005, speeds * 0.005)
        data.ctrl[world.gimbals[present]], data.ctrl[world.servos] = gimbals[present], joints
        data.ctrl[world.rotors] = command.thrust * noise.thrust_factor
        for i in range(5):
            mujoco.mj_step(world.model, data)
            if (5 * k + i + 1) % 2 == 0:
                imu = (rotation_of(data.qpos[3:7]), data.qvel[3:6].copy())
    return np.array(track)


@pytest.mark.parametrize("delay", [0.010, 0.003])
def test_compiled_loop_is_the_plain_loop(dragon4, world, delay):
    """Sensors' rates, delay, noise, mismatch and servo speed, over a motion, in still vacuum."""
    plan = planned("transform", dragon4, 200.0)
    late = replace(plan, **{n: getattr(plan, n)[600:700] for n in ("position", "velocity")})
    late = replace(
        late,
        time=plan.time[:100],
        acceleration=plan.acceleration[600:700],
        rotation=plan.rotation[:100],
        angular=plan.angular[:100],
        joints=plan.joints[600:700] + 0.3 * (np.arange(100) > 50)[:, None],
        start=plan.start,
    )
    what = Imperfections(delay=delay, **VACUUM)
    noise = draw(what, np.random.default_rng(4), 100, 8, len(world.qpos))
    flown = fly(world, late, flight_controller(dragon4), noise, what)
    expected = plain_loop(dragon4, world, late, noise, what, 0.5, np.ones(6))
    found = np.hstack([flown.qpos, flown.qvel])
    np.testing.assert_allclose(found, expected, atol=1e-8)
    assert np.abs(np.diff(flown.command[:, world.servos], axis=0)).max() == pytest.approx(0.005)


def test_the_same_seed_gives_the_same_bits_and_another_does_not(dragon4, world):
    plan = planned("hover", dragon4, 200.0, duration=0.5)
    a, b, c = (flight(dragon4, world, plan, seed) for seed in (7, 7, 8))
    assert a.qpos.tobytes() == b.qpos.tobytes() and a.command.tobytes() == b.command.tobytes()
    assert a.qpos.tobytes() != c.qpos.tobytes()


def test_halving_the_time_step_moves_the_cog_by_less_than_a_millimetre(dragon4):
    plan = planned("transform", dragon4, 200.0)
    plan = replace(
        plan,
        **{
            n: getattr(plan, n)[:1200]
            for n in (
                "time", "position", "velocity", "acceleration", "rotation", "angular", "joints"
            )
        },
    )  # fmt: skip
    tracks = []
    for step in (0.001, 0.0005):
        world = make_world(dragon4, timestep=step)
        flown = flight(dragon4, world, plan)
        tracks.append(record(world, plan, flight_controller(dragon4), flown, {}, margins=False))
    a, b = (t.channel("position").values for t in tracks)
    assert 0.0 < np.abs(a - b).max() < 1e-3


def test_motion_capture_is_seen_at_its_own_rate(dragon4, world):
    """Noise between two samples at 40 Hz changes nothing; noise on a sample does."""
    plan, what = planned("hover", dragon4, 200.0, duration=0.3), Imperfections()
    noise = draw(what, np.random.default_rng(0), 60, 8, len(world.qpos))
    shaken = np.arange(60) % 5 != 0
    between, on = noise.position.copy(), noise.position.copy()
    between[shaken] += 0.05
    on[~shaken] += 0.05
    runs = [
        fly(world, plan, flight_controller(dragon4), replace(noise, position=p), what)
        for p in (noise.position, between, on)
    ]
    assert runs[0].qpos.tobytes() == runs[1].qpos.tobytes() != runs[2].qpos.tobytes()


def test_a_slow_imu_and_a_delay_are_late(dragon4, world):
    plan = planned("hover", dragon4, 200.0, duration=0.3)
    usual = flight(dragon4, world, plan, what=Imperfections(**VACUUM))
    for change in ({"imu_rate": 50.0}, {"delay": 0.02}):
        other = flight(dragon4, world, plan, what=Imperfections(**VACUUM, **change))
        assert 0.0 < np.abs(other.qpos - usual.qpos).max() < 0.05


def test_divergence_stops_at_once_and_says_when_and_what(dragon4, world):
    plan = planned("hover", dragon4, 200.0, duration=1.0)
    push = np.zeros((200, 6))
    push[100:, 0] = 1e6
    flown = flight(dragon4, world, replace(plan, disturbance=push))
    assert flown.ticks == 101
    told = re.fullmatch(r"diverged at 0\.50 s: (\w+) at \S+ (m/s|rad/s)", flown.stopped)
    assert told is not None, flown.stopped
    free, at = world.model.joint(told[1]), np.abs(flown.qvel[-1]).argmax()
    assert (told[2] == "m/s") == (free.type[0] == mujoco.mjtJoint.mjJNT_FREE and at < 3)
    assert flown.events[-1][1] == "ERROR"
    push[100:] = np.nan
    flown = flight(dragon4, world, replace(plan, disturbance=push))
    assert flown.ticks == 101 and "root at nan" in flown.stopped


def test_a_tumbling_hybrid_is_named_and_its_free_wheels_may_spin(monkeypatch):
    """A wheel in the air turns as it likes; what ends a run is the body or a driven joint."""
    robot = snakegen.load("hybrid4")
    world = make_world(robot)
    spun = world.model.joint("wheel3_2_2").dofadr[0]
    placed = World.set_state

    def spinning(self, data, q, v=None):
        placed(self, data, q, v)
        data.qvel[spun] = -80.0

    plan = planned("hover", robot, duration=0.1)
    push = np.zeros((20, 6))
    push[10:, 4] = 1e5
    monkeypatch.setattr(World, "set_state", spinning)
    assert flight(robot, world, plan).stopped == ""
    tumbled = flight(robot, world, replace(plan, disturbance=push)).stopped
    assert "diverged at 0.05 s: " in tumbled and "wheel" not in tumbled


def test_an_interruption_keeps_a_readable_log(dragon4, tmp_path):
    def interrupt(done, _total):
        if done >= 60:
            raise KeyboardInterrupt

    recording = run(dragon4, "hover", options={"duration": 2.0}, progress=interrupt)
    assert recording.meta["stopped"].startswith("interrupted at 0.")
    assert len(recording.time) == round(200 * STRETCH)  # up to the look that saw it
    assert not recording.verdict.passed
    write(recording, tmp_path / "cut.rrd")
    back = read(tmp_path / "cut.rrd")
    np.testing.assert_array_equal(
        back.channel("position").values, recording.channel("position").values
    )
    assert back.meta["stopped"] == recording.meta["stopped"]


def test_a_lost_rotor_stops_and_the_run_may_give_up(dragon4, world):
    plan = planned("hover", dragon4, 200.0, duration=2.0, height=4.0)
    plan = replace(plan, failures=(Failure(0.5, 0.6, (2, 3)),), give_up=0.3)
    flown = flight(dragon4, world, plan)
    lost = flown.act[:, world.activation[2]]
    assert lost[99] > 5.0 and lost[-1] < 0.1
    assert np.abs(flown.command[121:, world.rotors[2]]).max() < 1e-9, "the controller knows"
    assert flown.command[110, world.rotors[2]] > 1.0, "not yet"
    assert "gave up" in flown.stopped and flown.ticks < len(plan.time)


def test_the_floor_carries_the_weight(dragon4):
    world = make_world(dragon4)
    data = mujoco.MjData(world.model)
    mujoco.mj_resetDataKeyframe(world.model, data, world.model.key("floor").id)
    mujoco.mj_step(world.model, data, 3000)
    force, total = np.zeros(6), 0.0
    for i in range(data.ncon):
        mujoco.mj_contactForce(world.model, data, i, force)
        total += force[0]
    assert data.sensordata.sum() == pytest.approx(total, rel=1e-9)
    assert total == pytest.approx(dragon4.force_scale, rel=1e-3)


def test_floor_distance_is_that_of_the_lowest_point(dragon4, world):
    rng, data = np.random.default_rng(0), mujoco.MjData(world.model)
    rows = np.repeat(data.qpos[None], 5, axis=0)
    rows[:, 2:7] = rng.normal(size=(5, 5))
    rows[:, world.qpos] = rng.normal(size=(5, len(world.qpos)))
    rows[:, 3:7] /= np.linalg.norm(rows[:, 3:7], axis=1, keepdims=True)
    found = clearances(world, rows)[0]
    for row, height in zip(rows, found, strict=True):
        data.qpos[:] = row
        mujoco.mj_kinematics(world.model, data)
        assert height == pytest.approx(lowest_point(world.model, data), abs=1e-12)


@pytest.mark.parametrize("name", ["dragon4", "dragon3"])
def test_both_platforms_fly_with_everything_on(name):
    recording = run(snakegen.load(name), "hover", options={"duration": 3.0}, seed=2)
    assert recording.verdict.passed, recording.verdict.summary()


def test_rates_are_free(dragon4):
    from snakegen.robot.robot import load
    from snakegen.spec.loading import load_spec

    fast = load(load_spec("dragon4", overrides=["control.attitude_rate=500"]))
    recording = run(fast, "hover", options={"duration": 1.0})
    assert np.diff(recording.time).max() == pytest.approx(0.002) and recording.verdict.passed


def test_only_flights_can_be_repeated():
    with pytest.raises(MissionError, match="loop of its own"):
        prepare(snakegen.load("screw4"), "lcrank")
