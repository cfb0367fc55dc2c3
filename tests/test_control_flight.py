"""The whole tick: against NumPy, against its own linearisation, and flying a rigid body."""

import numpy as np
import pinocchio as pin
import pytest
from flat_robots import random_rotation, snake
from test_control_allocation import G, controller_of, true_wrench

import snakegen
from snakegen.base.geometry import rotation_from_rpy, unskew
from snakegen.control import pose, switch
from snakegen.control.controller import flight_controller
from snakegen.control.frame import cog_frame
from snakegen.control.gains import Gains, gains_from
from snakegen.errors import SpecError
from snakegen.kernels.control.types import DUAL, REFUSED, VIRTUAL, Measured, Target
from snakegen.kernels.kinematics import chain

TABLE_3 = {
    "force_p": [4.0, 3.0, 5.6],
    "force_i": [3.0, 0.0005, 3.0],
    "force_d": [7.0, 1.5, 3.6],
    "torque_p": [1.4, 18.0, 10.0],
    "torque_i": [0.3, 0.3, 0.3],
    "torque_d": [2.0, 15.0, 6.0],
    "attitude_roll": 1.0,
    "attitude_pitch": 0.0,
    "vectoring_roll": [1.0, 0.0],
    "vectoring_pitch": [0.0, 0.0],
}
TUNED = TABLE_3 | {
    "force_i": [3.0, 1.0, 3.0],
    "torque_p": [30.0, 18.0, 10.0],
    "torque_d": [10.0, 15.0, 6.0],
    "vectoring_roll": 1.0,
    "vectoring_pitch": 1.0,
}


def bent_angles(robot, yaw=0.8, pitch=0.3):
    angles = np.zeros(len(robot[0].parent) - 1)
    angles[robot[3][:, 1]] = yaw
    angles[robot[3][:, 0]] = pitch * (-1.0) ** np.arange(len(robot[3]))
    return angles


def at_rest(robot, angles):
    return Measured(np.eye(3), *np.zeros((3, 3)), angles, np.zeros_like(angles))


def target_at(position, rotation=None):
    rotation = np.eye(3) if rotation is None else rotation
    return Target(np.array(position, float), np.zeros(3), np.zeros(3), rotation, np.zeros(3))


@pytest.mark.parametrize("seed", range(4))
def test_tick_asks_for_the_wrench_of_equations_15_to_19(seed):
    rng = np.random.default_rng(seed)
    robot = snake(4, offset=0.037)
    tree, n = robot[0], len(robot[0].parent) - 1
    c = controller_of(robot, axes_body=1, axes_rotation=random_rotation(rng))
    g = Gains()
    base, angles = random_rotation(rng), bent_angles(robot) + rng.normal(size=n) * 0.1
    measured = Measured(base, *rng.normal(size=(3, 3)), angles, rng.normal(size=n) * 0.3)
    target = Target(*rng.normal(size=(3, 3)), random_rotation(rng), rng.normal(size=3))
    before = c.start()._replace(
        force_integral=rng.normal(size=3), torque_integral=rng.normal(size=3)
    )
    state, command = c.tick(measured, target, before, 0.01)

    poses = chain.forward(tree, base, measured.position, angles)
    mass, cog, inertia = chain.mass_properties(tree, *poses)
    speed, _, _ = chain.centroidal_motion(
        tree, *poses, measured.linear, measured.angular, measured.rates
    )
    _, spins = chain.body_twists(tree, *poses, measured.linear, measured.angular, measured.rates)
    r = poses[0][1] @ c.law.axes_rotation
    inertia, omega = r.T @ inertia @ r, r.T @ spins[1]
    error = target.position - cog
    pulled = np.clip(before.force_integral + 0.01 * error, -2, 2)
    force = mass * (
        g.force_p * error + g.force_i * pulled + g.force_d * (target.velocity - speed)
        + target.acceleration + [0, 0, G]
    )  # fmt: skip
    e_r = unskew(0.5 * (r.T @ target.rotation - target.rotation.T @ r)) * 1.0
    e_w = r.T @ target.rotation @ target.angular - omega
    wound = np.clip(before.torque_integral + 0.01 * e_r, -2, 2)
    torque = inertia @ (g.torque_p * e_r + g.torque_i * wound + g.torque_d * e_w)
    torque += np.cross(omega, inertia @ omega)
    np.testing.assert_allclose(command.wanted, np.r_[r.T @ force, torque], atol=1e-9)
    np.testing.assert_allclose(
        pose.desired_force(g, mass, error, target.velocity - speed, pulled, target.acceleration),
        force,
        atol=1e-9,
    )
    alone = pose.desired_torque(g, inertia, r, target.rotation, omega, target.angular, wound)
    np.testing.assert_allclose(alone, torque, atol=1e-9)
    np.testing.assert_allclose(state.force_integral, pulled, atol=1e-12)
    np.testing.assert_allclose(state.torque_integral, wound, atol=1e-12)


