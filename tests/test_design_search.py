"""Design studies: closed-form arrays, certified figures, search, proof, resume, bad input."""

import copy
import json
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from click.testing import CliRunner

import snakegen
from snakegen.cli import cli, design
from snakegen.design_search import run
from snakegen.design_search.ascent import design_gradients
from snakegen.design_search.body_arrays import BodyArrays, Skeleton
from snakegen.design_search.bound import prove
from snakegen.design_search.evaluate import evaluate, least_power
from snakegen.design_search.front import given_design
from snakegen.design_search.posture_margins import certify, place_design
from snakegen.design_search.problem import Problem, prepare
from snakegen.design_search.study import StudyError, check_study, read_study
from snakegen.errors import SnakegenError
from snakegen.spec.loading import load_spec, templates_folder

STUDIES = templates_folder() / "studies"
SMALL: dict[str, Any] = {
    "format": 1,
    "name": "small",
    "robot": "dragon4",
    "variables": {
        "vectoring_apparatus.at.1.position": {"range": [0.0, 1.0]},
        "vectoring_apparatus.at.4.position": {"range": [0.2, 0.9]},
    },
    "constraints": {"apparatus_gap_m": {"min": 0.14}},
    "objectives": {
        "torque_margin_quantile_Nm": {"quantile": 0.05},
        "torque_margin_worst_Nm": {"over": "motion"},
    },
    "postures": {
        "search": 64,
        "certify": 256,
        "motion": [
            {"joint1_yaw": 1.0, "joint2_yaw": 1.0, "joint3_yaw": 1.0},
            {"joint1_yaw": 1.0, "joint1_pitch": -1.0, "joint2_pitch": 1.0, "joint3_yaw": 1.0},
        ],
        "step": 0.2,
    },
    "search": {"evaluations": 60, "weights": 2},
}


@pytest.fixture(scope="module")
def problem() -> Problem:
    return prepare(check_study(SMALL, "small"), Path())


@pytest.mark.parametrize(
    "change",
    [
        {"apparatus": "1,2@0.3,2@0.8,4"},
        {"links": 3, "overrides": ["joint.axes=[yaw]", "payload={at: 2@0.3, mass: 0.4}"]},
    ],
)
def test_closed_form_is_what_the_templates_give(change):
    """`Skeleton.of` refuses a robot whose closed form differs; another design is tried too."""
    spec = load_spec("dragon4", **change)
    skeleton = Skeleton.of(snakegen.load(spec), json.loads(json.dumps(spec.resolved())))
    more = [*change.get("overrides", []), "chain.length=0.3", "vectoring_apparatus.offset=0.02"]
    more += ["vectoring_apparatus.separation=0.3", "joint.gap=0.07", "chain.com=0.4"]
    other = load_spec("dragon4", **(change | {"overrides": more}))
    made = skeleton.fill(json.loads(json.dumps(other.resolved())))
    known = BodyArrays.of(snakegen.load(other))
    for a, b in zip(made.tree[3:7], known.tree[3:7], strict=True):
        np.testing.assert_allclose(a, b, atol=1e-12)
    np.testing.assert_allclose(made.rotors.position, known.rotors.position, atol=1e-12)
    assert made.link_length == pytest.approx(known.link_length, abs=1e-12)


def test_figures_are_those_of_the_robot_that_the_spec_builds(problem):
    x = np.array([0.2, 0.7])
    robot = snakegen.load(load_spec(problem.spec_data(x)))
    topology = problem.topology(x)
    placed = place_design(problem.arrays(x), topology.sets["range"][:5], topology.indices)
    for kind in ("force", "torque"):
        values = certify(placed, (kind,), 1e-3)[kind].values
        for value, row in zip(values, topology.sets["range"], strict=False):
            angles = dict(zip(topology.skeleton.chain_joints, row, strict=True))
            m = snakegen.margins(robot.configuration(angles, gimbals="hover"))
            low, high = m.force_bounds_N if kind == "force" else m.torque_bounds_Nm
            assert low * (1 - 1e-9) <= value <= high * (1 + 1e-9)


