"""A battery has an energy and a mass; flight time is what hover makes of them."""

import numpy as np
import pytest

import snakegen
from snakegen.analysis import hover
from snakegen.analysis.hover_result import Hover
from snakegen.control.power import FIGURE_OF_MERIT
from snakegen.errors import SpecError
from snakegen.robot.posture import hover_gimbals
from snakegen.robot.robot import Robot
from snakegen.spec.loading import load_spec


def analysed(*overrides: str, name: str = "dragon4") -> tuple[Robot, Hover]:
    robot = snakegen.load(load_spec(name, overrides=overrides))
    q = hover_gimbals(robot, np.array(robot.configuration({"joint1_yaw": 0.5, "joint2_yaw": 0.5})))
    return robot, hover.analyze(robot, q)


def test_flight_time_is_energy_over_momentum_theorys_power():
    robot, found = analysed()
    area = np.pi * 0.035**2
    one = (robot.mass * 9.81 / 8) ** 1.5 / np.sqrt(2 * 1.2 * area) / FIGURE_OF_MERIT
    assert found.power[0] == pytest.approx(8 * one, rel=1e-3)
    assert found.flight_time(0) == pytest.approx(213.0 * 3600 / (8 * one), rel=1e-3)
    assert found.to_json()["virtual_single_rotor"]["flight_time_s"] == found.flight_time(1)


def test_a_heavier_robot_flies_for_a_shorter_time():
    """Power goes as weight^1.5 where all rotors share it."""
    light, heavy = analysed()[1], analysed("chain.mass=1.1")[1]
    ratio = heavy.weight / light.weight
    assert ratio > 1.05
    assert heavy.flight_time(0) / light.flight_time(0) == pytest.approx(ratio**-1.5, rel=0.02)


def test_a_battery_of_its_own_weighs_where_it_is():
    base, more = analysed()[0], analysed("battery.mass=0.8", "battery.at=2@0.25")[0]
    assert more.mass == pytest.approx(base.mass + 0.8)
    a, b = (_cog(r) for r in (base, more))
    moved = (b * more.mass - a * base.mass) / 0.8
    link2 = 0.42 + 0.0515
    np.testing.assert_allclose(moved, [link2 + 0.25 * 0.42, 0, 0], atol=1e-6)
    with pytest.raises(SpecError, match="one is needed"):
        load_spec("dragon4", overrides=["battery.mass=0.8", "battery.at=1,2"])


def _cog(robot: Robot) -> np.ndarray:
    import pinocchio as pin

    data = robot.model.createData()
    return np.array(pin.centerOfMass(robot.model, data, np.array(robot.configuration())))


def test_no_battery_no_flight_time():
    found = analysed("plant.battery_energy=0")[1]
    assert found.flight_time(0) is None and found.to_json()["battery_Wh"] is None


def test_flight_ends_where_the_sagging_limit_meets_hover():
    """At 10 N a rotor, hover takes 98 %: the voltage may fall by 1 %, a tenth of the battery."""
    full, tight = analysed()[1], analysed("vectoring_apparatus.thrust_max=10.0")[1]
    use = float(np.max(tight.dual_thrust / 10.0))
    assert use > 0.95
    left = (1.0 - np.sqrt(use)) / 0.1
    assert tight.flight_time(0) == pytest.approx(left * full.flight_time(0), rel=1e-6)