def test_attitude_error_is_half_the_skew_part():
    """For a small turn a about an axis, e_R = a axis: fixes the ½ of eq 18."""
    robot = snake(4, offset=0.037)
    c, angles = controller_of(robot, gyroscopic=False), bent_angles(robot)
    frame = cog_frame(c, angles)
    turn = rotation_from_rpy([1e-4, -2e-4, 3e-4])
    _, command = c.tick(at_rest(robot, angles), target_at(frame.cog, turn), c.start(), 0.0)
    expected = frame.inertia @ (Gains().torque_p * [1e-4, -2e-4, 3e-4])
    np.testing.assert_allclose(command.wanted[3:], expected, rtol=1e-3)


@pytest.mark.parametrize("mode", [VIRTUAL, DUAL])
@pytest.mark.parametrize("constrained", [False, True])
def test_given_is_what_the_rotors_make(mode, constrained):
    robot = snake(4, offset=0.037)
    c = controller_of(robot, mode=mode, constrained=constrained)
    angles = bent_angles(robot)
    frame = cog_frame(c, angles)
    target = target_at(frame.cog + np.array([0.2, -0.1, 0.1]), rotation_from_rpy([0.0, 0.0, 0.03]))
    state, command = c.tick(at_rest(robot, angles), target, c.start(), 0.005)
    made = true_wrench(robot, frame, angles, command.gimbals, command.thrust)
    np.testing.assert_allclose(command.given, made, atol=1e-9)
    rows = slice(2 if mode == DUAL else 0, 6)
    np.testing.assert_allclose(command.given[rows], command.wanted[rows], atol=1e-5)
    assert state.saturated == 0


def test_integrals_are_clamped_and_do_not_wind_up_in_saturation():
    robot = snake(4, offset=0.037, limit=11.0)
    c, angles = controller_of(robot), bent_angles(robot)
    frame = cog_frame(c, angles)
    measured, state = at_rest(robot, angles), c.start()
    for _ in range(50):
        state, _ = c.tick(measured, target_at(frame.cog + np.array([0.01, 0, 0])), state, 10.0)
    assert state.force_integral[0] == pytest.approx(2.0), "clamped"
    far, state = target_at(frame.cog + np.array([0, 0, 5.0])), c.start()
    state, _ = c.tick(measured, far, state, 0.005)
    assert state.saturated == 1
    wound = state.force_integral[2]
    for _ in range(20):
        state, _ = c.tick(measured, far, state, 0.005)
    assert state.force_integral[2] == wound
    state, _ = c.tick(measured, target_at(frame.cog - np.array([0, 0, 0.5])), state, 0.005)
    assert state.force_integral[2] < wound, "it may shrink"


def test_straight_body_is_flagged_in_virtual_mode_only():
    robot = snake(4, offset=0.037)
    angles = np.zeros(len(robot[0].parent) - 1)
    target = target_at(cog_frame(controller_of(robot), angles).cog)
    for mode, refused in ((VIRTUAL, True), (DUAL, False)):
        c = controller_of(robot, mode=mode)
        _, command = c.tick(at_rest(robot, angles), target, c.start(), 0.005)
        assert (command.status == REFUSED) == refused


