"""Missions: plans within limits and floors, responses to known signals, refusals in one line."""

import numpy as np
import pytest

from snakegen import load
from snakegen.base.geometry import rotation_from_xyzw, rpy_from_rotation
from snakegen.errors import MissionError, SnakegenError
from snakegen.simulation.flight.postures import (
    bent,
    driven_joints,
    extent,
    place,
    resting_height,
    slim,
)
from snakegen.simulation.flight.run import prepare, run
from snakegen.simulation.missions import mission, missions, module_of, planned
from snakegen.simulation.missions.flight import fail, step
from snakegen.simulation.missions.options import options_of
from snakegen.spec.loading import load_spec

FLIGHTS = ("hover", "step", "transform", "ascend", "squeeze", "fail", "switch", "gust")


@pytest.fixture(scope="module")
def dragon4():
    return load("dragon4")


@pytest.fixture(scope="module")
def dragon3():
    return load("dragon3")


@pytest.mark.parametrize("name", FLIGHTS)
@pytest.mark.parametrize("preset", ["dragon3", "dragon4"])
def test_plans_are_smooth_and_within_limits(request, preset, name):
    robot = request.getfixturevalue(preset)
    # two apparatuses have no virtual-single-rotor mode to change to, but by force
    options = {"force": True} if (preset, name) == ("dragon3", "switch") else {}
    if name == "squeeze":  # the ceiling takes a search: benchmarks/plans.py
        options = {"doorway": True}
    plan = planned(name, robot, **options)
    low, high, _ = robot.limits(driven_joints(robot))
    assert np.all(plan.joints >= low - 1e-9) and np.all(plan.joints <= high + 1e-9)
    assert np.all(np.diff(plan.time) > 0) and len(plan.position) == len(plan.time)
    if name != "step":  # whose targets jump
        slope = np.gradient(plan.position, plan.time, axis=0)
        np.testing.assert_allclose(slope, plan.velocity, atol=0.02)


def test_a_known_second_order_response_is_measured_right():
    zeta, w = 0.5, 4.0
    t = np.arange(0.0, 8.0, 0.002)
    wd = w * np.sqrt(1 - zeta**2)
    x = 1 - np.exp(-zeta * w * t) * (np.cos(wd * t) + zeta * w / wd * np.sin(wd * t))
    rise, overshoot, settled = step.response(t, x)
    assert overshoot == pytest.approx(np.exp(-np.pi * zeta / np.sqrt(1 - zeta**2)), rel=1e-3)
    assert rise == pytest.approx(1.64 / w, rel=0.02)  # of ζ = 0.5, 10 to 90 %
    assert np.all(np.abs(x[t > settled + 0.01] - 1) <= 0.05)
    assert step.response(t, 0.5 * x)[2] is None and step.response(t, 0.5 * x)[0] is None


def test_steps_of_both_presets_settle(dragon3, dragon4):
    """With their own gains and noise: x of dragon3 swung on at Table 3's K_p 4, K_d 7."""
    for robot in (dragon3, dragon4):
        recording = run(robot, "step", seed=2)
        assert recording.verdict.passed, recording.verdict.summary()
        assert recording.metrics["overshoot"] < 0.4
    assert planned("step", dragon3).facts["hold_s"] == 6.0
    assert planned("step", dragon4).facts["hold_s"] == 7.5  # z settles in 5.7 s by its poles
    assert planned("step", dragon4, hold=2.0).facts["hold_s"] == 2.0


def test_no_long_body_touches_itself():
    for links in (2, 5, 12, 32):
        robot = load(load_spec("dragon4", links=links))
        joints = bent(robot)
        from snakegen.simulation.flight.world import make_world
        from snakegen.simulation.recording.clearance import clearances

        world = make_world(robot, floor=False)
        q = place(robot, joints, np.zeros(3))
        row = np.concatenate([q[:3], q[[6, 3, 4, 5]], robot.angles(q)])
        assert clearances(world, row[None])[1][0] > 0.05
        heading = np.cumsum(joints[1::2])
        assert np.ptp(heading) > 0.5 or links == 2  # bent, not straight


def test_the_slim_body_is_narrower_than_the_opening_and_the_resting_body_wider(dragon4):
    plan = planned("squeeze", dragon4, doorway=True)
    opening = plan.facts["opening_m"]
    assert np.ptp(extent(dragon4, slim(dragon4))[:, 1]) < opening < plan.facts["span_m"]
    left, right, lintel = plan.obstacles
    assert left.centre[1] - left.half[1] == pytest.approx(0.5 * opening)
    assert right.centre[1] + right.half[1] == pytest.approx(-0.5 * opening)
    assert lintel.centre[2] - lintel.half[2] == pytest.approx(plan.facts["lintel_m"])


