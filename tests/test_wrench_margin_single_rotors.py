"""A robot of single rotors: its margins, loads, hover and sweep count the drag of each."""

from types import SimpleNamespace

import numpy as np
import pytest
from dragging_bodies import SLICES, searched

from snakegen.analysis import wrench_margin
from snakegen.analysis.allocation import allocation
from snakegen.analysis.wrench_margin import vectored_margins
from snakegen.control.controller import flight_controller
from snakegen.kernels.kinematics.chain import centre_of_gravity, forward
from snakegen.robot.posture import hover_gimbals
from snakegen.robot.robot import load
from snakegen.simulation.missions.flight.fail import margin_without
from snakegen.simulation.recording.margins_along import margins_along
from snakegen.spec.loading import load_spec
from snakegen.statics.joint_loads import joint_loads
from snakegen.statics.support import hold_up
from snakegen.sweep.batch import NUMBERS, Body
from snakegen.sweep.worker import work
from snakegen.wrench_margins.inputs import force_map
from snakegen.wrench_margins.vectored import apparatus_sets, set_margins


@pytest.fixture(scope="module")
def single():
    """dragon4 with one rotor an apparatus, all of one spin, κ = 0.05 m."""
    changes = {"rotors": 1, "thrust_max": 26, "spin": "same", "drag_ratio": 0.05}
    pairs = [f"vectoring_apparatus.{k}={v}" for k, v in changes.items()]
    robot = load(load_spec("dragon4", overrides=pairs))
    joints = {f"joint{i}_yaw": 1.0 for i in (1, 2, 3)}
    return robot, hover_gimbals(robot, robot.configuration(joints))


def test_single_rotors_of_a_robot_drag(single):
    robot, q = single
    a, loads = allocation(robot, q), joint_loads(robot, q)
    assert np.abs(a.drag) == pytest.approx(0.05)
    whole = force_map(a.thrust_points, a.drag)
    for j in range(4):
        # a single rotor's thrust is its apparatus' force
        mine = slice(3 * j, 3 * j + 3)
        np.testing.assert_allclose(whole[:, mine] @ a.rotor_axes[j], a.dual[:, j], atol=1e-12)
        pushed = loads.forces[:, j] @ a.rotor_axes[j]
        np.testing.assert_allclose(pushed, loads.rotors[:, j], atol=1e-12)
        np.testing.assert_allclose(whole[:, mine] @ a.link_axes[j], a.force[:, mine], atol=1e-12)
    found = wrench_margin.analyze(robot, q)
    b = SimpleNamespace(
        points=a.thrust_points, limits=robot.gimbals.limit, drag=a.drag, hover=a.hover_wrench
    )
    rng = np.random.default_rng(0)
    for name, part in SLICES.items():
        low, high = found.vectored[name].bounds
        assert low * (1 - 1e-9) <= searched(b, part, rng, 8) <= high * (1 + 1e-3)
    assert found.vectored["force"].value == pytest.approx(20.84, abs=0.02)
    assert found.vectored_closed


def test_hover_of_single_rotors_balances_their_drag(single):
    robot, q = single
    held, a = hold_up(robot, q), allocation(robot, q)
    base = robot.base_pose(q)[0]
    forces = held.forces @ base
    torque = np.cross(a.thrust_points, forces) + a.drag[:, None] * forces
    np.testing.assert_allclose(forces.sum(axis=0), a.hover_wrench[:3], atol=1e-8)
    np.testing.assert_allclose(torque.sum(axis=0), 0.0, atol=1e-8)
    total = held.wrenches.sum(axis=0)
    np.testing.assert_allclose(total[:3], held.forces.sum(axis=0), atol=1e-9)
    rotation, position = forward(robot.tree, base, np.zeros(3), robot.angles(q))
    arms = position - centre_of_gravity(robot.tree, rotation, position)[1]
    about = held.wrenches[:, 3:] + np.cross(arms, held.wrenches[:, :3])
    np.testing.assert_allclose(about.sum(axis=0), 0.0, atol=1e-8)
    assert np.linalg.norm((a.drag[:, None] * forces).sum(axis=0)) > 1.0


def test_a_flight_counts_the_drag(single):
    """Along a run, and of what a lost apparatus leaves: the margins of plain arrays."""
    robot, q = single
    a, controller = allocation(robot, q), flight_controller(robot, mode="virtual_single_rotor")
    scale = {"force_scale": robot.force_scale, "torque_scale": robot.torque_scale}
    plan = SimpleNamespace(time=np.zeros(1), mode=None, failures=())
    base, origin = robot.base_pose(q)
    states = base[None], origin[None], robot.angles(q)[None]
    found = margins_along(robot, controller, plan, [0], states)
    sets = apparatus_sets(a.thrust_points[None], robot.gimbals.limit, a.drag)
    m = set_margins(sets, a.hover_wrench, tolerance=1e-2, **scale)  # a batch, as a run is
    assert found["force_margin"][0] == pytest.approx(m.force_bounds[0, 0], rel=1e-9)
    assert found["torque_margin"][0] == pytest.approx(m.torque_bounds[0, 0], rel=1e-9)
    left = np.where(np.arange(4) == 1, 0.0, robot.gimbals.limit)
    expected = vectored_margins(a.thrust_points, left, a.hover_wrench, drag=a.drag, **scale).wrench
    assert margin_without(robot, q, (1,)) == pytest.approx(expected, rel=1e-9)


def test_a_sweep_counts_the_drag(single):
    robot, _ = single
    body = Body.of(robot, ("joint1_yaw", "joint2_yaw"), np.eye(3), 1e-3)
    row = dict(zip(NUMBERS, work(body.task, np.array([[1.0, 0.8]]))[0], strict=True))
    q = hover_gimbals(robot, robot.configuration({"joint1_yaw": 1.0, "joint2_yaw": 0.8}))
    a = allocation(robot, q)
    m = set_margins(
        apparatus_sets(a.thrust_points[None], robot.gimbals.limit, a.drag),
        a.hover_wrench,
        force_scale=robot.force_scale,
        torque_scale=robot.torque_scale,
    )
    assert row["force_margin"] == pytest.approx(m.force_bounds[0, 0], rel=1e-6)
    assert row["torque_margin"] == pytest.approx(m.torque_bounds[0, 0], rel=1e-6)