class Rigid:
    """A rigid body under a controller: motor lag and delay, gimbals as commanded."""

    def __init__(self, robot, controller, angles, mode):
        self.robot, self.c, self.angles, self.mode = robot, controller, angles, mode
        frame = cog_frame(controller, angles)
        self.mass, self.inertia, self.arm = frame.mass, frame.inertia, frame.cog
        self.r, self.p, self.v, self.w = np.eye(3), np.zeros(3), np.zeros(3), np.zeros(3)
        self.state = controller.start(switch.hover_gimbals(controller, angles))
        self.pending, self.wrench, self.commands = [], None, []

    def measured(self):
        origin, omega = self.p - self.r @ self.arm, self.r @ self.w
        velocity = self.v + np.cross(omega, -self.r @ self.arm)
        return Measured(self.r, origin, velocity, omega, self.angles, 0 * self.angles)

    def fly(self, target, seconds, *, lag=0.035, delay=0.0, dt=0.005, error=None, mode=None):
        """Steps the loop; `error` scales each rotor's thrust. Returns CoG positions (n, 3)."""
        track, held = [], int(round(delay / dt))
        error = np.ones(len(self.robot[1].body)) if error is None else error
        for _ in range(int(round(seconds / dt))):
            mode = self.mode if mode is None else mode
            self.state, command = self.c.tick(self.measured(), target, self.state, dt, mode=mode)
            self.commands.append(command)
            self.pending.append(command)
            used = self.pending.pop(0) if len(self.pending) > held else self.pending[0]
            made = used.given
            if not np.all(error == 1.0):
                frame = cog_frame(self.c, self.angles)
                made = true_wrench(
                    self.robot, frame, self.angles, used.gimbals, used.thrust * error
                )
            if self.wrench is None:
                self.wrench = np.r_[0, 0, self.mass * G, 0, 0, 0]
            for _ in range(5):
                h = dt / 5
                self.wrench = self.wrench + (made - self.wrench) * (h / lag if lag else 1.0)
                self.v = self.v + h * (self.r @ self.wrench[:3] / self.mass - [0, 0, G])
                twist = np.cross(self.w, self.inertia @ self.w)
                self.w = self.w + h * np.linalg.solve(self.inertia, self.wrench[3:] - twist)
                self.p = self.p + h * self.v
                self.r = self.r @ pin.exp3(h * self.w)
            track.append(self.p)
        return np.array(track)


@pytest.mark.parametrize(
    "mode, gains", [(VIRTUAL, {}), (DUAL, TUNED)], ids=["fully actuated", "under-actuated"]
)
def test_a_step_settles_despite_lag_delay_and_thrust_error(mode, gains):
    robot = snake(4, offset=0.037) if mode == VIRTUAL else snake(2, offset=0.05)
    gains = Gains(**gains)
    body = Rigid(robot, controller_of(robot, gains, mode), bent_angles(robot, 0.7, 0.0), mode)
    error = 1 + 0.03 * np.random.default_rng(0).normal(size=len(robot[1].body))
    turn = 0.3 if mode == VIRTUAL else 0.05  # yaw by drag alone is weak
    target = target_at([0.5, -0.4, 0.3], rotation_from_rpy([0.0, 0.0, turn]))
    track = body.fly(target, 25.0, lag=0.04, delay=0.02, error=error)
    assert np.abs(track[-1] - target.position).max() < 0.1
    assert np.abs(track).max() < 1.0
    assert np.linalg.norm(pin.log3(body.r.T @ target.rotation)[2]) < 0.05
    assert np.abs(body.w).max() < 0.01 and np.abs(body.v).max() < 0.03


