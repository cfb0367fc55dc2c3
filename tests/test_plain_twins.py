"""The plain NumPy mathematics against its compiled twins, on random robots, sets and states."""

from typing import Any

import numpy as np
import pytest

from snakegen.base.geometry import rotation_from_rpy
from snakegen.control import dual_allocation, pose, vectored_allocation
from snakegen.control.gains import Gains
from snakegen.kernels.allocation import box_allocation as box_kernel
from snakegen.kernels.allocation import (
    confinement,
    dual_rotor,
    fully_actuated,
    mode_blending,
    underactuated,
)
from snakegen.kernels.allocation import gimbals as gimbal_kernel
from snakegen.kernels.allocation import wrench_map as map_kernel
from snakegen.kernels.allocation.types import Iteration, Limits, RotorBounds, Task
from snakegen.kernels.control import pose_law
from snakegen.kernels.dynamics import torque_terms as torque_kernel
from snakegen.kernels.dynamics.joint_loads import no_loads
from snakegen.kernels.kinematics import chain, jacobians
from snakegen.kernels.screw import constraints as screw_kernel
from snakegen.robot import allocation_maps, box_allocation, gimbal_geometry, kinematics
from snakegen.robot.robot import Robot, load
from snakegen.screw_drive import no_slip
from snakegen.statics import torque_terms
from snakegen.statics.joint_torques import armature, segments

ROBOTS = ("dragon4", "dragon3", "hybrid4", "grasper3", "arm6", "screw4")


def same(plain: Any, kernel: Any, tolerance: float = 1e-12) -> None:
    """Asserts that arrays, or tuples of them, agree to `tolerance` of the largest entry."""
    if not isinstance(plain, tuple):
        plain, kernel = (plain,), (kernel,)
    for x, y in zip(plain, kernel, strict=True):
        size = max(1.0, float(np.abs(y).max(initial=0.0)))
        np.testing.assert_allclose(x, y, rtol=0.0, atol=tolerance * size)


@pytest.fixture(scope="module", params=ROBOTS)
def robot(request: pytest.FixtureRequest) -> Robot:
    return load(request.param)


def states(robot: Robot) -> Any:
    """Yields (rng, tree, base rotation, base position, angles); in one of them joints slide."""
    n = len(robot.tree.parent)
    for seed in range(3):
        rng = np.random.default_rng(seed)
        slides = (rng.random(n) < 0.4).astype(np.int64) if seed == 2 else robot.tree.prismatic
        tree = robot.tree._replace(prismatic=slides)
        base = rotation_from_rpy(rng.normal(size=3))
        yield rng, tree, base, rng.normal(size=3), rng.normal(size=n - 1)


def test_kinematics(robot: Robot) -> None:
    for rng, tree, base, origin, angles in states(robot):
        poses = chain.forward(tree, base, origin, angles)
        same(kinematics.forward(tree, base, origin, angles), poses)
        same(kinematics.mass_properties(tree, *poses), chain.mass_properties(tree, *poses))
        columns = jacobians.twist_columns(tree, base, angles)
        same(kinematics.twist_columns(tree, base, angles), columns)
        at = int(rng.integers(len(tree.parent))), rng.normal(size=3)
        tip = jacobians.tip_jacobian(tree, base, angles, *at)
        same(kinematics.tip_jacobian(tree, base, angles, *at), tip)


def test_torque_terms(robot: Robot) -> None:
    for rng, tree, base, _, angles in states(robot):
        n = len(tree.parent)
        state = (rng.normal(size=5 + n), rng.normal(size=5 + n), rng.normal(size=(n, 6)))
        gravity = rng.normal(size=3)
        given = (tree, armature(robot), segments(robot), gravity, base, angles, *state)
        same(torque_terms.torque_terms(*given), torque_kernel.torque_terms(*given))
        stack = [np.stack([x, 0.5 * x]) for x in (angles, *state[:2])]
        given = (*given[:4], np.stack([base, base]), *stack, state[2])
        same(torque_terms.torque_terms(*given), torque_kernel.torque_terms_batch(*given))


