"""The plant: each effect against something that does not share its code."""

from dataclasses import fields

import mujoco
import numpy as np
import pytest

import snakegen
from snakegen.control.power import battery_joules
from snakegen.errors import SpecError
from snakegen.kernels.flight.aerodynamics import add_stream, air_forces, ground_factor, rotor_in_air
from snakegen.kernels.flight.flight import spin_torques
from snakegen.robot.losses import Losses
from snakegen.robot.robot import load
from snakegen.simulation.flight import mujoco_arrays
from snakegen.simulation.flight.plant import Imperfections
from snakegen.simulation.flight.run import prepare, run
from snakegen.simulation.flight.wind import DRYDEN_LENGTHS, dryden, one_minus_cosine, steady
from snakegen.simulation.flight.world import make_world
from snakegen.simulation.missions.flight.hover import Options
from snakegen.simulation.missions.flight.hover import plan as hover
from snakegen.simulation.monte_carlo import Spread
from snakegen.simulation.recording.rotor_signals import roll_moments
from snakegen.spec.loading import load_spec
from snakegen.spec.plant import Plant as PlantSpec

RHO = 1.2
BODY = '<inertial pos="0 0 0" mass="1" diaginertia="2e-3 3e-3 4e-3"/>'
ROTOR = '<inertial pos="0 0 0" mass="0.1" diaginertia="1e-5 1e-5 2e-5"/>'


@pytest.fixture(scope="module")
def dragon4():
    return snakegen.load("dragon4")


@pytest.fixture(scope="module")
def dragon3():
    return snakegen.load("dragon3")


class Tied:
    """A robot in its simulator with wires and plant, as the flight loop has them."""

    def __init__(self, robot, **changes):
        what = Imperfections(**changes)
        self.plan = hover(robot, 200.0, Options(duration=0.1))
        self.world = make_world(robot)
        self.model, self.data = self.world.model, mujoco.MjData(self.world.model)
        self.world.set_state(self.data, self.plan.start)
        self.wires = mujoco_arrays.wiring(self.world, self.plan)
        self.plant = mujoco_arrays.plant(self.world, self.plan, what, 0.005, 40.0)
        self.sim = mujoco_arrays.simulator(self.world, self.data)
        mujoco.mj_forward(self.model, self.data)

    def air(self, thrust, wind=(0.0, 0.0, 0.0)):
        applied = np.zeros((self.model.nbody, 6))
        air_forces(self.sim, self.wires, self.plant, np.array(thrust), np.array(wind), applied)
        return applied


def spinning(kind):
    """A free body with a rotor on its x axis: on a hinge that really spins, or welded."""
    hinge = '<joint name="spin" axis="0 0 1"/>' if kind == "hinge" else ""
    motor = '<actuator><velocity joint="spin" kv="1"/></actuator>' if kind == "hinge" else ""
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="1e-4" gravity="0 0 0" integrator="implicitfast"/>
        <worldbody><body name="body"><freejoint/>{BODY}
        <body name="rotor" pos="0.1 0 0" quat="0.9 0.3 0 0.1">{hinge}{ROTOR}
        <site name="rotor"/></body></body></worldbody>{motor}</mujoco>"""
    )


def test_gyroscopic_moment_is_that_of_a_rotor_that_really_spins():
    """Speed rises as the root of thrust does; the real rotor's motor is told the same speed."""
    inertia, top, steps = 2e-5, 3000.0, 3000
    real, welded = spinning("hinge"), spinning("weld")
    a, b = mujoco.MjData(real), mujoco.MjData(welded)
    thrust = 8.0 + 6.0 * np.sin(np.linspace(0.0, 9.0, steps))
    speed = top * np.sqrt(thrust / 16.0)
    start = np.array([0.3, -0.2, 0.1, 2.0, -3.0, 1.0])
    a.qvel[:6], b.qvel[:] = start, start
    a.qvel[6] = speed[0]
    mujoco.mj_forward(real, a)
    mujoco.mj_forward(welded, b)
    rotor = welded.body("rotor").id
    tied = Tied(snakegen.load("dragon4"))
    one = np.array([rotor], np.int64)
    sim = tied.sim._replace(
        applied=b.xfrc_applied, twist=b.cvel, site_axes=b.site_xmat, act=np.zeros(0)
    )
    wires = tied.wires._replace(rotor_body=one, rotor_site=np.zeros(1, np.int64))
    plant = tied.plant._replace(
        timestep=1e-4, thrust_max=np.array([16.0]), spin_momentum=np.array([inertia * top])
    )
    memory = mujoco_arrays.memory(tied.world, np.zeros((4, 2)), np.zeros(6), 0)._replace(
        momentum=np.array([inertia * speed[0]]), steady=np.zeros((welded.nbody, 6))
    )
    for k in range(steps):
        a.ctrl[0] = speed[k]
        mujoco.mj_step(real, a)
        spin_torques(sim, wires, plant, memory, thrust[k : k + 1])
        mujoco.mj_step(welded, b)
    free = mujoco.MjData(welded)
    free.qvel[:] = start
    mujoco.mj_step(welded, free, steps)
    turned = np.abs(free.qpos[3:] - a.qpos[3:7]).max()
    apart = np.abs(b.qpos[3:] - a.qpos[3:7]).max()
    assert turned > 0.1, "without the moment the attitude differs"
    assert apart < 0.01 * turned


