"""Plans that move the whole body faster than thrust and joints allow are refused."""

from dataclasses import replace

import numpy as np
import pytest

import snakegen
from snakegen.control.controller import flight_controller
from snakegen.errors import MissionError, SnakegenError
from snakegen.simulation.flight.plan import quintic
from snakegen.simulation.flight.reference_limits import check_motion
from snakegen.simulation.flight.run import prepare
from snakegen.simulation.missions import mission, missions
from snakegen.spec.loading import load_spec


@pytest.fixture(scope="module")
def dragon4():
    return snakegen.load("dragon4")


def planned(robot, tmp_path, *waypoints: str, **how):
    file = tmp_path / "m.yaml"
    file.write_text("waypoints:\n" + "".join(f"  - {w}\n" for w in waypoints))
    return prepare(robot, str(file), **how)


def test_ninety_radians_for_ninety_degrees_are_refused(dragon4, tmp_path):
    """Centrifugal torque at the joints, not thrust, is what such a turn takes first."""
    start = "{time: 0}"
    with pytest.raises(MissionError, match=r"joint\d_(yaw|pitch).*radians"):
        planned(dragon4, tmp_path, start, "{time: 5, rpy: [0, 0, 90]}")
    slow = planned(dragon4, tmp_path, start, "{time: 5, rpy: [0, 0, 1.57]}")
    assert np.abs(slow.plan.angular).max() == pytest.approx(1.57 / 5 * 15 / 8, rel=1e-2)


def test_ten_metres_in_a_second_are_refused_and_in_ten_are_flown(dragon4, tmp_path):
    start, far = "{time: 0, position: [0, 0, 1.5]}", "position: [10, 0, 1.5]"
    with pytest.raises(MissionError, match=r"N of thrust.*more time"):
        planned(dragon4, tmp_path, start, f"{{time: 1, {far}}}")
    planned(dragon4, tmp_path, start, f"{{time: 10, {far}}}")


def test_the_limit_is_that_of_the_thrust(dragon4, tmp_path):
    """Straight up: thrust to weight n allows (n − 1) g; a quintic asks 5.77 s/T² of it."""
    ratio = float(dragon4.rotors.thrust_max.sum()) / (dragon4.mass * 9.81)
    s = np.linspace(0, 1, 100001)
    most = float(quintic(s)[2].max())
    fastest = np.sqrt(most * 5.0 / ((ratio - 1.0) * 9.81))
    start = "{time: 0, position: [0, 0, 1.5]}"
    for share, fits in ((0.97, False), (1.03, True)):
        up = f"{{time: {share * fastest}, position: [0, 0, 6.5]}}"
        if fits:
            planned(dragon4, tmp_path, start, up, allocator="constrained")
        else:
            with pytest.raises(MissionError, match="thrust"):
                planned(dragon4, tmp_path, start, up, allocator="constrained")


def test_the_hover_of_a_body_at_its_limit_is_no_motion():
    tight = snakegen.load(load_spec("dragon4", overrides=["vectoring_apparatus.thrust_max=10.3"]))
    ready = prepare(tight, "hover")
    check_motion(tight, ready.controller, ready.plan)


def test_turning_loads_the_joints_of_a_bent_body_alone(dragon4):
    """A straight body turned about z at ω is pulled, not bent."""
    ready = prepare(dragon4, "hover")
    spun = replace(ready.plan, angular=ready.plan.angular + np.array([0.0, 0.0, 12.0]))
    with pytest.raises(MissionError, match=r"12 rad/s.*joint"):
        check_motion(dragon4, ready.controller, spun)
    straight = replace(spun, joints=np.zeros_like(spun.joints))
    check_motion(dragon4, ready.controller, straight)


@pytest.mark.parametrize("preset", ["dragon3", "dragon4", "hybrid4"])
def test_missions_of_the_presets_are_within_limits(preset):
    """The ceiling of `squeeze` takes a search of seconds; its plan is checked where it is flown."""
    robot = snakegen.load(preset)
    controller, checked = flight_controller(robot), 0
    for name in missions():
        try:
            module = mission(name, robot)
        except MissionError:
            continue
        if hasattr(module, "plan") and name not in ("path", "push"):
            options = {"doorway": True} if name == "squeeze" else {}
            try:
                plan = module.plan(robot, 200.0, module.Options(**options))
            except SnakegenError:
                continue
            check_motion(robot, controller, plan)
            checked += 1
    assert checked >= 5
