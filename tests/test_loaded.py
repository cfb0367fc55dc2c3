"""A body that gives way under a push: at rest in MuJoCo, followed, and as far as it can hold."""

import mujoco
import numpy as np
import pytest

from snakegen.control.controller import flight_controller
from snakegen.control.frame import cog_frame
from snakegen.kernels.allocation.compliance import twists, yielding_thrusts
from snakegen.kernels.allocation.gimbals import joint_order
from snakegen.kernels.allocation.types import RotorBounds
from snakegen.kernels.allocation.underactuated import rotor_map, truncated
from snakegen.kernels.control.types import Measured, Target
from snakegen.kernels.dynamics.joint_loads import no_loads
from snakegen.robot.robot import load
from snakegen.simulation.flight.postures import place, resting_joints
from snakegen.simulation.flight.world import make_world
from snakegen.simulation.push.limit_search import farthest, follow
from snakegen.simulation.push.prediction import forecast
from snakegen.simulation.push.quasi_static import Steady, lacking, load_on
from snakegen.spec.loading import load_spec

TURNED = {
    "joint1_pitch": 0.02, "joint1_yaw": 0.52, "joint2_pitch": 0.45,
    "joint2_yaw": 0.65, "joint3_pitch": -0.08, "joint3_yaw": -0.73,
}  # fmt: skip
YAW = np.array([0.0, 0.0, 0.0, 0.1, 0.1, -1.0])


def twisted(rows, angles, turn, thrust):
    """The plain sum: every newton turns its own gimbals."""
    out = angles.copy()
    np.add.at(out, rows[:, 2, 1].astype(int), turn * thrust[:, None])
    return out


@pytest.fixture(scope="module")
def dual():
    return load(load_spec("dragon4", overrides=["control.mode=dual_rotor"]))


@pytest.fixture(scope="module")
def start(dual):
    return place(dual, resting_joints(dual, TURNED), np.array([0.0, 0.0, 4.0]))


def settled(robot, start, t, allocator="paper"):
    c = flight_controller(robot, allocator=allocator)
    steady = Steady.hovering(load_on(robot, c, start, YAW, "link1"))
    assert steady.settle(t)
    return steady


def test_a_steady_body_rests_in_mujoco(dual, start):
    """Thrusts, gimbals and the push of a steady state leave no acceleration but rounding."""
    steady = settled(dual, start, 0.2)
    world = make_world(dual, floor=False)
    model, data = world.model, mujoco.MjData(world.model)
    world.set_state(data, steady.q)
    target = dict(zip(dual.joint_names, dual.angles(start), strict=True))
    for apparatus, turns in zip(dual.modules.apparatuses, steady.gimbals, strict=True):
        for name, angle in zip((apparatus.roll, apparatus.pitch), turns, strict=True):
            target[name] = angle
    for servo in dual.modules.servos:
        data.ctrl[model.actuator(servo.joint).id] = target[servo.joint]
    mujoco.mj_forward(model, data)
    rotors = [r.link for a in dual.modules.apparatuses for r in a.rotors]
    push = 0.2 * YAW
    cog = data.subtree_com[1].copy()
    root = model.body("link1").id
    lever = cog - data.xipos[root]
    data.xfrc_applied[root] = np.concatenate([push[:3], push[3:] + np.cross(lever, push[:3])])
    for name, thrust in zip(rotors, steady.thrust, strict=True):
        (actuator,) = [
            i for i in range(model.nu)
            if model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_SITE
            and model.site(model.actuator_trnid[i, 0]).name.startswith(name)
        ]  # fmt: skip
        data.ctrl[actuator] = thrust
        if model.actuator_actadr[actuator] >= 0:
            data.act[model.actuator_actadr[actuator]] = thrust
    mujoco.mj_forward(model, data)
    assert np.abs(data.qacc).max() < 1e-5


def test_a_steady_body_lacks_nothing_and_its_servos_give_way_by_their_torque(dual, start):
    steady = settled(dual, start, 0.2)
    load_ = steady.load
    assert np.abs(lacking(load_, steady.q, steady.thrust, 0.2)).max() < 1e-6
    rest, angles = dual.angles(start), dual.angles(steady.q)
    joints = [i for i, n in enumerate(load_.servos) if n in TURNED]
    off = (angles - rest)[load_.address[joints]]
    np.testing.assert_allclose(off, -steady.torque[joints] / load_.stiffness[joints], atol=1e-9)
    assert np.abs(off).max() > 1e-3, "a body that does not give way proves nothing"


def test_the_followed_reach_is_where_a_rotor_meets_its_limit(dual, start):
    c = flight_controller(dual)
    load_ = load_on(dual, c, start, YAW, "link1")
    reach = follow(load_, 0.5)
    short, beyond = Steady.hovering(load_), Steady.hovering(load_)
    assert short.settle(0.999 * reach.t) and beyond.settle(1.001 * reach.t)
    assert short.room()[0] > 0 > beyond.room()[0]
    assert all(what == "thrust" for what, _ in reach.stopped)
    # stiff servos hold more or less, but not the same: the give is what decides
    stiff = load(
        load_spec(
            "dragon4",
            overrides=["control.mode=dual_rotor", "vectoring_apparatus.servo.stiffness=1e6"],
        )
    )
    other = follow(load_on(stiff, flight_controller(stiff), start, YAW, "link1"), 0.5)
    assert abs(other.t / reach.t - 1.0) > 0.03