@pytest.mark.parametrize("height", [0.06, 0.1, 0.4])
def test_ground_effect_is_that_of_an_image_source(height):
    """A source of strength A v mirrored in the ground takes from the inflow; power stays."""
    radius, inflow = 0.1, 7.0
    mirrored = np.pi * radius**2 * inflow / (4.0 * np.pi * (2.0 * height) ** 2)
    assert ground_factor(radius, height, 1.0) == pytest.approx(inflow / (inflow - mirrored))
    assert ground_factor(radius, height, -1.0) == 1.0
    assert ground_factor(radius, 0.001, 1.0) == ground_factor(radius, 0.05, 1.0)


@pytest.mark.parametrize("down", [0.0, 0.3, 1.5])
def test_stream_carries_the_thrust_as_momentum_at_every_distance(down):
    thrust, radius = 9.0, 0.05
    axis = np.array([0.6, 0.0, 0.8])
    side = np.array([0.8, 0.0, -0.6])
    out, total, step = np.zeros(3), 0.0, 2e-4
    for e in np.arange(0.5 * step, 1.2, step):
        out[:] = 0.0
        add_stream(
            RHO,
            thrust,
            radius,
            np.ones(3),
            axis,
            np.ones(3) - (down + 1e-12) * axis + e * side,
            out,
        )
        total += RHO * (out @ out) * 2.0 * np.pi * e * step
    assert total == pytest.approx(thrust, rel=1e-3)
    out[:] = 0.0
    add_stream(RHO, thrust, radius, np.ones(3), axis, np.ones(3) + 0.1 * axis, out)
    assert not out.any(), "still upstream"


def test_rotor_in_air_stays_within_momentum_theory():
    """Axial loss lies between constant power (1/3 V/v_i) and V/v_i; across it is T V / 2 v_i."""
    thrust, radius, axis, out = 9.0, 0.05, np.array([0.0, 0.0, 1.0]), np.empty(3)
    induced = np.sqrt(thrust / (2.0 * RHO * np.pi * radius**2))
    flow = 0.01 * induced
    rotor_in_air(RHO, thrust, radius, axis, np.array([0.0, 0.0, -flow]), out)
    lost = -out[2] / thrust / (flow / induced)
    assert 1.0 / 3.0 < lost < 1.0 and abs(out[0]) < 1e-12
    rotor_in_air(RHO, thrust, radius, axis, np.array([3.0, -4.0, 0.0]), out)
    np.testing.assert_allclose(out, thrust / (2.0 * induced) * np.array([3.0, -4.0, 0.0]))


