"""Coaxial rotors: the lower one loses momentum theory's third, in the analysis and in the plant."""

from math import pi, sin, sqrt
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.optimize import brentq, linprog

import snakegen
from snakegen.analysis import hover, wake
from snakegen.analysis.allocation import allocation
from snakegen.control.power import power_factors
from snakegen.errors import DescriptionError
from snakegen.kernels.flight.aerodynamics import add_stream, mean_stream, thrust_in_stream
from snakegen.robot.rotor_streams import mean_inflow, thrust_kept
from snakegen.simulation.flight.bounds.stream_budget import stream_wrench
from snakegen.simulation.flight.plant import Imperfections
from snakegen.simulation.flight.run import run
from snakegen.simulation.flight.world import make_world
from snakegen.wrench_margins.thrust import thrust_margins
from tests.test_verify_plant import Tied

ARM = 0.4  # m: neighbours do not blow on each other
KEPT = 0.6823  # x (1 + x) with x (1 + x)² = 1


def coaxial(folder: Path, *, plant: str = "", rotor: dict[str, float] | None = None) -> Any:
    """Returns an octorotor of four coaxial pairs, 0.06 m apart, each an apparatus."""
    text = (
        '<robot name="x8"><link name="body"><inertial><mass value="3"/><inertia ixx="0.05" '
        'ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.1"/></inertial></link>'
    )
    pairs = []
    for k in range(4):
        x, y = (ARM * sin(pi / 4 + k * pi / 2 + a) for a in (pi / 2, 0.0))
        rotors = []
        for name, z in ((f"up{k}", 0.03), (f"low{k}", -0.03)):
            text += f'<link name="{name}"/><joint name="{name}_mount" type="fixed">'
            text += (
                f'<parent link="body"/><child link="{name}"/><origin xyz="{x} {y} {z}"/></joint>'
            )
            ratio = 0.016 * (-1) ** (k + (z < 0))
            rotors.append(
                {"link": name, "thrust_max": 8, "diameter": 0.2, "drag_ratio": ratio}
                | (rotor or {})
            )
        pairs.append({"rotors": rotors})
    path = folder / "x8.urdf"
    path.write_text(text + "</robot>")
    data: dict[str, Any] = {"floating_root": "body", "link_length": 0.2, "apparatuses": pairs}
    return snakegen.load(path, modules=data | ({"plant": {plant: 0}} if plant else {}))


@pytest.fixture(scope="module")
def x8(tmp_path_factory: pytest.TempPathFactory) -> snakegen.Robot:
    """Returns the octorotor with momentum theory's losses."""
    return coaxial(tmp_path_factory.mktemp("x8"))


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
    assert "loses 32 % of its thrust (counted in its limits)" in found.rows()[0][1]


def test_limits_and_drag_count_on_the_loss(x8: snakegen.Robot) -> None:
    most, drag = x8.rotors.thrust_max, np.abs(x8.rotors.torque_ratio)
    assert most == pytest.approx([8.0, 8.0 * KEPT] * 4, rel=1e-4)
    assert most * drag == pytest.approx([8.0 * 0.016] * 8)  # the torque at full speed stays
    factors = power_factors(x8)
    assert factors[1::2] * KEPT**1.5 == pytest.approx(factors[::2], rel=1e-3)
    model = make_world(x8).model
    ranges = [model.actuator(f"low{k}").ctrlrange[1] for k in range(4)]
    assert ranges == pytest.approx([8.0 * KEPT] * 4, rel=1e-4)


