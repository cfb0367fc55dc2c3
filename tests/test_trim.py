"""Trim before a mission: what it mends, what it leaves alone, and that its end is no bump."""

from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from snakegen.cli.flight import flight
from snakegen.control.controller import flight_controller
from snakegen.control.gains import gains_from
from snakegen.control.poles import loops
from snakegen.errors import MissionError
from snakegen.kernels.control.pose_law import integrate
from snakegen.kernels.kinematics.chain import centre_of_gravity, forward
from snakegen.robot.robot import load
from snakegen.simulation.flight.plant import bounded_normal
from snakegen.simulation.flight.run import prepare, run
from snakegen.simulation.flight.trim import integral_rates, integrator_state, trimmed
from snakegen.simulation.missions import planned
from snakegen.spec.loading import load_spec

QUIET = ("thrust_mismatch", "position_noise", "attitude_noise", "gyro_noise", "velocity_noise")
BIASED = [f"plant.{n}=0" for n in (*QUIET, "joint_noise")] + ["plant.attitude_bias=0.004"]
SHORT = {"duration": 1.0}
KINDS = ("force", "torque")


def biased(*more):
    return load(load_spec("dragon4", overrides=[*BIASED, *more]))


@pytest.fixture(scope="module")
def flights():
    """A biased IMU alone: hover without trim, until it has drifted, and with it."""
    robot = biased()
    long = run(robot, "hover", seed=1, options={"duration": 8.0})
    return long, run(robot, "hover", seed=1, options=SHORT | {"trim": 10.0})


def test_a_tilted_imu_pulls_the_cog_off_as_computed_and_trim_mends_it(flights):
    """Without: g b / K_p. With: what an integral of a time constant of 2 s leaves after 10 s.

    Besides, the controller sees the CoG b × l off, l from the root to the CoG: no trim mends that.
    """
    long, short = flights
    rng = np.random.default_rng(1)
    rng.standard_normal(8)  # the rotors' mismatch
    b = 0.004 * bounded_normal(rng, 3)
    q = prepare(biased(), "hover").plan.start
    robot = biased()
    poses = forward(robot.tree, *robot.base_pose(q), robot.angles(q))
    lever = centre_of_gravity(robot.tree, *poses)[1] - q[:3]
    unseen = np.cross(b, lever)[:2]
    off = long.channel("position").values[-1, :2] + unseen
    np.testing.assert_allclose(off, 9.81 / 3.6 * np.array([-b[1], b[0]]), rtol=0.1)
    left = short.channel("position").values[-1, :2] + unseen
    assert np.all(np.abs(left) < 0.02 * np.abs(off).max() + 1e-4)
    held = np.array(short.meta["trim"]["force_integral_m_s2"][:2])
    np.testing.assert_allclose(np.abs(held), 9.81 * np.abs([b[1], b[0]]), rtol=0.05)


def test_the_end_of_trim_is_no_bump(flights):
    _, short = flights
    step = np.abs(np.diff(short.channel("thrust_command").values, axis=0)).max(axis=1)
    time = short.times("thrust_command")[1:]
    assert step[np.abs(time) < 0.02].max() < 1e-4


def test_the_log_has_the_trim_before_zero_and_figures_begin_at_zero(flights):
    long, short = flights
    assert short.time[0] == pytest.approx(-10.0) and short.time[-1] == pytest.approx(0.995)
    assert short.meta["metrics_window_s"] == [0.0, pytest.approx(0.995)]
    assert short.metrics["position_max_m"] < 0.2 * long.metrics["position_max_m"]
    said = {e.time: e.text for e in short.events}
    assert "integrals run up to 60 times faster" in said[-10.0]
    assert said[0.0].startswith("trimmed: integrals hold")
    assert "Trimmed in hover for 10 s before t = 0" in short.report
    assert "Trimmed" not in long.report and long.time[0] == 0.0


def test_more_bias_than_the_clamp_holds_is_told():
    """An IMU ten times as far off as its data sheet, for which the clamps were sized."""
    ready = prepare(biased("plant.attitude_bias=0.002"), "hover", options=SHORT | {"trim": 10.0})
    worse = replace(ready.imperfections, attitude_bias=0.02)
    flown = ready.flown(ready.world(), worse, np.random.default_rng(1), 1)
    assert flown.meta["trim"]["at_clamp"] and "so not trimmed out" in flown.report
    clamp = 0.03 * 2.0
    assert np.abs(flown.meta["trim"]["force_integral_m_s2"][:2]).max() == pytest.approx(clamp)


def test_clamps_hold_three_times_the_declared_bias():
    """g b of 3 x 0.02 rad, over K_i of 0.03: 19.6 m s where the gain set has 2."""
    robot = biased("plant.attitude_bias=0.02")
    ready = prepare(robot, "hover", options=SHORT | {"trim": 10.0})
    limit = ready.controller.law.force_integral_limit
    np.testing.assert_allclose(limit, [3 * 9.81 * 0.02 / 0.03] * 2 + [2.0], rtol=1e-6)
    flown = ready.flown(ready.world(), ready.imperfections, np.random.default_rng(1), 1)
    assert not flown.meta["trim"]["at_clamp"]
    assert np.abs(flown.meta["trim"]["force_integral_m_s2"][:2]).max() > 0.06


