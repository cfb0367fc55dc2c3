"""Trials of arms: drawn plants, the pass rate and its interval, and planted faults that fail."""

import json

import numpy as np
import pytest

import snakegen
from snakegen.cli import main
from snakegen.simulation.arm.trials import ArmSpread, arm_trials, draw
from snakegen.simulation.flight.world import make_world
from snakegen.simulation.monte_carlo import wilson
from snakegen.spec.loading import load_spec

LOADED = {"duration": 0.4, "gravity": "0,0,-9.81"}


@pytest.fixture(scope="module")
def arm():
    return snakegen.load("arm6")


def test_an_arm_within_its_ranges_passes_and_repeats(arm):
    found, worst = arm_trials(arm, "table3", 3, seed=4, options=LOADED)
    again, _ = arm_trials(arm, "table3", 3, seed=4, options=LOADED)
    other, _ = arm_trials(arm, "table3", 3, seed=5, options=LOADED)
    off = [t.metrics["position_max_m"] for t in found.trials]
    assert off == [t.metrics["position_max_m"] for t in again.trials]
    assert off != [t.metrics["position_max_m"] for t in other.trials]
    assert found.survival == 1.0 and found.interval == wilson(3, 3)
    assert min(off) > 1e-4 and max(off) < 0.01 * 1.602
    assert found.worst == int(np.argmax(off)) and worst.meta["drawn"]["mass"] != 1.0
    assert "draw" not in worst.meta["options"]


@pytest.mark.parametrize(
    ("override", "check"),
    [
        ("joint.effort=20", "joint_torque_use"),
        ("joint.servo={stiffness: 10, damping: 0.4}", "position_max_m"),
    ],
)
def test_a_servo_at_half_strength_or_too_soft_fails(override, check):
    weak = snakegen.load(load_spec("arm6", overrides=[override]))
    found, _ = arm_trials(weak, "table3", 2, options=LOADED)
    assert found.survival == 0.0
    assert all(check in t.failed for t in found.trials)


def test_draws_keep_to_their_ranges(arm):
    world = make_world(arm, floor=False)
    spread = ArmSpread(mass=0.1, inertia=0.2, friction=0.05, stiffness=0.3, offset_rad=0.01)
    plants = [draw(world, spread, np.random.default_rng(k)) for k in range(50)]
    mass = np.array([p.mass for p in plants])
    assert 0.9 <= mass.min() < 0.91 and 1.09 < mass.max() <= 1.1
    rubbed = np.array([p.friction for p in plants])
    assert rubbed.min() >= 0 and 1.95 < rubbed.max() <= 0.05 * 40.0
    assert np.std([p.offset for p in plants]) == pytest.approx(0.01, rel=0.1)
    model = plants[0].model(world)
    assert model.body_mass[3] == pytest.approx(world.model.body_mass[3] * plants[0].mass[3])
    assert world.model.body_mass[3] == pytest.approx(
        make_world(arm, floor=False).model.body_mass[3]
    )


def test_trials_of_an_arm_by_command(capsys, tmp_path):
    arguments = [
        "analyze",
        "flight",
        "grasper3",
        "--mission",
        "table3",
        "--duration",
        "0.3",
        "--trials",
        "2",
        "--json",
    ]
    with pytest.raises(SystemExit) as ended:
        main([*arguments, "-o", str(tmp_path / "t.rrd")])
    out = json.loads(capsys.readouterr().out)
    assert ended.value.code == (0 if out["passed"] else 3)
    assert out["trials"] == 2 and (tmp_path / "t.rrd").is_file()
    assert out["uncertainty"]["friction"] == 0.005


def test_ranges_are_the_specs():
    ranges = "plant.uncertainty={mass: 0.2, inertia: 0.3, friction: 0.1}"
    robot = snakegen.load(load_spec("arm6", overrides=[ranges, "plant.joint_noise=0.01"]))
    expected = ArmSpread(mass=0.2, inertia=0.3, friction=0.1, offset_rad=0.01)
    assert ArmSpread.of(robot) == expected
