"""Motions of arms: sines, tables, limits, torques along them; MuJoCo's servos against the law."""

import numpy as np
import pinocchio as pin
import pytest
from published_arms import SIGNS, TABLE_5

import snakegen
from snakegen.analysis import motion as analysis
from snakegen.errors import AnalysisError, SnakegenError
from snakegen.inverse_kinematics import motion as motions
from snakegen.inverse_kinematics.friction import friction_of
from snakegen.inverse_kinematics.motion_files import motion_of
from snakegen.inverse_kinematics.torques_along import torques_along
from snakegen.inverse_kinematics.zs24_table3 import table3
from snakegen.simulation.flight.run import run
from snakegen.spec.loading import load_spec
from snakegen.statics.joint_torques import joint_torques

FREE = (0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def arm():
    return snakegen.load("arm6")


def test_table_3_is_the_papers_and_gives_table_5_as_a_reconstruction(arm):
    motion = table3(arm)
    t = np.array([0.0, 0.3, 1.7])
    angle, rate, bend = motion.at(t)
    np.testing.assert_allclose(angle, 0.2 * np.sin(np.pi * t)[:, None] * SIGNS, atol=1e-15)
    np.testing.assert_allclose(rate, 0.2 * np.pi * np.cos(np.pi * t)[:, None] * SIGNS, atol=1e-15)
    np.testing.assert_allclose(bend, -(np.pi**2) * angle, atol=1e-14)
    relative = analysis.analyze(arm, np.zeros(12)).peak / TABLE_5 - 1
    assert np.max(np.abs(relative[:10])) < 0.025
    np.testing.assert_allclose(relative[10:], [0.11, 0.09], atol=0.01)


def test_torques_along_equal_pinocchio_at_every_instant(arm):
    motion = motions.waypoints(
        arm, [0, 1, 2.5, 4], {"joint1_pitch": [0, 0.3, -0.2, 0], "joint4_yaw": [0.1, 0, 0.4, 0.2]}
    )
    time = motion.times(50)
    wrench = np.array([1.0, -2.0, 3.0, 0.1, 0.2, -0.3])
    along = torques_along(arm, np.zeros(12), motion, time, wrenches={"link5": wrench})
    data = arm.model.createData()
    frame = arm.model.getFrameId("link5", pin.FrameType.BODY)
    for k in (0, 57, 123, 200):
        q, v, a = along.angles[k], along.rates[k], along.accelerations[k]
        tau = pin.rnea(arm.model, data, q, v, a)
        around = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        pin.computeJointJacobians(arm.model, data, q)
        pin.updateFramePlacements(arm.model, data)
        tau -= pin.getFrameJacobian(arm.model, data, frame, around).T @ wrench
        np.testing.assert_allclose(along.torque()[k], tau, atol=1e-11)
        static = joint_torques(arm, q, wrenches={"link5": wrench}, terms="static")
        np.testing.assert_allclose(along.torque("static")[k], static, atol=1e-11)


def test_power_is_the_rate_of_energy(arm):
    motion = table3(arm, duration=0.7)
    time = motion.times(2000)
    along = torques_along(arm, np.zeros(12), motion, time)
    work = np.trapezoid(along.power().sum(axis=1), time)
    data = arm.model.createData()

    def energy(k):
        q, v = along.angles[k], along.rates[k]
        return pin.computeKineticEnergy(arm.model, data, q, v) + pin.computePotentialEnergy(
            arm.model, data, q
        )

    assert work == pytest.approx(energy(-1) - energy(0), rel=1e-5)
    assert abs(work) > 0.1


def test_joints_that_brake_feed_no_others(arm):
    """The supply gives the positive parts alone; the signed sum returns to nothing."""
    found = analysis.analyze(arm, np.zeros(12), rate=200.0)
    along, data = found.along, arm.model.createData()
    gravity, arm.model.gravity.linear = arm.model.gravity.linear.copy(), np.zeros(3)
    states = zip(along.angles, along.rates, along.accelerations, strict=True)
    each = np.array([v * pin.rnea(arm.model, data, q, v, a) for q, v, a in states])
    arm.model.gravity.linear = gravity
    supply, net = np.maximum(each, 0.0).sum(axis=1), each.sum(axis=1)
    out = found.to_json()
    assert out["power_supply_max_W"] == pytest.approx(supply.max(), rel=1e-9)
    assert out["work_supply_J"] == pytest.approx(np.trapezoid(supply, along.time), rel=1e-9)
    assert out["work_net_J"] == pytest.approx(np.trapezoid(net, along.time), abs=1e-9)
    assert out["work_supply_J"] > 9.0 and abs(out["work_net_J"]) < 0.01
    assert out["power_supply_max_W"] > 2.0 * out["power_max_W"]


def test_functions_give_what_sines_give(arm):
    signs = dict(zip(arm.chain_joints, SIGNS, strict=True))
    f = {n: (lambda t, s=s: 0.2 * s * np.sin(np.pi * t)) for n, s in signs.items()}
    ours, want = motions.functions(arm, f, 2.0), table3(arm, duration=2.0)
    t = np.linspace(0, 2, 777)
    for a, b, slack in zip(ours.at(t), want.at(t), (1e-12, 1e-9, 1e-6), strict=True):
        np.testing.assert_allclose(a, b, atol=slack)


def test_waypoints_pass_through_and_rest(arm, tmp_path):
    path = tmp_path / "m.csv"
    path.write_text("time,joint1_yaw,joint2_pitch\n1,0,0.1\n\n2,0.2,0.3\n4.5,-0.1,0.2\n")
    start = np.full(12, 0.05)
    motion = motion_of(arm, path, start=start)
    assert motion.duration == 3.5
    angle, rate, _ = motion.at(np.array([0.0, 1.0, 3.5]))
    np.testing.assert_allclose(angle[:, 1], [0, 0.2, -0.1], atol=1e-12)
    np.testing.assert_allclose(angle[:, 3], [0.1, 0.3, 0.2], atol=1e-12)
    np.testing.assert_allclose(angle[:, 5], 0.05, atol=1e-12)
    np.testing.assert_allclose(rate[[0, 2]], 0.0, atol=1e-12)
    assert abs(rate[1, 1]) > 0.05
    yaml = tmp_path / "m.yaml"
    yaml.write_text("duration: 2\nsines: {joint1_yaw: {amplitude: 0.1, period: 4, offset: 0.2}}\n")
    angle, _, _ = motion_of(arm, yaml).at(np.array([1.0]))
    assert angle[0, 1] == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("time,joint1_yaw\n0,0\n1,nan\n", r"m.csv, line 3: joint1_yaw is 'nan'"),
        ("time,joint1_yaw\n0,0\n1,\n", r"line 3: joint1_yaw is ''"),
        ("time,joint1_yaw\n0,0\n1\n", r"line 3: 1 entries for 2 columns"),
        ("time,joint1_yow\n0,0\n1,0\n", r"no joint 'joint1_yow' to move. Did you mean"),
        ("joint1_yaw\n0\n", r"first line must be time,joint1_pitch"),
        ("0,0\n1,0\n", r"line 1: numbers; the first line must name the columns"),
        ("time,joint1_yaw\n0,0\n0,0.1\n", r"rising times \(row 2\)"),
        ("time,joint1_yaw\n0,0\n", r"two waypoints or more"),
        ("time,joint1_yaw\n0,0\n5,0.9\n", r"goes to 0.9 rad at 5 s, outside its limits -0.7854"),
        (
            "time,joint1_yaw\n0,0\n0.3,0.5\n",
            r"turns at 2.5 rad/s.*its servo does 1: take 2.5 times",
        ),
    ],
)
def test_faulty_tables_are_one_clear_line(arm, tmp_path, text, line):
    path = tmp_path / "m.csv"
    path.write_text(text)
    with pytest.raises(AnalysisError, match=line) as caught:
        motion_of(arm, path)
    assert "\n" not in str(caught.value)