def test_at_rest_the_robot_touches_the_floor_and_no_more(dragon4):
    import mujoco

    from snakegen.description.mjcf.decorate import lowest_point
    from snakegen.simulation.flight.world import make_world

    q = place(dragon4, bent(dragon4), np.array([0.0, 0.0, 1.0]))
    q[2] += resting_height(dragon4, q) - 1.0
    world = make_world(dragon4)
    data = mujoco.MjData(world.model)
    world.set_state(data, q)
    mujoco.mj_forward(world.model, data)
    assert lowest_point(world.model, data) == pytest.approx(0.0, abs=1e-9)


def test_losing_more_leaves_less_margin(dragon4):
    q = place(dragon4, bent(dragon4), np.zeros(3))
    one = fail.margin_without(dragon4, q, fail.rotors_named(dragon4, "apparatus2"))
    two = fail.margin_without(dragon4, q, (2, 3, 4, 5))
    assert two < one < fail.margin_without(dragon4, q, ())


def test_switching_is_refused_where_rank_forbids_it():
    straight = {"joint1_yaw": 0.0, "joint2_yaw": 0.0, "joint3_yaw": 0.0}
    robot = load(load_spec("dragon4", overrides=["control.mode=dual_rotor"]))
    with pytest.raises(SnakegenError, match="refused"):
        planned("switch", robot, posture=straight)


@pytest.mark.parametrize(
    "name, options, text",
    [
        ("hover", {"height": 0.01}, "into the floor"),
        ("hover", {"duration": -1.0}, "more than 0"),
        ("hover", {"posture": {"joint1_yaw": 1e-3}}, "singular"),
        ("fail", {"lost": "rotor9_1"}, "no rotor"),
        ("fail", {"at": 30.0}, "duration 10 s: more than 30.1 is needed"),
        ("fail", {"at": 9.95}, "more than 10.05 is needed"),
        ("fail", {"at": -1.0}, "begins at 0"),
        ("switch", {"at": 30.0}, "duration 12 s: more than 30 is needed"),
        ("switch", {"stay": 0.0}, "more than 0"),
        ("gust", {"direction": "up"}, "x, y or z"),
        ("squeeze", {"gap": 2.0}, "smaller gap"),
        ("ascend", {"height": 0.01}, "no ascent"),
        ("transform", {"duration": 1.0}, "too short"),
    ],
)
def test_bad_input_is_one_clear_line(dragon4, name, options, text):
    with pytest.raises(SnakegenError, match=text) as caught:
        prepare(dragon4, name, options=options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "body, text",
    [
        ("waypoints:\n  - {time: 0}\n  - {time: 5, position: [0, 0, 0.02]}", "floor"),
        ("waypoints:\n  - {time: 0}\n  - {time: 5, joints: {joint1_yaw: 3.0}}", "limits"),
        ("waypoints:\n  - {time: 0}\n  - {time: 5, joints: {joint1_yow: 1.0}}", "joint1_yaw"),
        ("waypoints:\n  - {time: 0, positon: [0, 0, 1]}", "position"),
        ("waypoints:\n  - {time: 2}\n  - {time: 1}", "rise"),
        ("waypoints: 3", "list"),
        ("waypoints: []", "list"),
        ("waypoints: {time: 0}", "list"),
        ("- {time: 0}", "mapping"),
        ("", "mapping"),
        ("waypoints:\n  - 3", "waypoint 1 is no mapping"),
        ("waypoints:\n  - [0, 1]", "waypoint 1 is no mapping"),
        ("waypoints:\n  - {time: 0, joints: [1, 2]}", r"\[1, 2\] is no mapping of names"),
        ("waypoints:\n  - {time: 0, joints: 3}", "3 is no mapping of names"),
        ("waypoints:\n  - {time: 0, joints: {joint1_yaw: fast}}", "joint1_yaw: 'fast' is not a"),
        ("waypoints:\n  - {time: 0, joints: {joint1_yaw: [1, 2]}}", "not a finite number"),
        ("waypoints:\n  - {time: .nan}", "time: nan is not a finite number"),
        ("waypoints:\n  - {time: }\n", "time: None is not"),
        ("waypoints:\n  - {time: true}", "time: True is not"),
        ("waypoints:\n  - {time: '3'}", "time: '3' is not"),
        ("waypoints:\n  - {time: -2}\n  - {time: 1}", "begins at 0"),
        ("waypoints:\n  - {time: 0, position: [0, 1]}", "not a list of 3 finite numbers"),
        ("waypoints:\n  - {time: 0, position: [0, .nan, 1]}", "not a list of 3 finite numbers"),
        ("waypoints:\n  - {time: 0, position: [0, {x: 1}, 1]}", "not a list of 3"),
        ("waypoints:\n  - {time: 0, position: {x: 1}}", "not a list of 3 finite numbers"),
        ("waypoints:\n  - {time: 0, position: null}", "not a list of 3 finite numbers"),
        ("waypoints:\n  - {time: 0, rpy: [[0, 0, 0]]}", "not a list of 3 finite numbers"),
        ("waypoints:\n  - {time: 0}\n  - {position: [0, 0, 1.6], time: 0}", "must rise"),
        ("waypoints:\n  - {time: 0}\n  - {time: 9.0e+8}", "would take"),
        ("waypoints:\n  - {time: 0}\nduration: 3", "no field 'duration'"),
        ("waypoints:\n  - {time: 0}\n  - {time: 1" + "0" * 400 + "}", "not a finite number"),
    ],
)  # fmt: skip
def test_mission_files_are_refused_in_one_line(dragon4, tmp_path, body, text):
    file = tmp_path / "mine.yaml"
    file.write_text(body, encoding="utf-8")
    with pytest.raises(SnakegenError, match=text):
        prepare(dragon4, str(file))


