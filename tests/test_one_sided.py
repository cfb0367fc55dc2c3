"""Inputs at a limit: which wrench directions are lost, against linear programs."""

import numpy as np
import pytest
from scipy.optimize import linprog

import snakegen
from snakegen.analysis import actuation
from snakegen.analysis.allocation import allocation
from snakegen.control.one_sided import one_sided_loss
from snakegen.spec.loading import load_spec

ARC = {"joint1_yaw": 1.0, "joint2_yaw": 1.0, "joint3_yaw": 1.0}


def reachable(columns, rises, falls, d):
    """Whether J x = d has a solution with each x_i of the allowed signs."""
    ways = np.hstack([columns[:, rises], -columns[:, falls]])
    return linprog(np.zeros(ways.shape[1]), A_eq=ways, b_eq=d).status == 0


@pytest.mark.parametrize("seed", range(30))
def test_random_inputs_against_linear_programs(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(7, 12))
    columns = rng.normal(size=(6, count))
    kind = rng.integers(0, 3, count)
    rises, falls = kind != 1, kind != 2
    lost = one_sided_loss(columns, rises, falls)
    axes = [*np.eye(6), *-np.eye(6)]
    assert (lost is None) == all(reachable(columns, rises, falls, d) for d in axes)
    if lost is not None:
        assert np.max(lost @ columns[:, rises], initial=-1) < 1e-9
        assert np.max(-lost @ columns[:, falls], initial=-1) < 1e-9
        assert not reachable(columns, rises, falls, lost)


def dragon(limit):
    given = {"roll_limit": limit, "pitch_limit": limit}
    return snakegen.load(
        load_spec("dragon4", overrides=[f"vectoring_apparatus.{k}={v}" for k, v in given.items()])
    )


def virtual(robot, q):
    found = actuation.analyze(robot, q)
    return found, next(m for m in found.modes if m.mode == "virtual_single_rotor")


def test_gimbals_without_range_do_not_count():
    """Locked gimbals leave the thrusts alone: the rank of J_w falls to that of their columns."""
    robot = dragon(1e-8)
    q = robot.configuration(ARC)
    found, mode = virtual(robot, q)
    thrusts = allocation(robot, q).jacobian[:, :4]
    scale = np.repeat([1 / robot.force_scale, 1 / robot.torque_scale], 3)[:, None]
    expected = np.linalg.matrix_rank(scale * thrusts, tol=1e-6)
    assert found.rank_of("jacobian").rank == found.rank_of("force").rank == expected == 3
    assert mode.value == "underactuated"
    free = dragon(0.05)
    found, mode = virtual(free, free.configuration(ARC))
    assert found.rank_of("jacobian").rank == 6 and mode.value == "fully_actuated"


def test_gimbals_at_a_limit_push_one_way_alone():
    """All gimbals at +limit: yaw has one sense alone, rank 6 or not; just inside, both."""
    robot = dragon(0.05)
    turned = {f"gimbal{j}_{k}": 0.05 for j in range(1, 5) for k in ("roll", "pitch")}
    found, mode = virtual(robot, robot.configuration({**ARC, **turned}))
    assert found.rank_of("jacobian").rank == 6
    assert mode.value == "underactuated" and "gimbal1_pitch" in mode.sentence
    assert "one sense of yaw" in mode.sentence
    inside = dict.fromkeys(turned, 0.049)
    found, mode = virtual(robot, robot.configuration({**ARC, **inside}))
    assert mode.value == "fully_actuated"