def test_faulty_motions_of_other_kinds(arm, tmp_path):
    path = tmp_path / "m.yaml"
    for text, line in (
        ("sines: {joint1_yaw: {amplitude: 0.1, period: 2}}", "need a 'duration'"),
        ("duration: 2\nsines: {joint1_yaw: {amplitude: 0.1, perod: 2}}", "period .s. are needed"),
        ("duration: 2\nsines: {joint1_yaw: {amplitude: .nan, period: 2}}", "no finite number"),
        ("durations: 2", "Did you mean 'duration'"),
        ("[1]", "is a mapping"),
    ):
        path.write_text(text)
        with pytest.raises(SnakegenError, match=line):
            motion_of(arm, path)
    with pytest.raises(AnalysisError, match="no such file"):
        motion_of(arm, "nowhere.csv")
    with pytest.raises(AnalysisError, match="'table3', a table"):
        motion_of(arm, "table4")
    with pytest.raises(AnalysisError, match="static and sliding"):
        friction_of("0.1,0.3")
    with pytest.raises(AnalysisError, match=r"would take .* GB"):
        analysis.analyze(arm, np.zeros(12), rate=1e9)
    with pytest.raises(AnalysisError, match="fixed base"):
        dragon = snakegen.load("dragon3")
        analysis.analyze(dragon, dragon.configuration())


