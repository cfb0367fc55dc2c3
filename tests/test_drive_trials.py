"""Trials of drives: drawn plants, the pass rate and its interval, and planted faults that fail."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from snakegen.cli.flight import flight
from snakegen.errors import MissionError
from snakegen.robot.robot import load
from snakegen.simulation.drive.hardware import DriveDraw, DriveHardware
from snakegen.simulation.drive.run import contact_model
from snakegen.simulation.drive.trials import DriveSpread, drive_trials
from snakegen.simulation.flight.run import run
from snakegen.simulation.missions.drive import follow
from snakegen.simulation.monte_carlo import wilson
from snakegen.simulation.run_settings import RunSettings
from snakegen.spec.loading import load_spec

SHORT = {"points": [[0, 0], [0.3, 0]], "speed": 0.2, "duration": 2.0}
BALLS = "screw_drive.rollers=ball"


@pytest.fixture(scope="module")
def quick():
    return load(load_spec("screw4", overrides=[BALLS]))


def test_a_drive_within_its_ranges_passes_and_repeats(quick):
    found, worst = drive_trials(quick, "follow", 3, seed=4, options=SHORT)
    again, _ = drive_trials(quick, "follow", 3, seed=4, options=SHORT)
    other, _ = drive_trials(quick, "follow", 3, seed=5, options=SHORT)
    off = [t.metrics["position_max_m"] for t in found.trials]
    assert off == [t.metrics["position_max_m"] for t in again.trials]
    assert off != [t.metrics["position_max_m"] for t in other.trials]
    assert found.survival == 1.0 and found.interval == wilson(3, 3)
    drawn = [t.drawn for t in found.trials]
    assert len({d["ground"] for d in drawn}) == 3 and worst.meta["drawn"]["ground"] != 1.0
    assert found.worst == int(np.argmax(off))


def test_a_wrong_hand_fails_every_trial(quick):
    """The plant's second drum is right-handed like the first; the law believes that it is left."""
    wrong = load(
        load_spec("screw4", overrides=[BALLS, "screw_drive.hand=[right, right, right, left]"])
    )
    for seed in range(3):
        settings = RunSettings(seed, draw=DriveDraw(body=wrong))
        assert not follow.fly(quick, follow.Options(**SHORT), settings).verdict.passed
        assert run(quick, "follow", seed=seed, options=SHORT).verdict.passed


def test_draws_keep_to_their_ranges(quick):
    spread = DriveSpread(ground=0.3, losses=0.2, noise=0.1, delay=0.02)
    draws = [spread.draw(np.random.default_rng(k)) for k in range(100)]
    for name, low, high in (("ground", 0.7, 1.3), ("losses", 0.8, 1.2), ("noise", 0.9, 1.1)):
        values = np.array([getattr(d, name) for d in draws])
        margin = 0.05 * (high - low)
        assert low <= values.min() < low + margin and high - margin < values.max() <= high
    assert min(d.delay for d in draws) >= 0.0 and 0.018 < max(d.delay for d in draws) <= 0.02
    given = ["plant.uncertainty={ground: 0.4, mass: 0.2}", "plant.drive_mismatch=0.03"]
    own = DriveSpread.of(load(load_spec("screw4", overrides=given)))
    assert (own.ground, own.mass, own.drums, own.losses) == (0.4, 0.2, 0.03, 0.5)


def test_masses_and_drums_are_drawn_within_the_ranges_given(quick):
    """A caller's own ranges, not the robot's: masses, inertias and what drums turn too far."""
    still = DriveSpread(mass=0.0, inertia=0.0, drums=0.0)
    wide = DriveSpread(mass=0.3, inertia=0.0, drums=0.1)
    for spread, least, most in ((still, 0.0, 1e-12), (wide, 0.2, 0.3)):
        settings = RunSettings(3, draw=spread.draw(np.random.default_rng(0)))
        hardware = DriveHardware(quick, settings, 6)
        model = contact_model(quick)
        mass, inertia = model.body_mass.copy(), model.body_inertia.copy()
        hardware.change(model)
        factor = model.body_mass[1:] / mass[1:]
        assert least <= np.abs(factor - 1.0).max() <= most
        assert np.allclose(model.body_inertia[1:], inertia[1:] * factor[:, None], rtol=1e-9)
        turned = np.abs(hardware.factor - 1.0)
        assert (turned == 0.0).all() if most < 0.1 else turned.max() > 0.03


def test_the_command_prints_the_interval_and_refuses_what_draws_nothing(tmp_path):
    asked = ["screw4", "--set", BALLS, "--mission", "slope", "--trials", "2"]
    asked += ["-o", str(tmp_path / "a.rrd"), "--option", "slow=2", "--option", "until=0.8"]
    text = CliRunner().invoke(flight, asked, standalone_mode=False)
    assert "2 of 2 runs survived: 0.0" not in text.output
    assert "95 % interval" in text.stdout and "ground ±25 %" in text.stdout
    assert "drums' turn 1 % (standard deviation)" in text.stdout
    out = json.loads(CliRunner().invoke(flight, [*asked, "--json"], standalone_mode=False).stdout)
    assert set(out["worst"]["drawn"]) == {"ground", "losses", "noise", "delay_s"}
    ideal = CliRunner().invoke(flight, [*asked, "--ideal"], standalone_mode=False)
    assert isinstance(ideal.exception, MissionError) and "not ideal" in str(ideal.exception)
    with pytest.raises(MissionError, match="contact"):
        drive_trials(load("screw4"), "follow", 1, options={"plant": "kinematic"})


@pytest.mark.parametrize("joint", ["screw3", "joint2_yaw"])
def test_a_servo_at_half_strength_fails(quick, joint):
    """Feedback makes up for it, so tracking is as good; its own gain shows it."""
    weak = RunSettings(2, draw=DriveDraw(strength={joint: 0.5}))
    found = follow.fly(quick, follow.Options(**SHORT), weak)
    kind = "screw" if joint.startswith("screw") else "joint"
    assert {c.metric for c in found.verdict.failed} == {f"{kind}_servo_strength"}
    assert found.metrics[f"{kind}_servo_strength"] == pytest.approx(0.5, abs=0.05)
    assert found.verdict.failed[0].worst.part == joint
    good = run(quick, "follow", seed=2, options=SHORT)
    for name in ("screw_servo_strength", "joint_servo_strength"):
        assert good.metrics[name] == pytest.approx(1.0, abs=1e-9)


def test_a_servo_at_its_torque_limit_shows_no_gain():
    """Eight drums that start off their path: commands step to ±10 rad/s, torques to their limit."""
    long = load(load_spec("screw4", links=8))
    found = run(long, "lcrank", options={"duration": 1.0})
    torque = found.channel("screw_torque").values
    limit = np.array(found.meta["limits"]["screw_torque"])
    assert (np.abs(torque) > 0.99 * limit).any()
    assert found.metrics["screw_servo_strength"] == pytest.approx(1.0, abs=1e-6)