def test_a_switch_may_stay_and_a_loss_says_level(dragon4):
    """Beyond the end there is no change back; below a margin of 0 a tilted body may yet hover."""
    stays = planned("switch", dragon4, stay=100.0)
    assert stays.facts["switches_s"] == [3.0] and len(stays.events) == 1
    for lost, word in (("apparatus2", "cannot hover level"), ("rotor2_1", "hover level")):
        plan = planned("fail", dragon4, lost=lost)
        assert plan.events[-1][1].endswith(word)
        assert (plan.facts["predicted_wrench_margin"] < 0) == ("cannot" in plan.events[-1][1])


def test_a_mission_file_is_flown(dragon4, tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text(
        "waypoints:\n  - {time: 0}\n  - {time: 2, position: [0.2, 0, 1.5], rpy: [0, 0, 0.2]}\n",
        encoding="utf-8",
    )
    recording = run(dragon4, str(file), ideal=True, options={"duration": 3.0})
    assert recording.verdict.passed, recording.verdict.summary()
    assert recording.meta["mission"] == "path"
    assert abs(recording.channel("position").values[-1, 0] - 0.2) < 0.05


def test_a_flight_holds_the_attitude_that_it_starts_in(dragon4, tmp_path):
    """Hover keeps base_rpy; a path whose first waypoint is turned goes on from there, once."""
    tilted = {"joint1_yaw": 0.9, "joint2_yaw": 0.9, "base_rpy": [0.1, -0.1, 0.4]}
    held = run(dragon4, "hover", ideal=True, options={"duration": 1.0, "posture": tilted})
    asked = rpy_from_rotation(rotation_from_xyzw(held.channel("attitude_target").values[-1]))
    np.testing.assert_allclose(asked, tilted["base_rpy"], atol=1e-9)
    assert held.verdict.passed, held.verdict.summary()
    file = tmp_path / "turned.yaml"
    file.write_text(
        "waypoints:\n  - {time: 0, rpy: [0, 0, 0.4]}\n  - {time: 2, rpy: [0, 0, 0.6]}\n",
        encoding="utf-8",
    )
    flown = run(dragon4, str(file), ideal=True, options={"duration": 3.0})
    turned = [
        rpy_from_rotation(rotation_from_xyzw(flown.channel("attitude_target").values[k]))[2]
        for k in (0, -1)
    ]
    np.testing.assert_allclose(turned, [0.4, 0.6], atol=1e-9)
    assert flown.verdict.passed, flown.verdict.summary()


@pytest.mark.parametrize(
    ("robot", "mission", "posture", "says"),
    [
        ("dragon4", "push", {"base_rpy": [0, 0, 0.1]}, "starts level"),
        ("dragon3", "hover", {"base_rpy": [0.1, 0, 0]}, "holds no tilt"),
        ("dragon4", "hover", {"gimbal1_roll": 0.1}, "set by the mission"),
        ("dragon4", "hover", {"joint1_yw": 0.1}, "Did you mean"),
        ("screw4", "slope", {"base_rpy": [0.1, 0, 0]}, "the ground decides"),
    ],
)
def test_postures_that_a_mission_does_not_hold_are_refused(robot, mission, posture, says):
    with pytest.raises(SnakegenError, match=says):
        run(load(robot), mission, options={"posture": posture})


def test_options_are_checked_by_name_and_type(dragon4):
    for options, says in (
        ({"heigth": 2.0}, "Did you mean 'height'"),
        ({"height": "high"}, "not a number"),
        ({"height": True}, "not a number"),
        ({"height": float("nan")}, "not a number"),
        ({"posture": "a file"}, "not a mapping"),
    ):
        with pytest.raises(MissionError, match=says):
            planned("hover", dragon4, **options)
    with pytest.raises(MissionError, match="true or false"):
        planned("ring", dragon4, moving=1)
    with pytest.raises(MissionError, match="allocator"):
        planned("push", dragon4, allocator="paper")


def test_every_option_has_a_meaning():
    for name in missions():
        for key, option in options_of(module_of(name).Options).items():
            assert option.meaning, f"{name}.{key}"
            assert option.kinds, f"{name}.{key}"


def test_every_mission_says_what_it_shows():
    for name, text in missions().items():
        assert len(text) > 20, name
    with pytest.raises(MissionError, match="hover"):
        mission("hovr", None)
