"""The first lines of a report: questions answered in words, from the figures below them."""

import numpy as np
import pytest

import snakegen
from snakegen.analysis import (
    actuation,
    hover,
    screw_drive,
    singularity,
    statics,
    wrench_margin,
)
from snakegen.report.answers import answers
from snakegen.report.collection import Page

BENT = {"joint1_yaw": 1.0, "joint2_yaw": 1.0, "joint3_yaw": 1.0}


def _page(robot: snakegen.Robot, posture: dict[str, float]) -> Page:
    q = np.asarray(robot.configuration(posture, gimbals="hover"))
    modules = {"actuation": actuation, "singularity": singularity, "hover": hover}
    modules |= {"margin": wrench_margin, "statics": statics}
    return Page(robot, q, {k: m.analyze(robot, q) for k, m in modules.items()})


@pytest.fixture(scope="module")
def dragon4() -> snakegen.Robot:
    return snakegen.load("dragon4")


def test_a_bent_body_hovers_moves_and_resists(dragon4: snakegen.Robot) -> None:
    page = _page(dragon4, BENT)
    said = answers(page)
    assert [question for question, _ in said] == [
        "Can it hover?", "Can it move?", "What does it resist?", "", "How near is a singularity?"
    ]  # fmt: skip
    text = dict(said)
    assert text["Can it hover?"].startswith("yes: 78 N of weight, 128 N of thrust (1.63)")
    assert "6 of 6 motions" in text["Can it move?"]
    servo = page.results["margin"].push["virtual_single_rotor"].kinds["force"]["exact_servo"]
    assert f"{servo.value:.4g} N from any side" in text["What does it resist?"]
    assert "joint1_yaw" in text["What does it resist?"]
    assert f"{page.results['singularity'].sigma_min:.2f}" in text["How near is a singularity?"]


def test_a_straight_body_is_told_why_before_the_zero_shocks(dragon4: snakegen.Robot) -> None:
    said = answers(_page(dragon4, {}))
    torque = said[3][1]
    assert torque.startswith("0 N·m") and "geometry, bend the body" in torque
    assert "5 of 6 motions" in dict(said)["Can it move?"]


def test_an_under_actuated_body_is_asked_for_height_and_attitude() -> None:
    page = _page(snakegen.load("dragon3"), {"joint1_yaw": 0.8})
    text = dict(answers(page))
    assert text["Can it hover?"].startswith("yes")
    assert "4 of 6 motions" in text["Can it move?"]
    assert "N up or down" in text["What does it resist?"]


def test_too_heavy_a_body_does_not_hover(dragon4: snakegen.Robot) -> None:
    from snakegen.spec.loading import load_spec

    spec = load_spec("dragon4", overrides=("vectoring_apparatus.thrust_max=8",))
    text = dict(answers(_page(snakegen.load(spec), BENT)))
    assert text["Can it hover?"].startswith("no: 78 N of weight, 64 N of thrust (0.82)")


def test_an_arm_is_asked_what_it_carries() -> None:
    robot = snakegen.load("arm6")
    page = Page(
        robot, robot.configuration(), {"statics": statics.analyze(robot, robot.configuration())}
    )
    text = dict(answers(page))
    load = page.results["statics"].tip_load
    assert text["What does it carry?"].startswith(f"{load.payload:.3g} kg at the tip")
    assert f"{1e3 * np.linalg.norm(load.sag):.3g} mm" in text["What does it carry?"]
    assert f"{load.force_radius:.4g} N in every direction" in text["What does its tip push?"]
    assert text["Do the servos hold it?"].startswith("yes: joint1_pitch is the busiest, at 75%")


def test_a_drive_is_asked_whether_its_wheels_hold_it() -> None:
    robot = snakegen.load("screw4")
    q = np.asarray(robot.configuration())
    found = screw_drive.analyze(robot, q)
    text, slow = dict(answers(Page(robot, q, {"drive": found}))), found.cone.speed.min()
    assert text["Do its wheels hold it?"].startswith("yes, along, across and turning")
    assert text["How fast?"].startswith(f"{slow:.3f} m/s in its slowest direction")
