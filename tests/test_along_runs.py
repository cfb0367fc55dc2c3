"""Compiled loops over whole runs, each against plain NumPy, the analysis, or rerun's own."""

import sys
import tempfile
from pathlib import Path

import numpy as np

import snakegen
from snakegen.analysis.allocation import allocation
from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.stack_arrays import borrowed
from snakegen.kernels.flight.run_history import farthest_rows, maps_history
from snakegen.log import skeleton as sk
from snakegen.log.body import drawable
from snakegen.simulation.missions import planned


def test_rows_that_stand_out_are_those_of_numpy():
    rng = np.random.default_rng(0)
    for _ in range(50):
        stride, width = int(rng.integers(3, 9)), int(rng.integers(1, 6))
        values = rng.normal(size=(int(rng.integers(30, 200)), width))
        block = values[: len(values) // stride * stride].reshape(-1, stride, width)
        away = np.abs(block - block.mean(axis=1, keepdims=True)).max(axis=2).argmax(axis=1)
        expected = np.arange(len(block)) * stride + away
        np.testing.assert_array_equal(farthest_rows(values, stride), expected)
    values[4, 0] = np.nan
    assert farthest_rows(values, 8)[0] == 4


def test_maps_along_a_run_are_the_analysis():
    robot = snakegen.load("dragon4")
    rng = np.random.default_rng(1)
    rows = [planned("hover", robot, 200.0, duration=0.1).start for _ in range(3)]
    for q in rows:
        q[7:] += 0.3 * rng.normal(size=len(q) - 7)
    base = [robot.base_pose(q) for q in rows]
    angles = np.array([robot.angles(q) for q in rows])
    points, dual = maps_history(
        robot.tree,
        robot.rotors,
        robot.gimbals,
        np.array([b[0] for b in base]),
        np.array([b[1] for b in base]),
        angles,
    )
    for k, q in enumerate(rows):
        found = allocation(robot, q)
        np.testing.assert_allclose(points[k], found.thrust_points, atol=1e-12)
        np.testing.assert_allclose(dual[k], found.dual, atol=1e-12)


def test_joints_are_drawn_where_rerun_has_them():
    from rerun.urdf import UrdfTree

    urdf = snakegen.load("dragon4").urdf
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot.urdf"
        path.write_text(drawable(urdf, None), encoding="utf-8")
        tree = UrdfTree.from_file_path(path, "world")
    angle = np.linspace(-3.0, 3.0, 7)
    for joint in sk.skeleton(urdf).moving():
        position, xyzw = sk.joint_poses(joint, angle)
        own = tree.get_joint_by_name(joint.name)
        columns = own.compute_transform_columns(angle.tolist(), clamp=False)
        told = {c.component_descriptor().component: c.as_arrow_array() for c in columns}
        quaternion = next(v for k, v in told.items() if "quaternion" in k)
        place = next(v for k, v in told.items() if "translation" in k)
        theirs = np.array(quaternion.to_pylist(), float).reshape(-1, 4)
        sign = np.sign(np.sum(theirs * xyzw, axis=1))[:, None]
        np.testing.assert_allclose(sign * xyzw, theirs, atol=1e-6)
        np.testing.assert_allclose(position, np.array(place.to_pylist()).reshape(-1, 3), atol=1e-6)


@jit
def doubled(pair):
    """Doubles the first array of a pair in place and returns the sum of both."""
    one, two = borrowed(pair)
    total = 0.0
    for i in range(one.shape[0]):
        one[i] *= 2.0
        total += one[i] + two[i]
    return total


def test_borrowed_arrays_are_the_callers_own():
    one, two = np.arange(5.0), np.ones(5)
    before = sys.getrefcount(one)
    assert doubled((one, two)) == 25.0
    np.testing.assert_array_equal(one, 2.0 * np.arange(5.0))
    assert sys.getrefcount(one) == before
