"""Figures of designs by posture: each against the analysis of one robot in one posture."""

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import snakegen
from snakegen.analysis import wake
from snakegen.design_search.body_arrays import BodyArrays
from snakegen.design_search.evaluate import aggregate, best_posture, by_posture, evaluate, score
from snakegen.design_search.front import spread_out
from snakegen.design_search.grammar import MEASURES, NAMES, sign
from snakegen.design_search.joint_limited import hover_joint_torques, joint_limited_values
from snakegen.design_search.posture_figures import body_reach, opening_clearance, wake_losses
from snakegen.design_search.posture_margins import PlacedDesign, dual_values, place_design
from snakegen.design_search.problem import Problem, prepare
from snakegen.design_search.study import StudyError, check_study
from snakegen.errors import SnakegenError
from snakegen.spec.loading import load_spec
from snakegen.statics.joint_loads import joint_loads
from snakegen.wrench_margins.joint_limited_sets import sets_joint_limited
from snakegen.wrench_margins.rays import Bounds

ALL = [n for n in NAMES if n != "price"]
STUDY: dict[str, Any] = {
    "format": 1,
    "name": "figures",
    "robot": "dragon4",
    "fixed": {"joint.effort": 4.0},
    "variables": {
        "vectoring_apparatus.at.1.position": {"range": [0.0, 1.0]},
        "vectoring_apparatus.at.3.position": {"range": [0.0, 1.0]},
        "chain.length": {"range": [0.3, 0.5]},
        "vectoring_apparatus.rotor_diameter": {"range": [0.06, 0.12]},
    },
    "objectives": {"torque_margin_quantile_Nm": {"quantile": 0.05}},
    "opening": {"width": 1.0, "height": 0.6},
    "postures": {"search": 64, "certify": 256},
}
X = np.array([0.3, 0.7, 0.36, 0.11])


@pytest.fixture(scope="module")
def problem() -> Problem:
    return prepare(check_study(STUDY, "figures"), Path())


@pytest.fixture(scope="module")
def robot(problem) -> snakegen.Robot:
    return snakegen.load(load_spec(problem.spec_data(X)))


@pytest.fixture(scope="module")
def placed(problem) -> PlacedDesign:
    topology = problem.topology(X)
    return place_design(problem.arrays(X), topology.sets["range"][:24], topology.indices)


@pytest.fixture(scope="module")
def postures(problem, robot, placed) -> list[np.ndarray]:
    joints = problem.topology(X).skeleton.chain_joints
    return [
        robot.configuration(dict(zip(joints, row, strict=True)), gimbals="hover")
        for row in placed.samples
    ]


def test_every_figure_is_that_of_the_rebuilt_design(problem):
    """Arrays in closed form and of the templates' URDF give one score, for every name."""
    data = copy.deepcopy(STUDY)
    data["objectives"] = {n: {} for n in ALL}
    data["fixed"]["plant.battery_energy"] = 100.0
    whole = prepare(check_study(data, "all"), Path())
    small = Problem(whole.study, whole.names, whole.low, whole.high, whole.whole, whole.topologies)
    topology = small.topology(X)
    few = {name: rows[:16] for name, rows in topology.sets.items()}
    resolved, price = small.resolved(X)
    known = snakegen.load(load_spec(small.spec_data(X)))
    made, again = (
        score(small, arrays, topology.indices, few, resolved, price, final=True)
        for arrays in (small.arrays(X), BodyArrays.of(known))
    )
    assert set(made.values) == set(ALL)
    for name, value in made.values.items():
        assert again.values[name] == pytest.approx(value, rel=1e-9, abs=1e-12), name
    finite = [n for n, v in made.values.items() if np.isfinite(v) and v != 0.0]
    assert len(finite) > 15


def test_wake_losses_are_those_of_analyze_wake(robot, placed, postures):
    found = wake_losses(placed)
    known = [max((o.lost for o in wake.analyze(robot, q).overlaps), default=0.0) for q in postures]
    np.testing.assert_allclose(found, known, atol=1e-9)
    assert found.max() > 0.05 and found.min() < found.max()


