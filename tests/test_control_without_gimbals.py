"""Loops of bodies whose gimbals are absent or turn about one axis: the poles of what flies."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from multirotors import multirotor
from test_control_flight import Rigid, target_at
from test_control_poles import closed_loop_matrix

import snakegen
from snakegen.analysis import control
from snakegen.base.geometry import rotation_from_xyzw, rpy_from_rotation
from snakegen.control.controller import MODES, flight_controller
from snakegen.control.gain_sets import gain_set, turned_axes
from snakegen.control.gains import Gains
from snakegen.control.gimbal_reach import vectoring_share
from snakegen.control.poles import flight_loops
from snakegen.kernels.control.types import DUAL
from snakegen.simulation.flight.bounds.tilt_budget import air_lags, tilt_lags
from snakegen.simulation.flight.plant import Imperfections
from snakegen.simulation.flight.run import prepare, run
from snakegen.simulation.flight.trim import SLOW_SECONDS

PLUS = (0.0, 90.0, 180.0, 270.0)
NONE = (None,) * 4
ALL_X, ALL_Y = ("1 0 0",) * 4, ("0 1 0",) * 4
ALONG = ("1 0 0", "0 1 0", "1 0 0", "0 1 0")  # each about its own arm
BODIES = {"no gimbals": NONE, "about x": ALL_X, "about y": ALL_Y, "along arms": ALONG}
SHARES = {"no gimbals": (0, 0), "about x": (1, 0), "about y": (0, 1), "along arms": (0.5, 0.5)}
ATTITUDE = {"no gimbals": (1, 1), "about x": (1, 1), "about y": (1, 0), "along arms": (1, 0)}


@pytest.mark.parametrize("body", BODIES)
def test_gimbals_that_are_not_there_do_not_count(body, tmp_path):
    """Shares of y and x; the body tilts along an axis to which no gimbal turns a thrust."""
    robot = multirotor(tmp_path, PLUS, tilts=BODIES[body])
    c = flight_controller(robot, mode="dual_rotor")
    np.testing.assert_allclose(vectoring_share(c), SHARES[body], atol=1e-6)
    np.testing.assert_array_equal(c.law.attitude, ATTITUDE[body])  # k_φ, k_θ
    assert turned_axes(robot) == (SHARES[body][1] > 0, SHARES[body][0] > 0)


@pytest.mark.parametrize("body", BODIES)
def test_poles_are_those_of_the_tick(body, tmp_path):
    """Eigenvalues of the tick's own linearisation on a rigid body contain every pole printed."""
    robot = multirotor(tmp_path, PLUS, tilts=BODIES[body])
    gains = gain_set(robot)
    c = flight_controller(robot, gains, mode="dual_rotor")
    arrays = (robot.tree, robot.rotors, robot.gimbals)
    angles = np.zeros(len(robot.joint_names))
    measured = np.linalg.eigvals(closed_loop_matrix(arrays, c, angles, DUAL))
    inner = {"roll", "pitch"}  # within the loops of y and x, whose poles contain theirs
    for loop in flight_loops(c, gains, DUAL, lag=0.0):
        if loop.axis in inner:
            continue
        for pole in loop.poles:
            away = np.abs(measured - pole).min()
            assert away < 3e-3 * max(1.0, abs(pole)), (body, loop.axis, pole)


@pytest.mark.parametrize("body", BODIES)
def test_default_gains_have_delay_margins(body, tmp_path):
    """Stable with 35 ms of motor lag and 20 ms of further delay, along every axis."""
    robot = multirotor(tmp_path, PLUS, tilts=BODIES[body])
    found = control.analyze(robot)
    assert found.loops["default", "dual_rotor"]
    for loops in found.loops.values():
        assert min(loop.delay_margin for loop in loops) > 0.02, loops


