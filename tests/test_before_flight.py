"""What is refused before take-off, each with what would have worked: ranks, speeds, first hover."""

import re
from pathlib import Path

import numpy as np
import pytest

import snakegen
from snakegen import load
from snakegen.analysis.allocation import allocation
from snakegen.control.controller import flight_controller
from snakegen.control.frame import cog_frame
from snakegen.control.switch import check_mode
from snakegen.errors import MissionError, SnakegenError
from snakegen.kernels.control.types import DUAL, VIRTUAL
from snakegen.simulation.flight.postures import place, resting_joints
from snakegen.simulation.flight.preflight import check_start
from snakegen.simulation.flight.run import prepare, run
from snakegen.simulation.missions import planned
from snakegen.spec.loading import load_spec


@pytest.fixture(scope="module")
def dragon4():
    return load("dragon4")


def changed(name, *overrides, **more):
    return load(load_spec(name, overrides=list(overrides), **more))


@pytest.mark.parametrize(
    ("name", "links"), [("dragon3", None), ("dragon4", 2), ("dragon4", 3), ("dragon4", 8)]
)
def test_virtual_mode_needs_forces_that_turn_the_body(name, links):
    """σ_min of the analysis' Q_force, not of J_w alone, which an offset lifts above its threshold.

    Two apparatuses reach rank 6 by moving thrust points alone, and the margin is negative there.
    """
    robot = load(load_spec(name, links=links) if links else name)
    controller = flight_controller(robot)
    q = place(robot, resting_joints(robot), np.array([0.0, 0.0, 1.5]))
    check = check_mode(controller, VIRTUAL, robot.angles(q), robot.base_pose(q)[0])
    a = allocation(robot, q)
    scale = cog_frame(controller, robot.angles(q)).scale
    columns = np.repeat(robot.gimbals.limit, 3)
    least = np.linalg.svd(scale[:, None] * a.force * columns, compute_uv=False)[5]
    two = len(robot.modules.apparatuses) == 2
    # an apparatus' hover gimbals tilt a little as it carries its share, and move its thrust point
    assert check.map_sigma_min == pytest.approx(least, rel=0.02, abs=1e-9)
    assert check.sigma_min > 0.02 and check.allowed != two and (least < 1e-9) == two


@pytest.mark.parametrize(
    ("name", "overrides", "links"),
    [("dragon3", ["control.mode=virtual_single_rotor"], None), ("dragon4", [], 2)],
)
def test_two_apparatuses_do_not_start_in_virtual_mode(name, overrides, links):
    robot = changed(name, *overrides, links=links)
    with pytest.raises(MissionError, match=r"σ_min\(Q_force\) = 0 .*three apparatuses.*dual-rotor"):
        prepare(robot, "hover")
    dual = changed(name, "control.mode=dual_rotor", links=links)
    assert prepare(dual, "hover").controller.mode == DUAL
    plan = planned("hover", robot)
    check_start(robot, flight_controller(robot), plan, force=True)


def test_one_apparatus_is_told_to_get_more():
    """No bend and no mode helps it."""
    with pytest.raises(MissionError, match="three apparatuses or more") as caught:
        prepare(changed("dragon4", links=2, apparatus="1"), "hover")
    assert "dual-rotor" not in str(caught.value) and "bend" not in str(caught.value)


def test_two_apparatuses_are_not_switched_to_virtual_mode():
    robot = load("dragon3")
    with pytest.raises(SnakegenError, match=r"virtual-single-rotor mode refused.*Q_force"):
        planned("switch", robot)
    assert planned("switch", robot, force=True).mode is not None


STRAIGHT = {"joint1_yaw": 0.0, "joint2_yaw": 0.0, "joint3_yaw": 0.0}


def test_dual_mode_needs_yaw_to_start():
    """A straight body without rotor drag has none; with drag it has."""
    options = {"posture": STRAIGHT, "trim": 0.0}
    with pytest.raises(
        MissionError, match=r"σ_min\(Q_trunc\) 0 is below 0.001; .* on yaw: every drag"
    ):
        prepare(
            changed("dragon4", "control.mode=dual_rotor", "vectoring_apparatus.drag_ratio=0"),
            "hover",
            options=options,
        )
    prepare(changed("dragon4", "control.mode=dual_rotor"), "hover", options=options)


def test_joints_are_not_led_faster_than_they_turn(dragon4):
    """The quintic's peak, 15/8 of its mean rate, is what counts: 1 rad/s at dragon4's joints."""
    with pytest.raises(MissionError, match=r"joint\d_\w+ at .* rad/s at .* s; its servo turns at"):
        prepare(dragon4, "transform", options={"rate_limit": 100.0})
    prepare(dragon4, "transform", options={"rate_limit": 0.99})
    with pytest.raises(MissionError, match=r"at 1\.05 rad/s .* turns at 1 at most"):
        prepare(dragon4, "transform", options={"rate_limit": 1.05})