def test_joint_torques_balance_forces_of_least_norm(robot, placed, postures):
    found = hover_joint_torques(placed)
    for row, q in zip(found, postures, strict=True):
        loads, sets = joint_loads(robot, q), robot.force_sets(q)
        top = np.tile(np.eye(3), len(sets))
        turns = [
            np.cross(p, np.eye(3)).T + c * np.eye(3)
            for p, c in zip(sets.points, sets.drag, strict=True)
        ]
        whole = np.vstack([top, np.hstack(turns)])
        hover = np.r_[0.0, 0.0, robot.force_scale, 0.0, 0.0, 0.0]
        forces = np.linalg.lstsq(whole, hover, rcond=None)[0]
        known = loads.bias + loads.forces.reshape(len(loads.bias), -1) @ forces
        np.testing.assert_allclose(row, known, rtol=1e-8, atol=1e-9)
    assert np.abs(found).max() > 1.0


def test_dual_margins_are_those_of_the_analysis(robot, placed, postures):
    for kind, name in (("torque", "torque_Nm"), ("attitude_altitude", "attitude_altitude")):
        found = dual_values(placed, kind)
        rows = [getattr(snakegen.margins(q, mode="dual_rotor"), name) for q in postures]
        known = [value if value >= 0.0 else -np.inf for value in rows]
        np.testing.assert_allclose(found, known, rtol=1e-9, atol=1e-9)
        assert np.isfinite(found).any()


@pytest.mark.parametrize("kind", ["force", "torque"])
def test_joint_limited_margins_lie_within_the_plain_bounds(robot, placed, postures, kind):
    found = joint_limited_values(placed, kind, 1e-3)
    free = by_posture(MEASURES[f"{kind}_margin_worst_{'N' if kind == 'force' else 'Nm'}"], placed,
                      1e-3)  # fmt: skip
    for value, above, q in zip(found, free, postures, strict=True):
        loads = joint_loads(robot, q)
        sets, hover = robot.force_sets(q), np.r_[0.0, 0.0, robot.force_scale, 0.0, 0.0, 0.0]
        known = sets_joint_limited(
            sets, hover, Bounds(loads.forces, loads.bias, loads.disturbance, loads.limit),
            force_scale=robot.force_scale, torque_scale=robot.torque_scale,
        )  # fmt: skip
        low, high = getattr(known, f"{kind}_bounds")
        if np.isnan(low):
            assert value == -np.inf
            continue
        assert low * (1.0 - 2e-3) - 1e-9 <= value <= high * (1.0 + 1e-9) + 1e-9
        assert value <= above * (1.0 + 2e-3) + 1e-9
    limited = np.isfinite(found) & (found < 0.9 * free)
    assert limited.sum() >= 3  # the joints do stop some


def test_reach_and_opening_are_held_by_their_postures(problem, robot, placed):
    joints = problem.topology(X).skeleton.chain_joints
    wide = opening_clearance(placed, 5.0, 5.0, 1.0)
    narrow = opening_clearance(placed, 1.0, 0.6, 1.0)
    assert wide.value > narrow.value
    assert opening_clearance(placed, 1.2, 0.8, 1.0).value == pytest.approx(narrow.value + 0.1)
    reach = body_reach(placed, 1.0)
    for best in (narrow, reach):
        q = robot.configuration(dict(zip(joints, best.angles, strict=True)), gimbals="hover")
        assert snakegen.margins(q).torque_bounds_Nm[1] >= 1.0
    assert 0.9 < reach.value < 4 * 0.36 + 3 * 0.0515
    assert body_reach(placed, 8.0).value < reach.value
    assert body_reach(placed, 1e3).value == -np.inf


def test_clearance_is_that_of_the_shown_solids(problem, robot, placed):
    """The posture turned to its heading: links' ends and discs fit with the room that is told."""
    best = opening_clearance(placed, 1.0, 0.6, 1.0)
    here = place_design(placed.arrays, best.angles[None], placed.indices)
    c, s = np.cos(best.heading), np.sin(best.heading)
    turned = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    ends = here.spine[0].reshape(-1, 3) @ turned.T
    discs = here.discs[0] @ turned.T
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for points, radius in ((ends, 0.0125), (discs, 0.055)):
        low, high = (
            np.minimum(low, points.min(0) - radius),
            np.maximum(high, points.max(0) + radius),
        )
    room = 0.5 * (np.array([1.0, 0.6]) - (high - low)[1:])
    assert room.min() == pytest.approx(best.value, abs=1e-12)