def test_an_axis_that_nothing_moves_has_no_poles(tmp_path):
    """A gain set that leaves x to gimbals, on a body without any."""
    soft = "gains: soft, gain_sets: {soft: {attitude_pitch: 0}}"
    found = control.analyze(multirotor(tmp_path, control=soft))
    (loops,) = found.loops.values()
    x = loops[0]
    assert (x.axis, x.flown, x.stable, x.poles.size) == ("x", False, False, 0)
    out = found.to_json()["loops"]["soft"]["dual_rotor"]["x"]
    assert out["flown"] is False and out["delay_margin_s"] is None
    assert "not controlled" in dict(found.rows())["  x"]
    assert all(loop.flown and loop.stable for loop in loops[1:])


@pytest.mark.parametrize(
    ("azimuths", "drag", "lost"),
    [
        ((45.0, 135.0, 225.0, 315.0), (0.0,) * 4, "yaw: every drag ratio"),
        ((0.0, 120.0, 240.0), (0.016, -0.016, 0.016), "3 rotors set at most 3"),
        ((0.0, 0.0, 180.0, 180.0), (0.016, -0.016, 0.016, -0.016), "one line"),
    ],
)
def test_a_body_that_cannot_be_held_has_no_delay_margins(azimuths, drag, lost, tmp_path):
    robot = multirotor(tmp_path, azimuths, drag=drag, tilts=(None,) * len(drag))
    found = control.analyze(robot)
    assert not found.loops and lost in found.refused["dual_rotor"]
    assert not any("delay margin" in text for _, text in found.rows())
    assert found.to_json()["uncontrollable"] == found.refused


def test_modes_of_a_posture_that_is_singular(tmp_path):
    """Straight, dragon4 flies in dual-rotor mode alone; bent in both."""
    robot = snakegen.load(Path(__file__).parent.parent / "generated/dragon4/dragon4.urdf")
    straight = control.analyze(robot)
    assert list(straight.refused) == ["virtual_single_rotor"]
    assert "roll about the body axis" in straight.refused["virtual_single_rotor"]
    bent = control.analyze(robot, robot.configuration({"joint1_yaw": 0.8, "joint3_yaw": 0.8}))
    assert not bent.refused and {m for _, m in bent.loops} == set(MODES)


def test_a_plain_multirotor_flies_along_x(tmp_path):
    """It pitches forward to go forward: 1 m in the mission, within 5 cm at the end."""
    robot = multirotor(tmp_path)
    mission = tmp_path / "x_step.yaml"
    mission.write_text(
        "waypoints: [{time: 0, position: [0, 0, 1.5]}, {time: 4, position: [1, 0, 1.5]}, "
        "{time: 8, position: [1, 0, 1.5]}]\n"
    )
    flown = run(robot, str(mission), seed=0)
    position = flown.channel("position").values
    assert position[-1, 0] - position[0, 0] == pytest.approx(1.0, abs=0.05)
    assert np.all(np.abs(flown.metrics["position_end_m"]) < 0.05)
    turns = flown.channel("attitude").values
    pitch = [rpy_from_rotation(rotation_from_xyzw(x))[1] for x in turns]
    assert max(pitch) > 0.01  # forward is nose down, +y


def test_the_tick_pitches_for_a_forward_error(tmp_path):
    """The rigid body under the tick alone moves along x, and through pitch."""
    robot = multirotor(tmp_path)
    c = flight_controller(robot)
    arrays = (robot.tree, robot.rotors, robot.gimbals)
    body = Rigid(arrays, c, np.zeros(0), DUAL)
    track = body.fly(target_at([0.1, 0.0, 0.0]), 12.0, lag=0.035)
    assert track[-1, 0] == pytest.approx(0.1, abs=0.01)


def test_integrals_learn_unequal_rotors_within_seconds(tmp_path):
    """Axes of tilting have integrals of their own; those that gimbals act on keep Table 5's."""
    usual = Gains()
    none, some = (
        gain_set(multirotor(tmp_path, PLUS, tilts=BODIES[body]))
        for body in ("no gimbals", "about y")
    )
    assert np.all(none.force_i[:2] / none.force_p[:2] > 0.1)
    assert np.all(none.torque_i / none.torque_p >= [1.0, 1.0, 0.5])
    assert some.force_i[0] == usual.force_i[0] and some.torque_i[1] == usual.torque_i[1]
    assert some.force_i[1] == none.force_i[1] and some.torque_i[2] == usual.torque_i[2]


