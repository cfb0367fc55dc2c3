"""Poles and delay margins against the tick's own linearisation and its flights."""

import numpy as np
import pinocchio as pin
import pytest
from flat_robots import snake
from test_control_allocation import G, controller_of
from test_control_flight import TABLE_3, TUNED, Rigid, bent_angles, target_at

from snakegen.base.geometry import rotation_from_rpy
from snakegen.control.gains import Gains
from snakegen.control.poles import loops, settling_times
from snakegen.kernels.control.types import DUAL, VIRTUAL


def test_table_3_gains_diverge_as_their_poles_say():
    robot, gains = snake(2, offset=0.05), Gains(**TABLE_3)
    lateral = loops(gains, DUAL, lag=0.035)[1]
    assert not lateral.stable and lateral.delay_margin == 0.0
    body = Rigid(robot, controller_of(robot, gains, DUAL), bent_angles(robot, 0.7, 0.0), DUAL)
    swing = np.abs(body.fly(target_at([0.0, 0.02, 0.0]), 12.0)[:, 1] - 0.02)
    period = int(round(2 * np.pi / abs(lateral.poles[0].imag) / 0.005))
    growth = np.log(swing[-period:].max() / swing[-2 * period : -period].max()) / (0.005 * period)
    assert growth == pytest.approx(lateral.poles[0].real, rel=0.15)


def test_poles_of_table_3_read_literally():
    """THEORY A7: k_φ alone, integrals left out: +0.48 ± 1.16j."""
    lateral = loops(Gains(**TABLE_3), DUAL, vectoring=(0.0, 0.0), integral=False)[1]
    np.testing.assert_allclose(lateral.poles[0].real, 0.48, atol=0.005)
    np.testing.assert_allclose(abs(lateral.poles[0].imag), 1.16, atol=0.005)


def closed_loop_matrix(robot, c, angles, mode, h=1e-6):
    """A of x' = A x by finite differences of the tick: p, v, rotation, ω, ∫e_r, ∫e_R."""
    body = Rigid(robot, c, angles, mode)
    target, stride = target_at(np.zeros(3)), 1e-4

    def slope(x):
        body.p, body.v, body.w = x[:3], x[3:6], x[9:12]
        body.r = pin.exp3(x[6:9])
        state = body.state._replace(force_integral=x[12:15], torque_integral=x[15:])
        after, command = c.tick(body.measured(), target, state, stride, mode=mode)
        at, now = c.tick(body.measured(), target, state, 0.0, mode=mode)
        del at, command
        acceleration = body.r @ now.given[:3] / body.mass - [0, 0, G]
        twist = np.cross(body.w, body.inertia @ body.w)
        turning = np.linalg.solve(body.inertia, now.given[3:] - twist)
        pulled = (after.force_integral - x[12:15]) / stride
        wound = (after.torque_integral - x[15:]) / stride
        return np.r_[x[3:6], acceleration, x[9:12], turning, pulled, wound]

    return np.stack([(slope(h * e) - slope(-h * e)) / (2 * h) for e in np.eye(18)], axis=1)


@pytest.mark.parametrize(
    "mode, gains",
    [
        (VIRTUAL, Gains()),
        (DUAL, Gains(**TUNED)),
        (DUAL, Gains(**(TABLE_3 | {"vectoring_roll": 1}))),
    ],
)
def test_poles_are_those_of_the_tick_itself(mode, gains):
    links = 4 if mode == VIRTUAL else 2
    robot = snake(links, offset=0.037)
    angles = bent_angles(robot, 0.7, 0.0)
    c = controller_of(robot, gains, mode)
    measured = np.linalg.eigvals(closed_loop_matrix(robot, c, angles, mode))
    for loop in loops(gains, mode):
        if mode == DUAL and loop.axis == "roll":
            continue  # the inner loop of y, whose poles are among y's
        for pole in loop.poles:
            assert np.abs(measured - pole).min() < 2e-3 * max(1.0, abs(pole)), (loop.axis, pole)


def test_delay_margin_equals_the_phase_margin_over_the_crossover():
    gains = Gains()
    for i, loop in enumerate(loops(gains, VIRTUAL, lag=0.035)):
        rows = [gains.force_p, gains.force_i, gains.force_d] if i < 3 else [
            gains.torque_p, gains.torque_i, gains.torque_d]  # fmt: skip
        p, k, d = (row[i % 3] for row in rows)
        w = np.geomspace(0.3, 30, 200001)
        open_loop = (p + k / (1j * w) + d * 1j * w) / ((1j * w) ** 2 * (1 + 0.035j * w))
        last = np.flatnonzero(np.abs(open_loop) > 1)[-1]
        phase = np.pi + np.unwrap(np.angle(open_loop))[last]
        assert loop.delay_margin == pytest.approx((phase % (2 * np.pi)) / w[last], rel=2e-3)


@pytest.mark.parametrize("axis", [0, 2])
def test_settling_is_that_of_the_simulated_step(axis):
    """Residues of the loop against the tick on a rigid body; x through tilt and gimbals."""
    robot, gains = snake(2, offset=0.05), Gains(**TUNED)
    angles = bent_angles(robot, 0.7, 0.0)
    controller = controller_of(robot, gains, DUAL)
    told = settling_times(controller, gains, DUAL, lag=0.035, delay=0.005)["xyz"[axis]]
    goal = np.zeros(3)
    goal[axis] = 0.05
    body = Rigid(robot, controller, angles, DUAL)
    track = body.fly(target_at(goal), 20.0, lag=0.035, delay=0.005)
    away = np.flatnonzero(np.abs(track[:, axis] / 0.05 - 1.0) > 0.05)
    assert 0.005 * away[-1] == pytest.approx(told, rel=0.03)
    assert (
        settling_times(
            controller_of(robot, Gains(**TABLE_3), DUAL), Gains(**TABLE_3), DUAL, lag=0.035
        )["y"]
        == np.inf
    )


def test_simulated_loop_loses_stability_between_the_delay_margins():
    robot = snake(4, offset=0.037)
    margin = min(loop.delay_margin for loop in loops(Gains(), VIRTUAL, lag=0.035))
    target = target_at(np.zeros(3), rotation_from_rpy([0.02, 0.0, 0.0]))
    ends = []
    for delay in (0.8 * margin, 1.2 * margin):
        c = controller_of(robot)
        body = Rigid(robot, c, bent_angles(robot), VIRTUAL)
        body.fly(target, 10.0, lag=0.035, delay=delay)
        ends.append(np.linalg.norm(body.w))
    assert ends[0] < 0.005 < 0.05 < ends[1]
