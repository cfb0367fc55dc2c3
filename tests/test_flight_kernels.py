"""Small kernels of the flight loop against LAPACK and MuJoCo."""

import mujoco
import numpy as np
import pytest

from snakegen.kernels.core.cholesky import least_eigenvalue, least_singular_value, tridiagonal
from snakegen.kernels.dynamics.generalized_forces import generalize
from snakegen.robot.robot import load
from snakegen.simulation.flight import mujoco_arrays
from snakegen.simulation.flight.world import make_world
from snakegen.simulation.missions import planned


@pytest.mark.parametrize("n", [1, 2, 4, 6, 9])
def test_least_eigenvalue_is_that_of_lapack(n):
    """Of full and lost rank, of well and badly scaled rows, equal and distinct eigenvalues."""
    rng = np.random.default_rng(n)
    for k in range(300):
        a = rng.normal(size=(n, rng.integers(1, n + 4)))
        a *= 10.0 ** rng.uniform(-3, 3, (n, 1)) if k % 3 == 0 else 1.0
        square = np.eye(n) * rng.uniform(0, 5) if k % 10 == 0 else a @ a.T
        known = np.linalg.eigvalsh(square)
        found = least_eigenvalue(square.copy())
        assert found >= 0.0
        assert found == pytest.approx(max(known[0], 0.0), abs=2e-13 * known[-1])
    diagonal, off = np.empty(n), np.empty(n)
    square = a @ a.T
    tridiagonal(square.copy(), diagonal, off)
    same = (
        np.diag(diagonal) + np.diag(np.sqrt(off[: n - 1]), 1) + np.diag(np.sqrt(off[: n - 1]), -1)
    )
    np.testing.assert_allclose(np.linalg.eigvalsh(same), np.linalg.eigvalsh(square), atol=1e-10)


def test_least_singular_value_is_that_of_the_scaled_map():
    rng = np.random.default_rng(1)
    for _ in range(50):
        q, rows, weight = rng.normal(size=(6, 12)), rng.uniform(0.1, 2, 6), rng.uniform(1, 20, 12)
        known = np.linalg.svd(rows[:, None] * q * weight, compute_uv=False)[-1]
        assert least_singular_value(q, rows, weight) == pytest.approx(known, rel=1e-9)
        q[5] = q[4] - 2.0 * q[0]
        assert least_singular_value(q, rows, weight) < 1e-7 * known * 1e2


@pytest.mark.parametrize("stiffness", [0.0, 1300.0])
def test_forces_on_bodies_reach_the_joints_as_by_mujocos_jacobians(stiffness):
    robot, rng = load("dragon4"), np.random.default_rng(2)
    world, plan = (
        make_world(robot, link_stiffness=stiffness),
        planned("hover", robot, 200.0, duration=1.0),
    )
    model, data = world.model, mujoco.MjData(world.model)
    world.set_state(data, plan.start)
    data.qpos[7:] += rng.normal(size=model.nq - 7)
    data.qpos[3:7] = rng.normal(size=4)
    mujoco.mj_normalizeQuat(model, data.qpos)
    mujoco.mj_forward(model, data)
    sim, wires = mujoco_arrays.simulator(world, data), mujoco_arrays.wiring(world, plan)
    sim.applied[1:] = rng.normal(size=(model.nbody - 1, 6))
    generalize(sim, wires)
    known = np.zeros(model.nv)
    for b in range(1, model.nbody):
        f, t = sim.applied[b, :3].copy(), sim.applied[b, 3:].copy()
        mujoco.mj_applyFT(model, data, f, t, data.xipos[b].copy(), b, known)
    np.testing.assert_allclose(data.qfrc_applied, known, atol=1e-12)
    assert np.abs(known).min() > 1e-3


def test_two_halves_are_a_step_bit_for_bit():
    robot = load("dragon4")
    world, plan = make_world(robot), planned("hover", robot, 200.0, duration=1.0)
    one, two = mujoco.MjData(world.model), mujoco.MjData(world.model)
    rng = np.random.default_rng(3)
    for data in (one, two):
        world.set_state(data, plan.start)
    for _ in range(50):
        push, ctrl = rng.normal(size=world.model.nv), rng.uniform(0, 10, world.model.nu)
        for data in (one, two):
            data.qfrc_applied[:], data.ctrl[:] = push, ctrl
        mujoco.mj_step(world.model, one)
        mujoco.mj_step1(world.model, two)
        mujoco.mj_step2(world.model, two)
    assert np.array_equal(one.qpos, two.qpos) and np.array_equal(one.qvel, two.qvel)
    assert np.array_equal(one.act, two.act) and np.abs(one.qvel).max() > 0.1