def test_table_and_numbers_of_the_analysis(arm, tmp_path):
    path = tmp_path / "out.csv"
    result = analysis.analyze(arm, np.zeros(12), rate=100, friction="0.1,0.05", table=path)
    head = path.read_text().splitlines()[0].split(",")
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    column = head.index("joint3_yaw_Nm")
    np.testing.assert_allclose(np.abs(table[:, column]).max(), result.peak[5], rtol=1e-8)
    bare = analysis.analyze(arm, np.zeros(12), rate=100)
    added = result.torque - bare.torque
    moving = np.abs(bare.along.rates) > 0.3
    np.testing.assert_allclose(added[moving], 0.05 * np.sign(bare.along.rates[moving]), rtol=1e-6)
    wave = np.sqrt(np.mean(bare.torque[:-1] ** 2, axis=0))  # whole periods: the mean of samples
    np.testing.assert_allclose(bare.rms, wave, rtol=1e-3)
    data = result.to_json()
    assert data["peak_Nm"]["joint1_yaw"] == pytest.approx(result.peak[1])
    assert data["rate_use"]["joint1_yaw"] == pytest.approx(0.2 * np.pi, rel=1e-3)


def test_the_papers_motion_shrinks_to_a_robots_limits():
    """A report runs it unasked, so it must not be what makes a report fail."""
    from snakegen.spec.loading import load_spec

    slow = snakegen.load(load_spec("arm6", overrides=["joint.velocity=0.3", "joint.upper=0.1"]))
    result = analysis.analyze(slow, np.zeros(12))
    assert "within this robot's limits (0.095 rad, 2.09 s)" in result.name
    assert np.all(result.gravity == 0.0)
    assert np.abs(result.along.rates).max() < 0.3
    aside = ["joint.lower=0.2", "joint.upper=0.5", "joint.velocity=2"]
    off = analysis.analyze(snakegen.load(load_spec("arm6", overrides=aside)), np.full(12, 0.3))
    assert off.along.angles.min() >= 0.2 and off.along.angles.max() <= 0.5
    assert analysis.analyze(snakegen.load("arm6"), np.zeros(12)).name == "table3"


def test_servo_friction_is_one_friction_everywhere():
    """`joint.servo.friction` is what an option would say: in the law and in a run, once."""
    rubbed = snakegen.load(load_spec("arm6", overrides=["joint.servo.friction=0.5"]))
    plain = snakegen.load("arm6")
    own = analysis.analyze(rubbed, rubbed.configuration(), duration=1.0)
    asked = analysis.analyze(plain, plain.configuration(), duration=1.0, friction="0.5,0.5")
    np.testing.assert_array_equal(own.torque, asked.torque)
    assert own.friction.highest == (0.5, 0.5)
    less = analysis.analyze(rubbed, rubbed.configuration(), duration=1.0, friction="0.2")
    assert less.friction.highest == (0.2, 0.2)
    given = {"duration": 0.2, "gravity": "0,0,0"}
    runs = [
        run(robot, "table3", options=given | more)
        for robot, more in (
            (rubbed, {}),
            (plain, {"friction": "0.5"}),
            (rubbed, {"friction": "0.5"}),
        )
    ]
    torques = [run.channel("joint_torque").values for run in runs]
    np.testing.assert_array_equal(torques[0], torques[1])
    np.testing.assert_array_equal(torques[0], torques[2])
    assert np.abs(runs[0].channel("joint_friction").values).max() == pytest.approx(0.5, rel=1e-3)