def test_allocation_maps_and_gimbals(robot: Robot) -> None:
    if not robot.modules.apparatuses:
        return
    for rng, tree, base, origin, angles in states(robot):
        count = len(robot.modules.apparatuses)
        poses = chain.forward(tree, base, origin, angles)
        axes, thrust = rotation_from_rpy(rng.normal(size=3)), rng.uniform(1.0, 9.0, count)
        given = (tree, robot.rotors, robot.gimbals, *poses, axes)
        same(allocation_maps.wrench_maps(*given, thrust), map_kernel.wrench_maps(*given, thrust))
        cog = chain.centre_of_gravity(tree, *poses)[1]
        given = (tree, robot.rotors, robot.gimbals, *poses, cog, axes)
        m, rows = gimbal_kernel.mounts(*given)
        same(gimbal_geometry.mounts(*given), (m, rows))
        for j in np.repeat(np.arange(count), 20):
            wanted, last = rng.normal(size=3), rng.normal(size=2)
            wanted /= np.linalg.norm(wanted)
            low, high = -rng.uniform(0.0, 4.0, 2), rng.uniform(0.0, 4.0, 2)
            x, plain = np.empty(2), np.empty(2)
            gimbal_kernel.point_thrust(m, j, wanted, last, low, high, x)
            gimbal_geometry.point_thrust(m, int(j), wanted, last, low, high, plain)
            same(plain, x, 1e-7)  # a thrust on joint 1's axis is half as exact
        x = rng.normal(size=(count, 2))
        q = underactuated.rotor_map(m, rows, x)
        same(dual_allocation.rotor_map(m, rows, x), q)
        allowed = confinement.confinement(m, x)
        same(vectored_allocation.confinement(m, x), allowed)
        points = fully_actuated.point_map(m, x, allowed)
        same(vectored_allocation.point_map(m, x, allowed), points)
        wrench = fully_actuated.wrench_of(m, thrust, x)
        same(vectored_allocation.wrench_of(m, thrust, x), wrench)
        jacobian = fully_actuated.wrench_jacobian(m, thrust, x)
        same(vectored_allocation.wrench_jacobian(m, thrust, x), jacobian)


def test_dual_rotor_laws() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        attitude, force = rotation_from_rpy(rng.uniform(-1.0, 1.0, 3)), rng.normal(size=3)
        there = underactuated.horizontal(force, attitude)
        same(np.array(dual_allocation.horizontal(force, attitude)), np.array(there))
        given = (*there, attitude, 9.0, rng.uniform(0.0, 2.0, 2), 0.2)
        same(dual_allocation.tilted_target(*given), underactuated.tilted_target(*given))
        tilt = underactuated.level_axes(attitude)
        same(dual_allocation.level_axes(attitude), tilt)
        q, w = rng.normal(size=(6, 8)), rng.normal(size=6)
        four, wanted = underactuated.truncated(q, tilt), underactuated.truncated_wrench(w, tilt)
        same(dual_allocation.truncated(q, tilt), four)
        same(dual_allocation.truncated_wrench(w, tilt), wanted)
        rows, most = rng.uniform(0.5, 2.0, 4), rng.uniform(1.0, 3.0, 8)
        bounds = RotorBounds(0.0 * most, most, 0, no_loads(8))
        kernel = dual_rotor.allocate_dual(four, wanted, rows, bounds)
        same(dual_allocation.allocate_dual(four, wanted, rows, most), kernel, 1e-7)


