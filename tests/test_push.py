"""The tie: rays against closed forms and bisection, joint loads against the law, short pushes."""

from functools import cache

import numpy as np
import pytest

from snakegen import load
from snakegen.analysis import wrench_margin
from snakegen.analysis.allocation import allocation
from snakegen.control.controller import flight_controller
from snakegen.control.frame import cog_frame
from snakegen.errors import SnakegenError
from snakegen.kernels.allocation.fully_actuated import forces_of
from snakegen.kernels.allocation.gimbals import joint_order
from snakegen.kernels.control.types import Measured, Target
from snakegen.kernels.core.types import Body
from snakegen.kernels.dynamics.joint_loads import force_loads
from snakegen.kernels.kinematics.chain import forward
from snakegen.simulation.flight.postures import bent, place, resting_joints
from snakegen.simulation.flight.run import prepare, run
from snakegen.simulation.push.informed import informed_limit, true_points
from snakegen.simulation.push.prediction import forecast
from snakegen.simulation.recording.verdict import verdict


@pytest.fixture(scope="module")
def robot():
    return load("dragon4")


@pytest.fixture(scope="module")
def hover(robot):
    return place(robot, bent(robot), np.array([0.0, 0.0, 1.0]))


@pytest.mark.parametrize("allocator", ["paper", "constrained"])
def test_a_push_is_lost_where_the_analysis_says(robot, allocator):
    options = {"kind": "torque", "slow": 40.0}
    recording = run(robot, "push", allocator=allocator, ideal=True, options=options)
    m, found = recording.metrics, recording.meta["facts"]["forecast"]
    start = recording_start(robot)
    page = wrench_margin.analyze(robot, start, allocator=allocator).to_json()["prediction"]
    named = page["torque"]["value" if allocator == "paper" else "followed"]
    assert found["held"] == pytest.approx(named, rel=2e-3)
    # lower bounds both, the page's within a thousandth of what is true
    assert found["printed_margin"] == pytest.approx(page["torque"]["value"], rel=1e-3)
    assert found["push"] == pytest.approx(page["torque"]["push"], abs=1e-9)
    assert m["tracking_lost"] and 0.95 <= m["ratio"] <= 1.05
    assert m["informed_ratio"] == pytest.approx(m["ratio"], rel=2e-3)
    assert recording.verdict.passed, recording.verdict.summary()
    if allocator == "paper":
        first = m["limit_ratio"] * found["held"]
        assert first == pytest.approx(found["held_loaded"], rel=0.003)
    # the same push called by another name would show at once
    half = np.array(m["predicted_wrench"]) * 0.5
    lost = np.array(m["lost_wrench"])
    assert np.linalg.norm(lost) > 1.5 * np.linalg.norm(half)


def test_without_noise_both_sides_are_judged_with_noise_what_is_informed(robot):
    @cache
    def thresholds(ideal, allocator):
        how = {"ideal": ideal, "allocator": allocator}
        return prepare(robot, "push", options={"slow": 40.0}, **how).plan.thresholds

    def failed(found, ideal=False, allocator="paper"):
        bounds = thresholds(ideal, allocator)
        judged = verdict(found, {k: v for k, v in bounds.items() if v is not None})
        return {c.metric for c in judged.failed}

    good = {"ratio": 1.02, "limit_ratio": 1.0, "informed_ratio": 0.99}
    for wrong in ({"ratio": 1.07}, {"ratio": 0.93}, {"limit_ratio": 1.07}, {"limit_ratio": 0.93}):
        assert failed(good | wrong, ideal=True) == set(wrong)
        assert not failed(good | wrong) and not failed(good)
    for wrong in ({"ratio": 1.07}, {"ratio": 0.93}):
        assert failed(good | wrong, ideal=True, allocator="constrained") == set(wrong)
    assert not failed(good | {"limit_ratio": 0.5}, ideal=True, allocator="constrained")
    assert failed(good | {"limit_ratio": None}, ideal=True) == {"limit_ratio"}
    for allocator in ("paper", "constrained"):
        low = good | {"informed_ratio": 0.94}
        assert failed(low, allocator=allocator) == {"informed_ratio"}
        assert failed(good | {"informed_ratio": None}, allocator=allocator) == {"informed_ratio"}


