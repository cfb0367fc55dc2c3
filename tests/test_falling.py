"""A fall is a fall: the floor bears the robot again, and such a flight is not completed."""

import numpy as np
import pytest

import snakegen
from snakegen.simulation.flight.falling import fall
from snakegen.simulation.flight.run import run
from snakegen.spec.loading import load_spec

WEIGHT, DT = 80.0, 0.005


def contacts(*spans: tuple[int, int, float], ticks: int = 1000) -> np.ndarray:
    out = np.zeros(ticks)
    for first, last, force in spans:
        out[first:last] = force
    return out


@pytest.mark.parametrize(
    ("spans", "on_floor", "expected"),
    [
        ((), False, None),
        (((500, 1000, 80.0),), False, 500),  # lies there
        (((500, 504, 2000.0),), False, 500),  # bounces off: 40 N s in 20 ms
        (((500, 520, 8.0),), False, None),  # brushes past
        (((0, 200, 80.0),), True, None),  # has taken off
        (((0, 200, 80.0), (600, 1000, 80.0)), True, 600),
        (((0, 1000, 80.0),), True, None),  # never took off
        (((0, 100, 80.0), (150, 200, 80.0)), True, None),  # a hop of 0.25 s on the way up
        (((0, 100, 80.0), (150, 200, 80.0), (700, 800, 80.0)), True, 700),
    ],
)
def test_what_counts_as_a_fall(spans, on_floor, expected):
    assert fall(contacts(*spans), DT, WEIGHT, on_floor=on_floor) == expected


def test_a_robot_that_cannot_hold_itself_up_has_not_completed():
    """An empty battery lets it fall; the flight ends there, and says when."""
    short = snakegen.load(load_spec("dragon4", overrides=["plant.battery_energy=1.18"]))
    fallen = run(short, "hover", options={"duration": 6.0})
    empty = fallen.metrics["battery_empty_s"]
    assert fallen.metrics["completed"] is False
    assert fallen.meta["stopped"].startswith("fell to the floor at ")
    fell = float(fallen.meta["stopped"].split()[-2])
    floor = fallen.channel("floor_contact").values[:, 0]
    assert empty + 0.3 < fell < empty + 0.8  # 1.5 m less the body's own height: 0.5 s
    assert floor[fallen.time < fell - 1e-9].max() == 0.0
    assert floor[fallen.time > fell].max() > 80.0