def test_derivatives_by_spec_fields_against_central_differences(problem):
    x, h = np.array([0.31, 0.62]), 1e-5
    topology = problem.topology(x)

    def values(at):
        placed = place_design(problem.arrays(at), topology.sets["range"], topology.indices)
        return placed, certify(placed, ("torque",), 1e-6)["torque"]

    placed, found = values(x)
    by = design_gradients(problem, x, placed, found, "range")
    agreed = 0
    for k in range(2):
        step = h * np.eye(2)[k]
        high, low = values(x + step)[1], values(x - step)[1]
        exact = (high.solved * low.solved * found.solved) > 0
        difference = (high.values - low.values) / (2.0 * h)
        close = np.abs(difference - by[:, k]) <= 1e-5 * (1.0 + np.abs(by).max())
        agreed += int((close & exact).sum())
        assert (close | ~exact).sum() >= len(exact) - 1  # one posture may stand on a kink
    assert agreed >= 110 and np.abs(by).max() > 1.0


def test_no_design_passes_the_proved_bound(problem):
    study = problem.study.model_copy(
        update={"search": problem.study.search.model_copy(update={"gap": 0.1})}
    )
    one = Problem(
        study, problem.names, problem.low, problem.high, problem.whole, problem.topologies
    )
    bound = prove(one, np.array([0.5, 0.5]), time.monotonic() + 60.0, lambda *_: None)
    assert bound.closed and bound.gap <= 0.1 and bound.upper >= bound.best > 0.0
    name = "torque_margin_quantile_Nm"
    assert evaluate(one, np.array(bound.design)).values[name] == pytest.approx(bound.best)
    rng = np.random.default_rng(5)
    values = [
        evaluate(one, rng.uniform(one.low, one.high)).values.get(name, 0.0) for _ in range(40)
    ]
    assert 0.5 * bound.best < max(values) <= bound.upper


def test_proof_refuses_choices_and_masses(problem):
    data = copy.deepcopy(SMALL)
    data["variables"] = {"chain.mass": {"range": [0.8, 1.0]}}
    heavy = prepare(check_study(data, "heavy"), Path())
    with pytest.raises(StudyError, match="leave the mass"):
        prove(heavy, np.array([0.9]), time.monotonic() + 5.0, lambda *_: None)


def test_study_runs_resumes_and_repeats(tmp_path, monkeypatch):
    study = tmp_path / "small.yaml"
    study.write_text(yaml.safe_dump(SMALL))
    first = run.run_study(study, tmp_path / "a", processes=1)
    data = first.to_json()
    assert (tmp_path / "a/front.png").stat().st_size > 10_000
    assert json.loads((tmp_path / "a/front.json").read_text()) == json.loads(json.dumps(data))
    given = data["given"]["torque_margin_quantile_Nm"]
    assert data["front"][0]["torque_margin_quantile_Nm"] > given > 0.0
    for row in data["front"]:
        assert row["rebuilt_relative_error"] <= 1e-9
        assert row["equivalence_error"] <= 1e-9
        assert snakegen.load(row["spec"]).mass == pytest.approx(8.0, abs=0.01)
    steps = data["small_steps_of_chosen"]
    assert {s["variable"] for s in steps} == set(SMALL["variables"])
    assert any(abs(s["changes"]["torque_margin_quantile_Nm"]) > 1e-4 for s in steps)
    assert load_spec(tmp_path / "a" / "A.spec.yaml").name == "small_dragon4"
    # a kill in the middle of a line: the rest is searched again, to the same front
    lines = (tmp_path / "a/journal.jsonl").read_text().splitlines(keepends=True)
    (tmp_path / "b").mkdir()
    half = "".join(lines[: len(lines) // 2]) + lines[-1][:9]
    (tmp_path / "b/journal.jsonl").write_text(half)
    scored = []
    monkeypatch.setattr(
        "snakegen.design_search.executor.evaluate",
        lambda problem, x, final: (
            ((final or scored.append(x)) and None) or evaluate(problem, x, final=final)
        ),
    )
    damaged = (tmp_path / "b/journal.jsonl").read_text().replace('"x": [0.', '"x": [1.', 1)
    (tmp_path / "b/journal.jsonl").write_text(damaged)
    again = run.run_study(study, tmp_path / "b", processes=1, resume=True)
    assert len(scored) > first.scored - len(lines) // 2  # the damaged line too
    assert 0 < len(scored) < first.scored
    assert [d.x for d in again.front] == [d.x for d in first.front]
    with pytest.raises(StudyError, match="another study, seed or version"):
        run.run_study(study, tmp_path / "b", processes=1, resume=True, seed=1)


def changed(**parts: Any) -> dict[str, Any]:
    data = copy.deepcopy(SMALL)
    for path, value in parts.items():
        data[path] = value
    return data


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (changed(variables={}), "no free variables"),
        (changed(format=2), "another version"),
        (changed(constraints={"mass_kg": {"min": 9.0, "max": 8.0}}), "mass_kg: min 9 and max 8"),
        (changed(objectives={"torque_margin_quantil_Nm": {}}), "torque_margin_quantile_Nm"),
        (changed(objectives={}), "no objectives"),
        (changed(variables={"a": {"catalogue": [{"name": "T"}]}}), "masses"),
        (changed(variables={"a": {"range": [1.0, 0.0]}}), "empty"),
        (changed(postures={"search": 64}), "two waypoints"),
        (changed(colour=1), "no field 'colour'"),
    ],
)
def test_bad_studies_are_one_line(data, words):
    with pytest.raises(StudyError, match=words) as caught:
        check_study(data, "bad.yaml")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (changed(robot="arm6"), "cannot hover"),
        (changed(variables={"chain.radius": {"range": [0.01, 0.02]}}), "cannot vary"),
        (
            changed(variables={"vectoring_apparatus.at.7.position": {"range": [0, 1]}}),
            "count from 1",
        ),
    ],
)
def test_studies_that_do_not_fit_the_robot_are_refused(data, words):
    with pytest.raises(SnakegenError, match=words):
        prepare(check_study(data, "bad.yaml"), Path())


