"""Wake: thrust that links take, against the plant's own stream and closed forms."""

import numpy as np
import pytest

import snakegen
from snakegen.analysis import wake
from snakegen.base.geometry import rotation_from_rpy
from snakegen.kernels.flight.aerodynamics import add_stream
from snakegen.robot.modules import Rotor
from snakegen.spec.loading import load_spec

ROTOR = Rotor("rotor", 0.0, 10.0, 0.0, diameter=0.07)
RATE = {"drag": 1.1, "reach": 2.0, "spread": 0.1}


def taken(place, axis, start, rod, length, radius):
    return wake.blocked_share(ROTOR, place, axis, start, rod, length, radius, *RATE.values())


def by_the_plants_stream(place, axis, start, rod, length, radius, thrust=7.0, density=1.2):
    """Returns the same share, the plant's stream summed over small squares of the rod's face."""
    across = np.cross(axis, rod) / np.linalg.norm(np.cross(axis, rod))
    total, n, m = 0.0, 600, 24
    for s in (np.arange(n) + 0.5) / n * length:
        for w in ((np.arange(m) + 0.5) / m - 0.5) * 2 * radius:
            flow = np.zeros(3)
            add_stream(density, thrust, 0.035, place, axis, start + s * rod + w * across, flow)
            flow -= (flow @ rod) * rod
            force = 0.5 * density * 1.1 * np.linalg.norm(flow) * flow
            total += -(force @ axis) * (length / n) * (2 * radius / m)
    return total / thrust


@pytest.mark.parametrize("tilt", [(0.0, 0.0, 0.0), (0.4, 0.5, 0.2), (-0.2, 0.1, 1.0)])
@pytest.mark.parametrize("radius", [0.0125, 0.06])
def test_links_take_what_the_plants_stream_pushes(tilt, radius):
    axis = rotation_from_rpy(tilt) @ np.array([0.0, 0.0, 1.0])
    place, start = np.array([0.21, 0.012, 0.1]), np.zeros(3)
    rod, length = np.array([1.0, 0.0, 0.0]), 0.42
    share, distance = taken(place, axis, start, rod, length, radius)
    assert share == pytest.approx(
        by_the_plants_stream(place, axis, start, rod, length, radius), rel=2e-3
    )
    assert share > 0.02 and 0.0 < distance < 0.2


def test_a_long_thin_rod_through_the_middle_has_a_closed_form():
    up, rod = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    share, distance = taken(0.08 * up, up, -2.0 * rod, rod, 4.0, 1e-4)
    wide = 0.035 + 0.1 * 0.08
    assert share == pytest.approx(1.1 * 2e-4 / wide * np.sqrt(1 / (2 * np.pi)), rel=1e-3)
    assert distance == pytest.approx(0.08)
    assert taken(-0.08 * up, up, -2.0 * rod, rod, 4.0, 1e-4)[0] == 0.0  # it stands upstream
    assert taken(0.08 * up, up, -2.0 * up, up, 1.0, 0.01)[0] == 0.0  # seen end on


LONE = ["vectoring_apparatus.rotors=1", "vectoring_apparatus.thrust_max=40"]


def test_a_lone_rotor_above_its_link_is_said_to_lose_thrust_and_below_it_is_not():
    above = snakegen.load(
        load_spec("dragon4", overrides=[*LONE, "vectoring_apparatus.offset=0.08"])
    )
    found = wake.analyze(above, above.configuration())
    assert {(b.source, b.link) for b in found.blocked} == {
        (f"rotor{j}_1", f"link{j}") for j in (1, 2, 3, 4)
    }
    share = by_the_plants_stream(
        np.array([0.21, 0.0, 0.08]), np.array([0.0, 0.0, 1.0]), np.zeros(3),
        np.array([1.0, 0.0, 0.0]), 0.42, 0.0125,
    )  # fmt: skip
    assert [b.share for b in found.blocked] == pytest.approx([share] * 4, rel=2e-3)
    assert f"takes {100 * share:.2g} % of its thrust" in str(found.rows())
    below = snakegen.load(
        load_spec("dragon4", overrides=[*LONE, "vectoring_apparatus.offset=null"])
    )
    assert wake.analyze(below, below.configuration()).blocked == ()
    bent = {"joint1_yaw": 0.7, "joint2_pitch": -0.2, "joint3_yaw": -0.4}
    turned = wake.analyze(above, above.configuration(bent, base_rpy=(0.6, -0.3, 1.0)))
    own = [b.share for b in turned.blocked if b.source[5] == b.link[4]]
    assert own == pytest.approx([share] * 4, rel=2e-3)


def test_pairs_blow_beside_their_link_and_one_apparatus_is_enough_to_ask():
    pairs = snakegen.load("dragon4")
    assert wake.analyze(pairs, pairs.configuration()).blocked == ()
    single = snakegen.load(load_spec("dragon4", links=2, apparatus="1"))
    assert wake.applies(single) and wake.analyze(single, single.configuration()).overlaps == ()
