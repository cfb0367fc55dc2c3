"""Elastic links: what is split stays whole, and bends at the frequencies that are printed."""

import re

import mujoco
import numpy as np
import pytest
from click.testing import CliRunner

import snakegen
from snakegen.cli.flight import flight
from snakegen.cli.inspect import inspect
from snakegen.errors import DescriptionError
from snakegen.robot.robot import load
from snakegen.simulation.flight.elastic import modal_frequencies, split_links
from snakegen.simulation.flight.mujoco_arrays import stations
from snakegen.simulation.flight.run import run
from snakegen.simulation.flight.world import make_world
from snakegen.simulation.missions import planned
from snakegen.spec.loading import load_spec
from snakegen.spec.robot_spec import RobotSpec


@pytest.mark.parametrize("name", ["dragon4", "dragon3"])
def test_a_split_robot_has_the_same_mass_matrix_while_it_does_not_bend(name):
    robot = snakegen.load(name)
    start = planned("hover", robot, 200.0, duration=0.1).start
    found = []
    for stiffness in (0.0, 1300.0):
        world = make_world(robot, link_stiffness=stiffness)
        data = mujoco.MjData(world.model)
        world.set_state(data, start)
        mujoco.mj_forward(world.model, data)
        full = np.zeros((world.model.nv, world.model.nv))
        mujoco.mj_fullM(world.model, data, full)
        rows = np.r_[0:6, world.qvel]
        areas = stations(world)[3].sum()
        found.append((full[np.ix_(rows, rows)], data.subtree_com[0].copy(), data.ncon, areas))
    np.testing.assert_allclose(found[0][0], found[1][0], atol=1e-12)
    np.testing.assert_allclose(found[0][1], found[1][1], atol=1e-12)
    assert found[0][2] == found[1][2] == 0, "the halves do not touch"
    assert found[0][3] == pytest.approx(found[1][3])


@pytest.mark.parametrize("name", ["dragon3", "arm6"])
def test_a_split_robot_touches_itself_where_the_rigid_one_does(name):
    robot = snakegen.load(name)
    worlds = [make_world(robot, link_stiffness=k, floor=False) for k in (0.0, 1300.0)]
    data = [mujoco.MjData(w.model) for w in worlds]
    rng, count = np.random.default_rng(0), 0
    for _ in range(60):
        angles, found = rng.uniform(-2.0, 2.0, len(worlds[0].qpos)), []
        for world, d in zip(worlds, data, strict=True):
            d.qpos[world.qpos] = angles
            mujoco.mj_forward(world.model, d)
            owner = [world.model.body(int(b)).name for b in world.model.geom_bodyid]
            found.append(
                {frozenset(owner[g].removesuffix("_tip") for g in c.geom) for c in d.contact}
            )
        assert found[0] == found[1]
        count += len(found[0])
    assert count > 0


def one_link(length=0.8, mass=1.5, **more):
    chain = {"links": 1, "length": length, "mass": mass, "radius": 0.01, **more}
    return load(RobotSpec(name="rod", chain=chain))


def test_a_free_rod_bends_at_its_closed_form_frequency():
    """Two halves of inertia I_c on a spring k, free: ω² = 2 k / I_c."""
    length, mass, k = 0.8, 1.5, 400.0
    moment = mass * (3 * 0.01**2 + length**2) / 12
    world = make_world(one_link(length, mass), link_stiffness=k)
    half = 0.5 * (moment - mass * (length / 4) ** 2)
    expected = np.sqrt(2.0 * k / half) / (2.0 * np.pi)
    found = modal_frequencies(world.model, world.model.qpos0)
    np.testing.assert_allclose(found, [expected, expected], rtol=1e-6)


def test_a_released_robot_rings_at_the_lowest_frequency():
    robot = snakegen.load("dragon4")
    world = make_world(robot, link_stiffness=300.0, link_damping=0.0, floor=False)
    model, data = world.model, mujoco.MjData(world.model)
    model.opt.gravity[:] = 0.0
    model.actuator_biasprm[:, 2] = 0.0  # servos without damping
    world.set_state(data, planned("hover", robot, 200.0, duration=0.1).start)
    data.ctrl[world.servos] = data.qpos[world.qpos][world.chain]
    present = world.gimbals >= 0
    data.ctrl[world.gimbals[present]] = data.qpos[world.qpos][world.gimbal_joints[present]]
    lowest = modal_frequencies(model, data.qpos)[0]
    bends = [
        model.joint(f"link{i}_bend_{w}").qposadr[0] for i in (1, 2, 3) for w in ("pitch", "yaw")
    ]
    data.qvel[world.qvel[world.chain]] = 0.02
    track = np.empty((8000, len(bends)))
    for k in range(len(track)):
        mujoco.mj_step(model, data)
        track[k] = data.qpos[bends]
    power = (np.abs(np.fft.rfft(track * np.hanning(len(track))[:, None], axis=0)) ** 2).sum(axis=1)
    frequency = np.fft.rfftfreq(len(track), model.opt.timestep)
    near = (frequency > 0.5 * lowest) & (frequency < 1.25 * lowest)
    assert frequency[near][np.argmax(power[near])] == pytest.approx(lowest, abs=0.15)
    assert power[frequency < 0.8 * lowest].max() < 0.01 * power.max()


def test_dragon4_flies_on_its_own_tubes_and_prints_their_modes():
    robot = load(load_spec("dragon4", overrides=["plant.link_stiffness=1300"]))
    recording = run(robot, "hover", options={"duration": 2.0})
    assert recording.verdict.passed, recording.verdict.summary()
    modes = recording.meta["modal_frequencies_hz"]
    assert len(modes) == 14 + 8 and modes == sorted(modes) and modes[0] > 1.0


def test_a_run_that_diverges_says_when_and_what(tmp_path):
    """Springs too stiff for the time step: it stops at once, and the log says so too."""
    log, stiff = tmp_path / "stiff.rrd", ["--set", "plant.link_stiffness=1e5"]
    command = ["dragon3", "--duration", "1", "--option", "trim=0", "-o", str(log), *stiff]
    said = CliRunner().invoke(flight, command, standalone_mode=False)
    assert said.return_value == 3 and "failed: completed" in said.output
    assert re.search(
        r"ended early: diverged at 0\.\d\d s: \w+ at -?[\d.e+]+ (m/s|rad)", said.output
    )
    again = CliRunner().invoke(inspect, [str(log)], standalone_mode=False)
    assert again.return_value == 3 and "ended early: diverged" in again.output


def test_a_link_without_mass_cannot_be_split():
    with pytest.raises(DescriptionError, match="no mass"):
        split_links('<robot name="r"><link name="a"/></robot>', {"a": 1.0})
    with pytest.raises(DescriptionError, match="no link 'b'"):
        split_links('<robot name="r"><link name="a"/></robot>', {"b": 1.0})