def test_a_mission_file_that_is_too_fast_is_refused(dragon4, tmp_path):
    """2 rad in 0.4 s peak at 15/8 × 5 rad/s, in their middle."""
    file = tmp_path / "fast.yaml"
    file.write_text(
        "waypoints:\n  - {time: 0, joints: {joint1_yaw: -1.0}}\n"
        "  - {time: 0.4, joints: {joint1_yaw: 1.0}}\n",
        encoding="utf-8",
    )
    with pytest.raises(MissionError, match=r"joint1_yaw at 9.3\d* rad/s at 0.(19|20) s"):
        prepare(dragon4, str(file))


def test_the_refusal_of_a_first_posture_names_what_would_hover():
    """A tail-heavy body lacks the thrust that the line asks for, and hovers with it."""
    heavy = ["payload.mass=2", "payload.at=[4]"]
    with pytest.raises(MissionError, match=r"What would hover: .*posture=FILE") as caught:
        prepare(changed("dragon4", *heavy), "hover")
    times = float(re.search(r"([\d.]+) times the thrust", str(caught.value))[1])
    enough, short = (f"vectoring_apparatus.thrust_max={16.0 * k}" for k in (times, times - 0.02))
    prepare(changed("dragon4", *heavy, enough), "hover")
    with pytest.raises(MissionError, match="cannot hover"):
        prepare(changed("dragon4", *heavy, short), "hover")


def test_another_allocator_and_mode_are_named_where_they_hover():
    """Just below what dual-rotor mode's pseudo-inverse asks for; both that are named do fly."""
    weak, dual = "vectoring_apparatus.thrust_max=10.2", "control.mode=dual_rotor"
    named = r"allocator constrained; control\.mode=virtual_single_rotor; 1\.0"
    with pytest.raises(MissionError, match=named):
        prepare(changed("dragon4", weak, dual), "hover")
    prepare(changed("dragon4", weak, dual), "hover", allocator="constrained")
    prepare(changed("dragon4", weak), "hover")
    with pytest.raises(MissionError, match=r"What would hover: 1\.0"):  # neither does here
        prepare(changed("dragon4", "vectoring_apparatus.thrust_max=10.05"), "hover")


@pytest.mark.parametrize("reach, words", [(0.2, ""), (0.6, "tips over before its integrals hold")])
def test_a_body_that_unequal_rotors_tip_over_is_refused(
    reach: float, words: str, tmp_path: Path
) -> None:
    """Light for its levers: a radius of gyration of 35 mm with rotors 0.6 m off."""
    urdf = tmp_path / "solid.urdf"
    urdf.write_text(
        '<robot name="solid"><link name="body"><inertial><mass value="1.3"/><inertia ixx="0.0016" '
        'ixy="0" ixz="0" iyy="0.0016" iyz="0" izz="0.003"/></inertial></link></robot>'
    )
    spots = [[reach * np.cos(a), reach * np.sin(a), 0.02] for a in np.arange(6) * np.pi / 3]
    rotors = [
        {"link": "body", "position": [float(x) for x in p], "thrust_max": 8, "drag_ratio": d}
        for p, d in zip(spots, (0.016, -0.016) * 3, strict=True)
    ]
    data = {"floating_root": "body", "apparatuses": [{"rotors": [r]} for r in rotors]}
    robot = snakegen.load(urdf, modules=data)
    options = {"duration": 2.0}
    if words:
        with pytest.raises(MissionError, match=f"{words}.*35.1 mm.*0.6 m off.*thrust_mismatch"):
            prepare(robot, "hover", options=options)
        assert prepare(robot, "hover", options=options, ideal=True).robot is robot
        calm = snakegen.load(urdf, modules=data | {"plant": {"thrust_mismatch": 0.005}})
        assert prepare(calm, "hover", options=options).robot is calm
    else:
        assert run(robot, "hover", options={"duration": 10.0}, seed=2).verdict.passed


@pytest.mark.parametrize("limit, flies", [(0.02, False), (0.1, True)])
def test_gimbals_too_narrow_for_unequal_rotors_are_refused(limit: float, flies: bool) -> None:
    """Of ±0.02 rad hover is feasible, and six of eight draws fall with the usual mismatch."""
    limits = [f"vectoring_apparatus.{axis}_limit={limit}" for axis in ("roll", "pitch")]
    robot = changed("dragon4", *limits)
    bent = {f"joint{i}_yaw": 1.0 for i in (1, 2, 3)}
    options = {"duration": 2.0, "posture": bent}
    if flies:
        assert prepare(robot, "hover", options=options).robot is robot
        return
    with pytest.raises(MissionError, match=r"limited gimbals.*force margin is 1.86 N.*dual_rotor"):
        prepare(robot, "hover", options=options)
    assert prepare(robot, "hover", options=options, ideal=True).robot is robot