def test_margins_are_those_of_a_linear_program_with_the_loss(x8: snakegen.Robot) -> None:
    """No direction of lift and torques leaves the set nearer than the margin; with 8 N many do."""
    q, rng = x8.configuration(), np.random.default_rng(4)
    place = np.array([[ARM * c, ARM * s] for c, s in _corners() for _ in (0, 1)])
    drag = [0.016 * (-1) ** (k + n) / (KEPT if n else 1.0) for k in range(4) for n in (0, 1)]
    lift = np.vstack([np.ones(8), place[:, 1], -place[:, 0], drag])
    weight = np.array([x8.mass * 9.81, 0.0, 0.0, 0.0])

    def nearest(most: list[float]) -> float:
        found = []
        for d in [*rng.normal(size=(200, 4)), *np.eye(4), *-np.eye(4)]:
            rows = np.column_stack([lift, -d / np.linalg.norm(d)])
            bounds = [*((0.0, h) for h in most), (0.0, None)]
            found.append(
                -linprog(np.r_[np.zeros(8), -1.0], A_eq=rows, b_eq=weight, bounds=bounds).fun
            )
        return min(found)

    a = allocation(x8, q)
    limits = x8.rotors.thrust_min, x8.rotors.thrust_max
    m = thrust_margins(a.dual, *limits, a.hover_wrench, force_scale=1.0, torque_scale=1.0)
    assert float(m.attitude_altitude) == pytest.approx(nearest([8.0, 8.0 * KEPT] * 4), rel=1e-3)
    assert nearest([8.0] * 8) > 1.05 * float(m.attitude_altitude)
    whole = 4 * 8.0 * (1 + KEPT) / (x8.mass * 9.81)
    assert hover.analyze(x8, q).thrust_to_weight == pytest.approx(whole, rel=1e-4)


def _corners() -> list[tuple[float, float]]:
    return [(sin(3 * pi / 4 + k * pi / 2), sin(pi / 4 + k * pi / 2)) for k in range(4)]


def test_hover_says_what_it_counts_on(x8: snakegen.Robot) -> None:
    found = hover.analyze(x8, x8.configuration())
    assert found.stream_share == pytest.approx({f"low{k}": KEPT for k in range(4)}, abs=1e-4)
    assert not found.stream_loss  # nothing is lost besides
    assert any("4 rotors have 68.2 % of their still-air thrust" in t for _, t in found.rows())
    assert "stream_efficiency" in found.to_json()
    dragon = snakegen.load("dragon4")
    quiet = hover.analyze(dragon, dragon.configuration())
    assert not quiet.stream_loss and not quiet.stream_share


def test_the_plant_counts_the_loss_once(x8: snakegen.Robot) -> None:
    """The air takes nothing more from rotors of one body; a rotor of another body it does."""
    tied = Tied(x8, ground_effect=0.0)
    q = x8.configuration(base_position=[0.0, 0.0, 5.0])
    tied.world.set_state(tied.data, q)
    mujoco.mj_forward(tied.model, tied.data)
    command = np.array([5.0, 3.0] * 4)
    assert tied.air(command)[:, 2].sum() == 0.0
    budget = stream_wrench(tied.world, q, command, Imperfections(ground_effect=0.0))
    assert np.all(budget == 0.0)
    apart = tied.plant._replace(carrier=np.arange(8))
    tied.plant = apart
    lost = tied.air(np.full(8, 5.0))[:, 2].sum()
    assert lost == pytest.approx(-4 * 5.0 * (1 - KEPT), rel=1e-3)


def test_a_declared_efficiency_and_still_air_are_kept(tmp_path: Path) -> None:
    measured = coaxial(tmp_path, rotor={"stream_efficiency": 0.8})
    assert measured.rotors.thrust_max == pytest.approx([6.4] * 8)
    assert np.abs(measured.rotors.torque_ratio) == pytest.approx([0.02] * 8)
    for key in ("downwash", "air_density"):
        still = coaxial(tmp_path, plant=key)
        assert still.rotors.thrust_max == pytest.approx([8.0] * 8)


@pytest.mark.parametrize("value, words", [(1.2, "no share"), (-0.1, "negative")])
def test_an_efficiency_that_is_no_share_is_refused(
    tmp_path: Path, value: float, words: str
) -> None:
    with pytest.raises(DescriptionError, match=rf"stream_efficiency.*{words}"):
        coaxial(tmp_path, rotor={"stream_efficiency": value})


def test_a_coaxial_robot_hovers_within_its_bounds(x8: snakegen.Robot) -> None:
    flown = run(x8, "hover", options={"duration": 4.0})
    assert flown.verdict.passed, flown.verdict
    assert max(flown.metrics["position_rmse_m"]) < 0.03


def test_side_by_side_rotors_are_not_named() -> None:
    dragon = snakegen.load("dragon4")
    assert wake.analyze(dragon, dragon.configuration()).overlaps == ()