def test_the_battery_is_drained_where_it_is_asked_for(robot):
    def energy(**options):
        return prepare(robot, "push", options=options).imperfections.battery_energy

    assert energy() == 0.0 and energy(battery=True) == 213.0
    assert prepare(robot, "push").imperfections.thrust_mismatch == 0.03


def test_the_constrained_push_is_where_servos_are_weakest(robot):
    """Along x, where servos limit; along z the same body holds a third more."""
    found = forecast(
        robot, flight_controller(robot, allocator="constrained"), recording_start(robot)
    )
    assert abs(found.push[0]) > 0.95 and found.margin == "exact_servo"
    assert found.printed_margin == pytest.approx(34.47, abs=0.05)
    assert set(found.stopped) == {"joint1_yaw", "joint2_yaw"}


def test_thrust_factors_change_the_informed_limit(robot):
    """Known by hand: all factors alike change nothing of the pseudo-inverse, ceilings apart."""
    start, n = recording_start(robot), len(robot.rotors.body)
    for allocator in ("paper", "constrained"):
        c = flight_controller(robot, allocator=allocator)
        found = forecast(robot, c, start, "torque")
        given = (robot, c, start, found.push, found.link)
        margin = found.printed_margin
        assert informed_limit(*given, np.ones(n)) == pytest.approx(margin, rel=2e-3)
        weak = informed_limit(*given, np.full(n, 0.95))
        if allocator == "paper":  # it commands more; ceilings are of thrust
            assert weak == pytest.approx(margin, rel=1e-6)
        else:  # a command within limits gives 0.95 of the thrust
            assert weak < 0.96 * margin
        factors = np.random.default_rng(0).uniform(0.9, 1.1, n)
        assert abs(informed_limit(*given, factors) / margin - 1.0) > 1e-3


def test_the_informed_limit_is_that_of_the_true_rotors(robot):
    """Against the rotors one by one: unequal factors at the hover gimbals, dual-rotor map."""
    start, rng = recording_start(robot), np.random.default_rng(3)
    a, factors = allocation(robot, start), rng.uniform(0.9, 1.1, 8)
    rotors = robot.rotors
    axes = np.array([u / np.linalg.norm(u) for u in a.rotor_axes])
    share = np.bincount(rotors.apparatus, factors) / 2.0
    moved, drag = true_points(robot, a, factors)
    for j in range(4):
        mine = rotors.apparatus == j
        true = a.dual[:, mine] @ (factors[mine] * 6.0)
        thrust = axes[mine][0] * 12.0 * share[j]
        moment = np.cross(moved[j], thrust) + drag[j] * thrust
        assert true == pytest.approx(np.r_[thrust, moment], abs=1e-9)


BENT = {
    "joint1_pitch": -0.23, "joint1_yaw": 0.92, "joint2_pitch": 0.22,
    "joint2_yaw": -1.07, "joint3_pitch": -0.22, "joint3_yaw": -0.91,
}  # fmt: skip


def test_a_push_by_force_is_held_where_joints_stop_it(robot):
    """Thrust traded for joint torque: at once it swung up at 0.85 of the prediction."""
    options = {"kind": "force", "posture": BENT, "slow": 40.0}
    recording = run(robot, "push", allocator="constrained", ideal=True, options=options)
    found, m = recording.meta["facts"]["forecast"], recording.metrics
    assert found["printed_margin"] < 0.6 * found["thrust_only"]
    assert m["tracking_lost"] and 0.95 <= m["ratio"] <= 1.05


def test_a_push_on_another_link_is_held_too(robot):
    options = {"kind": "torque", "link": "link4", "slow": 12.0}
    recording = run(robot, "push", ideal=True, options=options)
    own = forecast(robot, flight_controller(robot), recording_start(robot), "torque")
    assert recording.meta["facts"]["forecast"]["held"] != pytest.approx(own.held, rel=1e-3)
    assert recording.metrics["limit_ratio"] == pytest.approx(1.0, abs=0.01)
    assert 0.95 <= recording.metrics["ratio"] <= 1.06