def test_wind_presses_on_the_side_of_links_only(dragon4):
    tied = Tied(dragon4)
    links = [tied.model.body(f"link{i + 1}").id for i in range(4)]
    force = tied.air(np.zeros(8), (3.0, 0.0, 5.0))[links, :3]
    for body, found in zip(links, force, strict=True):
        rod = tied.data.xmat[body].reshape(3, 3)[:, 0]
        wind = np.array([3.0, 0.0, 5.0])
        across = wind - rod * (rod @ wind)
        size = 0.5 * RHO * 1.1 * 0.42 * 0.025 * np.linalg.norm(across)
        np.testing.assert_allclose(found, size * across, atol=1e-12)


def test_air_damps_every_motion(dragon4):
    """In still air the power of its forces is negative, whatever the robot does."""
    tied, rng = Tied(dragon4, downwash=0.0, ground_effect=0.0), np.random.default_rng(1)
    for _ in range(10):
        tied.data.qvel[:] = rng.normal(size=tied.model.nv)
        mujoco.mj_forward(tied.model, tied.data)
        applied = tied.air(np.full(8, 9.0))
        power = 0.0
        for body in range(tied.model.nbody):
            speed = np.empty(6)
            mujoco.mj_objectVelocity(
                tied.model, tied.data, mujoco.mjtObj.mjOBJ_BODY, body, speed, 0
            )
            arm = tied.data.xipos[body] - tied.data.xpos[body]
            at_com = speed[3:] + np.cross(speed[:3], arm)
            power += applied[body, :3] @ at_com + applied[body, 3:] @ speed[:3]
        assert power < 0.0


def test_a_rotor_in_a_stream_loses_thrust_and_the_switch_works(dragon4):
    """Folded so that link 3 lies above link 1: apparatus 3 blows down on apparatus 1."""
    folded = {"joint1_pitch": -1.57, "joint2_pitch": -1.57, "gimbal3_pitch": 3.14}
    thrust, lost = np.zeros(8), []
    thrust[[0, 1, 4, 5]] = 10.0
    for on in (1.0, 0.0):
        tied = Tied(dragon4, downwash=on, ground_effect=0.0)
        q = dragon4.configuration(folded, base_position=[0.0, 0.0, 3.0])
        tied.world.set_state(tied.data, q)
        mujoco.mj_forward(tied.model, tied.data)
        rotors = tied.wires.rotor_body
        upper, lower = tied.data.xpos[rotors[4]], tied.data.xpos[rotors[0]]
        assert np.linalg.norm((upper - lower)[:2]) < 0.1 < upper[2] - lower[2]
        applied = tied.air(thrust)
        assert abs(applied[rotors[4], 2]) < 1e-9, "the upper one stands in still air"
        lost.append(-applied[rotors[0], 2])
    assert 0.5 < lost[0] < 10.0 and lost[1] == 0.0


def test_moment_on_the_roll_servo_is_what_mujoco_makes_of_unequal_rotors(dragon3):
    tied, rng = Tied(dragon3), np.random.default_rng(2)
    model, data, world = tied.model, tied.data, tied.world
    rolls = [model.joint(a.roll).dofadr[0] for a in dragon3.modules.apparatuses]
    for _ in range(5):
        data.qpos[world.qpos] = rng.uniform(-1.0, 1.0, len(world.qpos))
        mujoco.mj_forward(model, data)
        moment = np.zeros((model.nu, model.nv))
        mujoco.mju_sparse2dense(
            moment, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind
        )
        thrust = rng.uniform(2.0, 15.0, len(world.rotors))
        even = np.repeat(thrust.reshape(-1, 2).mean(axis=1), 2)
        expected = (moment[world.rotors].T @ (thrust - even))[rolls]
        found = roll_moments(dragon3, thrust[None], data.qpos[world.qpos][None])[0]
        np.testing.assert_allclose(found, expected, atol=1e-9)


