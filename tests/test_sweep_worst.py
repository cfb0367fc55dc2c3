"""The worst posture of a sweep: searched for, certified, and not claimed where it is open."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from scipy.linalg import block_diag
from scipy.optimize import minimize

from snakegen.analysis.allocation import allocation
from snakegen.errors import AnalysisError
from snakegen.robot.posture import hover_gimbals
from snakegen.robot.robot import Robot, load
from snakegen.sweep.batch import Body, evaluate
from snakegen.sweep.samples import draw
from snakegen.sweep.worst import refine


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load("dragon4")


@pytest.fixture(scope="module")
def body(robot: Robot) -> Body:
    return Body.of(robot, robot.chain_joints, np.eye(3), 1e-3)


def some(robot: Robot, count: int, seed: int = 0) -> np.ndarray:
    low, high, _ = robot.limits(robot.chain_joints)
    return draw("random", count, seed, low, high)


def hover_error(robot: Robot, angles: np.ndarray) -> float:
    """Returns how far bounded apparatus forces stay from hover, scaled, by SLSQP."""
    posture = dict(zip(robot.chain_joints, angles, strict=True))
    a = allocation(robot, hover_gimbals(robot, robot.configuration(posture)))
    rows = np.repeat([1.0 / robot.force_scale, 1.0 / robot.torque_scale], 3)
    limit = robot.gimbals.limit
    Q, w = rows[:, None] * a.force * np.repeat(limit, 3), rows * a.hover_wrench
    found = minimize(
        lambda f: 1e6 * np.sum((Q @ f - w) ** 2),
        np.linalg.lstsq(Q, w, rcond=None)[0],
        jac=lambda f: 2e6 * Q.T @ (Q @ f - w),
        constraints={
            "type": "ineq",
            "fun": lambda f: 1.0 - np.sum(f.reshape(-1, 3) ** 2, axis=1),
            "jac": lambda f: -2.0 * block_diag(*f.reshape(-1, 1, 3)),
        },
        method="SLSQP",
        options={"ftol": 1e-10, "maxiter": 500},
    )
    assert found.success
    return float(1e-3 * np.sqrt(found.fun))


def test_the_worst_posture_is_out_of_reach_where_there_is_such_a_posture(
    robot: Robot, body: Body
) -> None:
    nearly_straight = np.array([0.33, 0.29, -0.28, -0.33, 0.23, 0.37])
    spread = 0.02 * np.random.default_rng(0).normal(size=(40, 6))
    table = evaluate(body, nearly_straight + spread)
    found = refine(body, table, "torque_margin", rounds=6)
    assert found.sampled == np.nanmin(table["torque_margin"].to_numpy()) > 0.0
    assert not found.feasible and np.isnan(found.lower) and found.wrench < -1e-3
    apart = -found.wrench  # hover is no farther out of reach
    assert hover_error(robot, found.angles) == pytest.approx(apart, rel=1e-2)
    with pytest.raises(AnalysisError, match="no margin 'torq' in the sweep"):
        refine(body, table, "torq")


def test_a_lost_motion_is_a_margin_of_zero_and_closed(robot: Robot, body: Body) -> None:
    """Straight, no thrust turns the body about its axis; the bounds agree on 0."""
    table = evaluate(body, np.vstack([np.zeros(6), some(robot, 3)]))
    found = refine(body, table, "torque_margin")
    assert found.closed and found.zero and found.feasible
    assert found.upper <= 1e-6 * robot.torque_scale
    np.testing.assert_array_equal(found.angles, 0.0)


def test_the_worst_posture_is_worse_than_the_samples_and_certified() -> None:
    """A body that hovers in every posture: the search ends at a margin whose bounds agree."""
    strong = load(Path(__file__).parent.parent / "generated/hybrid4/hybrid4.urdf")
    stiff = Body.of(strong, ("joint1_yaw", "joint2_yaw"), np.eye(3), 1e-3)
    low, high, _ = strong.limits(stiff.joints)
    table = evaluate(stiff, draw("random", 30, 0, low, high))
    found = refine(stiff, table, "force_margin")
    assert found.feasible and 0.0 < found.lower < found.sampled
    assert found.closed and found.upper - found.lower <= 1e-3 * found.upper
    again = evaluate(stiff, found.angles[None])
    assert again["force_margin"][0].as_py() == pytest.approx(found.lower)


def test_a_search_that_did_not_close_is_not_taken_for_the_worst(robot: Robot, body: Body) -> None:
    table = evaluate(body, some(robot, 20))
    lower = table["force_margin"].to_numpy().copy()
    lower[3] = 0.0  # its upper bound says nothing of the kind
    at = table.column_names.index("force_margin")
    table = table.set_column(at, "force_margin", pa.array(lower))
    assert refine(body, table, "force_margin", rounds=1).sampled > 0.0