def test_vectored_allocation() -> None:
    robot, rng = load("dragon4"), np.random.default_rng(5)
    for _ in range(10):
        angles = rng.uniform(-0.8, 0.8, len(robot.tree.parent) - 1)
        poses = chain.forward(robot.tree, np.eye(3), np.zeros(3), angles)
        mass, cog, _ = chain.mass_properties(robot.tree, *poses)
        given = (robot.tree, robot.rotors, robot.gimbals, *poses, cog, np.eye(3))
        m, limit = gimbal_kernel.mounts(*given)[0], robot.gimbals.limit
        n = len(limit)
        wrench = mass * 9.81 * np.append([0.0, 0.0, 1.0], rng.uniform(-0.05, 0.05, 3))
        rows, last = np.repeat([1.0, 2.0], 3) / (mass * 9.81), np.zeros((n, 2))
        low, high = np.full((n, 2), -np.pi), np.full((n, 2), np.pi)
        numbers = (3, 10, 1e-8)
        plain = vectored_allocation.least_answer(
            m, limit, wrench, rows, last, (low, high), *numbers
        )
        free = (no_loads(3 * n), np.zeros((2, n, 3)), np.ones(2))
        kernel = mode_blending.allocate_virtual(
            m, Task(wrench, rows), Limits(limit, low, high), last, Iteration(*numbers), 0, *free
        )
        same(plain[:3], kernel[:3], 1e-6)
        made = vectored_allocation.wrench_of(m, plain[0], plain[1])
        assert np.linalg.norm(made - wrench) < 1e-6


def test_pose_law() -> None:
    rng = np.random.default_rng(29)
    for k in range(10):
        table, mass = rng.uniform(0.5, 3.0, (6, 3)), rng.uniform(1.0, 9.0)
        gains = Gains(*table)
        e, rate, integral, ahead = rng.normal(size=(4, 3))
        force, torque, error = np.empty(3), np.empty(3), np.empty(3)
        still = np.zeros(3)
        pose_law.desired_force_into(
            mass, still, still, integral, e, rate, ahead, table[:3], 9.81, force
        )
        same(pose.desired_force(gains, mass, e, rate, integral, ahead), force)
        now, there = (rotation_from_rpy(rng.normal(size=3)) for _ in range(2))
        pose_law.attitude_error_into(now, there, error)
        same(pose.attitude_error(now, there), error)
        inertia = np.diag(rng.uniform(0.1, 1.0, 3)) + 0.02
        given = (now, e, integral, there, rate, table[3:], k % 2)
        pose_law.desired_torque_into(inertia, *given, torque)
        plain = pose.desired_torque(gains, inertia, now, there, e, rate, integral, bool(k % 2))
        same(plain, torque)


def test_no_slip_rows() -> None:
    rng = np.random.default_rng(31)
    for _ in range(20):
        m, n = int(rng.integers(1, 7)), int(rng.integers(2, 6))
        link = np.sort(rng.integers(0, m, n))
        known = rng.normal(size=n), link, rng.uniform(0.0, 0.2, n), rng.uniform(0.1, 0.3, m)
        w = rng.normal(size=m + 2)
        same(no_slip.no_slip_rows(w, *known), screw_kernel.no_slip_rows(w, *known))
        rows = screw_kernel.unit_rows(w[3:], *known, 0.2)
        same(no_slip.unit_rows(w[3:], *known, 0.2), rows)


def test_box_allocation() -> None:
    rng = np.random.default_rng(7)
    for k in range(60):
        n, m = int(rng.integers(2, 13)), int(rng.choice([4, 6]))
        q, d, rows = rng.normal(size=(m, n)), rng.uniform(0.5, 2.0, n), rng.uniform(0.5, 2.0, m)
        low = -0.4 * d * (k % 2)
        wrench = q @ rng.uniform(low, d) * rng.choice([0.3, 1.0, 3.0])
        given = (q, wrench, rows, d, low, d)
        plain, kernel = box_allocation.box_allocation(*given), box_kernel.box_allocation(*given)
        missed = [np.linalg.norm(rows * (q @ x - wrench)) for x in (plain, kernel)]
        assert (plain >= low).all() and (plain <= d).all()
        assert missed[0] <= missed[1] + 1e-7
        same(plain, kernel, 1e-7 if missed[1] < 1e-7 else 2e-4)  # the kernel stops early beyond