def test_battery_lasts_its_endurance_in_hover_and_then_the_robot_falls(dragon4):
    flown = run(dragon4, "hover", options={"duration": 2.0})
    used = flown.channel("battery_used").values[-1, 0]
    power, time = flown.channel("power").values[:, 0], flown.time
    assert used == pytest.approx(time[-1] / 180.0, rel=0.05)
    energy = np.trapezoid(power[time <= flown.times("battery_used")[-1]], dx=0.005)
    assert used == pytest.approx(energy / battery_joules(213.0), rel=2e-3)
    short = load(load_spec("dragon4", overrides=["plant.battery_energy=0.59"]))
    fallen = run(short, "hover", options={"duration": 1.5, "height": 3.0})
    assert fallen.channel("thrust").values[-1].max() < 0.1
    assert not fallen.verdict.passed


def test_turbulence_has_drydens_variance_and_spectrum():
    from scipy.signal import welch

    rate, speed = 50.0, 6.0
    gusts = dryden(200_000, rate, np.random.default_rng(0), 1.5, speed, 0.0)
    np.testing.assert_allclose(gusts.std(axis=0), 1.5, rtol=0.08)
    for axis, length in enumerate(DRYDEN_LENGTHS):
        f, density = welch(gusts[:, axis], rate, nperseg=8192)
        band = (f > 0.02) & (f < 3.0)
        x = (2.0 * np.pi * f[band] * length / speed) ** 2
        shape = 1.0 / (1.0 + x) if axis == 0 else (1.0 + 3.0 * x) / (1.0 + x) ** 2
        factor = 4.0 if axis == 0 else 2.0  # one-sided, per Hz: MIL-F-8785C's 2σ²L/πV and σ²L/πV
        expected = factor * 1.5**2 * length / speed * shape
        ratio = density[band] / expected
        assert np.median(ratio) == pytest.approx(1.0, abs=0.05)
        assert np.percentile(ratio, 90) < 1.6
    turned = dryden(100, rate, np.random.default_rng(3), 1.0, speed, np.pi / 2)
    straight = dryden(100, rate, np.random.default_rng(3), 1.0, speed, 0.0)
    np.testing.assert_allclose(turned[:, 1], straight[:, 0], atol=1e-12)


def test_gust_rises_to_its_peak_and_leaves_nothing():
    time = np.linspace(0.0, 4.0, 401)
    gust = one_minus_cosine(time, 1.0, 2.0, np.array([0.0, 4.0, -2.0]))
    np.testing.assert_allclose(gust[200], [0.0, 4.0, -2.0])
    assert not gust[time <= 1.0].any() and np.abs(gust[time >= 3.0]).max() < 1e-12
    assert np.trapezoid(gust[:, 1], time) == pytest.approx(4.0, rel=1e-6), "half of peak × length"
    np.testing.assert_allclose(steady(3, 2.0, np.pi / 2)[1], [0.0, 2.0, 0.0], atol=1e-12)


def test_every_field_of_the_specs_plant_reaches_the_loop(dragon4):
    spec = PlantSpec().model_dump()
    ranges, losses = spec.pop("uncertainty"), spec.pop("losses")
    assert ranges == vars(Spread()) == dragon4.modules.uncertainty
    assert losses == vars(Losses()) == vars(dragon4.modules.losses)
    known = {f.name for f in fields(Imperfections)} - {"thrust_scale"}
    assert set(spec) == known
    own = {k: float(v) for k, v in spec.items()} | {"battery_energy": 213.0}
    assert Imperfections.of(dragon4.modules.plant) == Imperfections(**own)
    assert Imperfections() == Imperfections.of({})
    other = load(load_spec("dragon4", overrides=["plant.downwash=false", "plant.wind_speed=2.5"]))
    found = Imperfections.of(other.modules.plant)
    assert found.downwash == 0.0 and found.wind_speed == 2.5
    with pytest.raises(SpecError, match="turbulence"):
        Imperfections.of({"turbulense": 1.0})


def test_an_ideal_plant_changes_nothing(dragon4):
    ready = prepare(dragon4, "hover", ideal=True, options={"duration": 0.05})
    plant = mujoco_arrays.plant(make_world(dragon4), ready.plan, ready.imperfections, 0.005, 40.0)
    assert plant.air == 0.0 and not plant.spin_momentum.any() and plant.capacity == np.inf
    assert plant.delay == 0 and plant.imu == 1 and np.all(np.isinf(plant.joint_step))