def test_quantiles_of_small_figures_count_from_the_top():
    values = np.arange(1.0, 101.0)
    load, margin = MEASURES["joint_load_quantile"], MEASURES["torque_margin_quantile_Nm"]
    assert (values > aggregate(load, values, 0.05)).mean() == pytest.approx(0.05, abs=0.011)
    assert (values < aggregate(margin, values, 0.05)).mean() <= 0.05
    assert aggregate(MEASURES["joint_load_worst"], values, 0.5) == 100.0
    assert sign("joint_load_worst") == sign("mass_kg") == -1.0
    assert sign("reach_m") == sign("opening_clearance_m") == 1.0


def test_shown_designs_are_spread_over_the_front():
    """A crowd at one end does not take the places of the other designs."""
    t = np.r_[np.linspace(0.0, 0.05, 30), np.linspace(0.1, 1.0, 10)]
    rows = np.column_stack([np.cos(t * np.pi / 2), np.sin(t * np.pi / 2)])
    kept = spread_out(rows, 8)
    assert kept == sorted(kept) and len(kept) == 8 and {0, 39} <= set(kept)
    assert sum(k < 30 for k in kept) <= 2
    assert np.diff(t[kept]).max() < 0.25
    assert spread_out(rows[:3], 12) == [0, 1, 2] and spread_out(rows[:1], 12) == [0]


def changed(**parts: Any) -> dict[str, Any]:
    return copy.deepcopy(STUDY) | parts


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (changed(objectives={"force_margin_dual_worst_N": {}}), "does not apply: in dual-rotor"),
        (changed(objectives={"opening_clearance_m": {}}, opening=None), "needs the opening"),
        (changed(objectives={"reach_m": {"quantile": 0.1}}), "'quantile' has no meaning"),
        (changed(objectives={"mass_kg": {"over": "motion"}}), "'over' has no meaning"),
        (changed(constraints={"joint_load_worst": {}}), "'min' or 'max'"),
        (
            changed(constraints={"torque_margin_quantile_Nm": {"min": 1.0, "quantile": 0.2}}),
            "that of the objective",
        ),
        (changed(constraints={"reach_m": {"min": 1.0, "over": "motion"}}), "two waypoints"),
    ],
)  # fmt: skip
def test_figures_that_are_asked_for_wrongly_are_one_line(data, words):
    with pytest.raises(StudyError, match=words) as caught:
        check_study(data, "bad.yaml")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("fixed", "name", "words"),
    [
        ({"vectoring_apparatus.at": [2]}, "torque_margin_failed_worst_Nm", "the only apparatus"),
        ({"vectoring_apparatus.at": [2]}, "apparatus_gap_m", "one apparatus"),
        ({"plant.battery_energy": 0.0}, "flight_time_min", "never empties"),
        ({"chain.links": 1}, "joint_load_worst", "no joints"),
        (
            {"vectoring_apparatus.roll_limit": 1.0},
            "force_margin_joint_limited_worst_N",
            "gimbals have limits",
        ),
        ({"chain.links": 1}, "torque_margin_joint_limited_worst_Nm", "no joints"),
    ],
)
def test_figures_that_do_not_apply_are_refused(fixed, name, words):
    data = changed(objectives={name: {}}, fixed=fixed)
    data["variables"] = {"vectoring_apparatus.thrust_max": {"range": [10.0, 30.0]}}
    with pytest.raises(SnakegenError, match=words) as caught:
        prepare(check_study(data, "bad.yaml"), Path())
    assert name in str(caught.value) and "\n" not in str(caught.value)


def test_a_constraint_has_its_own_postures(problem):
    data = changed(constraints={"joint_load_quantile": {"max": 5.0, "quantile": 0.25}})
    loose = prepare(check_study(data, "loose"), Path())
    data["constraints"]["joint_load_quantile"]["quantile"] = 0.01
    tight = prepare(check_study(json.loads(json.dumps(data)), "tight"), Path())
    a, b = (evaluate(p, X).values["joint_load_quantile"] for p in (loose, tight))
    assert a < b
    assert best_posture(problem, MEASURES["reach_m"], place_design(
        problem.arrays(X), problem.topology(X).sets["range"][:4], problem.topology(X).indices,
    )).value > 0.0  # fmt: skip