def recording_start(robot):
    return place(robot, bent(robot), np.array([0.0, 0.0, 4.0]))


def held_for(robot, controller, seconds):
    """Returns a tick that holds 0.9 of the largest push, `seconds` after it struck a hover."""
    angles = place(robot, resting_joints(robot, BENT), np.zeros(3))
    found = forecast(robot, controller, angles, "force")
    frame = cog_frame(controller, robot.angles(angles))
    still = np.zeros(3)
    measured = Measured(
        np.eye(3), still, still, still, robot.angles(angles), np.zeros(len(robot.joint_names))
    )

    def asked(extra):
        lift = (extra - 0.9 * found.held * found.push[:3]) / robot.mass
        return Target(frame.cog, still, lift, np.eye(3), still)

    hover = Target(frame.cog, still, still, np.eye(3), still)
    state = controller.tick(measured, hover, controller.start(), 0.005, force_dt=0.0)[0]
    for _ in range(round(seconds / 0.005)):
        state = controller.tick(measured, asked(0.0), state, 0.005, force_dt=0.0)[0]

    def tick(extra=0.0):
        command = controller.tick(measured, asked(extra), state, 0.005, force_dt=0.0)[1]
        thrust = command.thrust.reshape(controller.apparatuses, -1).sum(1)
        forces = forces_of(frame.mounts, thrust, joint_order(frame.mounts, command.gimbals))
        poses = forward(robot.tree, np.eye(3), still, robot.angles(angles))
        loads = force_loads(
            robot.tree, controller.gimbals, Body(*poses, frame.cog, frame.axes), frame.mounts,
            joint_order(frame.mounts, command.gimbals), 9.81, controller.law.joints,
            controller.law.joint_limit,
        )  # fmt: skip
        use = np.abs(loads.bias + loads.rows @ forces) / loads.limit
        return forces, use.max(), np.abs(frame.scale * (command.given - command.wanted)).max()

    return tick


def test_internal_forces_ease_in_and_end_within_the_joints_limits(robot):
    eased = flight_controller(robot, allocator="constrained")
    abrupt = flight_controller(robot, allocator="constrained", internal_time=(1e-9, 1e-9))
    _, first, missed = held_for(robot, eased, 0.005)()
    assert first > 1.05 and missed < 1e-6, "the wrench is met before the joints are relieved"
    moved = {}
    for name, controller in (("eased", eased), ("abrupt", abrupt)):
        tick = held_for(robot, controller, 6.0)
        forces, use, missed = tick()
        assert use < 1.0 + 1e-3 and missed < 1e-6
        nudges = 0.01 * np.eye(3)
        moved[name] = max(np.linalg.norm(tick(e)[0] - forces) for e in nudges) / 0.01
    assert moved["eased"] < 1.5 < moved["abrupt"], moved


STRAIGHT = {"joint1_yaw": 0.0, "joint2_yaw": 0.0, "joint3_yaw": 0.0}


def test_a_singular_posture_is_refused(robot):
    with pytest.raises(SnakegenError, match="singular"):
        prepare(robot, "push", options={"posture": STRAIGHT})
    with pytest.raises(SnakegenError, match="margin is 0"):
        prepare(robot, "push", allocator="constrained", options={"posture": STRAIGHT})
    with pytest.raises(SnakegenError, match="singular"):
        prepare(robot, "hover", options={"posture": STRAIGHT})


def test_a_singular_posture_that_is_forced_fails_for_all_to_see(robot):
    nearly = dict.fromkeys(STRAIGHT, 0.03)
    with pytest.raises(SnakegenError, match="singular"):
        prepare(robot, "push", options={"posture": nearly})
    options = {"posture": nearly, "force": True}
    recording = run(robot, "push", options=options)
    assert np.all(recording.channel("sigma_min").values[:10] < 0.02)
    assert recording.meta["stopped"] and recording.metrics["ratio"] < 0.5
    assert [c.metric for c in recording.verdict.checks if not c.passed] == ["informed_ratio"]
    assert not recording.verdict.passed and not recording.metrics["completed"]
