"""The public Python surface: typed results, short `repr`, and what `dir` shows."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import linprog

import snakegen
from snakegen import log
from snakegen.analysis.allocation import allocation
from snakegen.errors import AnalysisError, LogError, SnakegenError
from snakegen.simulation.flight.run import run
from snakegen.spec.loading import load_spec

BENT = {"joint1_yaw": 1.0, "joint2_yaw": 1.0, "joint3_yaw": 1.0}


@pytest.fixture(scope="module")
def dragon() -> snakegen.Robot:
    return snakegen.load("dragon4")


def test_dir_shows_what_there_is() -> None:
    """Every name that `dir` shows loads, and each stays what it is after others are imported."""
    shown = [n for n in dir(snakegen) if not n.startswith("__")]
    assert shown == sorted(snakegen.__all__)
    for name in shown:
        assert callable(getattr(snakegen, name)), name
    with pytest.raises(AttributeError, match="no attribute 'marginz'"):
        _ = snakegen.marginz


def test_it_is_typed() -> None:
    """The marker by which type checkers read a package's own annotations ships with it."""
    from importlib.resources import files

    assert files("snakegen").joinpath("py.typed").is_file()


def test_vectored_margins_bound_what_forces_reach(dragon: snakegen.Robot) -> None:
    """Beyond the upper bound no forces of apparatuses balance the worst wrench; below they do."""
    q = dragon.configuration(BENT, gimbals="hover")
    m = snakegen.margins(q)
    assert m.mode == "virtual_single_rotor" and m.feasible and m.rank == 6 and m.closed
    for value, bounds in (
        (m.force_N, m.force_bounds_N),
        (m.torque_Nm, m.torque_bounds_Nm),
        (m.wrench, m.wrench_bounds),
    ):
        assert value == bounds[0] <= bounds[1] and value > 0
    assert np.linalg.norm(m.worst_force) == pytest.approx(1.0)
    a = allocation(dragon, q)
    # support of the balls along the force direction is at most hover plus any torque's cost
    u = np.concatenate([m.worst_force, np.zeros(3)])
    t = m.directional(u)
    assert m.force_bounds_N[0] * (1 - 1e-3) <= t <= m.force_bounds_N[1] * (1 + 2e-3)
    # independent: an inner polytope of each ball by linear programming stays below the bound
    rng = np.random.default_rng(0)
    d = rng.normal(size=(200, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    limit = dragon.gimbals.limit
    columns = [
        np.concatenate([f, np.cross(p, f) + c * f])
        for p, c, top in zip(a.thrust_points, a.drag, limit, strict=True)
        for f in d * top
    ]
    share = np.kron(np.eye(len(limit)), np.ones(len(d)))
    found = linprog(
        np.append(np.zeros(len(columns)), -1.0),
        A_eq=np.column_stack([np.array(columns).T, -u]),
        b_eq=a.hover_wrench,
        A_ub=np.column_stack([share, np.zeros(len(limit))]),
        b_ub=np.ones(len(limit)),
    )
    assert 0.85 * t < -found.fun <= m.force_bounds_N[1] * (1 + 2e-3)
    assert m.force_limits.at_upper and m.force_limits.at_lower == ()
    assert set(m.force_limits.at_upper) <= {f"apparatus {j} on link{j}" for j in range(1, 5)}
    assert math.isnan(m.attitude_altitude)


def test_dual_margins_are_exact(dragon: snakegen.Robot) -> None:
    """In dual-rotor mode the bounds coincide; a linear program gives the same along the worst."""
    q = dragon.configuration(BENT, gimbals="hover")
    m = snakegen.margins(q, mode="dual_rotor")
    assert m.torque_bounds_Nm == (m.torque_Nm, m.torque_Nm) and m.torque_Nm > 0
    a, rotors = allocation(dragon, q), dragon.rotors
    u = np.concatenate([np.zeros(3), m.worst_torque])
    found = linprog(
        np.append(np.zeros(8), -1.0),
        A_eq=np.column_stack([a.dual, -u]),
        b_eq=a.hover_wrench,
        bounds=[*zip(rotors.thrust_min, rotors.thrust_max, strict=True), (None, None)],
    )
    assert m.torque_Nm == pytest.approx(-found.fun, rel=1e-6)
    names = [r.link for part in dragon.modules.apparatuses for r in part.rotors]
    thrust = found.x[:8]
    for stopped, limit in (
        (m.torque_limits.at_upper, rotors.thrust_max),
        (m.torque_limits.at_lower, rotors.thrust_min),
    ):
        at = [names[i] for i in np.flatnonzero(np.abs(thrust - limit) < 1e-6)]
        assert set(stopped) <= set(at), at
    assert m.torque_limits.at_upper


def test_infeasible_hover_says_by_how_much(dragon: snakegen.Robot) -> None:
    """Without hover the wrench margin is negative, force and torque are undefined."""
    upside_down = dragon.configuration({"base_rpy": (math.pi / 2, 0, 0)})
    m = snakegen.margins(upside_down, mode="dual_rotor")
    assert not m.feasible and m.wrench < 0 and math.isnan(m.force_N)
    assert "infeasible" in repr(m)


def test_margins_refuse_in_one_line(dragon: snakegen.Robot) -> None:
    """An array, another mode, an arm: each is told what would have worked."""
    q = dragon.configuration()
    for wrong, words in (
        (lambda: snakegen.margins(np.array(q)), "validate_configuration"),
        (lambda: snakegen.margins(q, mode="dual"), "dual_rotor"),
        (lambda: snakegen.margins(snakegen.load("arm6").configuration()), "floating base"),
    ):
        with pytest.raises(AnalysisError, match=words):
            wrong()
    assert issubclass(AnalysisError, SnakegenError)


def test_what_is_printed_is_short(dragon: snakegen.Robot) -> None:
    """Each public object prints itself in one line."""
    q = dragon.configuration(BENT, gimbals="hover")
    m = snakegen.margins(q)
    dual = snakegen.margins(q, "dual_rotor")
    for thing in (dragon, q, m, dual, load_spec("dragon4")):
        assert "\n" not in repr(thing) and len(repr(thing)) < 240, repr(thing)
        assert "dragon4" in repr(thing)
    for thing in (m.exact, dual.exact, allocation(dragon, q)):
        assert "\n" not in repr(thing) and len(repr(thing)) < 120, repr(thing)


def test_simulate_returns_arrays_verdict_and_saves(tmp_path: Path) -> None:
    """A short flight: arrays by name, a verdict, short when printed, and a log that reads back."""
    flown = snakegen.simulate("dragon4", "hover", seed=3, duration=1.0, posture=BENT)
    assert flown["position"].shape == (200, 3) and "thrust" in flown and "q" in flown.names
    assert flown.verdict is not None and flown.passed == flown.verdict.passed
    for thing in (flown, flown.verdict, flown.verdict.checks[0], flown.channel("position")):
        assert "\n" not in repr(thing) and len(repr(thing)) < 240
    assert "dragon4 hover, seed 3" in repr(flown)
    with pytest.raises(LogError, match="position"):
        flown["positon"]
    back = log.read(flown.save(tmp_path / "hover.rrd"))
    assert np.array_equal(back["q"], flown["q"]) and back.metrics == flown.metrics
    same = run(
        snakegen.load("dragon4"), "hover", seed=3, options={"duration": 1.0, "posture": BENT}
    )
    assert np.array_equal(same["q"], flown["q"])


def test_simulate_takes_a_configuration_as_its_start(dragon: snakegen.Robot) -> None:
    """Joints and attitude are those of the configuration; the mission points the gimbals."""
    q = dragon.configuration(BENT | {"base_rpy": (0.0, 0.1, 0.2)}, gimbals="hover")
    flown = snakegen.simulate(dragon, "hover", duration=0.1, ideal=True, posture=q)
    np.testing.assert_allclose(flown["joint_angle"][0], [0, 1, 0, 1, 0, 1], atol=1e-9)
    np.testing.assert_allclose(flown["q"][0, 3:7], q[3:7], atol=1e-9)


def test_simulate_refuses_in_one_line(dragon: snakegen.Robot) -> None:
    for mission, options, words in (
        ("hovr", {}, "Did you mean 'hover'"),
        ("hover", {"heigth": 1.0}, "Did you mean 'height'"),
        ("table3", {}, "needs an arm"),
        ("hover", {"duration": 1e9}, "would fit"),
    ):
        with pytest.raises(SnakegenError, match=words) as refused:
            snakegen.simulate(dragon, mission, **options)
        assert "\n" not in str(refused.value) and "--" not in str(refused.value)