def test_constraints_that_exclude_each_other_are_named(tmp_path):
    data = changed(
        variables={"vectoring_apparatus.thrust_max": {"range": [12.0, 30.0]}},
        objectives={"force_margin_quantile_N": {}},
        constraints={
            "thrust_to_weight": {"max": 1.6},
            "force_margin_quantile_N": {"min": 60.0},
        },
        search={"evaluations": 50, "weights": 1},
    )
    study = tmp_path / "clash.yaml"
    study.write_text(yaml.safe_dump(data))
    with pytest.raises(StudyError, match=r"thrust_to_weight|nearest"):
        run.run_study(study, tmp_path / "out", processes=1)


def test_example_is_a_study_and_shipped_studies_are_read():
    made = CliRunner().invoke(cli, ["design", "--example"])
    assert made.exit_code == 0
    check_study(yaml.safe_load(made.stdout), "example")
    assert {read_study(p).name for p in STUDIES.glob("*.yaml")} >= {"placement", "failure"}


def test_command_without_study_says_how():
    with pytest.raises(SnakegenError, match="--example"):
        CliRunner().invoke(cli, ["design"], catch_exceptions=False)


def test_least_power_is_what_equal_rotors_draw_and_less_than_uneven_shares():
    weight, sizes = 78.48, np.array([0.07, 0.07, 0.1, 0.1])
    c = 1.0 / (0.6 * np.sqrt(2.0 * 1.2 * np.pi * (0.5 * sizes) ** 2))
    least = least_power(weight, sizes)
    rng = np.random.default_rng(0)
    shares = rng.dirichlet(np.ones(4), 2000) * weight
    powers = (c * shares**1.5).sum(axis=1)
    assert least <= powers.min() <= 1.05 * least
    assert least_power(weight, sizes[:2]) == pytest.approx(2 * c[0] * (weight / 2) ** 1.5)


def test_no_time_at_all_is_one_line(tmp_path):
    study = tmp_path / "small.yaml"
    study.write_text(yaml.safe_dump(SMALL))
    with pytest.raises(StudyError, match="more minutes"):
        run.run_study(study, tmp_path / "out", processes=1, minutes=1e-6)


def test_flights_agree_where_a_predicted_fall_happens(problem, tmp_path, monkeypatch):
    """A body that cannot hover after a loss must leave hover: then flight and margin agree."""
    monkeypatch.setattr(design, "FLIGHTS", ("fail",))
    given = given_design(problem, tmp_path)
    assert given is not None and given.equivalence <= 1e-9
    (flight,) = design._fly(SimpleNamespace(chosen=given, given=None), tmp_path, 0)
    assert flight["agrees"] and flight["passed"] and flight["predicted_wrench_margin"] < 0.0
    assert (tmp_path / "given_built/fail.rrd").is_file()
    assert "predicted 6-D margin after the loss -0.084" in "; ".join(design._measured(flight))
