"""What `ring` plucks with and what `fail` is judged by come from the margins of the body."""

import numpy as np
import pytest
from scipy.optimize import linprog

import snakegen
from snakegen.analysis.allocation import allocation
from snakegen.robot.configuration import Configuration
from snakegen.simulation.flight.run import run
from snakegen.simulation.missions import planned
from snakegen.spec.loading import load_spec


@pytest.mark.parametrize("name", ["dragon3", "dragon4"])
def test_a_pluck_is_one_that_the_body_bears(name):
    """Against a linear program over rotors, of the rows that a leaning body holds."""
    robot = snakegen.load(name)
    plan = planned("ring", robot)
    pluck = plan.facts["pluck"]
    peak = np.abs(plan.disturbance[:, 1]).max()
    assert peak == pytest.approx(pluck["force_N"], rel=1e-3) and 0.0 < peak <= 20.0
    assert peak <= 0.8 * pluck["steady_force_held_N"] + 1e-9
    if name == "dragon3":
        a, q = allocation(robot, plan.start), Configuration(robot, plan.start)
        base = robot.base_pose(plan.start)
        point = base[0].T @ (q.link_pose("link3")[1] - base[1]) - a.cog
        push = np.r_[base[0].T[:, 1], np.cross(point, base[0].T[:, 1])]
        n = a.dual.shape[1]
        found = linprog(
            np.r_[np.zeros(n), -1.0],
            A_eq=np.column_stack([a.dual, push])[2:],
            b_eq=a.hover_wrench[2:],
            bounds=[*zip(robot.rotors.thrust_min, robot.rotors.thrust_max, strict=True), (0, None)],
        )
        assert pluck["steady_force_held_N"] == pytest.approx(found.x[-1], rel=1e-6)
    assert run(robot, "ring", options={"duration": 4.0}).verdict.passed
    hard = planned("ring", robot, force=31.0)
    assert np.abs(hard.disturbance[:, 1]).max() == pytest.approx(31.0, rel=1e-3)


def test_a_loss_is_judged_by_what_the_analysis_says():
    """Four links cannot lose an apparatus and leave their hover; eight links have to keep it."""
    four = snakegen.load("dragon4")
    flown = run(four, "fail", options={"at": 0.3, "duration": 3.0})
    assert flown.metrics["left_hover"] and flown.verdict.passed
    soon = run(four, "fail", options={"at": 0.3, "duration": 0.45})  # has not left it yet
    assert not soon.metrics["left_hover"] and not soon.verdict.passed
    eight = snakegen.load(load_spec("dragon4", links=8))
    plan = planned("fail", eight)
    assert plan.facts["predicted_wrench_margin"] > 0.0
    assert plan.thresholds["position_max_m"] == {"at_most": 1.0}
    assert "left_hover" not in plan.thresholds
