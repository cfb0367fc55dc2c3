"""Monte Carlo: independent of threads, interruptible, and honest about what fell."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.stats import binomtest

import snakegen
from snakegen.cli.flight import flight
from snakegen.cli.trials import outcome_lines
from snakegen.errors import MissionError, SpecError
from snakegen.robot.robot import load
from snakegen.simulation.flight.run import prepare
from snakegen.simulation.flight.world import make_world
from snakegen.simulation.monte_carlo import (
    SURVIVED,
    Spread,
    fly_again,
    monte_carlo,
    perturbed,
    wilson,
)
from snakegen.spec.loading import load_spec


@pytest.fixture(scope="module")
def ready():
    return prepare(snakegen.load("dragon4"), "hover", options={"duration": 0.5})


def test_same_seed_same_bits_whatever_the_number_of_threads(ready):
    one, two = (monte_carlo(ready, 4, seed=5, workers=n).to_json() for n in (1, 3))
    assert json.dumps(one) == json.dumps(two)
    other = monte_carlo(ready, 4, seed=6, workers=2).to_json()
    assert json.dumps(other) != json.dumps(one)
    assert one["survived"] == one["trials"] == 4


def test_more_trials_keep_the_first_ones(ready):
    few, many = monte_carlo(ready, 2, seed=5), monte_carlo(ready, 4, seed=5)
    assert json.dumps([vars(t) for t in few.trials]) == json.dumps(
        [vars(t) for t in many.trials[:2]]
    )


def test_the_logged_trial_is_the_one_that_was_flown(ready):
    found = monte_carlo(ready, 3, seed=1)
    again = fly_again(ready, found.worst, seed=1)
    trial = found.trials[found.worst]
    assert again.meta["drawn"] == trial.drawn and again.meta["trial"] == found.worst
    for key, value in trial.metrics.items():
        assert again.metrics[key] == value, key
    farthest = max(found.trials, key=lambda t: t.metrics["position_max_m"])
    assert found.worst == farthest.number


def test_draws_change_the_simulated_robot_alone(ready):
    world = make_world(ready.robot)
    before = world.model.body_mass.copy()
    changed, plant, drawn = perturbed(
        world, ready.imperfections, Spread(), np.random.default_rng(3)
    )
    np.testing.assert_array_equal(world.model.body_mass, before)
    ratio = changed.model.body_mass[before > 0] / before[before > 0]
    assert np.abs(ratio - 1.0).max() <= 0.05 and np.ptp(ratio) > 0.05
    assert drawn["mass"] == pytest.approx(changed.model.body_mass.sum() / before.sum())
    whole = changed.model.body_subtreemass[0]
    assert whole == pytest.approx(changed.model.body_mass.sum()), "constants were renewed"
    lag = changed.model.actuator_dynprm[world.rotors, 0]
    np.testing.assert_allclose(lag, 0.035 * drawn["lag"])
    assert 0.005 <= plant.delay <= 0.015 and plant.thrust_scale == drawn["thrust"]
    assert plant.gyro_noise == pytest.approx(0.01 * drawn["noise"])
    # an inertia stays one of a body
    inertia = changed.model.body_inertia[before > 0]
    assert np.all(2.0 * inertia.max(axis=1) <= inertia.sum(axis=1) * (1 + 1e-9))


def test_a_robot_that_falls_has_not_survived(ready):
    longer = prepare(ready.robot, "hover", options={"duration": 2.0, "height": 0.6})
    found = monte_carlo(longer, 6, seed=0, spread=Spread(thrust=0.6))
    lost = [t for t in found.trials if not t.survived]
    assert lost and len(lost) < 6
    weak = [t for t in found.trials if t.drawn["thrust"] < 1.0]
    by_thrust = sorted(weak, key=lambda t: t.drawn["thrust"])
    assert [t.survived for t in by_thrust] == sorted(t.survived for t in weak)
    assert not by_thrust[0].survived, "too weak to hold its height"
    assert found.survival == (6 - len(lost)) / 6 and not found.trials[found.worst].survived
    assert found.interval == wilson(6 - len(lost), 6)
    for t in found.trials:
        held = t.metrics["position_max_m"] <= 0.5
        assert t.survived == (held and not set(t.failed) & set(SURVIVED))
    told = found.to_json()
    bound = longer.plan.thresholds["position_max_m"]["at_most"]
    assert told["failed_checks"]["position_max_m"] == len(
        [t for t in found.trials if t.metrics["position_max_m"] > bound]
    )
    page = "\n".join(outcome_lines(told, Path("worst.rrd")))
    assert f"position_max_m {told['failed_checks']['position_max_m']}" in page
    none = outcome_lines(told | {"percentiles": {}}, Path("worst.rrd"))
    assert not any("survivors" in line for line in none), "a table of nobody"
    still = monte_carlo(ready, 1, spread=Spread(0, 0, 0, 0, 0, 0)).trials[0].drawn
    assert still["lag"] == still["mass"] == still["thrust"] == 1.0


@pytest.mark.parametrize("good, count", [(0, 5), (3, 7), (98, 100), (256, 256)])
def test_interval_is_wilsons(good, count):
    expected = binomtest(good, count).proportion_ci(0.95, method="wilson")
    np.testing.assert_allclose(wilson(good, count), [expected.low, expected.high], atol=1e-12)


def test_interruption_keeps_what_is_finished(ready):
    def interrupt(done, _total):
        if done >= 2:
            raise KeyboardInterrupt

    found = monte_carlo(ready, 40, workers=1, progress=interrupt)
    assert 2 <= len(found.trials) < 40 and found.asked == 40
    assert found.to_json()["trials_asked"] == 40

    def at_once(_done, _total):
        raise KeyboardInterrupt

    assert len(monte_carlo(ready, 3, workers=1, progress=at_once).trials) >= 1
    with pytest.raises(MissionError, match="at least 1"):
        monte_carlo(ready, 0)


def test_command_line_reports_survival_and_logs_the_worst(tmp_path):
    log = tmp_path / "worst.rrd"
    asked = ["dragon4", "--duration", "0.3", "--trials", "2", "-o", str(log)]
    for extra in ([], ["--json"]):
        found = CliRunner().invoke(flight, asked + extra, standalone_mode=False)
        assert found.return_value == 0, found.output
        assert log.is_file()
        if extra:
            out = json.loads(found.stdout)
            assert out["survived"] == 2 and out["passed"] and out["log"] == str(log)
            names = {name.removesuffix("_s") for name in out["worst"]["drawn"]}
            assert set(out["uncertainty"]) == names | {"inertia"}
        else:
            assert "2 of 2 flights survived: 100.0 %" in found.stdout


def test_ranges_are_the_specs():
    robot = load(load_spec("dragon4", overrides=["plant.uncertainty={mass: 0.2, noise: 0}"]))
    ready = prepare(robot, "hover", options={"duration": 0.2})
    found = monte_carlo(ready, 6, seed=2)
    assert found.spread == Spread(mass=0.2, noise=0.0)
    assert found.to_json()["uncertainty"]["mass"] == 0.2
    drawn = [t.drawn for t in found.trials]
    assert {d["noise"] for d in drawn} == {1.0}
    usual = monte_carlo(prepare(load("dragon4"), "hover", options={"duration": 0.2}), 6, seed=2)
    assert usual.spread == Spread()
    wide, narrow = (np.ptp([t.drawn["mass"] for t in m.trials]) for m in (found, usual))
    assert wide == pytest.approx(4.0 * narrow, rel=1e-6), "the same draws, four times as wide"
    again = fly_again(ready, found.worst, seed=2)
    assert again.meta["drawn"] == found.trials[found.worst].drawn


def test_senseless_ranges_are_refused():
    with pytest.raises(SpecError, match="mass"):
        load_spec("dragon4", overrides=["plant.uncertainty.mass=1.5"])
    with pytest.raises(SpecError, match=r"mass"):
        Spread.of({"mas": 0.1})