LIGHT = """<robot name="light"><link name="body"><inertial><mass value="1.3"/><inertia ixx="0.0016"
ixy="0" ixz="0" iyy="0.0016" iyz="0" izz="0.003"/></inertial></link></robot>"""


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_body_that_unequal_rotors_carry_off_is_trimmed_before_it_hovers(seed, tmp_path):
    """A sixth of its arms in gyration: 3 % of thrust are 14 rad/s²; untrimmed it leaves."""
    (tmp_path / "light.urdf").write_text(LIGHT)
    turns = np.arange(6) * np.pi / 3
    rotors = [
        {"link": "body", "position": [0.2 * float(np.cos(a)), 0.2 * float(np.sin(a)), 0.0],
         "thrust_max": 8, "drag_ratio": 0.016 * (-1) ** k}
        for k, a in enumerate(turns)
    ]  # fmt: skip
    modules = {"floating_root": "body", "link_length": 0.3,
               "apparatuses": [{"rotors": [r]} for r in rotors]}  # fmt: skip
    robot = snakegen.load(tmp_path / "light.urdf", modules=modules)
    flown = run(robot, "hover", seed=seed, options={"duration": 3.0})
    assert flown.meta["trim_s"] == SLOW_SECONDS and flown.verdict.passed, flown.verdict
    if seed == 1:
        asked = run(robot, "hover", seed=seed, options={"duration": 3.0, "trim": 0.0})
        assert not asked.verdict.passed


def test_a_motion_by_tilting_lags_by_its_jerk(tmp_path):
    """x = A sin ωt: the tilt A ω²/g, and A ω³ τ / K_p behind it."""
    robot = multirotor(tmp_path, PLUS)
    ready = prepare(robot, "hover", options={"duration": 10.0, "trim": 0.0})
    plan, omega = ready.plan, 2.0 * np.pi / 5.0
    wave = np.zeros((len(plan.time), 3))
    wave[:, 0] = -0.4 * omega**2 * np.sin(omega * plan.time)
    place, lean = tilt_lags(ready.controller, replace(plan, acceleration=wave))
    law = ready.controller.law
    late = law.torque[2, 1] / law.torque[0, 1]
    expected = 0.4 * omega**3 * late / law.force[0, 0] / np.sqrt(2.0)
    np.testing.assert_allclose(place, [expected, 0.0], rtol=1e-3, atol=1e-12)
    np.testing.assert_allclose(lean, [0.4 * omega**2 / 9.81 / np.sqrt(2.0), 0.0], rtol=2e-3)


def test_a_motion_is_held_back_by_the_air_on_its_rotors(tmp_path):
    """x = A sin ωt: g v / 2 v_h over K_p, high-passed at K_i / K_p."""
    robot = multirotor(tmp_path, PLUS)
    ready = prepare(robot, "hover", options={"duration": 200.0, "trim": 0.0})
    plan, omega = ready.plan, 2.0 * np.pi / 8.0
    wave = np.zeros((len(plan.time), 3))
    wave[:, 2] = 0.3 * omega * np.cos(omega * plan.time)
    found = air_lags(robot, ready.controller, replace(plan, velocity=wave), Imperfections())
    (p, i, _), area = ready.controller.law.force[:, 2], 4 * np.pi * 0.05**2
    hover = np.sqrt(robot.mass * 9.81 / (2.0 * 1.2 * area))
    high = omega / np.hypot(omega, i / p)
    expected = 9.81 * 0.3 * omega / (2.0 * hover) / p * high / np.sqrt(2.0)
    np.testing.assert_allclose(found, [0.0, 0.0, expected], rtol=0.02, atol=1e-12)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_plain_multirotor_climbs_aslant_within_its_bounds(seed, tmp_path):
    mission = tmp_path / "aslant.yaml"
    mission.write_text(
        "waypoints: [{time: 0, position: [0, 0, 1.5]}, {time: 4, position: [0.7, 0.7, 2.3]}, "
        "{time: 6, position: [0.7, 0.7, 2.3]}]\n"
    )
    flown = run(multirotor(tmp_path), str(mission), seed=seed)
    assert flown.verdict.passed, flown.verdict