def test_integral_rates_are_those_of_a_2_s_integral_where_it_is_slower():
    law = flight_controller(load("dragon4")).law
    rates = integral_rates(law)
    np.testing.assert_allclose(rates[0], [60.0, 60.0, 1.4 / 1.2])
    np.testing.assert_allclose(rates[1], [25.0, 25.0, 50.0])
    swift = flight_controller(load("dragon3"), "tuned").law
    assert integral_rates(swift)[0, 0] == 1.0, "K_i of 3 is faster already"
    none = law._replace(force=law.force * [[1.0], [0.0], [1.0]])
    np.testing.assert_array_equal(integral_rates(none)[0], 1.0)
    weak = law._replace(torque=np.array([[9.0] * 3, [0.1] * 3, [0.3] * 3]))
    np.testing.assert_allclose(integral_rates(weak)[1], 9.0 * 0.3 / 3.0 / 0.1)


def test_trimming_loops_are_stable_with_the_slowest_motors():
    for name, gains in (("dragon4", "paper"), ("dragon3", "tuned")):
        robot = load(name)
        c = flight_controller(robot, gains)
        rates = integral_rates(c.law)
        values = robot.modules.gain_sets[gains]
        faster = {k: np.array(values[f"{k}_i"]) * r for k, r in zip(KINDS, rates, strict=True)}
        quick = gains_from(values | {f"{k}_i": v.tolist() for k, v in faster.items()})
        for loop in loops(quick, c.mode, lag=0.06, delay=0.02):
            assert loop.stable and loop.delay_margin > 0.03, (name, loop)


def test_an_integral_runs_faster_by_its_rate_up_to_the_clamp():
    integral, limit = np.array([0.1, 0.1, 0.1]), np.array([2.0, 2.0, 0.2])
    integrate(integral, np.array([0.5, -0.5, 0.5]), 0.01, np.array([1.0, 60.0, 50.0]), limit, 0)
    np.testing.assert_allclose(integral, [0.105, -0.2, 0.2])


def test_the_mission_itself_is_untouched():
    robot = load("dragon4")
    plan = planned("gust", robot)
    longer = trimmed(plan, 3.0)
    assert longer.trim == 600 and len(longer.time) == len(plan.time) + 600
    np.testing.assert_allclose(np.diff(longer.time), 0.005, atol=1e-12)
    for name in ("time", "position", "rotation", "joints", "wind"):
        np.testing.assert_array_equal(getattr(longer, name)[600:], getattr(plan, name))
    assert not longer.wind[:600].any() and plan.wind.any()
    assert np.all(longer.position[:600] == plan.position[0])
    assert trimmed(plan, 0.0) is plan


def test_integrals_have_their_own_pace_again_when_the_mission_begins():
    """A push after a trim that had nothing to mend is borne as without one."""
    robot, push = load("dragon4"), {"force": 10.0, "duration": 6.0}
    plain, after = (
        run(robot, "gust", ideal=True, options=push | {"trim": t}).channel("position").values
        for t in (0.0, 2.0)
    )
    assert np.abs(plain[:, 1]).max() > 0.05
    np.testing.assert_allclose(after[400:], plain, atol=1e-4)


@pytest.mark.parametrize("name", ["gust", "step", "switch", "fail", "transform"])
def test_a_run_interrupted_while_trimming_is_kept_and_fails(name):
    def stop(_done, _total):
        raise KeyboardInterrupt

    with np.errstate(all="raise"):
        kept = run(load("dragon4"), name, progress=stop)
    assert kept.meta["stopped"] == "interrupted at -9.01 s" and not kept.verdict.passed
    assert kept.metrics["duration_s"] == 0.0 and "trim" not in kept.meta


def test_trim_is_on_where_a_mission_starts_in_the_air_and_off_where_told():
    robot = load("dragon4")
    assert prepare(robot, "transform").plan.trim == 2000
    assert prepare(robot, "transform", options={"trim": 0.0}).plan.trim == 0
    assert prepare(robot, "transform", options={"floor": True}).plan.trim == 0
    assert prepare(robot, "hover").plan.trim == 0 and prepare(robot, "push").plan.trim == 0
    with pytest.raises(MissionError, match="start on the floor"):
        prepare(robot, "transform", options={"floor": True, "trim": 5.0})
    with pytest.raises(MissionError, match="0 or more"):
        prepare(robot, "hover", options={"trim": -1.0})


def test_what_integrals_hold_is_in_accelerations():
    c = flight_controller(load("dragon4"))
    state = c.start()._replace(force_integral=np.array([1.0, -2.0, 0.5]))
    held = integrator_state(c.law, state)
    np.testing.assert_allclose(held["force_integral_m_s2"], [0.03, -0.06, 0.6])
    assert held["at_clamp"] == ["y"]


def test_the_command_line_takes_it_and_logs_it(tmp_path):
    log = tmp_path / "trim.rrd"
    said = CliRunner().invoke(
        flight,
        ["dragon4", "--duration", "0.5", "--option", "trim=1.5", "-o", str(log)],
        standalone_mode=False,
    )
    assert said.return_value == 0, said.output
    from snakegen.log import read

    assert read(log).time[0] == pytest.approx(-1.5)


def test_the_page_names_the_missions_that_are_trimmed():
    from pathlib import Path

    from snakegen.simulation.missions import missions, module_of

    page = (Path(__file__).parents[1] / "docs/flights.md").read_text(encoding="utf-8")
    said = page.partition("Missions `transform`")[2].partition("are **trimmed** first")[0]
    named = {n for n in ("transform`" + said).split("`") if n.isidentifier()}
    trimmed_ones = set()
    for name in missions():
        module = module_of(name)
        always = not getattr(module, "UNTRIMMED", False)
        if always and getattr(module.Options, "trim", 0.0) != 0.0:
            trimmed_ones.add(name)
    assert named == trimmed_ones - {"path"}, "mission files are `path`"
