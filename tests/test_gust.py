"""Mission gust: wind through the plant's air, a push only if asked for, refused if it is void."""

from dataclasses import replace

import numpy as np
import pytest

import snakegen
from snakegen.errors import MissionError
from snakegen.simulation.flight.run import prepare, run
from snakegen.simulation.missions.flight.gust import Options, metrics, plan


@pytest.fixture(scope="module")
def dragon4():
    return snakegen.load("dragon4")


def test_a_gust_is_wind_that_carries_the_robot_off(dragon4):
    flown = {v: run(dragon4, "gust", options={"speed": v, "duration": 5.0}) for v in (1e-3, 8.0)}
    strong, calm = flown[8.0], flown[1e-3]
    wind = strong.channel("wind").values
    assert wind[np.argmin(np.abs(strong.times("wind") - 2.5))] == pytest.approx([0, 8, 0], abs=0.01)
    assert "disturbance" not in strong.channels
    off = [r.channel("position").values[:, 1].max() for r in (calm, strong)]
    assert off[1] > off[0] + 0.05
    assert strong.metrics["recovery_s"] > 0 and "recovery_s" in strong.verdict.thresholds()


def test_a_gust_against_the_other_way_carries_the_other_way(dragon4):
    back = run(dragon4, "gust", options={"speed": -8.0, "duration": 3.5})
    assert back.channel("position").values[:, 1].min() < -0.05


def test_a_push_may_stand_for_the_gust(dragon4):
    pushed = plan(dragon4, 200.0, Options(force=8.0, direction="z"))
    assert pushed.wind is None and pushed.disturbance[:, 2].max() == pytest.approx(8.0, rel=1e-3)
    assert not pushed.disturbance[:, [0, 1, 3, 4, 5]].any()


def test_turbulence_is_of_the_seed_and_of_the_strength_asked_for(dragon4):
    options = {"speed": 0.0, "turbulence": 1.5, "duration": 6.0}
    one, two, again = (run(dragon4, "gust", seed=s, options=options) for s in (1, 2, 1))
    winds = [r.channel("wind").values for r in (one, two, again)]
    np.testing.assert_array_equal(winds[0], winds[2])
    assert np.abs(winds[0] - winds[1]).max() > 0.1
    assert 0.3 < np.concatenate(winds[:2]).std() < 3.0
    assert one.meta["plant"]["turbulence"] == 1.5
    assert "recovery_s" not in one.verdict.thresholds(), "it goes on after the gust"


def test_a_run_that_ends_in_the_gust_has_not_come_back(dragon4):
    """Its CoG may be within 5 cm all the while; one that goes on to the end has come back."""
    recording = run(dragon4, "gust", options={"speed": 1.0, "duration": 3.5})
    assert recording.metrics["recovery_s"] == 0.0
    early = recording.time < 2.4
    cut = {
        k: replace(c, values=c.values[early])
        for k, c in recording.channels.items()
        if c.time is None
    }
    short = replace(recording, time=recording.time[early], channels=cut)
    assert metrics(short)["recovery_s"] is None
    assert metrics(short)["carried_off_m"] < 0.05


def test_wind_without_air_and_senseless_gusts_are_refused(dragon4):
    with pytest.raises(MissionError, match="does nothing without air"):
        prepare(dragon4, "gust", ideal=True)
    prepare(dragon4, "gust", ideal=True, options={"force": 8.0})
    with pytest.raises(MissionError, match="more than 3 is needed"):
        plan(dragon4, 200.0, Options(duration=2.5))
    with pytest.raises(MissionError, match="0 or more"):
        plan(dragon4, 200.0, Options(turbulence=-1.0))