@pytest.mark.parametrize("start, end", [(DUAL, VIRTUAL), (VIRTUAL, DUAL)])
def test_switching_is_smooth_and_keeps_the_pose(start, end):
    robot = snake(4, offset=0.037, drag=0.0125)
    angles = bent_angles(robot)
    gains = Gains(**(dict(TUNED) | {"force_i": [0.5, 0.5, 1.0]}))
    c = controller_of(robot, gains, start, blend_time=1.0)
    body = Rigid(robot, c, angles, start)
    target = target_at([0.05, 0.0, 0.0])
    body.fly(target, 6.0)
    switch.require_mode(c, end, angles)
    settled, before = body.p.copy(), body.commands[-1]
    track = body.fly(target, 4.0, mode=end)
    thrust = np.array([before.thrust] + [k.thrust for k in body.commands[-800:]])
    assert np.abs(np.diff(thrust, axis=0)).max() < 0.05, "N a tick"
    assert np.abs(thrust[-1] - thrust[0]).max() > 0.05, "the modes do differ"
    assert np.abs(track - settled).max() < 0.01
    assert body.state.blend == (1.0 if end == VIRTUAL else 0.0)


def test_cog_velocity_contains_the_joint_rates():
    robot = snake(4, offset=0.037)
    c, angles = controller_of(robot), bent_angles(robot)
    frame = cog_frame(c, angles)
    rates = np.zeros_like(angles)
    rates[robot[3][:, 1]] = 0.5
    still, moving = at_rest(robot, angles), at_rest(robot, angles)._replace(rates=rates)
    wanted = [c.tick(m, target_at(frame.cog), c.start(), 0.0)[1].wanted for m in (still, moving)]
    h = 1e-6
    drift = (cog_frame(c, angles + h * rates).cog - cog_frame(c, angles - h * rates).cog) / (2 * h)
    np.testing.assert_allclose(
        (wanted[1] - wanted[0])[:3], -frame.mass * Gains().force_d * drift, atol=1e-6
    )


def test_gains_name_their_mistakes():
    with pytest.raises(SpecError, match="force_p"):
        gains_from({"forse_p": [1, 2, 3]})
    with pytest.raises(SpecError, match="not 3"):
        Gains(force_p=[1.0, 2.0])
    with pytest.raises(SpecError, match="3 numbers for 2"):
        Gains(vectoring_roll=[1, 1, 1]).vectoring(2)
    with pytest.raises(SpecError, match="finite"):
        Gains(torque_d=[1.0, np.nan, 1.0])


@pytest.fixture(scope="module")
def dragon4():
    return snakegen.load("dragon4")


def test_controller_of_a_described_robot(dragon4):
    c = flight_controller(dragon4)
    np.testing.assert_allclose(c.law.force[0], [3.6, 3.6, 2.8])
    assert c.law.axes_body == 0 and c.mode == VIRTUAL and c.law.constrained == 0
    middle = flight_controller(dragon4, axes="middle", allocator="constrained")
    assert middle.law.axes_body > 0 and middle.law.constrained == 1
    with pytest.raises(SpecError, match="paper"):
        flight_controller(dragon4, "papre")
    with pytest.raises(SpecError, match="allocator"):
        flight_controller(dragon4, allocator="qp")


def test_described_robot_hovers_in_both_modes(dragon4):
    posture = {"joint1_yaw": 0.8, "joint2_yaw": 0.8, "joint3_yaw": 0.8, "joint1_pitch": 0.2}
    angles = dragon4.angles(dragon4.configuration(posture))
    for mode in ("virtual_single_rotor", "dual_rotor"):
        c = flight_controller(dragon4, mode=mode)
        turns = switch.hover_gimbals(c, angles)
        frame = cog_frame(c, angles)
        state, command = c.tick(at_rest(None, angles), target_at(frame.cog), c.start(turns), 0.005)
        assert command.status != REFUSED and state.saturated == 0
        assert command.thrust.sum() == pytest.approx(dragon4.mass * G, rel=0.02)
        np.testing.assert_allclose(command.given, frame.hover_wrench, atol=1e-5)
