"""Coaxial rotors: the lower one loses momentum theory's third, in the analysis and in the plant."""

from math import pi, sin, sqrt
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.optimize import brentq

import snakegen
from snakegen.analysis import hover, wake
from snakegen.kernels.flight.aerodynamics import add_stream, mean_stream, thrust_in_stream
from snakegen.robot.rotor_streams import mean_inflow, thrust_kept
from snakegen.simulation.flight.plant import Imperfections
from snakegen.simulation.flight.stream_budget import stream_wrench
from tests.test_verify_plant import Tied

KEPT = 0.6823  # x (1 + x) with x (1 + x)² = 1


@pytest.fixture(scope="module")
def x8(tmp_path_factory: pytest.TempPathFactory) -> snakegen.Robot:
    """Returns an octorotor of four coaxial pairs, 0.06 m apart, each an apparatus."""
    text = (
        '<robot name="x8"><link name="body"><inertial><mass value="3"/><inertia ixx="0.01" '
        'ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.02"/></inertial></link>'
    )
    pairs = []
    for k in range(4):
        x, y = (0.6 * sin(pi / 4 + k * pi / 2 + a) for a in (pi / 2, 0.0))
        rotors = []
        for name, z in ((f"up{k}", 0.03), (f"low{k}", -0.03)):
            text += f'<link name="{name}"/><joint name="{name}_mount" type="fixed">'
            text += (
                f'<parent link="body"/><child link="{name}"/><origin xyz="{x} {y} {z}"/></joint>'
            )
            ratio = 0.016 * (-1) ** (k + (z < 0))
            rotors.append({"link": name, "thrust_max": 8, "diameter": 0.2, "drag_ratio": ratio})
        pairs.append({"rotors": rotors})
    path = Path(tmp_path_factory.mktemp("x8")) / "x8.urdf"
    path.write_text(text + "</robot>")
    data = {"floating_root": "body", "link_length": 0.2, "apparatuses": pairs}
    return snakegen.load(path, modules=data)


@pytest.mark.parametrize("inflow", [0.0, 0.1, 1.0, 2.0, 7.0])
def test_thrust_at_the_same_power_is_that_of_momentum_theory(inflow: float) -> None:
    """P = T' (V + v') with T' = 2 ρ A (V + v') v', solved by bracketing."""
    density, area, thrust = 1.2, 0.03, 6.0
    hover = sqrt(thrust / (2 * density * area))
    flow, power = inflow * hover, thrust * hover
    mass = 2 * density * area
    own = brentq(lambda v: mass * (flow + v) * v * (flow + v) - power, 0.0, hover * 1.001)
    expected = mass * (flow + own) * own / thrust
    assert thrust_in_stream(inflow) == pytest.approx(expected, rel=1e-9)
    assert float(thrust_kept(inflow)) == pytest.approx(expected, rel=1e-9)


def test_kernel_and_numpy_agree() -> None:
    rng = np.random.default_rng(3)
    down, offset = rng.uniform(-0.2, 3.0, 200), rng.uniform(0.0, 0.5, 200)
    source, hit = rng.uniform(0.03, 0.2, (2, 200))
    expected = [mean_stream(*row) for row in zip(down, offset, source, hit, strict=True)]
    assert np.allclose(mean_inflow(down, offset, source, hit), expected, atol=1e-12)


@pytest.mark.parametrize("offset", [0.0, 0.1, 0.3])
def test_far_away_it_is_the_mean_of_the_plants_jet(offset: float) -> None:
    """The jet of `add_stream` integrated over the disc, in units of the induced velocity."""
    density, thrust, source, hit, down = 1.2, 5.0, 0.1, 0.12, 2.0
    induced = sqrt(thrust / (2 * density * pi * source**2))
    up, out = np.array([0.0, 0.0, 1.0]), np.zeros(3)

    def speed(x: float, y: float) -> float:
        out[:] = 0.0
        add_stream(density, thrust, source, np.zeros(3), up, np.array([x, y, -down]), out)
        return -float(out[2])

    def edge(x: float) -> float:
        return sqrt(max(hit**2 - (x - offset) ** 2, 0.0))

    total, _ = dblquad(
        lambda y, x: speed(x, y), offset - hit, offset + hit, lambda x: -edge(x), edge, epsrel=1e-4
    )
    mean = total / (pi * hit**2) / induced
    assert float(mean_inflow(down, offset, source, hit)) == pytest.approx(mean, rel=0.02)


def test_wake_names_the_pairs_and_what_they_lose(x8: snakegen.Robot) -> None:
    found = wake.analyze(x8, x8.configuration())
    assert [(o.source, o.hit) for o in found.overlaps] == [(f"up{k}", f"low{k}") for k in range(4)]
    assert all(o.lost == pytest.approx(1 - KEPT, abs=1e-4) for o in found.overlaps)
    assert "loses 32 % of its thrust" in found.rows()[0][1]


def test_hover_says_what_streams_take(x8: snakegen.Robot) -> None:
    found = hover.analyze(x8, x8.configuration())
    assert set(found.stream_loss) == {f"low{k}" for k in range(4)}
    assert all(x == pytest.approx(1 - KEPT, abs=1e-3) for x in found.stream_loss.values())
    assert any("4 rotors lose up to 32 %" in text for _, text in found.rows())
    assert "lost_in_streams" in found.to_json()
    dragon = snakegen.load("dragon4")
    assert not hover.analyze(dragon, dragon.configuration()).stream_loss


def test_the_plant_takes_the_same_third(x8: snakegen.Robot) -> None:
    tied = Tied(x8, ground_effect=0.0)
    q = x8.configuration(base_position=[0.0, 0.0, 5.0])
    tied.world.set_state(tied.data, q)
    mujoco.mj_forward(tied.model, tied.data)
    lost = tied.air(np.full(8, 5.0))[:, 2].sum()
    assert lost == pytest.approx(-4 * 5.0 * (1 - KEPT), rel=1e-3)
    budget = stream_wrench(tied.world, q, np.full(8, 5.0), Imperfections(ground_effect=0.0))
    assert budget[2] == pytest.approx(lost, rel=1e-6)


def test_side_by_side_rotors_are_not_named() -> None:
    dragon = snakegen.load("dragon4")
    assert wake.analyze(dragon, dragon.configuration()).overlaps == ()