def test_no_answer_nearby_holds_more_than_the_farthest(dual, start):
    """Against steps in all directions that keep the balance: none lengthens the push."""
    c = flight_controller(dual, allocator="constrained")
    found = forecast(dual, c, start, "wrench")
    paper = follow(load_on(dual, flight_controller(dual), start, found.push, "link1"), found.held)
    assert paper.t < found.loaded < found.held
    load_ = load_on(dual, c, start, found.push, "link1")
    rng = np.random.default_rng(0)
    start_ = np.concatenate([rng.uniform(4, 14, 8), np.zeros(2), [0.7 * found.loaded]])
    best = farthest(load_, start_).t
    assert np.isfinite(best) and best <= found.loaded * 1.001


def test_what_cannot_be_found_is_said(dual, start):
    c = flight_controller(dual, allocator="constrained")
    load_ = load_on(dual, c, start, 1e6 * YAW, "link1")
    reach = farthest(load_, np.concatenate([np.full(8, 10.0), np.zeros(2), [1.0]]))
    assert np.isnan(reach.t) or reach.t < 1e-5


def test_twists_are_the_slopes_of_the_map(dual, start):
    steady = settled(dual, start, 0.0)
    c = steady.load.controller
    frame = cog_frame(c, dual.angles(steady.q))
    m, rows = frame.mounts, frame.rotors
    angles, give = joint_order(m, steady.gimbals), np.full((4, 2), 0.01)
    turn, slope = twists(m, rows, angles, give)
    for r in range(8):
        j = int(rows[r, 2, 1])
        for kind in range(2):
            step = np.zeros((4, 2))
            step[j, kind] = 1e-6
            ahead, back = rotor_map(m, rows, angles + step), rotor_map(m, rows, angles - step)
            np.testing.assert_allclose(slope[r, kind], (ahead - back)[:, r] / 2e-6, atol=1e-7)
    stands = twisted(rows, angles, turn, np.eye(8)[0] * 3.0)
    np.testing.assert_allclose(
        stands - angles, np.r_[[3.0 * turn[0]], np.zeros((3, 2))], atol=1e-15
    )
    # a newton at ±s/2 of the roll axis, on a servo of 100 N·m/rad: 1.1 mrad
    assert abs(turn[0, 0]) == pytest.approx(0.01 * 0.223 / 2, rel=0.05)


@pytest.mark.parametrize("share", [0.3, 0.6])
def test_yielding_thrusts_make_the_wrench_with_the_gimbals_as_they_stand(dual, start, share):
    c = flight_controller(dual, allocator="constrained")
    frame = cog_frame(c, dual.angles(start))
    m, rows, give = frame.mounts, frame.rotors, joint_order(frame.mounts, c.law.gimbal_give)
    gimbals = np.array(
        [[dual.angles(start)[b - 1] for b in pair] for pair in
         zip(c.gimbals.roll_body, c.gimbals.pitch_body, strict=True)]
    )  # fmt: skip
    angles, tilt = joint_order(m, gimbals), np.eye(3)
    wanted = np.r_[frame.hover_wrench[2], share * np.array([0.03, 0.03, -0.25])]
    rigid = truncated(rotor_map(m, rows, angles), tilt)
    thrust, stood, _ = yielding_thrusts(
        m, rows, angles, give, tilt, wanted, frame.scale[2:],
        RotorBounds(c.rotors.thrust_min, c.rotors.thrust_max, 1, no_loads(8)),
    )  # fmt: skip
    turn, _ = twists(m, rows, angles, give)
    np.testing.assert_allclose(stood, twisted(rows, angles, turn, thrust), atol=1e-12)
    stands = truncated(rotor_map(m, rows, stood), tilt)
    assert np.abs(stands @ thrust - wanted).max() < 2e-3
    assert np.abs(rigid @ thrust - wanted).max() > 5e-3, "the twist must matter here"
    assert np.all(thrust >= -1e-9) and np.all(thrust <= c.rotors.thrust_max + 1e-9)


def test_a_command_for_gimbals_that_give_way_is_not_taken_for_a_saturated_one(dual, start):
    """Else the integrals stand still while there is room, and the body drifts off."""
    c, still = flight_controller(dual, allocator="constrained"), np.zeros(3)
    angles = dual.angles(start)
    frame = cog_frame(c, angles)
    pairs = zip(c.gimbals.roll_body, c.gimbals.pitch_body, strict=True)
    gimbals = np.array([[angles[b - 1] for b in pair] for pair in pairs])
    measured = Measured(np.eye(3), still, still, still, angles, np.zeros_like(angles))
    turned = np.array([[1.0, -0.02, 0.0], [0.02, 1.0, 0.0], [0.0, 0.0, 1.0]])
    target = Target(frame.cog, still, still, turned, still)
    state, command = c.tick(measured, target, c.start(gimbals), 0.005)
    assert abs(command.wanted[5]) > 0.05
    missed = frame.scale * (command.given - command.wanted)
    assert state.saturated == 0 and np.abs(missed[2:]).max() < 1e-6
